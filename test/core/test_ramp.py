"""Gains and payload that change at run time: no kick, stable on the way, refused as a whole."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest

from slip_core.errors import InputError
from slip_core.params import build
from slip_core.types import JointSample, SlipSample, WrenchSample
from slip_vic_controller.core.controller import VicController
from slip_vic_controller.core.ramp import make_ramp, ramp_time, tuning_at
from slip_vic_controller.core.tuning import gain_report, make_tuning
from slip_vic_controller.params import ControllerParams

from .small_arm import HOME, small_arm_urdf

MS = 1_000_000
ROUNDING = 1e-12
STIFF = {"gains.stiffness": (20.0,) * 6, "gains.damping": (5.0,) * 6}


def params(**values: Any) -> ControllerParams:
    return build(ControllerParams, {name.replace("__", "."): value for name, value in values.items()}, "test")


def tuning(**values: Any):
    given = params(**values)
    return make_tuning(given, gain_report(given).used)


def random_gains(rng: np.random.Generator) -> dict[str, Any]:
    return {
        "gains.stiffness": tuple(10.0 ** rng.uniform(0.0, 2.0, 6)),
        "gains.damping": tuple(10.0 ** rng.uniform(0.5, 1.5, 6)),
        "gains.inertia": tuple(10.0 ** rng.uniform(-0.5, 0.5, 6)),
        "gains.k_s": float(rng.uniform(10.0, 1000.0)),
        "object.mass": float(rng.uniform(0.2, 2.0)),
    }


@pytest.mark.parametrize("seed", range(4))
def test_the_lyapunov_function_never_grows_on_the_way(seed: int) -> None:
    """V of the module along the exact response of every axis, with the gains that the ramp gives at every step."""
    rng = np.random.default_rng(seed)
    start, target = tuning(**random_gains(rng)), tuning(**random_gains(rng))
    ramp = make_ramp(start, target, 0, 1e-3)
    ends = [t.gains.D_D / t.gains.M_D for t in (start, target)]
    a = 0.5 * np.minimum(*ends)
    e, e_dot = rng.normal(size=6), rng.normal(size=6)
    steps = 500
    dt = 1e-9 * ramp.duration_ns / steps
    largest_rate = max(
        np.sqrt((t.gains.K_D / t.gains.M_D).max()) + (t.gains.D_D / t.gains.M_D).max() for t in (start, target)
    )
    inner = max(1, min(200, int(np.ceil(dt * largest_rate / 0.05))))
    last = None
    for k in range(steps):
        gains = tuning_at(ramp, round(k * dt * 1e9)).gains
        stiffness, damping = gains.K_D / gains.M_D, gains.D_D / gains.M_D
        V = 0.5 * (e_dot + a * e) ** 2 + 0.5 * (stiffness + a * damping - a * a) * e * e
        assert last is None or (last * (1.0 + 1e-3 * inner) + 1e-300 >= V).all()
        last = V
        for _ in range(inner):
            e_dot = e_dot + dt / inner * (-damping * e_dot - stiffness * e)
            e = e + dt / inner * e_dot


def test_ends_are_exact_and_the_way_is_monotone() -> None:
    start, target = tuning(), tuning(**STIFF, object__mass=0.8)
    ramp = make_ramp(start, target, 5 * MS, 0.2)
    assert tuning_at(ramp, 5 * MS) is start
    assert tuning_at(ramp, 5 * MS + ramp.duration_ns) is target
    stiffness = [tuning_at(ramp, 5 * MS + k * ramp.duration_ns // 50).gains.K_D[0] for k in range(51)]
    assert all(b > a for a, b in itertools.pairwise(stiffness))


def test_a_harder_change_takes_longer_and_a_softer_one_only_the_least_time() -> None:
    soft, hard = tuning().gains, tuning(**STIFF).gains
    assert ramp_time(soft, hard) > 0.3
    assert ramp_time(hard, soft) == 0.0
    assert make_ramp(tuning(**STIFF), tuning(), 0, 0.2).duration_ns == 200 * MS


def running(seconds: float, change_at: float, **values: Any):
    """Efforts of an arm 20 mm off its goal that stands still, with a change of parameters on the way."""
    controller = VicController(params(), small_arm_urdf())
    rest = np.zeros(7)
    state = controller.initial_state(JointSample(0, np.array(HOME), rest, rest))
    state = state._replace(start_position=state.start_position + np.array([0.02, 0.0, 0.0]))
    efforts, stiffness = [], []
    for k in range(1, round(seconds * 1000)):
        if k == round(change_at * 1000):
            state = controller.retune(state, params(**values))
        joint = JointSample(k * MS, np.array(HOME), rest, rest)
        wrench = (WrenchSample(k * MS, np.array([0.0, 0.0, -4.9, 0.0, 0.0, 0.0])),)
        result = controller.step(state, joint, wrench, (SlipSample(k * MS, np.zeros(6)),))
        state = result.state
        efforts.append(result.command.effort)
        assert result.diagnostics.terms is not None
        stiffness.append(result.diagnostics.terms.gains.K_D[0])
    return np.array(efforts), np.array(stiffness)


def test_a_change_reaches_the_law_without_a_kick() -> None:
    efforts, stiffness = running(1.2, 0.05, **STIFF)
    whole = np.abs(efforts[-1] - efforts[0]).max()
    assert stiffness[0] == 5.0
    assert stiffness[-1] == 20.0
    assert whole > 0.1, "a change without consequence proves nothing"
    assert np.abs(np.diff(efforts, axis=0)).max() < 0.02 * whole


def test_a_refused_change_leaves_everything_as_it_was() -> None:
    controller = VicController(params(gains__k_s_mode="fixed"), small_arm_urdf())
    state = controller.initial_state(JointSample(0, np.array(HOME), np.zeros(7), np.zeros(7)))
    with pytest.raises(InputError, match="k_s"):
        controller.retune(state, params(gains__k_s_mode="fixed", gains__k_s=5000.0, **STIFF))
    assert state.ramp is None
    joint = JointSample(MS, np.array(HOME), np.zeros(7), np.zeros(7))
    wrench, slip = (WrenchSample(0, np.zeros(6)),), (SlipSample(MS, np.zeros(6)),)
    fresh = VicController(params(gains__k_s_mode="fixed"), small_arm_urdf())
    assert (
        controller.step(state, joint, wrench, slip).command.effort
        == fresh.step(state, joint, wrench, slip).command.effort
    ).all()


def test_k_s_gives_way_to_delays_that_are_measured_and_not_where_it_is_fixed() -> None:
    used = {}
    for mode in ("auto", "fixed"):
        controller = VicController(params(gains__k_s_mode=mode), small_arm_urdf())
        state = controller.initial_state(JointSample(0, np.array(HOME), np.zeros(7), np.zeros(7)))
        for k in range(1, 60):
            slip = SlipSample((k - 10) * MS, np.zeros(6))
            joint = JointSample(k * MS, np.array(HOME), np.zeros(7), np.zeros(7))
            result = controller.step(state, joint, (WrenchSample(k * MS, np.zeros(6)),), (slip,), None, (slip,))
            state = result.state
        assert result.diagnostics.terms is not None
        used[mode] = result.diagnostics.terms.gains.k_s
    assert used["fixed"] == 1000.0
    assert 70.0 < used["auto"] < 80.0  # half of 2 cos(10 pi / 21) / T = 149.5
