/* The controller as a plugin of ros2_control: the cycle runs in update(), on the arm's own joint states.
 *
 * Session and Settings are those of slip_vic_node, compiled from the folder of `slip-vic export`. Samples of the sensors
 * arrive in the executor's thread and wait in a list, which update() takes without ever waiting for it.
 */
#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include <controller_interface/controller_interface.hpp>
#include <geometry_msgs/msg/twist_stamped.hpp>
#include <geometry_msgs/msg/wrench_stamped.hpp>
#include <pluginlib/class_list_macros.hpp>
#include <std_srvs/srv/trigger.hpp>

#include "errors.hpp"
#include "session.hpp"
#include "slip_vic_ros2_control_parameters.hpp" /* made of slip_vic_ros2_control_parameters.yaml */
#include "words.hpp"

namespace slip_vic_ros2_control {

using controller_interface::CallbackReturn;
using controller_interface::InterfaceConfiguration;
using controller_interface::interface_configuration_type;
using controller_interface::return_type;

struct Sample {
  bool is_slip;
  int64_t stamp_ns, now_ns; /* of the sensor, and of its arrival */
  double six[6];
};

static int64_t steady_ns() {
  return std::chrono::nanoseconds(std::chrono::steady_clock::now().time_since_epoch()).count();
}

class SlipVicController : public controller_interface::ControllerInterface {
 public:
  CallbackReturn on_init() override {
    try {
      listener_ = std::make_shared<ParamListener>(get_node());
      settings_ = read_settings(listener_->get_params().folder);
      if (settings_.lockstep) throw InputError("mode", "lockstep", "realtime", "slip-vic export --mode realtime");
      if (settings_.contacts != 1) throw InputError("contacts.count", std::to_string(settings_.contacts), "1");
      session_ = std::make_unique<Session>(settings_);
    } catch (const std::exception &error) {
      RCLCPP_ERROR(get_node()->get_logger(), "%s", error.what());
      return CallbackReturn::ERROR;
    }
    return CallbackReturn::SUCCESS;
  }

  InterfaceConfiguration command_interface_configuration() const override { return interfaces({settings_.interface}); }

  InterfaceConfiguration state_interface_configuration() const override { return interfaces({"position", "velocity", "effort"}); }

  CallbackReturn on_configure(const rclcpp_lifecycle::State &) override {
    const auto params = listener_->get_params();
    wrench_ = get_node()->create_subscription<geometry_msgs::msg::WrenchStamped>(
        params.wrench_topic, rclcpp::SensorDataQoS(), [this](const geometry_msgs::msg::WrenchStamped &m) {
          add(false, m.header.stamp, m.wrench.force, m.wrench.torque);
        });
    slip_ = get_node()->create_subscription<geometry_msgs::msg::TwistStamped>(
        params.slip_topic, rclcpp::SensorDataQoS(), [this](const geometry_msgs::msg::TwistStamped &m) {
          add(true, m.header.stamp, m.twist.linear, m.twist.angular);
        });
    for (const auto &[name, request] : {std::pair{"enable", SLIP_VIC_REQUEST_ENABLE}, {"hold", SLIP_VIC_REQUEST_HOLD},
                                        {"reset_fault", SLIP_VIC_REQUEST_RESET_FAULT}, {"tare", SLIP_VIC_REQUEST_TARE}})
      services_.push_back(get_node()->create_service<std_srvs::srv::Trigger>(
          std::string("~/") + name, [this, request = request](const std_srvs::srv::Trigger::Request::SharedPtr,
                                                              std_srvs::srv::Trigger::Response::SharedPtr response) {
            const std::lock_guard<std::mutex> lock(mutex_);
            request_ = request;
            response->success = true;
            response->message = "decided in the next cycle, see the log";
          }));
    const size_t n = settings_.joint_names.size();
    joint_.position.resize(n), joint_.velocity.resize(n), joint_.effort.resize(n);
    waiting_.reserve(64), taken_.reserve(64);
    return CallbackReturn::SUCCESS;
  }

  return_type update(const rclcpp::Time &time, const rclcpp::Duration &) override {
    take_samples();
    const size_t n = joint_.position.size();
    joint_.stamp_ns = time.nanoseconds();
    for (size_t j = 0; j < n; ++j) {
      joint_.position[j] = state_interfaces_[j].get_value();
      joint_.velocity[j] = state_interfaces_[n + j].get_value();
      joint_.effort[j] = state_interfaces_[2 * n + j].get_value();
    }
    const int64_t now_ns = steady_ns();
    session_->add_joint(joint_, now_ns);
    if (!session_->cycle(now_ns) && !session_->watchdog(now_ns)) return return_type::OK; /* the last command stays */
    const bool commands = session_->commands();
    for (size_t j = 0; j < n; ++j) /* without a command an effort of zero, and else where the arm is */
      (void)command_interfaces_[j].set_value(commands ? session_->outputs().command[j]
                                             : settings_.interface == "position" ? joint_.position[j] : 0.0);
    report();
    return return_type::OK;
  }

 private:
  InterfaceConfiguration interfaces(const std::vector<std::string> &kinds) const {
    InterfaceConfiguration found{interface_configuration_type::INDIVIDUAL, {}};
    for (const std::string &kind : kinds)
      for (const std::string &joint : settings_.joint_names) found.names.push_back(joint + "/" + kind);
    return found;
  }

  void add(bool is_slip, const rclcpp::Time &stamp, const geometry_msgs::msg::Vector3 &a, const geometry_msgs::msg::Vector3 &b) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (waiting_.size() < waiting_.capacity()) /* update() does not run, or is starved: older samples are enough */
      waiting_.push_back({is_slip, stamp.nanoseconds(), steady_ns(), {a.x, a.y, a.z, b.x, b.y, b.z}});
  }

  void take_samples() {
    {
      const std::unique_lock<std::mutex> lock(mutex_, std::try_to_lock);
      if (!lock) return; /* in the next cycle */
      std::swap(waiting_, taken_);
      if (request_ != SLIP_VIC_REQUEST_NONE) session_->request(request_);
      request_ = SLIP_VIC_REQUEST_NONE;
    }
    for (const Sample &of : taken_) {
      const bool valid = std::all_of(of.six, of.six + 6, [](double x) { return std::isfinite(x); });
      if (of.is_slip)
        session_->add_slip(0, of.stamp_ns, of.six, valid, of.now_ns);
      else
        session_->add_wrench(0, of.stamp_ns, of.six, of.now_ns);
    }
    taken_.clear();
  }

  void report() { /* a log line where the mode changes: it may wait, so put it elsewhere where that matters */
    const SlipVic_ModeState &mode = session_->outputs().mode;
    if (mode.mode == mode_) return;
    mode_ = mode.mode;
    const std::string why = describe(mode.reason, settings_.joint_names);
    RCLCPP_INFO(get_node()->get_logger(), "mode %d: %s", static_cast<int>(mode_), why.c_str());
  }

  std::shared_ptr<ParamListener> listener_;
  Settings settings_;
  std::unique_ptr<Session> session_;
  JointSample joint_;
  std::mutex mutex_; /* of the next two */
  std::vector<Sample> waiting_;
  int64_t request_ = SLIP_VIC_REQUEST_NONE;
  std::vector<Sample> taken_;
  int64_t mode_ = -1;
  rclcpp::Subscription<geometry_msgs::msg::WrenchStamped>::SharedPtr wrench_;
  rclcpp::Subscription<geometry_msgs::msg::TwistStamped>::SharedPtr slip_;
  std::vector<rclcpp::Service<std_srvs::srv::Trigger>::SharedPtr> services_;
};

}  // namespace slip_vic_ros2_control

PLUGINLIB_EXPORT_CLASS(slip_vic_ros2_control::SlipVicController, controller_interface::ControllerInterface)
