#include "node.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <set>

#include <rcl/graph.h>

#include "words.hpp"

static const int64_t WATCHDOG_NS = 10'000'000, LOOK_NS = 20'000'000;
static const size_t KEPT = 100; /* messages that wait, of inputs of which none may be lost */

static int64_t now_ns() {
  return std::chrono::nanoseconds(std::chrono::steady_clock::now().time_since_epoch()).count();
}

static std::string of_contact(const std::string &name, int contact) {
  return contact == 0 ? name : "contact_" + std::to_string(contact) + "/" + name;
}

template <class Body, class Take>
void ControllerNode::subscribe(const std::string &name, size_t depth, Take take) {
  const ros::Qos qos{settings_.lockstep, false, settings_.lockstep ? KEPT : depth};
  const auto refuse = [this, name] { refusals_.add(name, {"message", "bytes that are none", "one of its type"}); };
  const auto checked = [this, name, take](const Body &body) {
    try {
      take(body);
    } catch (const InputError &error) {
      refusals_.add(name, error);
    }
  };
  inputs_.push_back(std::make_unique<ros::Subscription<Body, decltype(checked), decltype(refuse)>>(ros_, name, qos, checked, refuse));
}

ControllerNode::ControllerNode(ros::Node &ros, const Settings &settings)
    : ros_(ros),
      settings_(settings),
      session_(settings),
      reports_(ros, settings, session_, refusals_),
      joints_(settings.joint_names),
      command_(ros, settings.interface + "_command"),
      ledger_(ros, "controller/ledger"),
      ready_(ros, "controller/ready", ros::LATCHED),
      parameters_(ros, session_, &services_) {
  ros::set(command_.message->name, settings.joint_names);
  if (settings.interface != "effort" || settings.effort_array) array_.emplace(ros, settings.interface + "_controller/commands");
  if (session_.config().grip.follow) grip_.emplace(ros, "grip_command");
  const size_t numbers = 3 + 4 * static_cast<size_t>(settings.contacts) + 5 + settings.external();
  if (!rosidl_runtime_c__int64__Sequence__init(&ledger_.message->data, numbers)) throw std::bad_alloc();
  subscribe_contacts();
  if (settings.lockstep)
    subscribe<std_msgs__msg__Int64MultiArray>("lockstep_tick", KEPT, [this](const std_msgs__msg__Int64MultiArray &tick) {
      if (!session_.add_manifest(tick.data.data, tick.data.size))
        throw InputError("lockstep tick", std::to_string(tick.data.size) + " numbers", "3, and 2 more per contact");
      cycle();
    });
  subscribe<sensor_msgs__msg__JointState>("joint_states", 1, [this](const sensor_msgs__msg__JointState &message) {
    joints_.read(message, &sample_);
    session_.add_joint(sample_, now_ns());
    cycle();
  });
  needed_ = inputs_.size();
  subscribe_task();
  for (const auto &[name, request] : {std::pair{"~/enable", SLIP_VIC_REQUEST_ENABLE}, {"~/hold", SLIP_VIC_REQUEST_HOLD},
                                      {"~/reset_fault", SLIP_VIC_REQUEST_RESET_FAULT}, {"~/tare", SLIP_VIC_REQUEST_TARE}})
    services_.push_back(ros::serve<ros::Trigger>(ros, name, [this, request = request](const auto &, auto &response) {
      const auto [success, text] = answer(request);
      response.success = success;
      ros::set(response.message, text);
    }));
  log_info(std::string("configured in ") + (settings.lockstep ? "lockstep" : "realtime"));
  if (session_.config().models_wrench) log_warning("no wrench sensor (wrench.source: none): the load is modelled");
}

void ControllerNode::subscribe_contacts() {
  for (int contact = 0; contact < settings_.contacts; ++contact) {
    const std::string &pad = settings_.ee_frame, &own = settings_.wrench_frame;
    const std::string frame = contact == 0 && !own.empty() ? own : pad;
    const auto ended = [this] {
      if (settings_.lockstep) cycle();
    };
    if (!session_.config().models_wrench)
      subscribe<geometry_msgs__msg__WrenchStamped>(
          of_contact("wrench", contact), 1, [=](const geometry_msgs__msg__WrenchStamped &message) {
            check_frame(message.header, frame);
            const auto &f = message.wrench.force, &t = message.wrench.torque;
            const double six[] = {f.x, f.y, f.z, t.x, t.y, t.z};
            session_.add_wrench(contact, stamp_of(message.header.stamp), six, now_ns());
            ended();
          });
    if (settings_.slip_input == "flag")
      subscribe<sensor_msgs__msg__JointState>(
          of_contact("slip_flag", contact), KEPT, [=](const sensor_msgs__msg__JointState &message) {
            double six[6];
            const bool known = read_flag(message, six);
            session_.add_slip(contact, stamp_of(message.header.stamp), six, known, now_ns());
            ended();
          });
    else if (settings_.slip_input == "displacement")
      subscribe<geometry_msgs__msg__PoseStamped>(
          of_contact("slip_displacement", contact), KEPT, [=](const geometry_msgs__msg__PoseStamped &message) {
            check_frame(message.header, pad);
            SlipVic_Pose pose;
            const bool valid = read_displacement(message, &pose);
            session_.add_displacement(contact, stamp_of(message.header.stamp), valid ? &pose : nullptr, now_ns());
            ended();
          });
    else
      subscribe<geometry_msgs__msg__TwistStamped>(
          of_contact("slip_velocity", contact), KEPT, [=](const geometry_msgs__msg__TwistStamped &message) {
            check_frame(message.header, pad);
            const auto &v = message.twist.linear, &w = message.twist.angular;
            const double six[] = {v.x, v.y, v.z, w.x, w.y, w.z};
            const bool valid = std::all_of(six, six + 6, [](double x) { return std::isfinite(x); });
            session_.add_slip(contact, stamp_of(message.header.stamp), six, valid, now_ns());
            ended();
          });
  }
}

void ControllerNode::subscribe_task() {
  if (!settings_.external()) return;
  used_.emplace(ros_, "controller/reference_used");
  using Trajectory = trajectory_msgs__msg__MultiDOFJointTrajectory;
  const auto used = [this](const Trajectory &message) {
    if (!trajectory_msgs__msg__MultiDOFJointTrajectory__copy(&message, &*used_->message)) throw std::bad_alloc();
    used_->send();
  };
  if (settings_.trajectory == "topic") {
    subscribe<Trajectory>("reference", KEPT, [=](const Trajectory &message) {
      const Point point = read_reference(message, session_.config().follows_stream);
      session_.set_reference(point.motion, stamp_of(message.header.stamp));
      used(message);
    });
    return;
  }
  subscribe<Trajectory>("goal", KEPT, [=](const Trajectory &message) {
    try {
      const Point point = read_goal(message, settings_.goal_duration_s);
      used(message);
      session_.set_goal(point.motion, point.after_s);
    } catch (const InputError &error) {
      reports_.say(std::string("goal refused: ") + error.what());
      throw;
    }
  });
}

/* -- services --------------------------------------------------------------------------------------------------- */

std::pair<bool, std::string> ControllerNode::answer(int64_t request) {
  const int64_t mode = session_.arm().mode.mode;
  if (!session_.active()) return {false, "not active"};
  if (mode == SLIP_VIC_MODE_FAULT && request != SLIP_VIC_REQUEST_RESET_FAULT)
    return {false, "in FAULT: " + reports_.reason() + "; to continue call ~/reset_fault, then ~/enable"};
  if (request == SLIP_VIC_REQUEST_TARE && (mode == SLIP_VIC_MODE_ACTIVE || mode == SLIP_VIC_MODE_DEGRADED))
    return {false, "the law is active: call ~/hold first"};
  if (request == SLIP_VIC_REQUEST_TARE && session_.config().tare.duration_ns == 0)
    return {false, "tare.duration_s is 0: there is no tare"};
  session_.request(request);
  static const std::map<int64_t, std::string> names = {{SLIP_VIC_REQUEST_ENABLE, "enable"}, {SLIP_VIC_REQUEST_HOLD, "hold"},
                                                       {SLIP_VIC_REQUEST_RESET_FAULT, "reset_fault"},
                                                       {SLIP_VIC_REQUEST_TARE, "tare"}};
  return {true, names.at(request) + ": decided in the next cycle"};
}

/* -- cycles ----------------------------------------------------------------------------------------------------- */

void ControllerNode::cycle() {
  const int64_t began_ns = now_ns();
  if (session_.cycle(began_ns)) publish(began_ns);
}

void ControllerNode::send_command(int64_t stamp_ns, const double *numbers, size_t count) {
  auto &message = *command_.message;
  const std::string &interface = settings_.interface;
  ros::set(message.header.stamp, stamp_ns);
  ros::set(interface == "effort" ? message.effort : interface == "velocity" ? message.velocity : message.position, numbers, count);
  command_.send();
  if (!array_ || count == 0) return;
  ros::set(array_->message->data, numbers, count);
  array_->send();
}

void ControllerNode::publish(int64_t began_ns) {
  const SlipVic_CycleOutputs &out = session_.outputs();
  if (grip_) {
    grip_->message->data = out.grip;
    grip_->send();
  }
  send_command(session_.stamp_ns(), out.command, session_.commands() ? settings_.joint_names.size() : 0);
  reports_.time(began_ns);
  auto &data = ledger_.message->data;
  std::copy(out.ledger, out.ledger + data.size, data.data);
  ledger_.send();
  reports_.publish();
}

/* -- running ---------------------------------------------------------------------------------------------------- */

size_t ControllerNode::owners(const ros::AnySubscription &input) {
  const size_t count = input.publishers();
  if (count < 2) return count;
  /* Differently named nodes: a killed node's ghost lives on in discovery for a while. */
  rcl_topic_endpoint_info_array_t infos = rcl_get_zero_initialized_topic_endpoint_info_array();
  rcutils_allocator_t allocator = rcutils_get_default_allocator();
  if (rcl_get_publishers_info_by_topic(&ros_.node, &allocator, input.topic(), false, &infos) != RCL_RET_OK) {
    rcl_reset_error();
    return count;
  }
  std::set<std::string> names;
  for (size_t k = 0; k < infos.size; ++k)
    names.insert(std::string(infos.info_array[k].node_namespace) + "/" + infos.info_array[k].node_name);
  ros::ignore(rcl_topic_endpoint_info_array_fini(&infos, &allocator));
  return names.size();
}

void ControllerNode::look() {
  size_t on_command = 0;
  int64_t outside = SLIP_VIC_REASON_NONE;
  for (size_t k = 0; k < needed_; ++k)
    if (owners(*inputs_[k]) > 1) outside = SLIP_VIC_REASON_SECOND_PUBLISHER;
  ros::ignore(rcl_count_publishers(&ros_.node, command_.topic(), &on_command));
  if (on_command > 1) outside = SLIP_VIC_REASON_FOREIGN_COMMAND;
  session_.set_outside(outside);
  if (!is_ready_) announce_when_ready();
}

void ControllerNode::announce_when_ready() {
  const auto expected = static_cast<size_t>(std::max(0L, settings_.subscribers)), recorders = expected == 0 ? 0 : expected - 1;
  for (size_t k = 0; k < needed_; ++k)
    if (inputs_[k]->publishers() < 1) return;
  if (command_.subscribers() < expected || ledger_.subscribers() < recorders) return;
  if (grip_ && grip_->subscribers() < expected) return;
  if (used_ && used_->subscribers() < recorders) return;
  for (const ros::AnyPublisher *publisher : reports_.publishers())
    if (publisher->subscribers() < recorders) return;
  is_ready_ = true;
  ros::set(ready_.message->data, "controller");
  ready_.send();
  log_info("matched: every input has a publisher, and the command has a subscriber");
}

void ControllerNode::add_to(rcl_wait_set_t *set) const {
  for (const auto &input : inputs_) ros::check(rcl_wait_set_add_subscription(set, &input->subscription, nullptr), "wait set");
  for (const auto &service : services_) ros::check(rcl_wait_set_add_service(set, &service->service, nullptr), "wait set");
}

void ControllerNode::handle(const rcl_wait_set_t &set, size_t first_service) {
  for (size_t k = 0; k < services_.size(); ++k)
    if (set.services[first_service + k] != nullptr) services_[k]->handle();
  for (size_t k = 0; k < inputs_.size(); ++k)
    if (set.subscriptions[k] != nullptr) inputs_[k]->handle();
}

int64_t ControllerNode::attend() {
  const int64_t now = now_ns();
  if (now >= watchdog_ns_) {
    watchdog_ns_ = now + WATCHDOG_NS;
    if (session_.watchdog(now)) publish(now);
  }
  if (now >= look_ns_) {
    look_ns_ = now + LOOK_NS;
    look();
  }
  return std::min(look_ns_, watchdog_ns_);
}

void ControllerNode::set_active(bool active) {
  session_.set_active(active);
  if (!active) say_no_command();
}

void ControllerNode::say_no_command() {
  if (!session_.knows_joints()) return;
  const std::vector<double> zero(settings_.joint_names.size());
  const bool velocity = settings_.interface == "velocity"; /* such a drive continues with its last command */
  send_command(session_.arm().joint.last.stamp_ns, zero.data(), velocity ? zero.size() : 0);
}

void ControllerNode::close(int64_t timeout_ns) {
  if (!settings_.lockstep && session_.active()) say_no_command();
  const int64_t end_ns = now_ns() + timeout_ns;
  const auto deliver = [&](const ros::AnyPublisher &of) { of.deliver(std::max<int64_t>(0, end_ns - now_ns())); };
  deliver(command_), deliver(ledger_);
  for (const ros::AnyPublisher *publisher : reports_.publishers()) deliver(*publisher);
}
