"""The record of one evaluation of the law."""

from __future__ import annotations

from slip_core.records import Real, Record, Vec3, Vec6, Whole, dtype_of
from slip_vic_controller.sizes import Joints, WholeJoints


class Evaluation(Record):
    """Every symbol of one evaluation of the law; e, e_dot, K, D are in the coordinates of the orientation error."""

    ok: Whole  # every number is finite and every factor exists, else nothing here may be used
    near_singular_arm: Whole  # 1 while a fallback is active
    near_singular_attitude: Whole
    gate: Real  # slip activation, in [0, 1]
    damping_squared: Real  # 1/kg; what was added to J B^-1 J^T
    error_linear: Real  # m; |e|, linear part
    error_angular: Real  # rad
    slip_speed: Real  # m/s; |v_s|, linear part
    carried: Vec3  # m/s^2 {w}; G^T a_o + Phi2, linear part
    v_s: Vec6  # m/s, rad/s {ee}; slip velocity
    w_o: Vec3  # rad/s {ee}; turning of the object
    r: Vec3  # m {ee}; x_c - x_o
    h_o: Vec6  # N, N m {ee}; sum G_i h_ee,i
    a_o: Vec6  # m/s^2, rad/s^2 {ee}; acceleration of the object
    follow: Vec6  # m/s^2, rad/s^2 {ee}; G^T a_o + Phi2
    comp: Vec6  # m/s^2, rad/s^2 {ee}; compensation
    gated: Vec6  # m/s^2, rad/s^2 {ee}; gate times comp, spin limited
    h_int: Vec6  # N, N m {ee}; internal wrench of several contacts
    e: Vec6  # m, rad {w}
    e_dot: Vec6  # m/s, rad/s {w}
    K: Vec6  # N/m, N m/rad; diagonal
    D: Vec6  # N s/m, N m s/rad; diagonal
    Theta: Vec6  # m/s^2, rad/s^2 {w}
    Z: Vec6  # m/s^2, rad/s^2 {w}; T_e M_D^-1 (-K e - D e_dot)
    a_d: Vec6  # m/s^2, rad/s^2 {w}
    a_C: Vec6  # m/s^2, rad/s^2 {w}; control acceleration  # noqa: N815
    h_ee: Vec6  # N, N m {w}; wrench of the object on the robot
    tau_0: Joints  # N m; posture torque
    task: Vec6  # N, N m {w}; B_x (a_C - Jdot qd)
    null: Vec6  # N, N m {w}; force of tau_0 on the task
    tau: Joints  # N m; before the limits
    effort: Joints  # N m; inside the limits
    saturated: WholeJoints  # which joints are beyond


EVALUATION = dtype_of(Evaluation)
