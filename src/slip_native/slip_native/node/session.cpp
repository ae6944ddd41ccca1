#include "session.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "words.hpp"

static const int64_t SECOND_NS = 1'000'000'000;

Session::Session(const Settings &settings)
    : settings_(settings),
      parameters_(settings.parameters),
      config_(settings.config[0]),
      terms_(settings.urdf, settings.ee_frame, settings.gravity, settings.armature),
      n_(settings.joint_names.size()),
      state_(settings.state),
      exchange_((sizeof(SlipVic_CycleInputs) + sizeof(SlipVic_CycleOutputs)) / sizeof(double)),
      before_(settings.state),
      task_(reinterpret_cast<SlipVic_TaskState *>(state_.data())),
      arm_(reinterpret_cast<SlipVic_ArmState *>(task_ + 1)),
      inputs_(reinterpret_cast<SlipVic_CycleInputs *>(exchange_.data())),
      outputs_(reinterpret_cast<SlipVic_CycleOutputs *>(inputs_ + 1)),
      wrench_counts_(static_cast<size_t>(settings.contacts)),
      slip_counts_(static_cast<size_t>(settings.contacts)),
      displacements_(static_cast<size_t>(settings.contacts)) {}

void Session::add_joint(const JointSample &sample, int64_t now_ns) {
  now_ns = settings_.lockstep ? sample.stamp_ns : now_ns;
  const int64_t reason =
      slip_vic_receive_joint_state(&config(), arm_, static_cast<int64_t>(n_), sample.stamp_ns, sample.position.data(),
                                   sample.velocity.data(), sample.effort.data(), 0, now_ns, settings_.lockstep);
  if (arm_->joint.pending == 0) return; /* it is dropped: no cycle answers it */
  waits_ = true, reason_ = reason, waiting_ns_ = sample.stamp_ns;
}

void Session::add_wrench(int contact, int64_t stamp_ns, const double *six, int64_t now_ns) {
  ++wrench_counts_[static_cast<size_t>(contact)];
  slip_vic_receive_wrench(&config(), arm_, contact, stamp_ns, six, 0, settings_.lockstep ? stamp_ns : now_ns);
}

void Session::add_slip(int contact, int64_t stamp_ns, const double *six, bool valid, int64_t now_ns) {
  ++slip_counts_[static_cast<size_t>(contact)];
  slip_vic_receive_slip(&config(), arm_, contact, stamp_ns, six, valid, 0, settings_.lockstep ? stamp_ns : now_ns);
}

void Session::add_displacement(int contact, int64_t stamp_ns, const SlipVic_Pose *pose, int64_t now_ns) {
  double twist[6];
  std::fill_n(twist, 6, std::nan(""));
  auto &last = displacements_[static_cast<size_t>(contact)];
  const auto before = last;
  last.reset();
  if (pose == nullptr) return add_slip(contact, stamp_ns, twist, false, now_ns);
  last.emplace(stamp_ns, *pose);
  ++slip_counts_[static_cast<size_t>(contact)];
  if (!before || stamp_ns <= before->first) return;
  const SlipVic_Pose &from = before->second;
  slip_vic_mean_velocity(from.position, from.rotation, pose->position, pose->rotation, stamp_ns - before->first, twist);
  slip_vic_receive_slip(&config(), arm_, contact, (before->first + stamp_ns) / 2, twist, 1, 0,
                        settings_.lockstep ? stamp_ns : now_ns);
}

bool Session::add_manifest(const int64_t *numbers, size_t count) {
  if (count < 5 || count % 2 == 0) return false;
  manifest_.assign(numbers, numbers + count);
  return true;
}

bool Session::complete() const {
  if (!waits_ || !settings_.lockstep) return waits_;
  if (manifest_.size() != 3 + 2 * slip_counts_.size()) return false;
  if (manifest_[1] * SECOND_NS + manifest_[2] != waiting_ns_) return false;
  for (size_t k = 0; k < slip_counts_.size(); ++k) {
    if (!config().models_wrench && manifest_[3 + 2 * k] != wrench_counts_[k]) return false;
    if (manifest_[4 + 2 * k] != slip_counts_[k]) return false;
  }
  return true;
}

bool Session::cycle(int64_t now_ns) {
  if (!complete()) return false;
  waits_ = false;
  manifest_.clear();
  answered_ns_ = waiting_ns_;
  now_ns = settings_.lockstep ? answered_ns_ : now_ns;
  std::fill(exchange_.begin(), exchange_.end(), 0.0);
  const int64_t missing = active_ ? 0 : SLIP_VIC_MISSING_ACTIVATION;
  if (slip_vic_begin_answer(&config(), arm_, inputs_, now_ns, request_, missing, reason_))
    terms_.fill(arm_->joint.answers.position, arm_->joint.answers.velocity, &inputs_->arm);
  request_ = SLIP_VIC_REQUEST_NONE;
  commands_ = slip_vic_cycle(&config(), state_.data(), exchange_.data(), 1, static_cast<int64_t>(settings_.rows())) & 1;
  const int64_t measured = arm_->tare.rough + 2 * arm_->tare.done;
  if (measured != measured_) slip_vic_use_tare(&config_, arm_);
  measured_ = measured;
  return true;
}

bool Session::watchdog(int64_t now_ns) {
  const bool works = active_ && arm_->law.known && arm_->mode.mode != SLIP_VIC_MODE_WAITING_INPUT;
  if (settings_.lockstep || !works || !slip_vic_is_silent(&config(), arm_, now_ns)) return false;
  before_ = state_;
  const SlipVic_ArmState was = *arm_;
  std::fill(exchange_.begin(), exchange_.end(), 0.0);
  inputs_->present = 1, inputs_->now_ns = now_ns, inputs_->request = request_;
  arm_->joint.pending_fault = SLIP_VIC_REASON_SILENT;
  request_ = SLIP_VIC_REQUEST_NONE;
  answered_ns_ = arm_->joint.last.stamp_ns;
  commands_ = slip_vic_cycle(&config(), state_.data(), exchange_.data(), 1, static_cast<int64_t>(settings_.rows())) & 1;
  const bool changed = std::memcmp(&was.mode, &arm_->mode, sizeof was.mode) != 0 ||
                       std::memcmp(was.sent.effort, arm_->sent.effort, sizeof was.sent.effort) != 0 ||
                       std::memcmp(was.sent.velocity, arm_->sent.velocity, sizeof was.sent.velocity) != 0;
  if (!changed) state_ = before_; /* the effort has come down to what holds the arm: it is not repeated permanently */
  return changed;
}

void Session::set_reference(const SlipVic_DesiredMotion &reference, int64_t stamp_ns) {
  ++task_->taken;
  if (!config().follows_stream) {
    task_->reference_known = 1;
    task_->reference = reference;
    return;
  }
  SlipVic_Stream &stream = task_->stream;
  const int64_t room = sizeof stream.queue / sizeof *stream.queue;
  if (stream.queued == room) std::move(stream.queue + 1, stream.queue + stream.queued--, stream.queue);
  stream.queue[stream.queued++] = {stamp_ns, reference};
}

void Session::set_goal(const SlipVic_DesiredMotion &pose, double duration_s) {
  SlipVic_Goal &goal = task_->goal;
  ++goal.received, goal.pending = 1;
  std::memcpy(goal.to_position, pose.position, sizeof pose.position);
  std::memcpy(goal.to_rotation, pose.rotation, sizeof pose.rotation);
  goal.duration = duration_s;
  ++task_->taken;
}

void Session::set_parameters(const Values &given, const std::string &node) {
  Parameters wanted = parameters_.changed(given, node);
  if (wanted == parameters_) return;
  const Tuning tuning = tune(parameters_, wanted, config_);
  SlipVic_WhyRecord heavy{};
  slip_vic_too_heavy(&tuning.config, arm_, inputs_, &heavy);
  if (arm_->law.known && heavy.reason)
    throw InputError("parameters object and contacts", describe(heavy, settings_.joint_names), "an object that the arm can hold");
  if (tuning.other_object) arm_->tare.mass_share = 0.0; /* the user's mass replaces that of the tare */
  slip_vic_ramp_to(arm_, &tuning.config.gains, tuning.least_ns);
  config_ = tuning.config;
  parameters_ = std::move(wanted);
}

SlipVic_Symbols Session::symbols() const {
  SlipVic_Symbols found;
  slip_vic_describe(&config(), inputs_, outputs_, &found);
  return found;
}
