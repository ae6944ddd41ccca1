/* Kinematics and dynamics of the arm at one joint state, by Pinocchio, as the record that the cycle reads. */
#pragma once

#include <array>
#include <memory>
#include <string>
#include <vector>

#include "slip_vic.h"

class Terms {
 public:
  /* urdf: text whose moving joints are those of the controller, as `slip-vic export` writes it; armature: of each joint
   * [kg m2]. Throws InputError where the parts do not fit. */
  Terms(const std::string &urdf, const std::string &ee_frame, const std::array<double, 3> &gravity,
        const std::vector<double> &armature);
  ~Terms();

  /* Fill the record at a joint state [rad, rad/s]; allocates nothing. */
  void fill(const double *q, const double *qd, SlipVic_Arm *arm);

  const std::string &name() const; /* of the robot */

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};
