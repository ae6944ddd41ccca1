/* rcl as C++ values that close themselves: context and node, publishers, subscriptions, services. */
#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <vector>

#include <diagnostic_msgs/msg/detail/diagnostic_status__functions.h>
#include <diagnostic_msgs/msg/detail/key_value__functions.h>
#include <diagnostic_msgs/msg/diagnostic_array.h>
#include <geometry_msgs/msg/pose_stamped.h>
#include <geometry_msgs/msg/twist_stamped.h>
#include <geometry_msgs/msg/wrench_stamped.h>
#include <lifecycle_msgs/msg/detail/transition_description__functions.h>
#include <lifecycle_msgs/srv/change_state.h>
#include <lifecycle_msgs/srv/get_available_transitions.h>
#include <lifecycle_msgs/srv/get_state.h>
#include <rcl/error_handling.h>
#include <rcl/rcl.h>
#include <rcl_interfaces/msg/detail/floating_point_range__functions.h>
#include <rcl_interfaces/msg/detail/integer_range__functions.h>
#include <rcl_interfaces/msg/detail/parameter__functions.h>
#include <rcl_interfaces/msg/detail/parameter_descriptor__functions.h>
#include <rcl_interfaces/msg/detail/parameter_value__functions.h>
#include <rcl_interfaces/msg/detail/set_parameters_result__functions.h>
#include <rcl_interfaces/msg/parameter_event.h>
#include <rcl_interfaces/srv/describe_parameters.h>
#include <rcl_interfaces/srv/get_parameter_types.h>
#include <rcl_interfaces/srv/get_parameters.h>
#include <rcl_interfaces/srv/list_parameters.h>
#include <rcl_interfaces/srv/set_parameters.h>
#include <rcl_interfaces/srv/set_parameters_atomically.h>
#include <rosidl_runtime_c/primitives_sequence_functions.h>
#include <rosidl_runtime_c/string_functions.h>
#include <sensor_msgs/msg/joint_state.h>
#include <std_msgs/msg/float64.h>
#include <std_msgs/msg/float64_multi_array.h>
#include <std_msgs/msg/int64_multi_array.h>
#include <std_msgs/msg/string.h>
#include <std_srvs/srv/trigger.h>
#include <trajectory_msgs/msg/multi_dof_joint_trajectory.h>

namespace ros {

struct Error : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/* Throw what rcl says, where a call has failed. */
inline void check(rcl_ret_t code, const std::string &what) {
  if (code == RCL_RET_OK) return;
  const std::string why = rcl_get_error_string().str;
  rcl_reset_error();
  throw Error(what + ": " + why);
}

/* Go on where a call has failed: what it is for has gone, or goes with the process. */
inline void ignore(rcl_ret_t code) {
  if (code != RCL_RET_OK) rcl_reset_error();
}

/* A message with its type support. */
template <class Body>
struct Type;
#define SLIP_VIC_MESSAGE(package, name)                                                                           \
  template <>                                                                                                     \
  struct Type<package##__msg__##name> {                                                                           \
    static const rosidl_message_type_support_t *support() { return ROSIDL_GET_MSG_TYPE_SUPPORT(package, msg, name); } \
    static bool init(package##__msg__##name *body) { return package##__msg__##name##__init(body); }               \
    static void fini(package##__msg__##name *body) { package##__msg__##name##__fini(body); }                      \
  };
SLIP_VIC_MESSAGE(diagnostic_msgs, DiagnosticArray)
SLIP_VIC_MESSAGE(geometry_msgs, PoseStamped)
SLIP_VIC_MESSAGE(geometry_msgs, TwistStamped)
SLIP_VIC_MESSAGE(geometry_msgs, WrenchStamped)
SLIP_VIC_MESSAGE(rcl_interfaces, ParameterEvent)
SLIP_VIC_MESSAGE(sensor_msgs, JointState)
SLIP_VIC_MESSAGE(std_msgs, Float64)
SLIP_VIC_MESSAGE(std_msgs, Float64MultiArray)
SLIP_VIC_MESSAGE(std_msgs, Int64MultiArray)
SLIP_VIC_MESSAGE(std_msgs, String)
SLIP_VIC_MESSAGE(trajectory_msgs, MultiDOFJointTrajectory)
#undef SLIP_VIC_MESSAGE

template <class Body>
class Message {
 public:
  Message() {
    if (!Type<Body>::init(&body_)) throw std::bad_alloc();
  }
  ~Message() { Type<Body>::fini(&body_); }
  Message(const Message &) = delete;
  Message &operator=(const Message &) = delete;
  Body *operator->() { return &body_; }
  Body &operator*() { return body_; }

 private:
  Body body_{};
};

inline void set(rosidl_runtime_c__String &to, const std::string &text) {
  if (!rosidl_runtime_c__String__assign(&to, text.c_str())) throw std::bad_alloc();
}

inline void set(rosidl_runtime_c__String__Sequence &to, const std::vector<std::string> &texts) {
  rosidl_runtime_c__String__Sequence__fini(&to);
  if (!rosidl_runtime_c__String__Sequence__init(&to, texts.size())) throw std::bad_alloc();
  for (size_t k = 0; k < texts.size(); ++k) set(to.data[k], texts[k]);
}

/* Set numbers of a message; room is made once. */
inline void set(rosidl_runtime_c__double__Sequence &to, const double *values, size_t count) {
  if (to.capacity < count) {
    rosidl_runtime_c__double__Sequence__fini(&to);
    if (!rosidl_runtime_c__double__Sequence__init(&to, count)) throw std::bad_alloc();
  }
  to.size = count;
  std::copy(values, values + count, to.data);
}

inline void set(builtin_interfaces__msg__Time &to, int64_t stamp_ns) {
  const int64_t second = 1'000'000'000, rest = ((stamp_ns % second) + second) % second;
  to.nanosec = static_cast<uint32_t>(rest);
  to.sec = static_cast<int32_t>((stamp_ns - rest) / second);
}

struct Qos {
  bool reliable, latched;
  size_t depth;
  rmw_qos_profile_t profile() const {
    rmw_qos_profile_t made = rmw_qos_profile_default;
    made.depth = depth;
    made.reliability = reliable ? RMW_QOS_POLICY_RELIABILITY_RELIABLE : RMW_QOS_POLICY_RELIABILITY_BEST_EFFORT;
    made.durability = latched ? RMW_QOS_POLICY_DURABILITY_TRANSIENT_LOCAL : RMW_QOS_POLICY_DURABILITY_VOLATILE;
    return made;
  }
};
inline const Qos LATCHED{true, true, 1};

/* rcl for one process: its context and its only node. */
class Node {
 public:
  Node(int count, char **words, const char *name) {
    rcl_init_options_t options = rcl_get_zero_initialized_init_options();
    check(rcl_init_options_init(&options, rcl_get_default_allocator()), "rcl_init_options_init");
    const rcl_ret_t code = rcl_init(count, words, &options, &context);
    ignore(rcl_init_options_fini(&options));
    check(code, "ROS refused to start");
    const rcl_node_options_t own = rcl_node_get_default_options();
    check(rcl_node_init(&node, name, "", &context, &own), "ROS refused the node");
  }
  ~Node() {
    ignore(rcl_node_fini(&node));
    ignore(rcl_shutdown(&context));
    ignore(rcl_context_fini(&context));
    rcl_reset_error();
  }
  Node(const Node &) = delete;
  Node &operator=(const Node &) = delete;

  rcl_context_t context = rcl_get_zero_initialized_context();
  rcl_node_t node = rcl_get_zero_initialized_node();
};

/* What is common to publishers of all types. */
class AnyPublisher {
 public:
  AnyPublisher(Node &node, const rosidl_message_type_support_t *type, const std::string &name, Qos qos) : node_(node) {
    rcl_publisher_options_t options = rcl_publisher_get_default_options();
    options.qos = qos.profile();
    check(rcl_publisher_init(&publisher_, &node.node, type, name.c_str(), &options), "topic " + name);
  }
  virtual ~AnyPublisher() { ignore(rcl_publisher_fini(&publisher_, &node_.node)); }
  AnyPublisher(const AnyPublisher &) = delete;
  AnyPublisher &operator=(const AnyPublisher &) = delete;

  const char *topic() const { return rcl_publisher_get_topic_name(&publisher_); }
  size_t subscribers() const {
    size_t count = 0;
    check(rcl_publisher_get_subscription_count(&publisher_, &count), "subscribers");
    return count;
  }
  void deliver(int64_t timeout_ns) const { /* until reliable subscribers have it all */
    ignore(rcl_publisher_wait_for_all_acked(&publisher_, timeout_ns));
  }

 protected:
  rcl_publisher_t publisher_ = rcl_get_zero_initialized_publisher();

 private:
  Node &node_;
};

template <class Body>
class Publisher : public AnyPublisher {
 public:
  Publisher(Node &node, const std::string &name, Qos qos = {true, false, 10000})
      : AnyPublisher(node, Type<Body>::support(), name, qos) {}
  Message<Body> message;
  /* Send `message`; what the middleware refuses is lost, and the node continues. */
  void send() {
    ignore(rcl_publish(&publisher_, &*message, nullptr));
  }
};

class AnySubscription {
 public:
  AnySubscription(Node &node, const rosidl_message_type_support_t *type, const std::string &name, Qos qos)
      : name(name), node_(node) {
    rcl_subscription_options_t options = rcl_subscription_get_default_options();
    options.qos = qos.profile();
    check(rcl_subscription_init(&subscription, &node.node, type, name.c_str(), &options), "topic " + name);
  }
  virtual ~AnySubscription() { ignore(rcl_subscription_fini(&subscription, &node_.node)); }
  AnySubscription(const AnySubscription &) = delete;
  AnySubscription &operator=(const AnySubscription &) = delete;

  const char *topic() const { return rcl_subscription_get_topic_name(&subscription); }
  size_t publishers() const {
    size_t count = 0;
    check(rcl_subscription_get_publisher_count(&subscription, &count), "publishers");
    return count;
  }
  /* Handle messages that wait, no more than the queue holds: who floods a topic does not hold up the others. */
  virtual void handle() = 0;

  const std::string name; /* as in the table of topics */
  rcl_subscription_t subscription = rcl_get_zero_initialized_subscription();

 private:
  Node &node_;
};

/* Hands every message to `take(body)`, and to `refuse()` what is no message of the type. */
template <class Body, class Take, class Refuse>
class Subscription final : public AnySubscription {
 public:
  Subscription(Node &node, const std::string &name, Qos qos, Take take, Refuse refuse)
      : AnySubscription(node, Type<Body>::support(), name, qos), take_(take), refuse_(refuse) {}
  void handle() override {
    for (size_t left = rcl_subscription_get_options(&subscription)->qos.depth; left > 0; --left) {
      if (rcl_take(&subscription, &*message_, nullptr, nullptr) == RCL_RET_OK) {
        take_(*message_);
        continue;
      }
      if (rcl_error_is_set()) refuse_(); /* else nothing is left */
      rcl_reset_error();
      return; /* what is left behind a message that is none is handled after the next wait */
    }
  }

 private:
  Message<Body> message_;
  Take take_;
  Refuse refuse_;
};

/* A service with its types. */
#define SLIP_VIC_SERVICE(package, name)                                                                             \
  struct name {                                                                                                     \
    using Request = package##__srv__##name##_Request;                                                               \
    using Response = package##__srv__##name##_Response;                                                             \
    static const rosidl_service_type_support_t *support() { return ROSIDL_GET_SRV_TYPE_SUPPORT(package, srv, name); } \
  };                                                                                                                \
  SLIP_VIC_PART(package##__srv__##name##_Request)                                                                   \
  SLIP_VIC_PART(package##__srv__##name##_Response)
#define SLIP_VIC_PART(type)                                        \
  template <>                                                      \
  struct Type<type> {                                              \
    static bool init(type *body) { return type##__init(body); }    \
    static void fini(type *body) { type##__fini(body); }           \
  };
SLIP_VIC_SERVICE(lifecycle_msgs, ChangeState)
SLIP_VIC_SERVICE(lifecycle_msgs, GetAvailableTransitions)
SLIP_VIC_SERVICE(lifecycle_msgs, GetState)
SLIP_VIC_SERVICE(std_srvs, Trigger)
SLIP_VIC_SERVICE(rcl_interfaces, DescribeParameters)
SLIP_VIC_SERVICE(rcl_interfaces, GetParameters)
SLIP_VIC_SERVICE(rcl_interfaces, GetParameterTypes)
SLIP_VIC_SERVICE(rcl_interfaces, ListParameters)
SLIP_VIC_SERVICE(rcl_interfaces, SetParameters)
SLIP_VIC_SERVICE(rcl_interfaces, SetParametersAtomically)
#undef SLIP_VIC_SERVICE
#undef SLIP_VIC_PART

class AnyService {
 public:
  AnyService(Node &node, const rosidl_service_type_support_t *type, const std::string &name) : node_(node) {
    const rcl_service_options_t options = rcl_service_get_default_options();
    check(rcl_service_init(&service, &node.node, type, name.c_str(), &options), "service " + name);
  }
  virtual ~AnyService() { ignore(rcl_service_fini(&service, &node_.node)); }
  AnyService(const AnyService &) = delete;
  AnyService &operator=(const AnyService &) = delete;
  virtual void handle() = 0;

  rcl_service_t service = rcl_get_zero_initialized_service();

 private:
  Node &node_;
};

/* Answers every request with `answer(request, response)`; the response is empty at first. */
template <class Kind, class Answer>
class Service final : public AnyService {
 public:
  Service(Node &node, const std::string &name, Answer answer) : AnyService(node, Kind::support(), name), answer_(answer) {}
  void handle() override {
    for (size_t left = rcl_service_get_options(&service)->qos.depth; left > 0; --left) {
      rmw_request_id_t id;
      Message<typename Kind::Request> request;
      Message<typename Kind::Response> response;
      if (rcl_take_request(&service, &id, &*request) != RCL_RET_OK) break;
      answer_(*request, *response);
      ignore(rcl_send_response(&service, &id, &*response)); /* the client may have gone */
    }
    rcl_reset_error();
  }

 private:
  Answer answer_;
};

template <class Kind, class Answer>
std::unique_ptr<AnyService> serve(Node &node, const std::string &name, Answer answer) {
  return std::make_unique<Service<Kind, Answer>>(node, name, answer);
}

}  // namespace ros
