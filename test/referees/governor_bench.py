"""The governor as a cycle calls it, with a path in plain numpy: entries of the compiled parts for tests."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from slip_core.compiled import part
from slip_core.records import new, record
from slip_core.vectors import Spatial, mat, put_spatial, spatial, vec
from slip_vic_controller.reference import governor as g
from slip_vic_controller.reference.friction_estimate import LOAD_HISTORY, Friction, slip_sample
from slip_vic_controller.reference.load import ALONE, Held, load, size, surface
from slip_vic_controller.reference.path_grid import GRID_POINTS, PATH_GRID, Along, Governing, along

PAPER_PLANAR = SimpleNamespace(
    mass=0.5, inertia=np.diag([2e-3] * 3), r=np.array([-0.02, 0.0, 0.0]), radius=0.03, force=0.25,
    axes=np.array([1.0, 1, 0, 0, 0, 1]), gravity=np.array([0, 0, -9.81]),
)  # fmt: skip
"""The object of `paper_planar` on pad axes, which are turned by half a turn about the normal."""


def configuration(case, **changes):
    """Return a GOVERNOR_CONFIG buffer of a case with the defaults of the page."""
    buffer = new(g.GOVERNOR_CONFIG)
    config = record(buffer, g.GOVERNOR_CONFIG)
    config.mode, config.margin, config.path_margin, config.given_up = Governing.SLOW_DOWN, 0.95, 0.97, 0.985
    config.radius, config.slip_axes[:], config.gravity[:] = case.radius, case.axes, case.gravity
    config.duration, config.length, config.floor, config.most_grip = 2.0, 0.1, 0.05, 1.0
    config.most_speed = config.most_turning = 1e3
    config.points_per_cycle, config.window = 25, 1
    e = config.estimate
    e.friction, e.told, e.kept, e.least, e.probe = Friction.LEARNT, case.force, 0.95, 0.02 * case.force, 0.01
    e.threshold, e.quiet_ns, e.sensor_delay_ns, e.trust = 5e-5, 50_000_000, 0, 0.5
    e.friction = changes.pop("estimator", e.friction)
    for name, value in changes.items():
        target = e if name in e.dtype.names else config
        target[name] = value
    return buffer


@part
def _start(config, state, history, held, R):
    weights = surface(spatial(config.slip_axes), config.radius)
    nothing = spatial(np.zeros(6))
    at_rest = load(held, weights, R, nothing.linear, vec(config.gravity), nothing)
    g.start_governor(config, state, history, size(at_rest))


@part
def _before(config, state, grid, held, time, R, twist, acceleration, x_e, R_ee, v_ee, most_rate, dt):
    at = along(config, config.duration, time, R, twist, acceleration)
    g.run(config, state, grid, held, at, g.Pad(x_e, R_ee, v_ee), most_rate, dt)


@part
def _reference(config, state, time, R, twist, acceleration, out):
    at = along(config, config.duration, time, R, twist, acceleration)
    v, a = g.governed(state, at)
    put_spatial(out[:6], v)
    put_spatial(out[6:], a)


@part
def _plan_all(config, state, grid):
    for _ in range(100 * GRID_POINTS):
        if state.phase != g.Phase.READY:
            g.plan(config, state, grid)


def compiled_held(case):
    return Held(case.mass, mat(np.ascontiguousarray(case.inertia)), vec(case.r), ALONE)


class Governor:
    """One governor and its path; `before` and `after` the law, every cycle."""

    def __init__(self, path, case, dt=1e-3, **changes):
        self.path, self.case, self.dt = path, case, dt
        self.buffers = (
            configuration(case, **{"duration": path.duration, **changes}),
            new(g.GOVERNOR),
            new(PATH_GRID),
            new(LOAD_HISTORY),
        )
        layouts = (g.GOVERNOR_CONFIG, g.GOVERNOR, PATH_GRID, LOAD_HISTORY)
        views = [record(b, d) for b, d in zip(self.buffers, layouts, strict=True)]
        self.config, self.state, self.grid, self.history = views
        self.held = compiled_held(case)
        _start(self.config, self.state, self.history, self.held, mat(path.start))
        self.sample()

    def sample(self):
        while g.wants_points(self.state):
            _, R, v, a = self.path.at(g.wanted_time(self.config, self.state))
            g.next_point(self.config, self.state, self.grid, self.held, mat(R), spatial(v), spatial(a))

    def plan(self):
        """Plan to the end at once."""
        _plan_all(self.config, self.state, self.grid)
        return self

    @property
    def points(self):
        return self.grid.points

    def before(self, x=None, R=None, v=None, most_rate=1e3):
        """Do the planning and the step; return position, attitude, twist, acceleration of the reference."""
        p_s, R_s, v_s, a_s = self.path.at(float(self.state.time))
        x, R = p_s if x is None else x, R_s if R is None else R
        v = float(self.state.rate) * v_s if v is None else v
        _before(
            self.config, self.state, self.grid, self.held, float(self.state.time), mat(R_s), spatial(v_s),
            spatial(a_s), vec(x - p_s), mat(np.ascontiguousarray(R)), spatial(v), most_rate, self.dt,
        )  # fmt: skip
        p, R_d, v_d, a_d = self.path.at(float(self.state.out_time))
        out = np.zeros(12)
        _reference(self.config, self.state, float(self.state.out_time), mat(R_d), spatial(v_d), spatial(a_d), out)
        return p, R_d, out[:6], out[6:]

    def feel(self, h_ee, now_ns):
        g.feel(self.config, self.state, self.history, spatial(h_ee), now_ns)

    def after(self, a_C, a_d, R, w):
        R = mat(np.ascontiguousarray(R))
        return g.hold_back(self.config, self.state, self.held, R, vec(w), spatial(a_C), spatial(a_d))

    def slip(self, stamp_ns, speed):
        return slip_sample(self.config.estimate, self.state.estimate, self.history, stamp_ns, speed)

    def load_of(self, R, w, a):
        weights = surface(spatial(np.array(self.config.slip_axes)), float(self.config.radius))
        l = load(self.held, weights, mat(np.ascontiguousarray(R)), vec(w), vec(self.case.gravity), spatial(a))  # noqa: E741
        return np.concatenate(l)


__all__ = ["PAPER_PLANAR", "Along", "Friction", "Governing", "Governor", "Spatial"]
