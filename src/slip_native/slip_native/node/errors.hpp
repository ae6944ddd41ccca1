/* Bad input as one line: what, got, expected, fix. */
#pragma once

#include <algorithm>
#include <stdexcept>
#include <string>

/* Return a text from elsewhere as a line of a terminal may show it. */
inline std::string shown(const std::string &text) {
  const size_t most = 120;
  std::string line = text.size() <= most ? text : text.substr(0, most - 3) + "...";
  std::replace_if(line.begin(), line.end(), [](char sign) { return sign < ' ' || sign > '~'; }, '?');
  return line;
}

class InputError : public std::runtime_error {
 public:
  InputError(const std::string &what, const std::string &got, const std::string &expected, const std::string &fix = "")
      : std::runtime_error(what + ": got " + shown(got) + ", expected " + expected + (fix.empty() ? "" : "; " + fix)),
        expected(expected) {}

  const std::string expected;
};
