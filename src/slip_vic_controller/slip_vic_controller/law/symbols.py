"""The published numbers of a tick: every symbol of the law, in one layout whose names are those of the topic."""

from __future__ import annotations

import functools
import math
from typing import Any

import numpy as np

from slip_core.arrays import Array
from slip_core.compiled import part
from slip_core.records import REAL, layout
from slip_core.vectors import ZERO, Mat, Spatial, Vec, mat, put_spatial, spatial, vec
from slip_vic_controller.law.attitude import T_e_inverse
from slip_vic_controller.law.contact import G_T_inverse, Phi2
from slip_vic_controller.law.impedance import V_e, V_s
from slip_vic_controller.law.rotation import logarithm
from slip_vic_controller.law.torque import null_torque, smallest_singular_value, task_torque
from slip_vic_controller.sizes import MAX_JOINTS

_SIX, _JOINTS = (REAL, (6,)), (REAL, (MAX_JOINTS,))

SLIP_ESTIMATE = layout(sliding=REAL, significance=REAL, deviation=_SIX, error=_SIX)
"""What an observer publishes: whether it slides, how significantly; standard deviation of the slip velocity and the
error of the object's acceleration that it has found [m/s, rad/s], [m/s^2, rad/s^2]; zeros without an observer."""

SYMBOLS = layout(
    safe=REAL,
    near_singular_arm=REAL,
    near_singular_attitude=REAL,
    effort=_JOINTS,
    saturated=_JOINTS,
    gate=REAL,
    V_e=REAL,
    V_s=REAL,
    sigma_min=REAL,
    damping_squared=REAL,
    k_s=REAL,
    sliding=REAL,
    slip_significance=REAL,
    position=_SIX,
    desired=_SIX,
    s=_SIX,
    twist=_SIX,
    h_ee=_SIX,
    v_s=_SIX,
    e=_SIX,
    e_dot=_SIX,
    K=_SIX,
    D=_SIX,
    comp=_SIX,
    Lambda=_SIX,
    Theta=_SIX,
    Z=_SIX,
    a_d=_SIX,
    a_C=_SIX,
    h_o=_SIX,
    v_o=_SIX,
    a_o=_SIX,
    Phi2=_SIX,
    slip_deviation=_SIX,
    slip_error=_SIX,
    tau_task=_JOINTS,
    tau_null=_JOINTS,
    tau_bias=_JOINTS,
)
"""Flags, effort and saturation of each joint; then what the law has made, NaN where it was not evaluated.

position, desired and s are poses: position and rotation vector. Vectors are on {w}; e, e_dot, K, D in the coordinates
of the error. Joints beyond those in use are not published.
"""

AXES = ("x", "y", "z", "rx", "ry", "rz")


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
    config: Any, gains: Any, arm: Any, slips: Any, reference: Any, evaluation: Any, estimate: Any, out: Any
) -> None:
    """Fill the SYMBOLS of a law that was evaluated; its flag `safe` is 0.

    Args:
        config, gains, arm, slips, reference: what `evaluate` was given.
        evaluation: EVALUATION that it has filled.
        estimate: SLIP_ESTIMATE, or any record with these names.
        out: SYMBOLS.

    Implements: Eq. (24), (28), (30), with Lambda = M_D T_e^-1 gate comp.
    """
    n, v = config.joints, evaluation
    R_ee, R_d, v_ee = mat(arm.rotation), mat(reference.rotation), spatial(arm.twist)
    v_s, comp, gated, M_D = spatial(v.v_s), spatial(v.comp), spatial(v.gated), spatial(gains.gains.M_D)
    w_o, r = vec(v.w_o), vec(v.r)

    out.safe, out.near_singular_arm, out.near_singular_attitude = 0.0, v.near_singular_arm, v.near_singular_attitude
    out.gate, out.V_e, out.V_s = v.gate, V_e(gains.gains, v.e, v.e_dot), V_s(v_s)
    out.sigma_min, out.damping_squared = smallest_singular_value(arm.J[:, :n]), v.damping_squared
    out.k_s, out.sliding, out.slip_significance = gains.gains.k_s, estimate.sliding, estimate.significance
    put_pose(out.position, vec(arm.position), R_ee)
    put_pose(out.desired, vec(reference.position), R_d)
    put_pose(out.s, vec(slips[0].position), mat(slips[0].rotation))
    put_spatial(out.v_s, R_ee @ v_s)
    put_spatial(out.comp, R_ee @ comp)
    put_spatial(out.Lambda, M_D * T_e_inverse(config.attitude, vec(v.e[3:]), R_d, R_ee @ gated))
    put_spatial(out.h_o, R_ee @ spatial(v.h_o))
    put_spatial(out.v_o, R_ee @ G_T_inverse(r, R_ee.T() @ v_ee - v_s))
    put_spatial(out.a_o, R_ee @ spatial(v.a_o))
    put_spatial(out.Phi2, Spatial(R_ee @ Phi2(w_o, r).linear, ZERO))
    for i in range(6):
        out.twist[i], out.h_ee[i] = arm.twist[i], v.torque.h_ee[i]
        out.e[i], out.e_dot[i], out.K[i], out.D[i] = v.e[i], v.e_dot[i], v.K[i], v.D[i]
        out.Theta[i], out.Z[i], out.a_d[i], out.a_C[i] = v.Theta[i], v.Z[i], v.a_d[i], v.a_C[i]
        out.slip_deviation[i], out.slip_error[i] = estimate.deviation[i], estimate.error[i]
    for j in range(n):
        out.effort[j], out.saturated[j] = v.effort[j], v.saturated[j]
        out.tau_task[j], out.tau_null[j] = task_torque(arm, v.torque, j), null_torque(arm, v.torque, j)
        out.tau_bias[j] = arm.bias[j]


@part
def put_pose(out: Array, position: Vec, rotation: Mat) -> None:
    """Write position [m] and rotation vector [rad]; (6,)."""
    put_spatial(out, Spatial(position, logarithm(rotation)))


@part
def no_symbols(effort: Array, saturated: Array, joints: int, out: Any) -> None:
    """Fill the SYMBOLS of a tick without the law: flag `safe`, the command, and NaN for the rest.

    Args:
        effort, saturated: the command, and which joints were clipped; [N m], 0 or 1.
        joints: how many.
        out: SYMBOLS.
    """
    nan = math.nan
    out.safe, out.near_singular_arm, out.near_singular_attitude = 1.0, 0.0, 0.0
    out.gate = out.V_e = out.V_s = out.sigma_min = out.damping_squared = nan
    out.k_s = out.sliding = out.slip_significance = nan
    for i in range(6):
        out.position[i] = out.desired[i] = out.s[i] = out.twist[i] = out.h_ee[i] = out.v_s[i] = nan
        out.e[i] = out.e_dot[i] = out.K[i] = out.D[i] = out.comp[i] = out.Lambda[i] = nan
        out.Theta[i] = out.Z[i] = out.a_d[i] = out.a_C[i] = nan
        out.h_o[i] = out.v_o[i] = out.a_o[i] = out.Phi2[i] = nan
        out.slip_deviation[i] = out.slip_error[i] = nan
    for j in range(joints):
        out.effort[j], out.saturated[j] = effort[j], saturated[j]
        out.tau_task[j] = out.tau_null[j] = out.tau_bias[j] = nan
