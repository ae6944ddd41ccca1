/* Prints the record of each joint state that it reads; fails where that allocates memory. */
#include <cstdio>
#include <fstream>
#include <iterator>
#include "terms.hpp"
extern "C" void *__libc_malloc(size_t);
static long allocations = 0;
extern "C" void *malloc(size_t size) { return ++allocations, __libc_malloc(size); }
int main(int, char **names) {
  std::ifstream file(names[1]);
  const int n = std::atoi(names[3]);
  Terms terms({std::istreambuf_iterator<char>(file), {}}, names[2], {0.1, 0.2, -9.81}, std::vector<double>(n, 0.05));
  std::vector<double> state(2 * n);
  while (std::fread(state.data(), 8, state.size(), stdin) == state.size()) {
    SlipVic_Arm arm{};
    const long before = allocations;
    terms.fill(state.data(), state.data() + n, &arm);
    if (allocations != before) return 1;
    std::fwrite(&arm, sizeof arm, 1, stdout);
  }
}
