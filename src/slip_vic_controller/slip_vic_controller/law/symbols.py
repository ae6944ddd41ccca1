"""The published numbers of a tick: every symbol of the law, in one layout whose names are those of the topic."""

from __future__ import annotations

import functools
import math

import numpy as np

from slip_core.arrays import Array
from slip_core.compiled import part
from slip_core.records import Pose, Real, Record, Records, Vec6, WholeArray, dtype_of, record
from slip_core.types import AXES
from slip_core.vectors import ZERO, Mat, Spatial, Vec, mat, put_spatial, spatial, vec
from slip_vic_controller.law.arm import Arm, DesiredMotion
from slip_vic_controller.law.config import LawConfig
from slip_vic_controller.law.contact import G_T_inverse, Phi2
from slip_vic_controller.law.evaluation import Evaluation
from slip_vic_controller.law.gains import LawGains
from slip_vic_controller.law.paper import Lambda, V_e, V_s, control_torque
from slip_vic_controller.law.rotation import logarithm
from slip_vic_controller.law.torque import given_axes, smallest_singular_value
from slip_vic_controller.sizes import Joints


class Symbols(Record):
    """The published numbers, NaN where the law was not evaluated; the name on the topic is the field's.

    Poses are position [m] and rotation vector [rad]. Vectors are on {w}; e, e_dot, K, D in the coordinates of the
    error. Joints beyond those in use are not published. Units: see `Evaluation`.
    """

    safe: Real  # 1 where the law was not evaluated
    near_singular_arm: Real
    near_singular_attitude: Real
    effort: Joints  # N m
    saturated: Joints  # 0 or 1
    gate: Real
    V_e: Real  # J
    V_s: Real  # m^2/s^2
    sigma_min: Real  # smallest singular value of J
    damping_squared: Real  # 1/kg
    k_s: Real  # 1/s
    sliding: Real  # 1 while the observer finds slip
    position: Vec6  # pose of the pad
    desired: Vec6  # pose of the reference
    s: Vec6  # pose of the pad on the object
    twist: Vec6
    h_ee: Vec6
    v_s: Vec6
    e: Vec6
    e_dot: Vec6
    K: Vec6
    D: Vec6
    comp: Vec6
    Lambda: Vec6
    Theta: Vec6
    Z: Vec6
    a_d: Vec6
    a_C: Vec6  # noqa: N815
    h_o: Vec6
    v_o: Vec6
    a_o: Vec6
    Phi2: Vec6
    tau_task: Joints  # N m
    tau_null: Joints  # N m
    tau_bias: Joints  # N m


SYMBOLS = dtype_of(Symbols)


@functools.lru_cache
def published(joints: int) -> tuple[tuple[str, ...], Array]:
    """Return names and places of the numbers of an arm: `dict(zip(names, buffer[places]))` is on the topic."""
    names: list[str] = []
    places: list[int] = []
    for name in SYMBOLS.names or ():
        kind, offset = SYMBOLS.fields[name][:2]  # type: ignore[index]
        ends = {(): ("",), (6,): tuple(f"_{axis}" for axis in AXES)}.get(
            kind.shape, tuple(f"_{j + 1}" for j in range(joints))
        )
        names += [name + end for end in ends]
        places += range(offset // 8, offset // 8 + len(ends))
    return tuple(names), np.array(places)


@part
def symbols(
    config: LawConfig, gains: LawGains, arm: Arm, slips: Records[Pose], reference: DesiredMotion,
    evaluation: Evaluation, sliding: float, out: Symbols,
) -> None:  # fmt: skip
    """Fill the symbols of a law that was evaluated; their flag `safe` is 0.

    Args:
        config, gains, arm, slips, reference: of the evaluation.
        evaluation: filled by `evaluate`.
        sliding: 1 while the observer finds slip, 0 without one.
        out: result.

    Implements: Eq. (24), (28), (30), with Lambda = M_D T_e^-1 gate comp.
    """
    n, v = config.joints, evaluation
    R_ee, R_d, v_ee = mat(arm.rotation), mat(reference.rotation), spatial(arm.twist)
    v_s, comp, gated = spatial(v.v_s), spatial(v.comp), spatial(v.gated)
    w_o, r = vec(v.w_o), vec(v.r)

    out.safe, out.near_singular_arm, out.near_singular_attitude = 0.0, v.near_singular_arm, v.near_singular_attitude
    out.gate, out.V_e, out.V_s = v.gate, V_e(gains.gains, v.e, v.e_dot), V_s(v_s)
    given = np.empty(6, np.int64)
    given_axes(arm.J[:, :n], config.sigma_min, given)
    out.sigma_min = smallest_singular_value(arm.J[:, :n], given, math.inf)
    out.damping_squared = v.damping_squared
    out.k_s, out.sliding = gains.gains.k_s, sliding
    put_pose(out.position, vec(arm.position), R_ee)
    put_pose(out.desired, vec(reference.position), R_d)
    put_pose(out.s, vec(slips[0].position), mat(slips[0].rotation))
    put_spatial(out.v_s, R_ee @ v_s)
    put_spatial(out.comp, R_ee @ comp)
    put_spatial(out.Lambda, Lambda(config.attitude, vec(v.e[3:]), R_d, gains.gains, R_ee @ gated))
    put_spatial(out.h_o, R_ee @ spatial(v.h_o))
    put_spatial(out.v_o, R_ee @ G_T_inverse(r, R_ee.T() @ v_ee - v_s))
    put_spatial(out.a_o, R_ee @ spatial(v.a_o))
    put_spatial(out.Phi2, Spatial(R_ee @ Phi2(w_o, r).linear, ZERO))
    out.twist[:], out.h_ee[:] = arm.twist, v.h_ee
    out.e[:], out.e_dot[:], out.K[:], out.D[:] = v.e, v.e_dot, v.K, v.D
    out.Theta[:], out.Z[:], out.a_d[:], out.a_C[:] = v.Theta, v.Z, v.a_d, v.a_C
    out.tau_bias[:], force = arm.bias, v.task - v.h_ee
    for j in range(n):
        out.effort[j], out.saturated[j] = v.effort[j], v.saturated[j]
        out.tau_task[j] = control_torque(arm, force, j) - arm.bias[j]
        out.tau_null[j] = v.tau[j] - arm.bias[j] - out.tau_task[j]


@part
def put_pose(out: Array, position: Vec, rotation: Mat) -> None:
    """Write position [m] and rotation vector [rad]; (6,)."""
    put_spatial(out, Spatial(position, logarithm(rotation)))


@part
def no_symbols(effort: Array, saturated: WholeArray, symbols_buffer: Array) -> None:
    """Fill the symbols of a tick without the law: flag `safe`, the command, and NaN for the rest.

    Args:
        effort, saturated: the command, and which joints were clipped; [N m], 0 or 1.
        symbols_buffer: Symbols; result.
    """
    symbols_buffer[:] = math.nan
    out: Symbols = record(symbols_buffer, SYMBOLS)
    out.safe, out.near_singular_arm, out.near_singular_attitude = 1.0, 0.0, 0.0
    for j in range(effort.shape[0]):
        out.effort[j], out.saturated[j] = effort[j], saturated[j]
