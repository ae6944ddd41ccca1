/* The controller node: joint states, wrench and slip velocity in, joint commands out; topics and services of one arm. */
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include "parameter_server.hpp"
#include "reports.hpp"
#include "ros.hpp"
#include "samples.hpp"
#include "session.hpp"

class ControllerNode {
 public:
  ControllerNode(ros::Node &ros, const Settings &settings);

  /* Numbers of its subscriptions and services: add them to a wait set before waiting, handle them after it. */
  size_t subscriptions() const { return inputs_.size(); }
  size_t services() const { return services_.size(); }
  void add_to(rcl_wait_set_t *set) const;
  void handle(const rcl_wait_set_t &set, size_t first_service);
  /* Do what is due: the watchdog's cycle, a check for other nodes; return when it is due again, steady clock [ns]. */
  int64_t attend();
  void set_active(bool active);
  /* Publish that there is no command any more, and wait until subscribers have everything. */
  void close(int64_t timeout_ns);
  int64_t cycles() const { return session_.arm().cycles; }
  int64_t missed() const { return reports_.missed(); }

 private:
  template <class Body, class Take>
  void subscribe(const std::string &name, size_t depth, Take take);
  void subscribe_contacts();
  void subscribe_task();
  void say_no_command();
  void cycle();
  void publish(int64_t began_ns);
  void send_command(int64_t stamp_ns, const double *numbers, size_t count);
  void look();
  void announce_when_ready();
  size_t owners(const ros::AnySubscription &input);
  std::pair<bool, std::string> answer(int64_t request);

  ros::Node &ros_;
  const Settings &settings_;
  Session session_;
  Refusals refusals_;
  Reports reports_;
  JointReader joints_;
  JointSample sample_;
  ros::Publisher<sensor_msgs__msg__JointState> command_;
  ros::Publisher<std_msgs__msg__Int64MultiArray> ledger_;
  ros::Publisher<std_msgs__msg__String> ready_;
  std::optional<ros::Publisher<std_msgs__msg__Float64MultiArray>> array_;
  std::optional<ros::Publisher<std_msgs__msg__Float64>> grip_;
  std::optional<ros::Publisher<trajectory_msgs__msg__MultiDOFJointTrajectory>> used_;
  std::vector<std::unique_ptr<ros::AnySubscription>> inputs_; /* the joint states last: they begin a cycle */
  std::vector<std::unique_ptr<ros::AnyService>> services_;
  ParameterServer parameters_;
  bool is_ready_ = false;
  int64_t look_ns_ = 0, watchdog_ns_ = 0;
  size_t needed_ = 0; /* of the inputs, those without which the node is not ready */
};
