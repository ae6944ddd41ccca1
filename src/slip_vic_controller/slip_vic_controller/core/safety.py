"""When the law must not be evaluated, and what the arm does then."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from slip_core.arrays import Array
from slip_core.types import CartesianReference, JointSample, SlipSample, WrenchSample
from slip_vic_controller.core.watch_kernel import all_finite

_REFERENCE_SHAPES = (("position", (3,)), ("rotation", (3, 3)), ("twist", (6,)), ("acceleration", (6,)))


def refusal(
    last_stamp_ns: int,
    joints: int,
    contacts: int,
    slip_needed: bool,
    joint: JointSample,
    wrenches: Sequence[WrenchSample],
    slips: Sequence[SlipSample],
    reference: CartesianReference | None,
) -> str:
    """Return why the law must not be evaluated on these inputs, or an empty text where nothing speaks against it.

    An invalid slip sample is not "no slip": where the law needs slip (`slip_needed`), it is a reason to refuse.

    Implements: ours: a tick never raises; sizes, finiteness and time are looked at before any formula.
    """
    for name, values in (("position", joint.position), ("velocity", joint.velocity)):
        if values.shape != (joints,):
            return f"joint {name} has not {joints} values"
        if not finite(values):
            return f"joint {name} is not finite"
    if joint.stamp_ns < last_stamp_ns:
        return "joint sample is older than the last one"
    if len(wrenches) != contacts or len(slips) != contacts:
        return f"wrench and slip samples are not of {contacts} contacts"
    for i, (wrench, slip) in enumerate(zip(wrenches, slips, strict=True)):
        if wrench.wrench.shape != (6,) or not finite(wrench.wrench):
            return f"wrench of contact {i} is not six finite values"
        if slip.valid:
            if slip.twist.shape != (6,) or not finite(slip.twist):
                return f"slip of contact {i} is not six finite values"
        elif slip_needed:
            return f"slip of contact {i} is invalid"
    if reference is not None:
        for name, shape in _REFERENCE_SHAPES:
            part = getattr(reference, name)
            if part.shape != shape or not finite(part.ravel()):
                return f"reference {name} is not finite or has not shape {shape}"
    return ""


def safe_torque(gravity: Array, velocity: Array | None, damping: float) -> Array:
    """Return g(q) - d qd, which holds the arm against gravity and brakes it; (n,) [N m], (n,) [rad/s].

    `velocity` None (not known) leaves gravity compensation alone.

    Implements: ours: the command given where the law gives none.
    """
    return gravity if velocity is None else gravity - damping * velocity


def limit_effort(torque: Array, limit: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Return the torque clipped to +-limit and which joints were clipped; (n,) [N m] -> (n,) [N m], (n,) bool.

    Implements: ours: the limits are the URDF's; saturation is reported, never hidden.
    """
    return np.minimum(np.maximum(torque, -limit), limit), np.abs(torque) > limit


def finite(values: Array) -> bool:
    """Return whether every element is finite and its square is; (k,).

    Implements: ours: NaN passes through clipping, so it is looked for by name.
    """
    return bool(all_finite(values))
