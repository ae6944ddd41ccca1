"""Built-in reference motions, relative to the pose of {ee} at the first tick; position, velocity, acceleration agree.

A path is six coordinates over time, displacement and rotation vector on world axes, with their two derivatives, at rest
before 0 and after its end; the reference is made from it in one place, so angular velocity and acceleration are exact.
Near the limits of the arm it is run through more slowly, and without slip velocity it comes to rest.
"""

from __future__ import annotations

import math
from enum import IntEnum, unique
from typing import Annotated, NamedTuple, Protocol, TypeVar

import numpy as np

from slip_core.arrays import Array
from slip_core.compiled import IN1, IN2, OUT1, OUT2, VOID, kernel, part
from slip_core.errors import InputError
from slip_core.records import Pose, Real, Record, Vec3, Vec6, Whole, dtype_of, new, record
from slip_core.vectors import NOTHING, Mat, Spatial, Vec, mat, put, put_mat, put_spatial, spatial, vec
from slip_vic_controller.law.arm import DesiredMotion
from slip_vic_controller.law.rotation import exponential, left_jacobian, left_jacobian_rate
from slip_vic_controller.params.controller_params import TrajectoryParams
from slip_vic_controller.sizes import ROOM


class Path(Record):
    """A path: polynomial segments, a circle or a lemniscate."""

    kind: Whole  # PathKind
    segments: Whole
    knot: Annotated[Array, ROOM + 1]  # s
    polynomial: Annotated[Array, (ROOM, 6, 6)]  # [segment, coordinate, power], time since the segment's knot
    end: Vec6  # where the last segment ends
    speed: Real  # rad/s, phase speed of a curve
    ramp: Real  # s
    duration: Real  # s
    along: Vec6  # vectors of the curve
    across: Vec6
    carries: Whole  # whether it is the object's
    lever: Vec3  # m, then the pad as seen from its centre of mass {ee}


REFERENCE, PATH = dtype_of(DesiredMotion), dtype_of(Path)


class PathScaling(Record):
    """Speed along the path."""

    scale: Real  # 1 = as planned
    rate: Real  # 1/s, of the scale


class Started(Protocol):
    """A record that has the pose of a pad where the path began: position [m] and attitude {w}."""

    start_position: Array
    start_rotation: Array


@unique
class PathKind(IntEnum):
    """What a path is made of."""

    HOLD = 0
    POLYNOMIALS = 1
    CIRCLE = 2
    LEMNISCATE = 3


PLANES = {"xy": (0, 1), "yz": (1, 2), "zx": (2, 0)}

Value = TypeVar("Value", float, Vec)


class PathPoint(NamedTuple):
    """Displacement and rotation vector [m, rad] {w}, with first and second time derivative."""

    value: Spatial
    rate: Spatial
    rate_rate: Spatial


class Reference(NamedTuple):
    """The desired motion, as in REFERENCE."""

    position: Vec
    rotation: Mat
    twist: Spatial
    acceleration: Spatial


@part
def reference_at(path: Path, t: float, start_position: Array, start_rotation: Array) -> Reference:
    """Return the desired motion at time t [s] of a PATH from a pose (3,) [m], (3, 3) {w}.

    R_d = exp(phi) R_0, omega_d = J_l phi_dot, alpha_d = J_l phi_ddot + Jdot_l phi_dot.
    """
    point = point_at(path, t)
    phi, phi_dot = point.value.angular, point.rate.angular
    alpha_d = left_jacobian(phi, point.rate_rate.angular) + left_jacobian_rate(phi, phi_dot)
    reference = Reference(
        vec(start_position) + point.value.linear,
        exponential(phi) @ mat(start_rotation),
        Spatial(point.rate.linear, left_jacobian(phi, phi_dot)),
        Spatial(point.rate_rate.linear, alpha_d),
    )
    if path.carries == 0:
        return reference
    moved = offset(reference, reference.rotation @ vec(path.lever))  # of the pad, as the centre of mass is displaced
    position = moved.position - mat(start_rotation) @ vec(path.lever)
    return Reference(position, moved.rotation, moved.twist, moved.acceleration)


@part
def offset(reference: Reference, r: Vec) -> Reference:
    """Return the motion of a point fixed at r [m] {w} from that of a reference on the same body."""
    w, a, alpha = reference.twist.angular, reference.acceleration.linear, reference.acceleration.angular
    return Reference(
        reference.position + r,
        reference.rotation,
        Spatial(reference.twist.linear + w.cross(r), w),
        Spatial(a + alpha.cross(r) + w.cross(w.cross(r)), alpha),
    )


@part
def relative(first: Started, other: Started, out: Pose) -> None:
    """Write how one pad sees another to a POSE; first, other: with start_position [m], start_rotation {w}."""
    R = mat(first.start_rotation).T()
    put(out.position, R @ (vec(other.start_position) - vec(first.start_position)))
    put_mat(out.rotation, R @ mat(other.start_rotation))


@part
def carried(reference: Reference, grasp: Pose) -> Reference:
    """Return the motion of a pad on an object whose first pad moves by a reference; grasp: as of `relative`."""
    moved = offset(reference, reference.rotation @ vec(grasp.position))
    return Reference(moved.position, moved.rotation @ mat(grasp.rotation), moved.twist, moved.acceleration)


@part
def standing(reference: Reference) -> Reference:
    """Return the pose of a reference, at rest."""
    return Reference(reference.position, reference.rotation, NOTHING, NOTHING)


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


@part
def read_reference(given: DesiredMotion) -> Reference:
    """Return a REFERENCE."""
    return Reference(vec(given.position), mat(given.rotation), spatial(given.twist), spatial(given.acceleration))


@part
def put_reference(out: DesiredMotion, reference: Reference) -> None:
    """Write a reference to a REFERENCE."""
    put(out.position, reference.position)
    put_mat(out.rotation, reference.rotation)
    put_spatial(out.twist, reference.twist)
    put_spatial(out.acceleration, reference.acceleration)


@part
def point_at(path: Path, t: float) -> PathPoint:
    """Return the point of a PATH at time t [s]."""
    if path.kind == PathKind.POLYNOMIALS:
        return polynomial_point(path, t)
    if path.kind == PathKind.CIRCLE or path.kind == PathKind.LEMNISCATE:
        return curve_point(path, t)
    return PathPoint(NOTHING, NOTHING, NOTHING)


@part
def polynomial_point(path: Path, t: float) -> PathPoint:
    """Return the point of quintic segments with common velocity and acceleration at the knots, so C2; t [s]."""
    if t <= 0.0:
        return PathPoint(NOTHING, NOTHING, NOTHING)
    if t >= path.knot[path.segments]:
        return PathPoint(spatial(path.end), NOTHING, NOTHING)
    i = 0
    while t >= path.knot[i + 1]:
        i += 1
    u, p = t - path.knot[i], path.polynomial[i]
    x, y, z = horner(p[0], u), horner(p[1], u), horner(p[2], u)
    a, b, c = horner(p[3], u), horner(p[4], u), horner(p[5], u)
    return PathPoint(
        Spatial(Vec(x[0], y[0], z[0]), Vec(a[0], b[0], c[0])),
        Spatial(Vec(x[1], y[1], z[1]), Vec(a[1], b[1], c[1])),
        Spatial(Vec(x[2], y[2], z[2]), Vec(a[2], b[2], c[2])),
    )


@part
def horner(c: Array, u: float) -> tuple[float, float, float]:
    """Return a polynomial (6,), lowest power first, and its two derivatives at u: Horner's scheme."""
    value = slope = curve = 0.0
    for k in range(5, -1, -1):
        value = value * u + c[k]
        if k > 0:
            slope = slope * u + k * c[k]
        if k > 1:
            curve = curve * u + (k - 1) * (k * c[k])
    return value, slope, curve


@part
def curve_point(path: Path, t: float) -> PathPoint:
    """Return the point of a closed curve in a plane, run through with a phase p that starts and stops smoothly; t [s].

    Circle: r (sin p, 1 - cos p); lemniscate (Gerono): r (sin p, sin 2p / 2); rotation: amplitude * sin p.
    """
    p, p_dot, p_ddot = smooth_phase(t, path.speed, path.ramp, path.duration)
    s, c = math.sin(p), math.cos(p)
    if path.kind == PathKind.CIRCLE:
        f, f_p, f_pp = 1.0 - c, s, c
    else:
        f, f_p, f_pp = s * c, c * c - s * s, -4.0 * s * c
    along, across = spatial(path.along), spatial(path.across)
    return PathPoint(
        s * along + f * across,
        (c * p_dot) * along + (f_p * p_dot) * across,
        (c * p_ddot - s * p_dot * p_dot) * along + (f_p * p_ddot + f_pp * p_dot * p_dot) * across,
    )


@part
def smooth_phase(t: float, speed: float, ramp: float, duration: float) -> tuple[float, float, float]:
    """Return phase and its two rates: speed ramps up by a quintic over `ramp`, and down at the end; [s], [rad/s]."""
    t = min(max(t, 0.0), duration)
    end = speed * (duration - ramp)
    if t < ramp:
        p, v, a = rising(t / ramp)
        return speed * ramp * p, speed * v, speed * a / ramp
    if t > duration - ramp:
        p, v, a = rising((duration - t) / ramp)
        return end - speed * ramp * p, speed * v, -speed * a / ramp
    return speed * (t - 0.5 * ramp), speed, 0.0


@part
def rising(x: float) -> tuple[float, float, float]:
    """Return the integral, the value and the slope of the quintic step from 0 to 1 at x in [0, 1]."""
    cube, both = x * x * x, x * (1.0 - x)
    return x * cube * (2.5 + x * (x - 3.0)), cube * (10.0 + x * (6.0 * x - 15.0)), 30.0 * (both * both)


@part
def quintic(h: float, way: Value, v0: Value, a0: Value, v1: Value, a1: Value) -> tuple[Value, Value, Value]:
    """Return the coefficients of t^3, t^4 and t^5 of the quintic over a way in h [s], with these rates at its ends."""
    d = way - h * v0 - (0.5 * h * h) * a0
    dv, da = h * (v1 - v0 - h * a0), (h * h) * (a1 - a0)
    return (
        (1.0 / (h * h * h)) * (10.0 * d - 4.0 * dv + 0.5 * da),
        (1.0 / (h * h * h * h)) * (-15.0 * d + 7.0 * dv - da),
        (1.0 / (h * h * h * h * h)) * (6.0 * d - 3.0 * dv + 0.5 * da),
    )


@part
def put_quintic(c: Array, h: float, begin: tuple[float, float, float], end: tuple[float, float, float]) -> None:
    """Write the coefficients (6,) of the quintic over h [s] between two values, each with its two rates."""
    p, v, a = begin
    c[0], c[1], c[2] = p, v, 0.5 * a
    c[3], c[4], c[5] = quintic(h, end[0] - p, v, a, end[1], end[2])


@kernel(VOID, OUT1, IN2, IN2, IN2)
def join(path: Array, values: Array, rates: Array, rate_rates: Array) -> None:
    """Write the quintics between the knots of a PATH; points (k, 6) and their two rates."""
    shape = record(path, PATH)
    for i in range(shape.segments):
        for k in range(6):
            begin = values[i, k], rates[i, k], rate_rates[i, k]
            end = values[i + 1, k], rates[i + 1, k], rate_rates[i + 1, k]
            put_quintic(shape.polynomial[i, k], shape.knot[i + 1] - shape.knot[i], begin, end)


@kernel(VOID, IN1, IN1, OUT2)
def sample_path(path: Array, times: Array, out: Array) -> None:
    """Write displacement and rotation vector at times (k,) [s] of a PATH to `out` (k, 6) [m, rad] {w}."""
    shape = record(path, PATH)
    for k in range(len(times)):
        put_spatial(out[k], point_at(shape, times[k]).value)


def make_path(params: TrajectoryParams) -> Array:
    """Return the PATH that the parameters ask for; `topic` gives the hold that is used until references arrive.

    Raises:
        InputError: more waypoints than a path can have.
    """
    buffer = new(PATH)
    path = record(buffer, PATH)
    if params.kind == "quintic":
        goal = np.array([np.zeros(6), [*params.displacement, *params.rotation]])
        fill_segments(buffer, np.array([0.0, params.duration_s]), goal, np.zeros((2, 6)), np.zeros((2, 6)))
    elif params.kind == "waypoints":
        points = np.vstack([np.zeros(6), np.array(params.waypoints).reshape(-1, 6)])
        times = np.linspace(0.0, params.duration_s, len(points))
        from scipy.interpolate import CubicSpline  # 14 MiB, for way points alone

        spline = CubicSpline(times, points, bc_type="clamped")
        rate_rates = spline(times, 2)
        rate_rates[[0, -1]] = 0.0
        fill_segments(buffer, times, points, spline(times, 1), rate_rates)
    elif params.kind in ("circle", "lemniscate"):
        path.kind = PathKind[params.kind.upper()].value
        path.speed, path.ramp, path.duration = 2.0 * math.pi / params.period_s, params.ramp_s, params.duration_s
        first, second = PLANES[params.plane]
        path.along[first] = path.across[second] = params.radius
        path.along[3:] = params.rotation
    return buffer


def fill_segments(buffer: Array, times: Array, values: Array, rates: Array, rate_rates: Array) -> None:
    """Write quintic segments through given points to a PATH; knots (k,) [s] that grow from 0, points (k, 6) each.

    Raises:
        InputError: more segments than ROOM.
    """
    path, count = record(buffer, PATH), len(times) - 1
    if count > ROOM:
        raise InputError("parameter trajectory.waypoints", got=f"{count} points", expected=f"at most {ROOM}")
    path.kind, path.segments = PathKind.POLYNOMIALS.value, count
    path.knot[: count + 1] = times
    path.end[:] = values[-1]
    join(buffer, values, rates, rate_rates)
