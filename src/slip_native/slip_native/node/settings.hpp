/* What the node takes from a folder of `slip-vic export`: the parameters that are its own, CONFIG, first state, arm. */
#pragma once

#include <array>
#include <string>
#include <vector>

#include "parameters.hpp"
#include "slip_vic.h"

struct Settings {
  Parameters parameters;
  std::vector<std::string> joint_names;
  std::vector<double> armature; /* kg m2, of each joint */
  std::array<double, 3> gravity{};
  std::string ee_frame, wrench_frame, interface, slip_input, trajectory, governor, urdf;
  bool lockstep = true, effort_array = false, auto_activate = true;
  int contacts = 1;
  long subscribers = 1; /* on the command before the node is ready */
  double goal_duration_s = 0.0;
  std::vector<SlipVic_ControllerConfig> config;
  std::vector<double> state;

  bool external() const { return trajectory == "topic" || trajectory == "goal"; }
  bool governed() const { return governor != "off" || trajectory == "goal"; }
  size_t rows() const;
};

/* Read a folder; throws InputError. */
Settings read_settings(const std::string &folder);
