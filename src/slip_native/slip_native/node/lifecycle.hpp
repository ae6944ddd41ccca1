/* The managed node: unconfigured it has no topics, inactive it gives no commands, active it controls the arm. */
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "node.hpp"

class Lifecycle {
 public:
  /* Configure and activate if `auto_activate` is true; throws if that fails. */
  Lifecycle(ros::Node &ros, const Settings &settings);
  ~Lifecycle() { ros::ignore(rcl_wait_set_fini(&set_)); }

  /* Run until `stop` is set, or a transition shuts the node down. */
  void run(const volatile int &stop);
  ControllerNode *node() { return node_ ? &*node_ : nullptr; } /* nullptr while unconfigured, and after a shutdown */

 private:
  bool change(uint8_t transition);
  void wait();

  ros::Node &ros_;
  const Settings &settings_;
  uint8_t state_;
  bool changed_ = false; /* since the wait: the wait set may refer to what is gone */
  std::optional<ControllerNode> node_;
  std::vector<std::unique_ptr<ros::AnyService>> services_;
  rcl_wait_set_t set_ = rcl_get_zero_initialized_wait_set();
};
