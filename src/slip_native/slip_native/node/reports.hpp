/* What the node reports: mode and why, the numbers of the law, how its cycles go in time, messages that are refused. */
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "errors.hpp"
#include "ros.hpp"
#include "session.hpp"

void log_info(const std::string &text);
void log_warning(const std::string &text);
void log_error(const std::string &text);

/* Counts refused messages by topic, and logs each kind of fault once: what was got may differ in every message. */
class Refusals {
 public:
  void add(const std::string &topic, const InputError &error);
  const std::map<std::string, int64_t> &counts() const { return counts_; }

 private:
  std::map<std::string, int64_t> counts_;
  std::set<std::pair<std::string, std::string>> told_; /* topic, what was expected */
};

class Reports {
 public:
  Reports(ros::Node &ros, const Settings &settings, const Session &session, const Refusals &refusals);

  /* Report how a cycle went that began at a steady time [ns], whose command has just been published. */
  void time(int64_t began_ns);
  /* Report a cycle. */
  void publish();
  /* What a recorder subscribes to. */
  const std::vector<const ros::AnyPublisher *> &publishers() const { return publishers_; }
  int64_t missed() const { return missed_; }
  std::string reason() const;
  void say(const std::string &line); /* of goals */

 private:
  void publish_mode();
  void publish_symbols();
  void publish_goals();
  void publish_status(int64_t stamp_ns, uint8_t level, const std::string &text);
  std::vector<std::pair<std::string, std::string>> mode_values() const;

  const Settings &settings_;
  const Session &session_;
  const Refusals &refusals_;
  std::string name_;
  ros::Publisher<sensor_msgs__msg__JointState> scalars_;
  ros::Publisher<geometry_msgs__msg__PoseStamped> ee_pose_, reference_pose_;
  ros::Publisher<std_msgs__msg__String> mode_;
  ros::Publisher<diagnostic_msgs__msg__DiagnosticArray> status_;
  std::optional<ros::Publisher<sensor_msgs__msg__JointState>> joints_, timing_;
  std::optional<ros::Publisher<std_msgs__msg__String>> goal_;
  std::vector<const ros::AnyPublisher *> publishers_;
  std::vector<double> numbers_;
  int64_t symbols_period_ = -1, mode_period_ = -1;
  std::vector<int64_t> last_mode_;
  int64_t last_began_ns_ = 0, last_stamp_ns_ = 0;
  int64_t overruns_ = 0, missed_ = 0;
  int64_t goal_number_ = 0, goal_phase_ = 0, goal_refused_ = 0;
};
