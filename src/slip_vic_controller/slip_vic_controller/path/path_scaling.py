"""Speed along the path: slower near the edge of what the arm can follow, at rest where slip is not known."""

from __future__ import annotations

from slip_core.compiled import part
from slip_core.records import Real, Record, dtype_of
from slip_vic_controller.path.paths import Reference


class PathScaling(Record):
    """Speed along the path."""

    scale: Real  # 1 = as planned
    rate: Real  # 1/s, of the scale


PATH_SCALING = dtype_of(PathScaling)


@part
def advance(scaling: PathScaling, wanted: float, dt: float, slow_down_s: float) -> None:
    """Move the scale of a PATH_SCALING towards `wanted`, at most from 1 to 0 in `slow_down_s`; dt [s].

    The reference brakes in a known time, and never jumps.
    """
    before = scaling.scale
    if wanted == before:
        scaling.rate = 0.0
        return
    step = dt / slow_down_s
    scaling.scale = min(max(wanted, before - step), before + step)
    scaling.rate = (scaling.scale - before) / dt if dt > 0.0 else 0.0


@part
def scale_for_error(linear: float, angular: float, bound_linear: float, bound_angular: float) -> float:
    """Return how fast the path may run at these errors [m], [rad]: 1 up to half the bounds, 0 at the bounds."""
    worst = max(linear / bound_linear, angular / bound_angular)
    return 1.0 if worst <= 0.5 else max(0.0, 2.0 - 2.0 * worst)


@part
def scaled(reference: Reference, scaling: PathScaling) -> Reference:
    """Return the reference of a path that is run through at another speed: the chain rule; PATH_SCALING.

    Twist sigma v, acceleration sigma^2 a + sigma_dot v.
    """
    sigma = scaling.scale
    return Reference(
        reference.position,
        reference.rotation,
        sigma * reference.twist,
        (sigma * sigma) * reference.acceleration + scaling.rate * reference.twist,
    )


@part
def lost_ns(scaling: PathScaling, dt_ns: int) -> int:
    """Return by how much the start of the trajectory moves later in a tick of dt_ns [ns]; 0 at full speed, exactly."""
    return 0 if scaling.scale == 1.0 else round((1.0 - scaling.scale) * dt_ns)
