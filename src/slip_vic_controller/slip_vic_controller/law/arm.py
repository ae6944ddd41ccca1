"""The arm in the law: pose, motion, Jacobian, inertia and torques at one joint state; and its desired motion."""

from __future__ import annotations

from typing import Annotated

from slip_core.arrays import Array
from slip_core.compiled import IN1, IN2_F, OUT1, VOID, kernel, part
from slip_core.records import POSE, Mat3, Pose, Record, Vec3, Vec6, dtype_of, record
from slip_core.vectors import Spatial, Vec, mat, put, put_mat, vec
from slip_vic_controller.sizes import MAX_JOINTS, Joints


class Arm(Record):
    """The arm at one joint state: all {w}, origin at {ee}. Joints beyond those in use are zero."""

    position: Vec3  # m; x_ee
    rotation: Mat3  # R_ee
    twist: Vec6  # m/s, rad/s; v_ee
    jdot_qd: Vec6  # m/s^2, rad/s^2; Jdot qd
    bias: Joints  # N m; C qd + g
    gravity: Joints  # N m; g
    J: Annotated[Array, (6, MAX_JOINTS)]  # Jacobian
    M: Annotated[Array, (MAX_JOINTS, MAX_JOINTS)]  # kg m2; inertia B(q)


ARM = dtype_of(Arm)


class DesiredMotion(Record):
    """Desired motion of {ee}; {w}."""

    position: Vec3  # m, x_d
    rotation: Mat3  # R_d
    twist: Vec6  # m/s, rad/s
    acceleration: Vec6  # m/s^2, rad/s^2, a_d


@part
def column(arm: Arm, j: int) -> Spatial:
    """Return how the pad moves with joint j {w}; its product with a wrench on the pad is the torque on the joint."""
    return Spatial(Vec(arm.J[0, j], arm.J[1, j], arm.J[2, j]), Vec(arm.J[3, j], arm.J[4, j], arm.J[5, j]))


@kernel(VOID, IN1, IN1, IN2_F, IN1, IN1, IN1, IN1, IN1, IN2_F, IN1, IN1, IN2_F, OUT1)
def gather(
    qd: Array, placement: Array, R_joint: Array, p_joint: Array, v: Array, w: Array, a: Array, dw: Array,
    J_world: Array, nle: Array, gravity: Array, M: Array, arm: Array,
) -> None:  # fmt: skip
    """Fill the record of an arm from Pinocchio's results; n joints.

    Args:
        qd: joint velocity; (n,) [rad/s].
        placement: POSE of {ee} on the axes of the last joint.
        R_joint, p_joint: pose of the last joint; (3, 3), (3,) [m] {w}.
        v, w, a, dw: its twist, and its spatial acceleration at zero joint acceleration; (3,) each, on its axes.
        J_world: Jacobian of that joint at the world's origin; (6, n) {w}.
        nle, gravity: C qd + g, and g; (n,) [N m].
        M: inertia B(q), upper triangle; (n, n) [kg m2].
        arm: ARM.

    Implements: Eq. (1), (7), (8); Jdot qd is the classical acceleration of {ee} at zero joint acceleration.
    """
    out: Arm = record(arm, ARM)
    ee: Pose = record(placement, POSE)
    R, lever, w_joint, dw_joint = mat(R_joint), vec(ee.position), vec(w), vec(dw)
    x = vec(p_joint) + R @ lever
    put(out.position, x)
    put_mat(out.rotation, R @ mat(ee.rotation))
    v_ee = vec(v) + w_joint.cross(lever)
    put(out.twist[:3], R @ v_ee)
    put(out.twist[3:], R @ w_joint)
    put(out.jdot_qd[:3], R @ (vec(a) + dw_joint.cross(lever) + w_joint.cross(v_ee)))
    put(out.jdot_qd[3:], R @ dw_joint)
    for j in range(qd.shape[0]):
        out.bias[j], out.gravity[j] = nle[j], gravity[j]
        angular = Vec(J_world[3, j], J_world[4, j], J_world[5, j])
        put(out.J[:3, j], Vec(J_world[0, j], J_world[1, j], J_world[2, j]) + angular.cross(x))
        put(out.J[3:, j], angular)
        for i in range(j + 1):
            out.M[i, j] = out.M[j, i] = M[i, j]
