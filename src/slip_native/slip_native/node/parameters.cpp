#include "parameters.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>

#include <Eigen/Eigenvalues>
#include <rcl_yaml_param_parser/parser.h>
#include <rcutils/allocator.h>
#include <rcutils/error_handling.h>

#include "slip_vic_words.h"

static const double LARGEST_M = 1.0; /* of a contact from the centre of mass: grasp_params.py */
static const double RELATIVE = 1e-6; /* tolerance at the ends of a range, as in rclpy */
static const char *const AXES[] = {"x", "y", "z", "rx", "ry", "rz"};
static const char *const TYPES[] = {"NOT_SET",    "BOOL",          "INTEGER",      "DOUBLE",      "STRING",
                                    "BYTE_ARRAY", "BOOL_ARRAY",    "INTEGER_ARRAY", "DOUBLE_ARRAY", "STRING_ARRAY"};
static const char *const AT_START[] = {"nullspace.", "singularity."}; /* settable for ROS, but not while the law runs */

/* -- declarations ----------------------------------------------------------------------------------------------- */

const std::vector<ParameterInfo> &parameter_infos() {
  static const std::vector<ParameterInfo> all = [] {
    std::vector<ParameterInfo> made;
    for (const auto &of : slip_vic_parameters)
      made.push_back({of.name, of.description, of.unit, of.constraint, of.live != 0, of.least, of.most});
    return made;
  }();
  return all;
}

const ParameterInfo *parameter_info(const std::string &name) {
  static const std::map<std::string, const ParameterInfo *> by_name = [] {
    std::map<std::string, const ParameterInfo *> made;
    for (const ParameterInfo &info : parameter_infos()) made[info.name] = &info;
    return made;
  }();
  const auto found = by_name.find(name);
  return found == by_name.end() ? nullptr : found->second;
}

/* -- texts ------------------------------------------------------------------------------------------------------ */

/* Return a number as Python shows it. */
static std::string shown(double x) {
  if (!std::isfinite(x)) return std::isnan(x) ? "nan" : x < 0.0 ? "-inf" : "inf";
  char text[32];
  const auto written = [&](std::chars_format format) {
    return std::string(text, std::to_chars(text, text + sizeof text, x, format).ptr);
  };
  const std::string scientific = written(std::chars_format::scientific);
  const int exponent = std::stoi(scientific.substr(scientific.find('e') + 1));
  if (x != 0.0 && (exponent < -4 || exponent >= 16)) return scientific;
  const std::string fixed = written(std::chars_format::fixed);
  return fixed.find('.') == std::string::npos ? fixed + ".0" : fixed;
}

static std::string shown(const std::vector<double> &list) {
  std::string text;
  for (const double x : list) text += (text.empty() ? "" : ", ") + shown(x);
  return "[" + text + "]";
}

static std::string brief(const char *format, double x) {
  char text[64];
  std::snprintf(text, sizeof text, format, x);
  return text;
}

/* -- values ----------------------------------------------------------------------------------------------------- */

static Value value_of(const rcl_variant_t &of) {
  const auto list = [](const auto *from) {
    return std::vector<std::decay_t<decltype(*from->values)>>(from->values, from->values + from->size);
  };
  if (of.bool_value != nullptr) return *of.bool_value;
  if (of.integer_value != nullptr) return *of.integer_value;
  if (of.double_value != nullptr) return *of.double_value;
  if (of.string_value != nullptr) return std::string(of.string_value);
  if (of.bool_array_value != nullptr) return list(of.bool_array_value);
  if (of.integer_array_value != nullptr) return list(of.integer_array_value);
  if (of.double_array_value != nullptr) return list(of.double_array_value);
  if (of.string_array_value != nullptr)
    return std::vector<std::string>(of.string_array_value->data, of.string_array_value->data + of.string_array_value->size);
  return {};
}

Parameters::Parameters(const std::string &path) : path_(path) {
  rcl_params_t *all = rcl_yaml_node_struct_init(rcutils_get_default_allocator());
  const bool read = all != nullptr && rcl_parse_yaml_file(path.c_str(), all);
  const std::string why = read ? "" : rcutils_get_error_string().str;
  rcutils_reset_error();
  const bool one = read && all->num_nodes == 1;
  for (size_t k = 0; one && k < all->params[0].num_params; ++k)
    values_[all->params[0].parameter_names[k]] = value_of(all->params[0].parameter_values[k]);
  rcl_yaml_node_struct_fini(all);
  if (!one) throw InputError(path, read ? "other nodes" : why, "the controller's parameters");
}

const Value &Parameters::value(const std::string &name) const {
  static const Value empty = std::vector<double>();
  const auto found = values_.find(name);
  return found == values_.end() ? empty : found->second;
}

/* -- changes ---------------------------------------------------------------------------------------------------- */

/* Check a value against the declared type and range, in rclpy's order. */
void Parameters::check_one(const std::string &name, const Value &wanted) const {
  const ParameterInfo &info = *parameter_info(name);
  if (!info.live) throw Refused("Trying to set a read-only parameter: " + name + ".");
  if (wanted.index() == 0) throw Refused("Static parameter cannot be undeclared");
  const size_t type = value(name).index();
  if (wanted.index() != type)
    throw Refused(std::string("Wrong parameter type, expected 'Type.") + TYPES[type] + "' got 'Type." + TYPES[wanted.index()] + "'");
  const double *x = std::get_if<double>(&wanted);
  if (x == nullptr) return;
  const auto at = [x](double end) { return std::abs(*x - end) <= RELATIVE * std::max(std::abs(*x), std::abs(end)); };
  if (!at(info.least) && !at(info.most) && !(info.least < *x && *x < info.most))
    throw Refused("Parameter " + name + " out of range Min: " + shown(info.least) + ", Max: " + shown(info.most) +
                  ", value: " + shown(*x));
}

static Eigen::Matrix3d inertia_of(const std::vector<double> &six) {
  Eigen::Matrix3d J;
  J << six[0], six[3], six[4], six[3], six[1], six[5], six[4], six[5], six[2];
  return J;
}

/* Refuse an inertia that no body can have; six: as in the parameter. */
static void check_inertia(const std::vector<double> &six) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(inertia_of(six), Eigen::EigenvaluesOnly);
  const Eigen::Vector3d p = solver.eigenvalues();
  if (p[0] <= 0.0 || p[0] + p[1] < p[2] * (1.0 - 1e-9))
    throw InputError("object.inertia", "principal moments " + shown(std::vector<double>(p.data(), p.data() + 3)),
                     "positive principal moments, each at most the sum of the other two");
}

/* Check as controller_params.py does, in its order: each value, then whether they are consistent. */
void Parameters::check_all(const std::string &node) const {
  const std::string of = node + ": parameter ";
  const auto beyond = [](double x, double most) { return !(std::abs(x) <= most); };
  for (const char *group : {"object", "contacts", "gains"}) {
    std::vector<std::pair<std::string, const std::vector<double> *>> lists;
    for (const ParameterInfo &info : parameter_infos()) {
      const std::string name = info.name;
      if (!info.live || name.rfind(std::string(group) + ".", 0) != 0) continue;
      if (const double *x = std::get_if<double>(&value(name))) { /* ROS's range has a tolerance */
        if (*x < info.least || *x > info.most)
          throw InputError(of + name, shown(*x),
                           std::string(*x < info.least ? "greater" : "less") + " than or equal to " +
                               shown(*x < info.least ? info.least : info.most));
        continue;
      }
      const std::vector<double> &list = numbers(name);
      const auto bad = std::find_if(list.begin(), list.end(), [](double x) { return !std::isfinite(x); });
      if (bad != list.end()) throw InputError(of + name + "." + std::to_string(bad - list.begin()), shown(*bad), "a finite number");
      const bool six = name != "contacts.position";
      if (six && list.size() > 6)
        throw InputError(of + name, shown(list), "at most 6 items after validation, not " + std::to_string(list.size()));
      if (six && list.size() < 6) throw InputError(of + name, shown(list), "6 values");
      lists.emplace_back(name, &list);
    }
    const auto refuse = [&](const std::string &why) { throw InputError(of + group, why, "consistent values"); };
    for (const auto &[name, list] : lists) {
      const ParameterInfo &info = *parameter_info(name);
      if (std::any_of(list->begin(), list->end(), [&](double x) { return beyond(x, info.most); }))
        refuse(name.substr(name.find('.') + 1) + " " + shown(*list) + ": no number may be beyond " + brief("%g", info.most) +
               " " + info.unit);
    }
    for (const auto &[name, list] : lists) {
      const ParameterInfo &info = *parameter_info(name);
      const bool gain = group == std::string("gains");
      if (gain && *std::min_element(list->begin(), list->end()) < info.least)
        refuse(name.substr(name.find('.') + 1) + " " + shown(*list) + ": every gain must be positive, at least " +
               brief("%g", info.least) + " " + info.unit);
      if (name == "object.inertia") check_inertia(*list);
      if (name != "contacts.position") continue;
      const size_t q = numbers("contacts.orientation_xyzw").size(), count = list->size() / 3;
      const size_t axes = flags("contacts.slip_axes").size();
      if (count < 1 || list->size() != 3 * count || q != 4 * count || axes != 6 * count)
        refuse("contacts.position, orientation_xyzw, slip_axes have " + std::to_string(list->size()) + ", " +
               std::to_string(q) + ", " + std::to_string(axes) + " values; n contacts need 3 n, 4 n, 6 n");
      if (std::any_of(list->begin(), list->end(), [&](double x) { return beyond(x, LARGEST_M); }))
        refuse("contacts.position " + shown(*list) + ": no contact is " + brief("%g", LARGEST_M) + " m from the centre of mass");
    }
  }
}

Parameters Parameters::changed(const Values &given, const std::string &node) const {
  for (const auto &[name, wanted] : given) {
    if (name.empty()) throw Refused("a parameter without a name");
    if (parameter_info(name) == nullptr) throw Refused("Invalid access to undeclared parameter(s): ['" + name + "']");
  }
  Parameters wanted = *this;
  for (const auto &[name, value] : given) {
    check_one(name, value);
    wanted.values_[name] = value;
  }
  if (wanted.values_ == values_) return wanted;
  wanted.check_all(node);
  for (const auto &[name, value] : given)
    for (const char *group : AT_START)
      if (name.rfind(group, 0) == 0 && value != this->value(name))
        throw InputError("parameter " + name, shown(std::get<double>(value)), shown(number(name)) + " while the law runs",
                         "restart the node");
  return wanted;
}

/* -- the numbers of the controller ------------------------------------------------------------------------------ */

static void judge(const SlipVic_Gains &gains, const std::vector<double> &damping, bool classical, double delay_s) {
  const auto refuse = [](const char *name, double got, const std::string &expected, const std::string &why) {
    throw InputError(std::string("parameter ") + name, brief("%g", got), expected, why);
  };
  const double least = *std::min_element(damping.begin(), damping.end());
  if (!classical && least < 1.0)
    refuse("gains.damping", least, "more than 1", "Prop. 1: lambda_min(D_D) > 1/lambda_1 needs a lambda_1 below 1");
  if (!classical && gains.k_s < 1.0)
    refuse("gains.k_s", gains.k_s, "more than 1", "Prop. 2: k_s > 1/lambda_2 needs a lambda_2 below 1");
  for (int j = 0; j < 6; ++j) {
    const double limit = slip_vic_stiffness_limit(gains.D_D[j], gains.M_D[j], delay_s);
    if (limit / gains.K_D[j] < 1.0)
      refuse("gains.stiffness", gains.K_D[j], "at most " + brief("%.6g", limit),
             "with " + brief("%.3g", 1e3 * delay_s) +
                 " ms from a measurement to the motion that it causes, the impedance oscillates above this stiffness on axis " +
                 AXES[j] + "; more damping admits more");
  }
}

/* Write the gains and the payload as the user sets them. */
static void read_gains(const Parameters &p, SlipVic_LawGains *made) {
  SlipVic_Gains &gains = made->gains;
  for (int j = 0; j < 6; ++j) {
    gains.K_D[j] = p.numbers("gains.stiffness")[j], gains.D_D[j] = p.numbers("gains.damping")[j];
    gains.M_D[j] = p.numbers("gains.inertia")[j];
    gains.gamma_k[j] = p.number(j < 3 ? "gains.gamma_kp" : "gains.gamma_ko");
    gains.gamma_d[j] = p.number(j < 3 ? "gains.gamma_dp" : "gains.gamma_do");
  }
  gains.alpha = p.number("gains.alpha"), gains.k_s = p.number("gains.k_s"), gains.kappa = p.number("gains.kappa");
  gains.characteristic_length = p.number("gains.characteristic_length");
  made->object.mass = p.number("object.mass");
  const Eigen::Matrix3d J = inertia_of(p.numbers("object.inertia"));
  std::copy_n(J.data(), 9, &made->object.inertia[0][0]); /* symmetric */
  std::copy_n(p.numbers("contacts.position").begin(), 3, made->contact_position);
}

Tuning tune(const Parameters &now, const Parameters &wanted, const SlipVic_ControllerConfig &config) {
  Tuning made{config, 0, false};
  SlipVic_ControllerConfig &c = made.config;
  const bool classical = wanted.text("controller") == "classical", bounded = wanted.text("gains.spin") == "bounded";
  const std::vector<double> &positions = wanted.numbers("contacts.position"), &before = now.numbers("contacts.position");
  for (int64_t k = 0; k < c.law.contacts; ++k) std::copy_n(&positions[3 * k], 3, c.law.contact[k].position);
  read_gains(wanted, &c.gains);
  slip_vic_retune(&c, classical, bounded ? wanted.number("gains.spin_excursion") : std::numeric_limits<double>::infinity(),
                  wanted.number("safety.hold_stiffness"));
  judge(c.gains.gains, wanted.numbers("gains.damping"), classical, c.impedance_delay_s);
  double squares = 0.0;
  for (int j = 0; j < 3; ++j) squares += (positions[j] - before[j]) * (positions[j] - before[j]);
  /* Shifting the contact seems to move the object, and the law follows it. */
  const double least_s = std::max(wanted.number("gains.ramp_s"), std::sqrt(squares) / wanted.number("safety.limits.speed_linear"));
  made.least_ns = std::llrint(1e9 * least_s);
  made.other_object = wanted.value("object.mass") != now.value("object.mass") ||
                      wanted.value("object.inertia") != now.value("object.inertia");
  return made;
}
