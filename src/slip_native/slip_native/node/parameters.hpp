/* The controller's parameters: declarations, values, and the changes that are accepted while the law runs. */
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <variant>
#include <vector>

#include "errors.hpp"
#include "slip_vic.h"

/* A value; its index is ROS's number of the type. */
using Value = std::variant<std::monostate, bool, int64_t, double, std::string, std::vector<uint8_t>, std::vector<bool>,
                           std::vector<int64_t>, std::vector<double>, std::vector<std::string>>;
using Values = std::map<std::string, Value>;

/* Declaration of a parameter; least, most: range of a number, or of each in a list. */
struct ParameterInfo {
  const char *name, *description, *unit, *constraint;
  bool live;
  double least, most;
};
const std::vector<ParameterInfo> &parameter_infos(); /* in the order of their declaration */
const ParameterInfo *parameter_info(const std::string &name);

/* A change that is refused, with ROS's reason. */
struct Refused : std::runtime_error {
  using std::runtime_error::runtime_error;
};

class Parameters {
 public:
  Parameters() = default;
  /* Read those of the only node in a parameter file. */
  explicit Parameters(const std::string &path);

  /* Throw InputError where there is no such value, or one of another kind. */
  const std::string &text(const std::string &name) const { return get<std::string>(name, "a text"); }
  bool flag(const std::string &name) const { return get<bool>(name, "true or false"); }
  int64_t whole(const std::string &name) const { return get<int64_t>(name, "a whole number"); }
  double number(const std::string &name) const { return get<double>(name, "a number"); }
  const std::vector<double> &numbers(const std::string &name) const { return get<std::vector<double>>(name, "numbers"); }
  const std::vector<bool> &flags(const std::string &name) const { return get<std::vector<bool>>(name, "flags"); }
  const std::vector<std::string> &texts(const std::string &name) const {
    return get<std::vector<std::string>>(name, "a list of names");
  }
  const Value &value(const std::string &name) const; /* an empty list where the file has none */

  /* Return these parameters with changes, checked one by one and together; node: its name in errors. Throws Refused
     for what rclpy refuses, InputError for what the controller refuses. */
  Parameters changed(const Values &given, const std::string &node) const;
  bool operator==(const Parameters &other) const { return values_ == other.values_; }

 private:
  template <class Kind>
  const Kind &get(const std::string &name, const char *expected) const {
    const auto found = values_.find(name);
    if (found == values_.end() || !std::holds_alternative<Kind>(found->second))
      throw InputError(path_ + ": parameter " + name, "none, or another kind", expected, "export again");
    return std::get<Kind>(found->second);
  }
  void check_one(const std::string &name, const Value &wanted) const;
  void check_all(const std::string &node) const;

  std::string path_;
  Values values_;
};

/* What follows from parameters that are changed while the controller runs. */
struct Tuning {
  SlipVic_ControllerConfig config;
  int64_t least_ns; /* shortest ramp */
  bool other_object;
};
/* Return it; throws InputError if the gains are not accepted. */
Tuning tune(const Parameters &now, const Parameters &wanted, const SlipVic_ControllerConfig &config);
