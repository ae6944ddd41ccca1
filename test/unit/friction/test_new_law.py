"""The interface of a friction law is open: one that nobody knows, with a memory of its own, runs in the grasp step."""

from __future__ import annotations

import numpy as np
import pytest
from numba import njit

from slip_core.compiled import part
from slip_core.records import Real, Record, dtype_of, new, record
from slip_core.vectors import Vec
from slip_sim_bridge.friction.limit_surface import projection
from slip_sim_bridge.plant import rigid, rigid_step
from test.unit.bridge.grasp_cases import friction_used, grasp, slip_speed


@part
def _limit(law, speed, normal_force):
    share = 1.0 / (1.0 + speed / law.half_speed)
    return law.mu * normal_force * share, -law.mu * normal_force * share * share / law.half_speed


_project = projection(_limit)


class WeakeningLaw(Record):
    mu: Real
    half_speed: Real  # m/s


class Weakening:
    """F(s) = mu N / (1 + s / half_speed); its state counts steps in stick and in slip."""

    LAYOUT = dtype_of(WeakeningLaw)
    STATEFUL = True
    limit = staticmethod(_limit)

    @staticmethod
    @part
    def steepest_fall(law, normal_force):
        return law.mu * normal_force / law.half_speed

    @staticmethod
    @part
    def solve(law, u_free, A_hat, normal_force, dt, state):
        f_hat, u = _project(law, u_free, A_hat, normal_force)
        moving = u.norm() > 0.0
        return f_hat, u, Vec(state.x, state.y + 1.0, 0.0) if moving else Vec(state.x + 1.0, state.y, 0.0)


def test_a_law_from_outside_is_all_that_the_step_needs(monkeypatch):
    parameters = new(Weakening.LAYOUT)
    law = record(parameters, Weakening.LAYOUT)
    law.mu, law.half_speed = 0.6, 0.2
    module = type(pytest)("weakening")  # a law is a module
    for name in ("LAYOUT", "STATEFUL", "limit", "steepest_fall", "solve"):
        setattr(module, name, getattr(Weakening, name))
    monkeypatch.setattr(rigid_step, "kernel", lambda signature: njit(signature, error_model="numpy"))  # not kept
    monkeypatch.setattr(rigid, "rigid_step", rigid_step.rigid_step.__wrapped__)
    monkeypatch.setattr(rigid, "friction_law", lambda params: (module, parameters))

    simulation = grasp(gravity_on_pad=(1.0, 0.3, 0.0), offset=(0.02, 0.01, 0.0), grip=60.0, substeps=1)
    for _ in range(20):
        simulation.step(None)
    assert simulation.plant._state.tolist() == [20.0, 0.0, 0.0]
    simulation.set_grip_force(7.0)
    for _ in range(60):
        simulation.step(None)
        speed = slip_speed(simulation)
        assert friction_used(simulation) == pytest.approx(0.6 * 7.0 / (1.0 + speed / 0.2), rel=0.01)
    assert speed > 0.05
    assert np.array_equal(simulation.plant._state, (20.0, 60.0, 0.0))
