/* The floor: the ping-pong of pingpong.py in C, on the same rcl, middleware and messages, default waiting.
 *
 *   pingpong answer
 *   pingpong ask <rounds> <warm-up>      prints the round trips after the warm-up [s] as a JSON list
 *
 * Built as a library and called from a Python process that does nothing else: the wheels' own libraries need the
 * interpreter's symbols.
 */
#include <signal.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <geometry_msgs/msg/twist_stamped.h>
#include <geometry_msgs/msg/wrench_stamped.h>
#include <nav_msgs/msg/odometry.h>
#include <rcl/error_handling.h>
#include <rcl/rcl.h>
#include <rosgraph_msgs/msg/clock.h>
#include <rosidl_runtime_c/primitives_sequence_functions.h>
#include <rosidl_runtime_c/string_functions.h>
#include <sensor_msgs/msg/joint_state.h>
#include <std_msgs/msg/int64_multi_array.h>

#define JOINTS 7
#define SLIP_AXES 6
#define REPEAT_NS 200000000LL
#define START_TIMEOUT_S 20.0

#define CHECK(call)                                                              \
  do {                                                                           \
    rcl_ret_t ret_ = (call);                                                     \
    if (ret_ != RCL_RET_OK) {                                                    \
      fprintf(stderr, "%s: %s\n", #call, rcl_get_error_string().str);            \
      exit(1);                                                                   \
    }                                                                            \
  } while (0)

static volatile sig_atomic_t stop_wanted = 0;
static void on_signal(int number) { (void)number; stop_wanted = 1; }

static double now_s(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static rcl_context_t context;
static rcl_node_t node;

static rcl_publisher_t publisher(const rosidl_message_type_support_t *type, const char *name) {
  rcl_publisher_t made = rcl_get_zero_initialized_publisher();
  rcl_publisher_options_t options = rcl_publisher_get_default_options();
  options.qos.depth = 100;
  CHECK(rcl_publisher_init(&made, &node, type, name, &options));
  return made;
}

static rcl_subscription_t subscription(const rosidl_message_type_support_t *type, const char *name) {
  rcl_subscription_t made = rcl_get_zero_initialized_subscription();
  rcl_subscription_options_t options = rcl_subscription_get_default_options();
  options.qos.depth = 100;
  CHECK(rcl_subscription_init(&made, &node, type, name, &options));
  return made;
}

static rcl_wait_set_t wait_set_for(size_t count) {
  rcl_wait_set_t made = rcl_get_zero_initialized_wait_set();
  CHECK(rcl_wait_set_init(&made, count, 0, 0, 0, 0, 0, &context, rcl_get_default_allocator()));
  return made;
}

static void wait_for(rcl_wait_set_t *set, rcl_subscription_t *subscriptions, size_t count) {
  CHECK(rcl_wait_set_clear(set));
  for (size_t i = 0; i < count; ++i) CHECK(rcl_wait_set_add_subscription(set, &subscriptions[i], NULL));
  rcl_ret_t ret = rcl_wait(set, REPEAT_NS);
  if (ret != RCL_RET_OK && ret != RCL_RET_TIMEOUT) CHECK(ret);
}

static void set_text(rosidl_runtime_c__String *text, const char *value) {
  if (!rosidl_runtime_c__String__assign(text, value)) exit(1);
}

static void named_numbers(sensor_msgs__msg__JointState *m, size_t count, const char *prefix, int arrays) {
  sensor_msgs__msg__JointState__init(m);
  rosidl_runtime_c__String__Sequence__init(&m->name, count);
  for (size_t i = 0; i < count; ++i) {
    char name[32];
    snprintf(name, sizeof name, "%s%zu", prefix, i + 1);
    set_text(&m->name.data[i], name);
  }
  rosidl_runtime_c__double__Sequence__init(&m->position, count);
  rosidl_runtime_c__double__Sequence__init(&m->velocity, count);
  if (arrays == 3) rosidl_runtime_c__double__Sequence__init(&m->effort, count);
}

static void set_stamp(builtin_interfaces__msg__Time *stamp, int64_t tick) {
  stamp->sec = 0;
  stamp->nanosec = (uint32_t)tick;
}

enum { WRENCH, SLIP, STATE, TICK, NEEDED };

static void answer(void) {
  rcl_subscription_t in[NEEDED] = {
      [WRENCH] = subscription(ROSIDL_GET_MSG_TYPE_SUPPORT(geometry_msgs, msg, WrenchStamped), "pp_wrench"),
      [SLIP] = subscription(ROSIDL_GET_MSG_TYPE_SUPPORT(geometry_msgs, msg, TwistStamped), "pp_slip"),
      [STATE] = subscription(ROSIDL_GET_MSG_TYPE_SUPPORT(sensor_msgs, msg, JointState), "pp_joints"),
      [TICK] = subscription(ROSIDL_GET_MSG_TYPE_SUPPORT(std_msgs, msg, Int64MultiArray), "pp_tick")};
  rcl_publisher_t effort_out = publisher(ROSIDL_GET_MSG_TYPE_SUPPORT(sensor_msgs, msg, JointState), "pp_effort");
  rcl_publisher_t ledger_out = publisher(ROSIDL_GET_MSG_TYPE_SUPPORT(std_msgs, msg, Int64MultiArray), "pp_ledger");
  geometry_msgs__msg__WrenchStamped wrench;
  geometry_msgs__msg__TwistStamped slip;
  sensor_msgs__msg__JointState state, effort;
  std_msgs__msg__Int64MultiArray tick, ledger;
  geometry_msgs__msg__WrenchStamped__init(&wrench);
  geometry_msgs__msg__TwistStamped__init(&slip);
  sensor_msgs__msg__JointState__init(&state);
  std_msgs__msg__Int64MultiArray__init(&tick);
  named_numbers(&effort, JOINTS, "arm_joint", 3);
  std_msgs__msg__Int64MultiArray__init(&ledger);
  rosidl_runtime_c__int64__Sequence__init(&ledger.data, 12);
  void *messages[NEEDED] = {[WRENCH] = &wrench, [SLIP] = &slip, [STATE] = &state, [TICK] = &tick};
  int64_t seen[NEEDED] = {-1, -1, -1, -1};
  rcl_wait_set_t set = wait_set_for(NEEDED);
  while (!stop_wanted) {
    wait_for(&set, in, NEEDED);
    for (int i = 0; i < NEEDED; ++i) {
      while (rcl_take(&in[i], messages[i], NULL, NULL) == RCL_RET_OK) {
        seen[i] = i == WRENCH   ? wrench.header.stamp.nanosec
                  : i == SLIP   ? slip.header.stamp.nanosec
                  : i == STATE  ? state.header.stamp.nanosec
                                : tick.data.data[0];
        if (seen[WRENCH] == seen[SLIP] && seen[SLIP] == seen[STATE] && seen[STATE] == seen[TICK]) {
          set_stamp(&effort.header.stamp, seen[i]);
          CHECK(rcl_publish(&effort_out, &effort, NULL));
          ledger.data.data[0] = seen[i];
          CHECK(rcl_publish(&ledger_out, &ledger, NULL));
        }
      }
    }
  }
}

static void ask(int rounds, int warm_up) {
  rcl_publisher_t wrench_out = publisher(ROSIDL_GET_MSG_TYPE_SUPPORT(geometry_msgs, msg, WrenchStamped), "pp_wrench");
  rcl_publisher_t slip_out = publisher(ROSIDL_GET_MSG_TYPE_SUPPORT(geometry_msgs, msg, TwistStamped), "pp_slip");
  rcl_publisher_t state_out = publisher(ROSIDL_GET_MSG_TYPE_SUPPORT(sensor_msgs, msg, JointState), "pp_joints");
  rcl_publisher_t tick_out = publisher(ROSIDL_GET_MSG_TYPE_SUPPORT(std_msgs, msg, Int64MultiArray), "pp_tick");
  rcl_publisher_t clock_out = publisher(ROSIDL_GET_MSG_TYPE_SUPPORT(rosgraph_msgs, msg, Clock), "pp_clock");
  rcl_publisher_t object_out = publisher(ROSIDL_GET_MSG_TYPE_SUPPORT(nav_msgs, msg, Odometry), "pp_object");
  rcl_publisher_t truth_out = publisher(ROSIDL_GET_MSG_TYPE_SUPPORT(sensor_msgs, msg, JointState), "pp_truth");
  rcl_subscription_t in = subscription(ROSIDL_GET_MSG_TYPE_SUPPORT(sensor_msgs, msg, JointState), "pp_effort");
  geometry_msgs__msg__WrenchStamped wrench;
  geometry_msgs__msg__TwistStamped slip;
  sensor_msgs__msg__JointState state, truth, effort;
  std_msgs__msg__Int64MultiArray tick;
  rosgraph_msgs__msg__Clock clock_message;
  nav_msgs__msg__Odometry object;
  geometry_msgs__msg__WrenchStamped__init(&wrench);
  geometry_msgs__msg__TwistStamped__init(&slip);
  set_text(&wrench.header.frame_id, "ee");
  set_text(&slip.header.frame_id, "ee");
  named_numbers(&state, JOINTS, "arm_joint", 3);
  named_numbers(&truth, SLIP_AXES, "s_", 2);
  sensor_msgs__msg__JointState__init(&effort);
  std_msgs__msg__Int64MultiArray__init(&tick);
  rosidl_runtime_c__int64__Sequence__init(&tick.data, 5);
  rosgraph_msgs__msg__Clock__init(&clock_message);
  nav_msgs__msg__Odometry__init(&object);
  set_text(&object.header.frame_id, "world");
  set_text(&object.child_frame_id, "object");

  rcl_publisher_t *needed[NEEDED] = {&wrench_out, &slip_out, &state_out, &tick_out};
  const double start_deadline = now_s() + START_TIMEOUT_S;
  for (bool matched = false; !matched && !stop_wanted;) {
    size_t count = 0;
    CHECK(rcl_subscription_get_publisher_count(&in, &count));
    matched = count > 0;
    for (int i = 0; i < NEEDED; ++i) {
      CHECK(rcl_publisher_get_subscription_count(needed[i], &count));
      matched = matched && count > 0;
    }
    if (now_s() > start_deadline) {
      fprintf(stderr, "no partner\n");
      exit(1);
    }
    struct timespec pause = {0, 10000000};
    nanosleep(&pause, NULL);
  }
  rcl_wait_set_t set = wait_set_for(1);
  printf("[");
  int64_t answered = -1;
  for (int k = 0; k < rounds + warm_up && !stop_wanted; ++k) {
    const double start = now_s();
    while (answered != k && !stop_wanted) {
      set_stamp(&wrench.header.stamp, k);
      set_stamp(&slip.header.stamp, k);
      set_stamp(&state.header.stamp, k);
      tick.data.data[0] = k;
      CHECK(rcl_publish(&wrench_out, &wrench, NULL));
      CHECK(rcl_publish(&slip_out, &slip, NULL));
      CHECK(rcl_publish(&state_out, &state, NULL));
      CHECK(rcl_publish(&tick_out, &tick, NULL));
      set_stamp(&clock_message.clock, k);
      set_stamp(&object.header.stamp, k);
      set_stamp(&truth.header.stamp, k);
      CHECK(rcl_publish(&clock_out, &clock_message, NULL));
      CHECK(rcl_publish(&object_out, &object, NULL));
      CHECK(rcl_publish(&truth_out, &truth, NULL));
      const double repeat = now_s() + 1e-9 * REPEAT_NS;
      while (answered != k && now_s() < repeat && !stop_wanted) {
        wait_for(&set, &in, 1);
        while (rcl_take(&in, &effort, NULL, NULL) == RCL_RET_OK) answered = effort.header.stamp.nanosec;
      }
    }
    if (k >= warm_up) printf(k > warm_up ? ", %.9f" : "%.9f", now_s() - start);
  }
  printf("]\n");
  fflush(stdout);
}

int pingpong_main(int argc, char **argv) {
  if (argc < 2 || (strcmp(argv[1], "answer") != 0 && argc < 4)) {
    fprintf(stderr, "usage: pingpong answer | ask <rounds> <warm-up>\n");
    return 2;
  }
  signal(SIGINT, on_signal);
  signal(SIGTERM, on_signal);
  rcl_init_options_t options = rcl_get_zero_initialized_init_options();
  CHECK(rcl_init_options_init(&options, rcl_get_default_allocator()));
  context = rcl_get_zero_initialized_context();
  CHECK(rcl_init(0, NULL, &options, &context));
  node = rcl_get_zero_initialized_node();
  rcl_node_options_t node_options = rcl_node_get_default_options();
  CHECK(rcl_node_init(&node, argv[1], "", &context, &node_options));
  if (strcmp(argv[1], "answer") == 0) {
    answer();
  } else {
    ask(atoi(argv[2]), atoi(argv[3]));
  }
  CHECK(rcl_node_fini(&node));
  CHECK(rcl_shutdown(&context));
  return 0;
}
