#include "lifecycle.hpp"

#include <algorithm>
#include <chrono>
#include <cstring>
#include <thread>

static const int64_t IDLE_NS = 20'000'000;
static const std::chrono::milliseconds LINGER(200); /* for the answer to a shutdown to be delivered */
enum State : uint8_t { UNCONFIGURED = 1, INACTIVE, ACTIVE, FINALIZED }; /* numbers of lifecycle_msgs */
static const char *const LABELS[] = {"unknown", "unconfigured", "inactive", "active", "finalized"};

struct Transition {
  uint8_t id, from, to;
  const char *label;
};
static const Transition TRANSITIONS[] = {
    {1, UNCONFIGURED, INACTIVE, "configure"}, {2, INACTIVE, UNCONFIGURED, "cleanup"}, {3, INACTIVE, ACTIVE, "activate"},
    {4, ACTIVE, INACTIVE, "deactivate"},      {5, UNCONFIGURED, FINALIZED, "shutdown"}, {6, INACTIVE, FINALIZED, "shutdown"},
    {7, ACTIVE, FINALIZED, "shutdown"},
};

Lifecycle::Lifecycle(ros::Node &ros, const Settings &settings) : ros_(ros), settings_(settings), state_(UNCONFIGURED) {
  ros::check(rcl_wait_set_init(&set_, 0, 0, 0, 0, 0, 0, &ros.context, rcl_get_default_allocator()), "wait set");
  if (settings.auto_activate) {
    node_.emplace(ros, settings);
    state_ = ACTIVE;
  }
  services_.push_back(ros::serve<ros::ChangeState>(ros, "~/change_state", [this](const auto &request, auto &response) {
    uint8_t id = request.transition.id;
    for (const Transition &one : TRANSITIONS)
      if (one.from == state_ && request.transition.label.size > 0 && std::strcmp(one.label, request.transition.label.data) == 0)
        id = one.id;
    response.success = change(id);
  }));
  services_.push_back(ros::serve<ros::GetState>(ros, "~/get_state", [this](const auto &, auto &response) {
    response.current_state.id = state_;
    ros::set(response.current_state.label, LABELS[state_]);
  }));
  services_.push_back(ros::serve<ros::GetAvailableTransitions>(
      ros, "~/get_available_transitions", [this](const auto &, auto &response) {
        std::vector<Transition> found;
        for (const Transition &one : TRANSITIONS)
          if (one.from == state_) found.push_back(one);
        auto &list = response.available_transitions;
        if (!lifecycle_msgs__msg__TransitionDescription__Sequence__init(&list, found.size())) throw std::bad_alloc();
        for (size_t k = 0; k < found.size(); ++k) {
          list.data[k].transition.id = found[k].id;
          list.data[k].start_state.id = found[k].from, list.data[k].goal_state.id = found[k].to;
          ros::set(list.data[k].transition.label, found[k].label);
          ros::set(list.data[k].start_state.label, LABELS[found[k].from]);
          ros::set(list.data[k].goal_state.label, LABELS[found[k].to]);
        }
      }));
}

bool Lifecycle::change(uint8_t transition) {
  const Transition *end = std::end(TRANSITIONS), *one = std::find_if(std::begin(TRANSITIONS), end, [&](const Transition &of) {
    return of.id == transition && of.from == state_;
  });
  if (one == end) return false;
  if (one->from == ACTIVE) node_->set_active(false);
  if (one->to == INACTIVE && one->from == UNCONFIGURED) {
    try {
      node_.emplace(ros_, settings_);
    } catch (const std::runtime_error &error) {
      node_.reset();
      log_error(error.what());
      return false;
    }
    node_->set_active(false);
  }
  if (one->to == ACTIVE) node_->set_active(true);
  if (one->to == UNCONFIGURED || one->to == FINALIZED) node_.reset();
  if (one->to == FINALIZED) log_info("shut down by a transition: the process ends");
  state_ = one->to;
  changed_ = true;
  return true;
}

void Lifecycle::wait() {
  const size_t own = services_.size(), subscriptions = node_ ? node_->subscriptions() : 0;
  const size_t services = own + (node_ ? node_->services() : 0);
  if (set_.size_of_subscriptions != subscriptions || set_.size_of_services != services)
    ros::check(rcl_wait_set_resize(&set_, subscriptions, 0, 0, 0, services, 0), "wait set");
  ros::check(rcl_wait_set_clear(&set_), "wait set");
  for (const auto &service : services_) ros::check(rcl_wait_set_add_service(&set_, &service->service, nullptr), "wait set");
  if (node_) node_->add_to(&set_);
  const int64_t due_ns = node_ ? node_->attend() : 0;
  const int64_t now = std::chrono::nanoseconds(std::chrono::steady_clock::now().time_since_epoch()).count();
  const rcl_ret_t code = rcl_wait(&set_, node_ ? std::max<int64_t>(0, due_ns - now) : IDLE_NS);
  if (code != RCL_RET_TIMEOUT) ros::check(code, "waiting");
}

void Lifecycle::run(const volatile int &stop) {
  while (!stop && state_ != FINALIZED) {
    wait();
    changed_ = false;
    for (size_t k = 0; k < services_.size() && !changed_; ++k)
      if (set_.services[k] != nullptr) services_[k]->handle();
    if (node_ && !changed_) node_->handle(set_, services_.size());
  }
  if (state_ == FINALIZED) std::this_thread::sleep_for(LINGER);
}
