/* The floor of a controller in C++: the same messages and rcl without a law, and bare wake-ups.
 *
 *   slip_vic_node FOLDER --ros-args ...    answers every joint state by the measured efforts, and records a ledger
 *   slip_vic_node wake-ups RATE SECONDS    sleeps to absolute times; prints share in time, and lateness [s], as JSON
 */
#include <algorithm>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <memory>
#include <type_traits>
#include <vector>

#include <sys/prctl.h>

#include "ros.hpp"

extern "C" { /* as in main.cpp */
__attribute__((visibility("default"))) void *PyExc_RuntimeError = nullptr;
__attribute__((visibility("default"))) char _Py_TrueStruct[64] = {};
}

static volatile std::sig_atomic_t stop = 0;
static const int64_t LOOK_NS = 20'000'000, SECOND_NS = 1'000'000'000;

static int wake_up(double rate_hz, double seconds) {
  const auto period = static_cast<int64_t>(1e9 / rate_hz), ticks = static_cast<int64_t>(seconds * rate_hz);
  const auto now = [] {
    timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec * SECOND_NS + t.tv_nsec;
  };
  std::vector<double> late;
  for (int64_t due = now() + period; static_cast<int64_t>(late.size()) < ticks; due += period) {
    const timespec at{due / SECOND_NS, due % SECOND_NS};
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &at, nullptr);
    late.push_back(1e-9 * static_cast<double>(now() - due));
  }
  std::sort(late.begin(), late.end());
  const auto in_time = std::lower_bound(late.begin(), late.end(), 1e-9 * static_cast<double>(period)) - late.begin();
  const auto share = [&](double of) { return late[static_cast<size_t>(of * static_cast<double>(late.size() - 1))]; };
  std::printf("{\"fresh_share\": %.9f, \"latency_p50_s\": %.9f, \"latency_p99_s\": %.9f, \"latency_p999_s\": %.9f, "
              "\"latency_max_s\": %.9f}\n", static_cast<double>(in_time) / static_cast<double>(ticks), share(0.5),
              share(0.99), share(0.999), late.back());
  return 0;
}

static int answer(int count, char **words) {
  ros::Node node(count - 1, words + 1, "slip_vic_controller");
  ros::Publisher<sensor_msgs__msg__JointState> command(node, "effort_command");
  ros::Publisher<std_msgs__msg__Int64MultiArray> ledger(node, "controller/ledger");
  ros::Publisher<std_msgs__msg__String> ready(node, "controller/ready", {true, true, 1});
  if (!rosidl_runtime_c__int64__Sequence__init(&ledger.message->data, 12)) return 1;
  const auto joints = [&](const sensor_msgs__msg__JointState &state) {
    if (!sensor_msgs__msg__JointState__copy(&state, &*command.message)) std::abort();
    command.message->position.size = command.message->velocity.size = 0;
    command.send();
    ++ledger.message->data.data[0];
    ledger.message->data.data[1] = state.header.stamp.sec, ledger.message->data.data[2] = state.header.stamp.nanosec;
    ledger.send();
  };
  const auto others = [](const auto &) {};
  const auto refuse = [] {};
  std::vector<std::unique_ptr<ros::AnySubscription>> inputs;
  const auto subscribe = [&](auto kind, const char *name, size_t depth, auto take) {
    using Body = std::remove_pointer_t<decltype(kind)>;
    inputs.push_back(std::make_unique<ros::Subscription<Body, decltype(take), decltype(refuse)>>(
        node, name, ros::Qos{false, false, depth}, take, refuse));
  };
  subscribe(static_cast<geometry_msgs__msg__WrenchStamped *>(nullptr), "wrench", 1, others);
  subscribe(static_cast<geometry_msgs__msg__TwistStamped *>(nullptr), "slip_velocity", 100, others);
  subscribe(static_cast<sensor_msgs__msg__JointState *>(nullptr), "joint_states", 1, joints);
  rcl_wait_set_t set = rcl_get_zero_initialized_wait_set();
  ros::check(rcl_wait_set_init(&set, inputs.size(), 0, 0, 0, 0, 0, &node.context, rcl_get_default_allocator()), "wait set");
  for (bool announced = false; !stop;) {
    ros::check(rcl_wait_set_clear(&set), "wait set");
    for (const auto &input : inputs) ros::check(rcl_wait_set_add_subscription(&set, &input->subscription, nullptr), "wait set");
    const rcl_ret_t code = rcl_wait(&set, LOOK_NS);
    if (code != RCL_RET_TIMEOUT) ros::check(code, "waiting");
    for (size_t k = 0; k < inputs.size(); ++k)
      if (set.subscriptions[k] != nullptr) inputs[k]->handle();
    const auto sent = [](const auto &input) { return input->publishers() > 0; };
    if (announced || command.subscribers() < 2 || ledger.subscribers() < 1 || !std::all_of(inputs.begin(), inputs.end(), sent))
      continue;
    announced = true;
    ros::set(ready.message->data, "controller");
    ready.send();
  }
  for (const ros::AnyPublisher *publisher : {static_cast<ros::AnyPublisher *>(&command), static_cast<ros::AnyPublisher *>(&ledger)})
    publisher->deliver(SECOND_NS);
  ros::ignore(rcl_wait_set_fini(&set));
  std::printf("{\"event\": \"done\", \"missed\": 0}\n");
  return 0;
}

int main(int count, char **words) {
  prctl(PR_SET_TIMERSLACK, 1, 0, 0, 0);
  if (count == 4 && std::strcmp(words[1], "wake-ups") == 0) return wake_up(std::atof(words[2]), std::atof(words[3]));
  for (const int number : {SIGINT, SIGTERM, SIGHUP}) std::signal(number, [](int) { stop = 1; });
  try {
    return answer(count, words);
  } catch (const std::exception &error) {
    std::fprintf(stderr, "error: %s\n", error.what());
    return 1;
  }
}
