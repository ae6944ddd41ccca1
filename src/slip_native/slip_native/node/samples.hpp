/* From messages to samples: names, sizes, frames and stamps are checked here, numbers by the library. */
#pragma once

#include <string>
#include <vector>

#include "errors.hpp"
#include "ros.hpp"
#include "session.hpp"

/* Return a stamp [ns]; throws InputError, as everything here does. */
int64_t stamp_of(const builtin_interfaces__msg__Time &stamp);

/* Reads joint states whose names come in any order, with more joints, without velocities or efforts. */
class JointReader {
 public:
  explicit JointReader(const std::vector<std::string> &names) : names_(names), places_(names.size()) {}
  void read(const sensor_msgs__msg__JointState &message, JointSample *sample);

 private:
  void find(const rosidl_runtime_c__String__Sequence &names);

  const std::vector<std::string> &names_;
  std::vector<std::string> seen_; /* names of the last message, for which the places hold */
  std::vector<size_t> places_;
};

/* Throw where a message names another frame. */
void check_frame(const std_msgs__msg__Header &header, const std::string &frame);

/* A slip flag as six ones or zeros; false if it is unknown. */
bool read_flag(const sensor_msgs__msg__JointState &message, double *six);

/* A slip displacement; false if it is invalid. */
bool read_displacement(const geometry_msgs__msg__PoseStamped &message, SlipVic_Pose *pose);

/* The only point of a reference, or of a goal, in {w}. */
struct Point {
  SlipVic_DesiredMotion motion;
  double after_s; /* time_from_start */
};
Point read_reference(const trajectory_msgs__msg__MultiDOFJointTrajectory &message, bool governed);
Point read_goal(const trajectory_msgs__msg__MultiDOFJointTrajectory &message, double duration_s);
