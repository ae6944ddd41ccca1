"""The governor as a cycle calls it, with a path in plain numpy: entries of the compiled parts for tests."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from slip_core.compiled import IN1, IN2, INT, OUT1, REAL, VOID, kernel, part
from slip_core.records import Mat3, Real, Record, Vec3, dtype_of, new, record, records
from slip_core.vectors import ZERO, Spatial, Vec, mat, put_spatial, spatial, vec
from slip_vic_controller.contact.friction_estimate import Friction, remember, slip_sample
from slip_vic_controller.governor import governor as g
from slip_vic_controller.governor.guard import hold_back
from slip_vic_controller.governor.layouts import GOVERNOR, GOVERNOR_CONFIG, PAD
from slip_vic_controller.governor.load import ALONE, Held, load, size
from slip_vic_controller.governor.plan import GRID_POINT, GRID_POINTS, Governing, along, sample_time
from slip_vic_controller.governor.step import Pad
from slip_vic_controller.path.paths import Reference

PAPER_PLANAR = SimpleNamespace(
    mass=0.5, inertia=np.diag([2e-3] * 3), r=np.array([-0.02, 0.0, 0.0]), radius=0.03, force=0.25,
    axes=np.array([1.0, 1, 0, 0, 0, 1]), gravity=np.array([0, 0, -9.81]),
)  # fmt: skip
"""The object of `paper_planar` on pad axes, which are turned by half a turn about the normal."""


def scene(mass, inertia, r, force, radius, gravity, way, duration):
    """Return an object that a pad carries in a plane, and the way and the time of its path."""
    return SimpleNamespace(
        mass=mass, inertia=inertia * np.eye(3), r=np.array([*r, 0.0]), radius=radius, force=force,
        gravity=np.array([*gravity, 0.0]), axes=np.array([1.0, 1, 0, 0, 0, 1]),
        way=np.array([way[0], way[1], 0, 0, 0, way[2]], float), duration=duration,
    )  # fmt: skip


PAPER = scene(0.5, 2e-3, (0.02, 0), 0.25, 0.03, (0, 0), (0.4, 0.3, 0.8), 2.0)
VERTICAL = scene(0.2, 3e-4, (0, 0.02), 2.308, 0.015, (0, -9.81), (0.3, 0.15, 0.4), 0.8)
"""`paper_planar` and `vertical_plane`."""


def configuration(case, **changes):
    """Return a GOVERNOR_CONFIG buffer of a case with the defaults of the page."""
    buffer = new(GOVERNOR_CONFIG)
    config = record(buffer, GOVERNOR_CONFIG)
    config.mode, config.margin = Governing.SLOW_DOWN, 0.95
    config.radius, config.slip_axes[:], config.gravity[:] = case.radius, case.axes, case.gravity
    config.weights[:3], config.weights[3:] = case.axes[:3], case.axes[3:] / case.radius
    config.duration, config.most_grip = 2.0, 1.0
    config.most_speed = config.most_turning = 1e3
    config.window, config.led = 1, 1
    e = config.friction
    e.friction, e.configured, e.least, e.probe = Friction.LEARNT, case.force, 0.02 * case.force, 0.01
    e.threshold, e.sensor_delay_ns = 5e-5, 0
    e.friction = changes.pop("estimator", e.friction)
    for name, value in changes.items():
        target = e if name in e.dtype.names else config
        target[name] = value
    return buffer


class Grasped(Record):
    """The object on pad axes."""

    mass: Real
    inertia: Mat3
    r: Vec3


OBJECT = dtype_of(Grasped)


@part
def _held(c, grasped):
    return Held(grasped.mass, mat(grasped.inertia), vec(grasped.r), spatial(c.weights), vec(c.gravity), ALONE)


@kernel(VOID, IN1, OUT1, OUT1, IN1, IN2)
def _start(config, state, pad, grasped, R):
    c, s = record(config, GOVERNOR_CONFIG), record(state, GOVERNOR)
    at_rest = load(_held(c, record(grasped, OBJECT)), mat(R), ZERO, Spatial(ZERO, ZERO))
    p = record(pad, PAD)
    g.start_pad(c, p, size(at_rest), False, 1.0)
    g.start_governor(c, s, p)


@kernel(VOID, IN1, OUT1, OUT1, IN1, INT, IN2, IN1, IN1)
def _sample(config, state, grid, grasped, i, R, twist, acceleration):
    c, s = record(config, GOVERNOR_CONFIG), record(state, GOVERNOR)
    held = _held(c, record(grasped, OBJECT))
    g.sample_point(
        c, s, records(grid, GRID_POINT), i, held, Reference(ZERO, mat(R), spatial(twist), spatial(acceleration))
    )


@kernel(VOID, IN1, OUT1, OUT1, IN1, IN1, IN2, IN1, IN1, IN1, IN2, IN1, REAL, REAL)
def _before(config, state, grid, pad, grasped, R, twist, acceleration, x_e, R_ee, v_ee, most_rate, dt):
    c, s = record(config, GOVERNOR_CONFIG), record(state, GOVERNOR)
    held = _held(c, record(grasped, OBJECT))
    at = along(c, c.duration, s.time, Reference(ZERO, mat(R), spatial(twist), spatial(acceleration)))
    seen = Pad(vec(x_e), mat(R_ee), spatial(v_ee), spatial(record(pad, PAD).feedback))
    g.run(c, s, records(grid, GRID_POINT), held, at, seen, most_rate, dt)


@kernel(VOID, IN1, IN1, IN2, IN1, IN1, OUT1)
def _reference(config, state, R, twist, acceleration, out):
    c, s = record(config, GOVERNOR_CONFIG), record(state, GOVERNOR)
    at = Reference(ZERO, mat(R), spatial(twist), spatial(acceleration))
    v, a = g.governed(c, s, along(c, c.duration, s.out_time, at))
    put_spatial(out[:6], v)
    put_spatial(out[6:], a)


@kernel(VOID, IN1, OUT1, OUT1)
def _plan(config, state, grid):
    c, s = record(config, GOVERNOR_CONFIG), record(state, GOVERNOR)
    g.plan(c, s, records(grid, GRID_POINT))


@kernel(VOID, OUT1, REAL, INT)
def _record_load(pad, measured, now_ns):
    p = record(pad, PAD)
    remember(p.friction, now_ns, measured, p.commanded)


@kernel(VOID, IN1, OUT1, INT, REAL)
def _slip(config, pad, stamp_ns, speed):
    c, p = record(config, GOVERNOR_CONFIG), record(pad, PAD)
    slip_sample(c.friction, p.contact, p.friction, stamp_ns, Spatial(Vec(speed, 0.0, 0.0), ZERO), False)


@kernel(REAL, IN1, OUT1, OUT1, IN1, IN2, IN1, IN1, IN1)
def _hold_back(config, state, pad, grasped, R, w, a_C, a_d):
    c, s = record(config, GOVERNOR_CONFIG), record(state, GOVERNOR)
    held = _held(c, record(grasped, OBJECT))
    p = record(pad, PAD)
    return hold_back(c, s.ceiling, p, held, mat(R), vec(w), spatial(a_C), spatial(a_d), s.contact.slipping != 0)


@kernel(VOID, IN1, IN1, IN2, IN1, IN1, OUT1)
def _load(config, grasped, R, w, a, out):
    c = record(config, GOVERNOR_CONFIG)
    put_spatial(out, load(_held(c, record(grasped, OBJECT)), mat(R), vec(w), spatial(a)))


class Governor:
    """One governor and its path; `before` and `after` the law, every cycle."""

    def __init__(self, path, case, dt=1e-3, **changes):
        self.path, self.case, self.dt = path, case, dt
        self.buffers = (
            configuration(case, **{"duration": path.duration, **changes}),
            new(GOVERNOR),
            np.zeros(GRID_POINTS * GRID_POINT.itemsize // 8),
            new(PAD),
        )
        config, state, grid, pad = self.buffers
        self.config, self.state, self.pad = record(config, GOVERNOR_CONFIG), record(state, GOVERNOR), record(pad, PAD)
        self.points = records(grid, GRID_POINT)
        self.grasped = new(OBJECT)
        grasped = record(self.grasped, OBJECT)
        grasped.mass, grasped.inertia, grasped.r = case.mass, case.inertia, case.r
        _start(config, state, pad, self.grasped, np.ascontiguousarray(path.start))
        self.sample()

    def sample(self):
        for i in range(GRID_POINTS):
            _, R, v, a = self.path.at(sample_time(self.config.mode, i, float(self.state.duration)))
            _sample(*self.buffers[:3], self.grasped, i, np.ascontiguousarray(R), v, a)

    def plan(self):
        """Plan the path; a cycle does it too."""
        _plan(*self.buffers[:3])
        return self

    def before(self, x=None, R=None, v=None, most_rate=1e3):
        """Do the planning and the step; return position, attitude, twist, acceleration of the reference."""
        p_s, R_s, v_s, a_s = self.path.at(float(self.state.time))
        x, R = p_s if x is None else x, R_s if R is None else R
        v = float(self.state.rate) * v_s if v is None else v
        config, state, grid, pad = self.buffers
        there = np.ascontiguousarray(R_s), v_s, a_s, x - p_s, np.ascontiguousarray(R), np.asarray(v, float)
        _before(config, state, grid, pad, self.grasped, *there, most_rate, self.dt)
        p, R_d, v_d, a_d = self.path.at(float(self.state.out_time))
        out = np.zeros(12)
        _reference(config, state, np.ascontiguousarray(R_d), v_d, a_d, out)
        return p, R_d, out[:6], out[6:]

    def record_load(self, h_ee, now_ns):
        weights = np.where(np.arange(6) < 3, 1.0, 1.0 / self.case.radius) * self.case.axes
        _record_load(self.buffers[3], float(np.linalg.norm(weights * h_ee)), now_ns)

    def after(self, a_C, a_d, R, w):
        config, state, _, pad = self.buffers
        return _hold_back(config, state, pad, self.grasped, np.ascontiguousarray(R), w, a_C, a_d)

    def slip(self, stamp_ns, speed):
        config, _, _, pad = self.buffers
        before = self.pad.friction.events
        _slip(config, pad, stamp_ns, speed)
        return self.pad.friction.events > before

    def load_of(self, R, w, a):
        out = np.empty(6)
        _load(self.buffers[0], self.grasped, np.ascontiguousarray(R), w, a, out)
        return out
