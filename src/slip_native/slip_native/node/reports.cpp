#include "reports.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <iterator>

#include <Eigen/Geometry>
#include <rcutils/logging_macros.h>

#include "slip_vic_words.h"
#include "words.hpp"

static const int64_t SYMBOLS_PERIOD_NS = 10'000'000, STATUS_PERIOD_NS = 1'000'000'000;
enum Level : uint8_t { OK, WARN, ERROR };
static const Level LEVELS[] = {WARN, WARN, OK, WARN, ERROR}; /* by mode */
static const char *const TIMING_NAMES[] = {"period_s",  "input_age_s", "wrench_age_s", "slip_age_s",
                                           "compute_s", "latency_s",   "overruns",     "missed"};

void log_info(const std::string &text) { RCUTILS_LOG_INFO_NAMED("slip_vic_controller", "%s", text.c_str()); }
void log_warning(const std::string &text) { RCUTILS_LOG_WARN_NAMED("slip_vic_controller", "%s", text.c_str()); }
void log_error(const std::string &text) { RCUTILS_LOG_ERROR_NAMED("slip_vic_controller", "%s", text.c_str()); }

void Refusals::add(const std::string &topic, const InputError &error) {
  ++counts_[topic];
  if (told_.emplace(topic, error.expected).second) log_error(topic + ": message refused: " + error.what());
}

static std::vector<std::string> names_of_symbols(size_t joints, bool governed) {
  static const char *const axes[] = {"x", "y", "z", "rx", "ry", "rz"};
  std::vector<std::string> names;
  for (size_t k = 0; k < std::size(slip_vic_symbol_names); ++k) {
    const std::string name = slip_vic_symbol_names[k];
    const int size = slip_vic_symbol_sizes[k];
    if (size == 1) names.push_back(name);
    for (const char *axis : axes)
      if (size == 6) names.push_back(name + "_" + axis);
    for (size_t j = 0; size > 6 && j < joints; ++j) names.push_back(name + "_" + std::to_string(j + 1));
  }
  if (governed) names.insert(names.end(), std::begin(slip_vic_governed_names), std::end(slip_vic_governed_names));
  names.insert(names.end(), {"mode", "path_speed"});
  return names;
}

Reports::Reports(ros::Node &ros, const Settings &settings, const Session &session, const Refusals &refusals)
    : settings_(settings),
      session_(session),
      refusals_(refusals),
      name_(std::string(rcl_node_get_fully_qualified_name(&ros.node)).substr(1)),
      scalars_(ros, "controller/scalars"),
      ee_pose_(ros, "controller/ee_pose"),
      reference_pose_(ros, "controller/reference_pose"),
      mode_(ros, "controller/mode", ros::LATCHED),
      status_(ros, "/diagnostics", {true, false, 100}) {
  publishers_ = {&scalars_, &ee_pose_, &reference_pose_};
  if (session.config().estimator.on) {
    joints_.emplace(ros, "controller/joint_estimate");
    ros::set(joints_->message->name, settings.joint_names);
    publishers_.push_back(&*joints_);
  }
  if (!settings.lockstep) {
    timing_.emplace(ros, "controller/timing");
    ros::set(timing_->message->name, {std::begin(TIMING_NAMES), std::end(TIMING_NAMES)});
    publishers_.push_back(&*timing_);
  }
  if (settings.trajectory == "goal") goal_.emplace(ros, "controller/goal", ros::LATCHED);
  const std::vector<std::string> names = names_of_symbols(settings.joint_names.size(), settings.governed());
  ros::set(scalars_.message->name, names);
  numbers_.resize(names.size());
  for (auto *header : {&ee_pose_.message->header, &reference_pose_.message->header}) ros::set(header->frame_id, "world");
  if (!diagnostic_msgs__msg__DiagnosticStatus__Sequence__init(&status_.message->status, 1)) throw std::bad_alloc();
  ros::set(status_.message->status.data[0].name, name_ + ": mode");
  ros::set(status_.message->status.data[0].hardware_id, session.robot());
}

std::string Reports::reason() const { return describe(session_.arm().mode.reason, settings_.joint_names); }

void Reports::say(const std::string &line) {
  if (!goal_) return;
  ros::set(goal_->message->data, line);
  goal_->send();
}

/* -- time ------------------------------------------------------------------------------------------------------- */

static int64_t oldest(const int64_t *ledger, int contacts, int of) { /* stamp of wrench (0) or slip (1), 0 = none */
  int64_t found = INT64_MAX;
  for (int k = 0; k < contacts; ++k) {
    const int64_t *pair = ledger + 3 + 4 * k + 2 * of;
    found = std::min(found, pair[0] * 1'000'000'000 + pair[1]);
  }
  return found;
}

void Reports::time(int64_t began_ns) {
  if (!timing_) return;
  using namespace std::chrono;
  const int64_t ended_ns = nanoseconds(steady_clock::now().time_since_epoch()).count();
  const int64_t wall_ns = nanoseconds(system_clock::now().time_since_epoch()).count();
  const int64_t period_ns = session_.config().period_ns, *ledger = session_.outputs().ledger;
  const int64_t stamp_ns = ledger[1] * 1'000'000'000 + ledger[2], compute_ns = ended_ns - began_ns;
  const auto age_s = [&](int of) {
    const int64_t stamp = oldest(ledger, settings_.contacts, of);
    return stamp == 0 ? std::nan("") : 1e-9 * static_cast<double>(stamp_ns - stamp);
  };
  const double compute_s = 1e-9 * static_cast<double>(compute_ns);
  const double latency_s = 1e-9 * static_cast<double>(wall_ns - stamp_ns);
  if (last_stamp_ns_ != 0) missed_ += std::max<int64_t>(0, (stamp_ns - last_stamp_ns_ + period_ns / 2) / period_ns - 1);
  const double since_s = last_began_ns_ == 0 ? std::nan("") : 1e-9 * static_cast<double>(began_ns - last_began_ns_);
  last_began_ns_ = began_ns, last_stamp_ns_ = stamp_ns;
  overruns_ += compute_ns > period_ns;
  const double numbers[] = {since_s,
                            latency_s - compute_s,
                            age_s(0),
                            age_s(1),
                            compute_s,
                            latency_s,
                            static_cast<double>(overruns_),
                            static_cast<double>(missed_)};
  ros::set(timing_->message->header.stamp, wall_ns);
  ros::set(timing_->message->position, numbers, std::size(numbers));
  timing_->send();
}

/* -- mode ------------------------------------------------------------------------------------------------------- */

void Reports::publish() {
  publish_mode();
  publish_symbols();
  publish_goals();
}

void Reports::publish_mode() {
  const SlipVic_ModeState &mode = session_.outputs().mode;
  const int64_t stamp_ns = session_.stamp_ns(), period = stamp_ns / STATUS_PERIOD_NS;
  const bool held = mode.mode == SLIP_VIC_MODE_HOLD && !mode.enabled;
  const std::vector<int64_t> now = {mode.mode,         mode.reason.reason, mode.reason.fault,
                                    mode.reason.over, mode.reason.which, held};
  if (period == mode_period_ && now == last_mode_) return;
  mode_period_ = period;
  std::string reason = describe(mode.reason, settings_.joint_names);
  if (mode.mode == SLIP_VIC_MODE_FAULT) reason += "; to continue call ~/reset_fault, then ~/enable";
  if (held) reason += "; to continue call ~/enable";
  const std::string name = slip_vic_mode_names[mode.mode];
  if (now != last_mode_) {
    const std::string line = reason.empty() ? name : name + ": " + reason;
    ros::set(mode_.message->data, line);
    mode_.send();
    if (last_mode_.empty() || last_mode_[0] != mode.mode) {
      const Level level = LEVELS[mode.mode];
      (level == OK ? log_info : level == WARN ? log_warning : log_error)(line);
    }
  }
  last_mode_ = now;
  const SlipVic_CycleOutputs &out = session_.outputs();
  const bool near = out.ok && (out.law.near_singular_arm || out.law.near_singular_attitude);
  const bool saturated = std::any_of(std::begin(out.saturated), std::end(out.saturated), [](int64_t x) { return x; });
  const Level level = std::max(LEVELS[mode.mode], near || saturated ? WARN : OK);
  publish_status(stamp_ns, level, reason.empty() ? name : reason);
}

std::vector<std::pair<std::string, std::string>> Reports::mode_values() const {
  const SlipVic_CycleOutputs &out = session_.outputs();
  const SlipVic_WhyRecord &why = out.mode.reason;
  const std::string words = slip_vic_reason_words[why.reason];
  const bool of_joint = words.find("{joint}") != std::string::npos;
  std::vector<std::pair<std::string, std::string>> values = {
      {"mode", slip_vic_mode_names[out.mode.mode]},
      {"reason", slip_vic_reason_names[why.reason]},
      {"reason_number", std::to_string(why.reason)},
      {"fault", slip_vic_reason_names[why.fault]},
      {"which", of_joint ? joint_of(why.which, settings_.joint_names) : std::to_string(why.which)},
      {"value", std::to_string(why.value)},
      {"limit", std::to_string(why.limit)},
      {"cycle", std::to_string(out.ledger[0])}};
  const auto count = [&](const std::string &input, const int64_t *counts, size_t size) {
    for (size_t fault = 1; fault < size; ++fault)
      if (counts[fault]) values.emplace_back(input + " " + slip_vic_reason_names[fault], std::to_string(counts[fault]));
  };
  const SlipVic_ArmState &arm = session_.arm();
  count("joint state", arm.joint.counts, std::size(arm.joint.counts));
  for (int k = 0; k < settings_.contacts; ++k) {
    const std::string of = k == 0 ? "" : " of contact " + std::to_string(k);
    count("wrench" + of, arm.wrench_inputs[k].counts, std::size(arm.wrench_inputs[k].counts));
    count("slip" + of, arm.slip_inputs[k].counts, std::size(arm.slip_inputs[k].counts));
  }
  if (timing_) values.insert(values.end(), {{"overruns", std::to_string(overruns_)}, {"missed", std::to_string(missed_)}});
  for (const auto &[topic, refused] : refusals_.counts()) values.emplace_back(topic + " refused", std::to_string(refused));
  return values;
}

void Reports::publish_status(int64_t stamp_ns, uint8_t level, const std::string &text) {
  auto &status = status_.message->status.data[0];
  const auto values = mode_values();
  ros::set(status_.message->header.stamp, stamp_ns);
  ros::set(status.message, text);
  status.level = level;
  diagnostic_msgs__msg__KeyValue__Sequence__fini(&status.values);
  if (!diagnostic_msgs__msg__KeyValue__Sequence__init(&status.values, values.size())) throw std::bad_alloc();
  for (size_t k = 0; k < values.size(); ++k) {
    ros::set(status.values.data[k].key, values[k].first);
    ros::set(status.values.data[k].value, values[k].second);
  }
  status_.send();
}

/* -- the law ---------------------------------------------------------------------------------------------------- */

static void put(geometry_msgs__msg__Pose &to, const double *position, const double (*rotation)[3]) {
  const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> R(rotation[0]);
  const Eigen::Quaterniond q(R);
  to.position.x = position[0], to.position.y = position[1], to.position.z = position[2];
  to.orientation.x = q.x(), to.orientation.y = q.y(), to.orientation.z = q.z(), to.orientation.w = q.w();
}

void Reports::publish_symbols() {
  const int64_t stamp_ns = session_.stamp_ns(), period = stamp_ns / SYMBOLS_PERIOD_NS;
  if (!session_.commands() || period == symbols_period_) return;
  symbols_period_ = period;
  const SlipVic_CycleOutputs &out = session_.outputs();
  const SlipVic_Symbols symbols = session_.symbols();
  const double *from = reinterpret_cast<const double *>(&symbols);
  auto to = numbers_.begin();
  for (const int size : slip_vic_symbol_sizes) {
    to = std::copy(from, from + (size > 6 ? static_cast<int>(settings_.joint_names.size()) : size), to);
    from += size;
  }
  const double *governed = reinterpret_cast<const double *>(&out.governor);
  if (settings_.governed()) to = std::copy(governed, governed + std::size(slip_vic_governed_names), to);
  *to++ = static_cast<double>(out.mode.mode), *to = out.path_scale;
  ros::set(scalars_.message->header.stamp, stamp_ns);
  ros::set(scalars_.message->position, numbers_.data(), numbers_.size());
  scalars_.send();
  if (joints_) {
    const size_t n = settings_.joint_names.size();
    ros::set(joints_->message->header.stamp, stamp_ns);
    ros::set(joints_->message->position, out.joints.position, n);
    ros::set(joints_->message->velocity, out.joints.velocity, n);
    ros::set(joints_->message->effort, out.joints.effort, n);
    joints_->send();
  }
  if (!out.ok) return;
  put(ee_pose_.message->pose, session_.inputs().arm.position, session_.inputs().arm.rotation);
  put(reference_pose_.message->pose, out.reference.position, out.reference.rotation);
  for (auto *header : {&ee_pose_.message->header, &reference_pose_.message->header}) ros::set(header->stamp, stamp_ns);
  ee_pose_.send(), reference_pose_.send();
}

/* -- goals ------------------------------------------------------------------------------------------------------ */

static std::string refusal(const SlipVic_Goal &goal) {
  char text[200];
  switch (goal.refusal) {
    case SLIP_VIC_REFUSAL_TOO_HEAVY:
      std::snprintf(text, sizeof text,
                    "friction cannot carry the object at %.3f s of its path: holding the weight needs %.3f N, "
                    "friction can carry %.3f N", goal.where, goal.value, goal.limit);
      break;
    case SLIP_VIC_REFUSAL_TOO_FAR:
      std::snprintf(text, sizeof text, "it is %.4g m away, the limit is %g: check unit and frame", goal.value, goal.limit);
      break;
    case SLIP_VIC_REFUSAL_TOO_FAST:
    case SLIP_VIC_REFUSAL_TURNS_TOO_FAST: {
      const char *unit = goal.refusal == SLIP_VIC_REFUSAL_TOO_FAST ? "m/s" : "rad/s";
      std::snprintf(text, sizeof text, "it needs %.2f %s, the limit is %.2f: allow more time", goal.value, unit, goal.limit);
      break;
    }
    default:
      return "the law is not active, see controller/mode";
  }
  return text;
}

void Reports::publish_goals() {
  if (settings_.trajectory != "goal") return;
  const SlipVic_Goal &goal = session_.task().goal;
  if (goal.refused != goal_refused_) {
    goal_refused_ = goal.refused;
    say("goal " + std::to_string(goal.refused) + " refused: " + refusal(goal));
  }
  static const char *const phases[] = {"", "waits until the pad is at rest on its current path", "is planned",
                                       "moves", "reached"};
  const int64_t number = goal.phase == SLIP_VIC_GOALPHASE_STOPS ? goal.received : goal.number;
  if ((number != goal_number_ || goal.phase != goal_phase_) && goal.phase != SLIP_VIC_GOALPHASE_RESTS)
    say("goal " + std::to_string(number) + " " + phases[goal.phase]);
  goal_number_ = number, goal_phase_ = goal.phase;
}
