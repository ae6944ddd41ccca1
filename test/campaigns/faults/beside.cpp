/* The native node's session behind C functions of one form, for a trial in Python: one session at a time. */
#include <algorithm>
#include <memory>
#include <string>

#include "session.hpp"

struct Beside { /* `given`: values that change together */
  explicit Beside(const char *folder) : settings(read_settings(folder)), session(settings) {}
  Settings settings;
  Session session;
  JointSample joint;
  Values given;
  std::string refusal;
};

static std::unique_ptr<Beside> of;

extern "C" {
void make(const char *folder) { of = std::make_unique<Beside>(folder); }
const void *state() { return &of->session.task(); }
const void *exchange() { return &of->session.inputs(); }
const void *config() { return &of->session.config(); }

/* Parameters that only Python changes: CONFIG, then the state. */
void change(int64_t, int64_t, const double *numbers) {
  const size_t size = sizeof(SlipVic_ControllerConfig) / sizeof(double);
  std::copy_n(numbers, size, reinterpret_cast<double *>(const_cast<void *>(config())));
  std::copy_n(numbers + size, of->settings.state.size(), reinterpret_cast<double *>(const_cast<void *>(state())));
}

void add_joint(int64_t stamp_ns, int64_t now_ns, const double *numbers) {
  const size_t n = of->settings.joint_names.size();
  of->joint.stamp_ns = stamp_ns;
  for (std::vector<double> *part : {&of->joint.position, &of->joint.velocity, &of->joint.effort}) {
    part->assign(numbers, numbers + n);
    numbers += n;
  }
  of->session.add_joint(of->joint, now_ns);
}

void add_wrench(int64_t stamp_ns, int64_t now_ns, const double *six) {
  if (!of->session.config().models_wrench) of->session.add_wrench(0, stamp_ns, six, now_ns);
}

void add_slip(int64_t stamp_ns, int64_t now_ns, const double *six_and_valid) {
  of->session.add_slip(0, stamp_ns, six_and_valid, six_and_valid[6] != 0.0, now_ns);
}

/* Name a parameter that changes: its length, 0 of a number. */
void give(const char *name, int64_t length, const double *numbers) {
  of->given[name] = length == 0 ? Value(*numbers) : Value(std::vector<double>(numbers, numbers + length));
}

/* Set those that were named; return why not, empty where they are set. */
const char *set_parameters() {
  of->refusal.clear();
  try {
    of->session.set_parameters(of->given, "trial");
  } catch (const std::runtime_error &error) {
    of->refusal = error.what();
  }
  of->given.clear();
  return of->refusal.c_str();
}

void request(int64_t wanted, int64_t, const double *) { of->session.request(wanted); }

void set_reference(int64_t stamp_ns, int64_t, const double *motion) {
  of->session.set_reference(*reinterpret_cast<const SlipVic_DesiredMotion *>(motion), stamp_ns);
}

void set_goal(int64_t, int64_t, const double *pose_and_duration) {
  const size_t size = sizeof(SlipVic_DesiredMotion) / sizeof(double);
  of->session.set_goal(*reinterpret_cast<const SlipVic_DesiredMotion *>(pose_and_duration), pose_and_duration[size]);
}

int cycle(int64_t, int64_t now_ns, const double *) { return of->session.cycle(now_ns); }
int watchdog(int64_t, int64_t now_ns, const double *) { return of->session.watchdog(now_ns); }
}
