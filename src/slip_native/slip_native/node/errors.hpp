/* Bad input as one line: what, got, expected, fix. */
#pragma once

#include <stdexcept>
#include <string>

class InputError : public std::runtime_error {
 public:
  InputError(const std::string &what, const std::string &got, const std::string &expected, const std::string &fix = "")
      : std::runtime_error(what + ": got " + got + ", expected " + expected + (fix.empty() ? "" : "; " + fix)) {}
};
