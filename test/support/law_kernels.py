"""The parts of the law as functions over arrays: what runs inside of the cycle, called from a test."""

from __future__ import annotations

import numpy as np

from slip_core.arrays import Array
from slip_core.compiled import IN1, IN2, INT, OUT1, OUT2, REAL, VOID, WHOLE1, kernel
from slip_core.records import layout, new, record
from slip_core.vectors import mat, put, put_mat, put_spatial, spatial, vec
from slip_vic_controller.law import attitude, contact, impedance, rotation, torque
from slip_vic_controller.law.arm import ARM
from slip_vic_controller.law.config import LAW_CONFIG
from slip_vic_controller.law.contact import CONTACT, CONTACT_SAMPLE, SLIP
from slip_vic_controller.law.gains import GAINS, LAW_GAINS, sample_gains
from slip_vic_controller.law.giving_up import GIVEN_UP, GIVING_UP, judge_compensation
from slip_vic_controller.law.law import EVALUATION, evaluate, predict_motion, scale_acceleration
from slip_vic_controller.law.object import object_motion
from slip_vic_controller.law.symbols import SLIP_ESTIMATE, SYMBOLS, no_symbols, symbols
from slip_vic_controller.observer.layouts import MOTION
from slip_vic_controller.reference import path_scaling, paths
from slip_vic_controller.reference.path_scaling import PATH_SCALING
from slip_vic_controller.reference.paths import PATH, REFERENCE
from slip_vic_controller.safety.validation import JOINT_SAMPLE
from slip_vic_controller.sizes import MAX_CONTACTS, MAX_JOINTS

SAMPLES, SLIPS = layout(at=(CONTACT_SAMPLE, MAX_CONTACTS)), layout(at=(SLIP, MAX_CONTACTS))
MEMORY = layout(posture=("f8", MAX_JOINTS), e_previous=("f8", 3))
GIVEN = layout(
    gains=LAW_GAINS, samples=(CONTACT_SAMPLE, MAX_CONTACTS), slips=(SLIP, MAX_CONTACTS), reference=REFERENCE,
    follow_error=("f8", 6), law=EVALUATION,
)  # fmt: skip
OBJECT_MOTION = layout(w_o=("f8", 3), r=("f8", 3), h_o=("f8", 6), a_o=("f8", 6))
ATTITUDE = layout(
    error=("f8", 3), rate=("f8", 3), Theta=("f8", 3), T_e=("f8", (3, 3)), T_e_inverse=("f8", (3, 3)),
    near_singular="i8",
)  # fmt: skip


@kernel(VOID(IN1, OUT1, OUT1, IN1, INT, REAL, REAL, REAL))
def run_giving_up(config, state, gains, v_s, seen, error, fall, dt) -> None:
    judge_compensation(
        record(config, GIVING_UP), record(state, GIVEN_UP), record(gains, GAINS), spatial(v_s), seen, error, fall, dt
    )


@kernel(VOID(*[IN1] * 4, OUT1))
def run_law(config, arm, sample, memory, given) -> None:
    evaluate(
        record(config, LAW_CONFIG), record(arm, ARM), record(sample, JOINT_SAMPLE), record(memory, MEMORY),
        record(given, GIVEN),
    )  # fmt: skip


@kernel(VOID(*[IN1] * 4, REAL, OUT1))
def run_scaled_law(config, arm, sample, memory, factor, given) -> None:
    scale_acceleration(
        record(config, LAW_CONFIG), record(arm, ARM), record(sample, JOINT_SAMPLE), record(memory, MEMORY), factor,
        record(given, GIVEN),
    )  # fmt: skip


@kernel(VOID(*[IN1] * 7, OUT1))
def run_symbols(config, gains, arm, slips, reference, evaluation, estimate, out) -> None:
    symbols(
        record(config, LAW_CONFIG), record(gains, LAW_GAINS), record(arm, ARM), record(slips, SLIPS).at,
        record(reference, REFERENCE), record(evaluation, EVALUATION), record(estimate, SLIP_ESTIMATE),
        record(out, SYMBOLS),
    )  # fmt: skip


@kernel(VOID(IN1, WHOLE1, OUT1))
def run_no_symbols(effort, saturated, out) -> None:
    no_symbols(effort, saturated, out)


@kernel(VOID(IN1, IN1, IN1, REAL, OUT1))
def run_slips(config, samples, slips, dt, out) -> None:
    contact.integrate_slips(
        record(config, LAW_CONFIG), record(samples, SAMPLES).at, record(slips, SLIPS).at, dt, record(out, SLIPS).at
    )


@kernel(INT(*[IN1] * 6, OUT1))
def run_motion(config, gains, arm, samples, slips, slip_twist, out) -> int:
    return predict_motion(
        record(config, LAW_CONFIG), record(gains, LAW_GAINS), record(arm, ARM), record(samples, SAMPLES).at,
        record(slips, SLIPS).at, slip_twist, record(out, MOTION),
    )  # fmt: skip


@kernel(VOID(*[IN1] * 4, IN2, IN1, IN1, OUT1))
def run_object(config, gains, samples, slips, R_ee, w_ee, slip_angular, out) -> None:
    o = object_motion(
        record(config, LAW_CONFIG), record(gains, LAW_GAINS), record(samples, SAMPLES).at, record(slips, SLIPS).at,
        mat(R_ee), vec(w_ee), vec(slip_angular),
    )  # fmt: skip
    found = record(out, OBJECT_MOTION)
    put(found.w_o, o.w_o)
    put(found.r, o.r)
    put_spatial(found.h_o, o.h_o)
    put_spatial(found.a_o, o.a_o)


@kernel(VOID(IN1, REAL, IN1, IN2, OUT1))
def run_reference(path, t, position, rotation, out) -> None:
    paths.put_reference(record(out, REFERENCE), paths.reference_at(record(path, PATH), t, position, rotation))


@kernel(VOID(IN1, REAL, IN1, IN2, IN1, OUT1))
def run_scaled(path, t, position, rotation, scaling, out) -> None:
    reference = paths.reference_at(record(path, PATH), t, position, rotation)
    paths.put_reference(record(out, REFERENCE), path_scaling.scaled(reference, record(scaling, PATH_SCALING)))


@kernel(INT(OUT1, REAL, INT, REAL))
def run_scaling(scaling, wanted, dt_ns, slow_down_s) -> int:
    path_scaling.advance(record(scaling, PATH_SCALING), wanted, 1e-9 * dt_ns, slow_down_s)
    return path_scaling.lost_ns(record(scaling, PATH_SCALING), dt_ns)


@kernel(REAL(REAL, REAL, REAL, REAL))
def scale_for_error(linear, angular, bound_linear, bound_angular) -> float:
    return path_scaling.scale_for_error(linear, angular, bound_linear, bound_angular)


@kernel(VOID(IN1, REAL, IN1, OUT1))
def _integrate_slip(slip, dt, v_s, out) -> None:
    contact.integrate_slip(record(slip, SLIP), spatial(v_s), dt, record(out, SLIP))


@kernel(VOID(IN1, REAL, REAL, OUT1))
def _dead_band(v_s, linear, angular, out) -> None:
    put_spatial(out, contact.beyond_dead_band(spatial(v_s), linear, angular))


@kernel(VOID(IN1, IN1, IN1, OUT2))
def _grasp(r, x, w_o, out) -> None:
    put_spatial(out[0], contact.G(vec(r), spatial(x)))
    put_spatial(out[1], contact.G_T(vec(r), spatial(x)))
    put_spatial(out[2], contact.G_T_inverse(vec(r), spatial(x)))
    put_spatial(out[3], contact.Phi2(vec(w_o), vec(r)))


@kernel(VOID(IN2, IN1, IN1, OUT1))
def _contact_arm(o_R_c, contact_record, slip, out) -> None:
    c = record(contact_record, CONTACT)
    put(out, contact.contact_arm(mat(o_R_c), vec(c.position), c, record(slip, SLIP)))


@kernel(VOID(IN1, OUT2))
def _exponential(phi, out) -> None:
    put_mat(out, rotation.exponential(vec(phi)))


@kernel(VOID(IN2, OUT1))
def _logarithm(R, out) -> None:
    put(out, rotation.logarithm(mat(R)))


@kernel(VOID(IN1, IN1, OUT2))
def _jacobians(phi, rate, out) -> None:
    put(out[0], rotation.left_jacobian(vec(phi), vec(rate)))
    put(out[1], rotation.left_jacobian_inverse(vec(phi), vec(rate)))
    put(out[2], rotation.left_jacobian_rate(vec(phi), vec(rate)))


@kernel(VOID(INT, IN2, IN2, IN1, IN1, IN1, IN1, OUT1))
def _attitude_error(coordinates, R_ee, R_d, w_ee, w_d, alpha_d, previous, out) -> None:
    found = record(out, ATTITUDE)
    error = attitude.attitude_error(coordinates, mat(R_ee), mat(R_d), vec(w_ee), vec(w_d), vec(alpha_d), vec(previous))
    put(found.error, error.error)
    put(found.rate, error.rate)
    put(found.Theta, error.Theta)
    found.near_singular = error.near_singular
    unit = np.zeros(6)
    for j in range(3):
        unit[3 + j] = 1.0
        forward = attitude.T_e(error, spatial(unit)).angular
        back = attitude.T_e_inverse(coordinates, error.error, mat(R_d), spatial(unit)).angular
        put(found.T_e[:, j], forward)
        put(found.T_e_inverse[:, j], back)
        unit[3 + j] = 0.0


@kernel(VOID(IN2, OUT1))
def _roll_pitch_yaw(R, out) -> None:
    put(out, attitude.roll_pitch_yaw(mat(R)))


@kernel(VOID(IN1, IN1, IN1, OUT1))
def _faded(full, gamma, v_s, out) -> None:
    put_spatial(out, impedance.faded(full, gamma, spatial(v_s)))


@kernel(REAL(IN1, IN1))
def slip_activation(gains, v_s) -> float:
    return impedance.slip_activation(record(gains, GAINS), spatial(v_s))


@kernel(VOID(REAL, IN1, OUT1))
def _limit_spin(limit, motion, out) -> None:
    put_spatial(out, impedance.limit_spin(limit, spatial(motion)))


@kernel(REAL(IN1, IN1, IN1))
def V_e(gains, e, e_dot) -> float:
    return impedance.V_e(record(gains, GAINS), e, e_dot)


@kernel(REAL(IN1))
def V_s(v_s) -> float:
    return impedance.V_s(spatial(v_s))


@kernel(REAL(IN2, REAL))
def smallest_singular_value_below(J, limit) -> float:
    return torque.smallest_singular_value_below(J, limit)


@kernel(REAL(IN2))
def smallest_singular_value(J) -> float:
    return torque.smallest_singular_value(J)


@kernel(REAL(REAL, REAL, REAL))
def singularity_damping(sigma, sigma_min, most_damping) -> float:
    return torque.singularity_damping(sigma, sigma_min, most_damping)


def exponential(phi: Array) -> Array:
    out = np.empty((3, 3))
    _exponential(np.asarray(phi, dtype=float), out)
    return out


def logarithm(R: Array) -> Array:
    out = np.empty(3)
    _logarithm(np.ascontiguousarray(R), out)
    return out


def left_jacobians(phi: Array, rate: Array) -> tuple[Array, Array, Array]:
    """Return J_l rate, J_l^-1 rate, Jdot_l rate."""
    out = np.empty((3, 3))
    _jacobians(phi, rate, out)
    return tuple(out)


def attitude_error(coordinates: int, R_ee, R_d, w_ee, w_d, alpha_d, previous):
    """Return an ATTITUDE record."""
    out = new(ATTITUDE)
    matrices = np.ascontiguousarray(R_ee), np.ascontiguousarray(R_d)
    _attitude_error(coordinates, *matrices, w_ee, w_d, alpha_d, previous, out)
    return record(out, ATTITUDE)


def roll_pitch_yaw(R: Array) -> Array:
    out = np.empty(3)
    _roll_pitch_yaw(R, out)
    return out


def grasp(r: Array, x: Array, w_o: Array) -> Array:
    """Return G x, G^T x, G^-T x, Phi2(w_o, r); (4, 6)."""
    out = np.empty((4, 6))
    _grasp(np.asarray(r), np.asarray(x), np.asarray(w_o), out)
    return out


def contact_arm(o_R_c: Array, contact_buffer: Array, slip: Array) -> Array:
    out = np.empty(3)
    _contact_arm(np.ascontiguousarray(o_R_c), contact_buffer, slip, out)
    return out


def integrate_slip(slip: Array, v_s: Array, dt: float) -> Array:
    out = np.empty_like(slip)
    _integrate_slip(slip, dt, v_s, out)
    return out


def dead_band(v_s: Array, linear: float, angular: float) -> Array:
    out = np.empty(6)
    _dead_band(v_s, linear, angular, out)
    return out


def faded(full: Array, gamma: Array, v_s: Array) -> Array:
    out = np.empty(6)
    _faded(full, gamma, v_s, out)
    return out


def limit_spin(limit: float, motion: Array) -> Array:
    out = np.empty(6)
    _limit_spin(limit, motion, out)
    return out


def gains_now(ramp: Array, stamp_ns: int):
    """Return the LAW_GAINS record in effect."""
    out = new(LAW_GAINS)
    sample_gains(ramp, stamp_ns, out)
    return record(out, LAW_GAINS)


def reference_at(path: Array, t: float, position: Array, rotation: Array):
    """Return a REFERENCE record."""
    out = new(REFERENCE)
    run_reference(path, t, position, np.ascontiguousarray(rotation), out)
    return record(out, REFERENCE)
