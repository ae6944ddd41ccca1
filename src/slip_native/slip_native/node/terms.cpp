#include "terms.hpp"

#include <pinocchio/algorithm/crba.hpp>
#include <pinocchio/algorithm/jacobian.hpp>
#include <pinocchio/algorithm/kinematics.hpp>
#include <pinocchio/algorithm/rnea.hpp>
#include <pinocchio/parsers/urdf.hpp>

#include "errors.hpp"

struct Terms::Parts {
  pinocchio::Model model;
  pinocchio::Data data;
  pinocchio::JointIndex joint = 0;
  SlipVic_Pose placement{};
  Eigen::VectorXd q, qd, rest;
};

static pinocchio::Model read(const std::string &urdf) {
  pinocchio::Model model;
  try {
    pinocchio::urdf::buildModelFromXML(urdf, model);
  } catch (const std::exception &error) {
    throw InputError("arm.urdf", error.what(), "a URDF", "export again");
  }
  return model;
}

Terms::Terms(const std::string &urdf, const std::string &ee_frame, const std::array<double, 3> &gravity,
             const std::vector<double> &armature)
    : parts_(new Parts) {
  Parts &p = *parts_;
  p.model = read(urdf);
  const auto n = static_cast<Eigen::Index>(armature.size());
  if (p.model.nv != n || p.model.nq != n)
    throw InputError("arm.urdf", std::to_string(p.model.nv) + " joints", std::to_string(n), "export again");
  if (!p.model.existFrame(ee_frame, pinocchio::BODY)) throw InputError("arm.urdf", "no link " + ee_frame, "ee_frame");
  p.model.gravity.linear() << gravity[0], gravity[1], gravity[2];
  p.model.armature = Eigen::Map<const Eigen::VectorXd>(armature.data(), n);
  p.data = pinocchio::Data(p.model);
  const auto &frame = p.model.frames[p.model.getFrameId(ee_frame, pinocchio::BODY)];
  p.joint = frame.parentJoint;
  for (int i = 0; i < 3; ++i) {
    p.placement.position[i] = frame.placement.translation()[i];
    for (int j = 0; j < 3; ++j) p.placement.rotation[i][j] = frame.placement.rotation()(i, j);
  }
  p.q = p.qd = p.rest = Eigen::VectorXd::Zero(n);
}

Terms::~Terms() = default;

const std::string &Terms::name() const { return parts_->model.name; }

void Terms::fill(const double *q, const double *qd, SlipVic_Arm *arm) {
  Parts &p = *parts_;
  const auto n = p.q.size();
  p.q = Eigen::Map<const Eigen::VectorXd>(q, n);
  p.qd = Eigen::Map<const Eigen::VectorXd>(qd, n);
  /* The calls of robot.py in their order, so that the bits are the same. */
  pinocchio::computeGeneralizedGravity(p.model, p.data, p.q);
  pinocchio::nonLinearEffects(p.model, p.data, p.q, p.qd);
  pinocchio::forwardKinematics(p.model, p.data, p.q, p.qd, p.rest);
  pinocchio::computeJointJacobians(p.model, p.data);
  pinocchio::crba(p.model, p.data, p.q);
  const auto &pose = p.data.oMi[p.joint];
  const auto &twist = p.data.v[p.joint], &acceleration = p.data.a[p.joint];
  const Eigen::Vector3d v = twist.linear(), w = twist.angular(), a = acceleration.linear(), dw = acceleration.angular();
  slip_vic_gather(n, p.qd.data(), &p.placement, pose.rotation().data(), pose.translation().data(), v.data(), w.data(),
                  a.data(), dw.data(), p.data.J.data(), p.data.nle.data(), p.data.g.data(), p.data.M.data(), arm);
}
