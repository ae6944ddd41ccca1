/* Prints in words each reason that it reads. */
#include <cstdio>
#include "words.hpp"
int main() {
  SlipVic_WhyRecord why;
  while (std::fread(&why, sizeof why, 1, stdin) == 1) std::puts(describe(why, {"one", "two"}).c_str());
}
