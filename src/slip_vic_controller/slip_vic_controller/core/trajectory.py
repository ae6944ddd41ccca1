"""Built-in reference motions, relative to the pose of {ee} at the first tick; position, velocity, acceleration agree.

A motion is a path in six coordinates, displacement and rotation vector on world axes, with its two derivatives;
`CartesianReference` is made from it in one place, so angular velocity and acceleration are exact.
"""

from __future__ import annotations

import bisect
import math
from typing import Protocol

import numpy as np
from scipy.interpolate import CubicSpline

from slip_core.arrays import Array, readonly
from slip_core.types import CartesianReference
from slip_vic_controller.core.params import TrajectoryParams
from slip_vic_controller.core.path_kernel import place_quintic, place_reference, quintic_point
from slip_vic_controller.core.rotation import exp_so3, left_jacobian_product, left_jacobian_rate

PLANES = {"xy": (0, 1), "yz": (1, 2), "zx": (2, 0)}


class PathPoint:
    """Displacement and rotation vector (6,) [m, rad] {w} with first and second time derivative; packed (18,)."""

    __slots__ = ("packed",)

    def __init__(self, packed: Array) -> None:
        self.packed = packed

    @property
    def value(self) -> Array:
        """The point; (6,)."""
        return self.packed[:6]

    @property
    def rate(self) -> Array:
        """Its first derivative; (6,)."""
        return self.packed[6:12]

    @property
    def rate_rate(self) -> Array:
        """Its second derivative; (6,)."""
        return self.packed[12:]


class Path(Protocol):
    """A motion over time, at rest before 0 and after its end."""

    def at(self, t: float) -> PathPoint:
        """Return the point at time t [s]."""
        ...


_REST = PathPoint(readonly(np.zeros(18)))


class Hold:
    """Stay at the start."""

    def at(self, t: float) -> PathPoint:
        """Return rest at every time t [s].

        Implements: ours: the reference that asks for nothing.
        """
        return _REST


class PiecewiseQuintic:
    """Quintic segments through given points with common velocity and acceleration at the knots, so C2.

    Args:
        times: knots; (k,) [s], growing, the first is 0.
        values, rates, rate_rates: at the knots; (k, 6) each.
    """

    def __init__(self, times: Array, values: Array, rates: Array, rate_rates: Array) -> None:
        self._times = times.tolist()
        self._polynomials = [
            _with_derivatives(
                _quintic(times[i + 1] - times[i], *(a[j] for j in (i, i + 1) for a in (values, rates, rate_rates)))
            )
            for i in range(len(times) - 1)
        ]
        self._last = PathPoint(readonly(np.concatenate((values[-1], np.zeros(12)))))

    def at(self, t: float) -> PathPoint:
        """Return the point at time t [s].

        Implements: ours: minimum-jerk polynomials, the usual smooth point-to-point motion.
        """
        if t <= 0.0:
            return _REST
        if t >= self._times[-1]:
            return self._last
        i = self._segment(t)
        point = np.empty(18)
        quintic_point(self._polynomials[i], t - self._times[i], point)
        return PathPoint(point)

    def place(self, t: float, position: Array, rotation: Array, out: Array) -> bool:
        """Write the packed reference at time t [s] where the path moves; return whether it does."""
        if not 0.0 < t < self._times[-1]:
            return False
        i = self._segment(t)
        place_quintic(self._polynomials[i], t - self._times[i], position, rotation, out)
        return True

    def _segment(self, t: float) -> int:
        return bisect.bisect_right(self._times, t) - 1


def _quintic(h: float, p0: Array, v0: Array, a0: Array, p1: Array, v1: Array, a1: Array) -> Array:
    """Return the coefficients (6 powers, 6) of the quintic with these ends; h [s]."""
    d = p1 - p0 - h * v0 - 0.5 * h * h * a0
    dv = (v1 - v0 - h * a0) * h
    da = (a1 - a0) * h * h
    return np.array(
        [
            p0,
            v0,
            0.5 * a0,
            (10.0 * d - 4.0 * dv + 0.5 * da) / h**3,
            (-15.0 * d + 7.0 * dv - da) / h**4,
            (6.0 * d - 3.0 * dv + 0.5 * da) / h**5,
        ]
    )


def _with_derivatives(coefficients: Array) -> Array:
    """Return the matrix (18, 6) that maps powers of time to value, first and second derivative of six coordinates."""
    d = np.diag(np.arange(1.0, 6.0), k=1)
    return np.vstack([coefficients.T, coefficients.T @ d.T, coefficients.T @ d.T @ d.T])


class Curve:
    """Circle or lemniscate in a plane, run through with a phase that starts and stops smoothly.

    Circle: r (sin p, 1 - cos p); lemniscate (Gerono): r (sin p, sin 2p / 2); rotation: amplitude * sin p.
    """

    def __init__(self, params: TrajectoryParams) -> None:
        self._speed = 2.0 * math.pi / params.period_s
        self._ramp, self._duration = params.ramp_s, params.duration_s
        first, second = PLANES[params.plane]
        self._along = np.array([*(params.radius * np.eye(3)[first]), *params.rotation])
        self._across = np.array([*(params.radius * np.eye(3)[second]), 0.0, 0.0, 0.0])
        self._circle = params.kind == "circle"

    def at(self, t: float) -> PathPoint:
        """Return the point at time t [s].

        Implements: ours: closed curves that excite both axes.
        """
        p, p_dot, p_ddot = smooth_phase(t, self._speed, self._ramp, self._duration)
        s, c = math.sin(p), math.cos(p)
        if self._circle:
            f, f_p, f_pp = 1.0 - c, s, c
        else:
            f, f_p, f_pp = s * c, c * c - s * s, -4.0 * s * c
        along = (s, c * p_dot, c * p_ddot - s * p_dot * p_dot)
        across = (f, f_p * p_dot, f_p * p_ddot + f_pp * p_dot * p_dot)
        return PathPoint(
            np.concatenate([a * self._along + b * self._across for a, b in zip(along, across, strict=True)])
        )


def smooth_phase(t: float, speed: float, ramp: float, duration: float) -> tuple[float, float, float]:
    """Return phase and its two rates: speed ramps up by a quintic over `ramp`, and down at the end; [s], [rad/s].

    Implements: ours: velocity and acceleration of the curves begin and end at zero.
    """

    def rising(x: float) -> tuple[float, float, float]:
        return x**4 * (2.5 + x * (x - 3.0)), x**3 * (10.0 + x * (6.0 * x - 15.0)), 30.0 * (x * (1.0 - x)) ** 2

    t = min(max(t, 0.0), duration)
    end = speed * (duration - ramp)
    if t < ramp:
        p, v, a = rising(t / ramp)
        return speed * ramp * p, speed * v, speed * a / ramp
    if t > duration - ramp:
        p, v, a = rising((duration - t) / ramp)
        return end - speed * ramp * p, speed * v, -speed * a / ramp
    return speed * (t - 0.5 * ramp), speed, 0.0


def make_path(params: TrajectoryParams) -> Path:
    """Return the path that the parameters ask for; `topic` gives the hold that is used until references arrive.

    Implements: ours: one place that knows all kinds.
    """
    if params.kind == "quintic":
        goal = np.array([np.zeros(6), [*params.displacement, *params.rotation]])
        return PiecewiseQuintic(np.array([0.0, params.duration_s]), goal, np.zeros((2, 6)), np.zeros((2, 6)))
    if params.kind == "waypoints":
        points = np.vstack([np.zeros(6), np.array(params.waypoints).reshape(-1, 6)])
        times = np.linspace(0.0, params.duration_s, len(points))
        if params.waypoint_times_s:
            times = np.array([0.0, *params.waypoint_times_s])
        spline = CubicSpline(times, points, bc_type="clamped")
        rate_rates = spline(times, 2)
        rate_rates[[0, -1]] = 0.0
        return PiecewiseQuintic(times, points, spline(times, 1), rate_rates)
    if params.kind in ("circle", "lemniscate"):
        return Curve(params)
    return Hold()


def reference_at(path: Path, t: float, position: Array, rotation: Array) -> CartesianReference:
    """Return the desired motion at time t [s], starting from pose (3,) [m], (3, 3) {w}; the plain form.

    Implements: ours: R_d = exp(phi) R_0, omega_d = J_l phi_dot, alpha_d = J_l phi_ddot + Jdot_l phi_dot.
    """
    point = path.at(t)
    phi, phi_dot = point.value[3:], point.rate[3:]
    alpha = left_jacobian_product(phi, point.rate_rate[3:]) + left_jacobian_rate(phi, phi_dot)
    return CartesianReference(
        position + point.value[:3],
        exp_so3(phi).dot(rotation),
        np.concatenate((point.rate[:3], left_jacobian_product(phi, phi_dot))),
        np.concatenate((point.rate_rate[:3], alpha)),
    )


def packed_reference_at(path: Path, t: float, position: Array, rotation: Array) -> Array:
    """Return `reference_at` packed; (24,) {w}.

    Implements: ours: the form that the tick's kernel takes.
    """
    out = np.empty(24)
    if not (isinstance(path, PiecewiseQuintic) and path.place(t, position, rotation, out)):
        place_reference(path.at(t).packed, position, rotation, out)
    out.setflags(write=False)
    return out
