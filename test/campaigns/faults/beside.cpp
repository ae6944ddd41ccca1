/* The native node's session behind C functions of one form, for a trial in Python: one session at a time. */
#include <algorithm>
#include <memory>

#include "session.hpp"

struct Beside {
  explicit Beside(const char *folder) : settings(read_settings(folder)), session(settings) {}
  Settings settings;
  Session session;
  JointSample joint;
};

static std::unique_ptr<Beside> of;

extern "C" {
void make(const char *folder) { of = std::make_unique<Beside>(folder); }
const void *state() { return &of->session.task(); }
const void *exchange() { return &of->session.inputs(); }

/* Parameters that change while the law runs, which the node does not take: CONFIG, then the state. */
void change(int64_t, int64_t, const double *numbers) {
  const size_t size = sizeof(SlipVic_ControllerConfig) / sizeof(double);
  std::copy_n(numbers, size, reinterpret_cast<double *>(of->settings.config.data()));
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
