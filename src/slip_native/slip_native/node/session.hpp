/* The controller of one arm between cycles: samples in, Pinocchio's terms, results out. No ROS in it. */
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "settings.hpp"
#include "slip_vic.h"
#include "terms.hpp"

/* A joint state in the order of the joints. */
struct JointSample {
  int64_t stamp_ns = 0;
  std::vector<double> position, velocity, effort; /* rad, rad/s, N m */
};

class Session {
 public:
  explicit Session(const Settings &settings);

  /* Take a sample in; now_ns: of arrival, which lockstep replaces by the stamp. */
  void add_joint(const JointSample &sample, int64_t now_ns);
  void add_wrench(int contact, int64_t stamp_ns, const double *six, int64_t now_ns);
  void add_slip(int contact, int64_t stamp_ns, const double *six, bool valid, int64_t now_ns);
  /* Take a slip displacement, nullptr if it is invalid: each one after the first gives a slip velocity. */
  void add_displacement(int contact, int64_t stamp_ns, const SlipVic_Pose *pose, int64_t now_ns);
  /* Take the bridge's list of what belongs to a cycle: tick, sec, nanosec, then counts; false where it is none. */
  bool add_manifest(const int64_t *numbers, size_t count);
  /* Take who else publishes: a SlipVic_Reason. */
  void set_outside(int64_t reason) { arm_->outside = reason; }
  void request(int64_t request) { request_ = request; }
  /* Start the law again, or answer without commands until it is started; a fault stays. */
  void set_active(bool active) { active_ = active, arm_->law.known = 0; }
  bool active() const { return active_; }
  /* Take changed parameters, which ramp from the next cycle on; if it throws Refused or InputError, nothing changes.
     node: its name in errors. */
  void set_parameters(const Values &given, const std::string &node);
  /* Take a reference, or a goal with its duration [s]. */
  void set_reference(const SlipVic_DesiredMotion &reference, int64_t stamp_ns);
  void set_goal(const SlipVic_DesiredMotion &pose, double duration_s);

  /* Answer the joint state that waits, where all that belongs to it is there; return whether there was one. */
  bool cycle(int64_t now_ns);
  /* Answer joint states that stay away; return whether there is something to publish. */
  bool watchdog(int64_t now_ns);

  /* Of the last cycle. */
  int64_t stamp_ns() const { return answered_ns_; } /* of the joint state that it answers */
  const SlipVic_CycleInputs &inputs() const { return *inputs_; }
  const SlipVic_CycleOutputs &outputs() const { return *outputs_; }
  bool commands() const { return commands_; }

  const SlipVic_ControllerConfig &config() const { return config_; }
  const Parameters &parameters() const { return parameters_; }
  const SlipVic_ArmState &arm() const { return *arm_; }
  const SlipVic_TaskState &task() const { return *task_; }
  SlipVic_Symbols symbols() const;
  const std::string &robot() const { return terms_.name(); }
  bool knows_joints() const { return arm_->joint.known != 0; }

 private:
  bool complete() const;

  const Settings &settings_;
  Parameters parameters_;
  SlipVic_ControllerConfig config_;
  Terms terms_;
  size_t n_;
  std::vector<double> state_, exchange_, before_;
  SlipVic_TaskState *task_;
  SlipVic_ArmState *arm_;
  SlipVic_CycleInputs *inputs_;
  SlipVic_CycleOutputs *outputs_;
  bool waits_ = false, commands_ = false, active_ = true;
  int64_t waiting_ns_ = 0, answered_ns_ = 0, reason_ = 0, request_ = SLIP_VIC_REQUEST_NONE;
  int64_t measured_ = 0; /* by a tare: 1 noise of the velocities, 2 all noise */
  std::vector<int64_t> manifest_, wrench_counts_, slip_counts_;
  std::vector<std::optional<std::pair<int64_t, SlipVic_Pose>>> displacements_; /* the last of each contact */
};
