"""Gains and payload that change while the law runs: no kick, refused as a whole; k_s gives way to measured delays."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest

from slip_core.errors import InputError
from slip_core.params import build
from slip_core.types import JointSample, SlipSample, WrenchSample
from slip_vic_controller.params.controller_params import ControllerParams
from slip_vic_controller.safety.modes import Mode, Request
from slip_vic_controller.session.cycle_result import CycleResult
from test.support.one_arm import OneArm, one_arm
from test.support.small_arm import HOME, small_arm_urdf

MS = 1_000_000
REST = np.zeros(7)
LET_BE = {"safety.load.drop_speed": 10.0, "safety.inputs.frozen_s": 5.0}
"""An arm that stands still whatever its effort, with a wrench to match, would be taken for what it is."""
STIFF = {"gains.stiffness": (20.0,) * 6, "gains.damping": (5.0,) * 6}
WEIGHT = np.array([0.0, 0.0, -4.9, 0.0, 0.0, 0.0])


def params(**values: Any) -> ControllerParams:
    return build(ControllerParams, LET_BE | {name.replace("__", "."): value for name, value in values.items()}, "test")


def new_session(**values: Any) -> OneArm:
    return OneArm(one_arm(params(**values), small_arm_urdf(), lockstep=False))


def step(session: OneArm, k: int, slip_age: int = 0) -> CycleResult:
    """Answer a joint state at rest, k ms after the beginning."""
    stamp_ns = (1000 + k) * MS
    session.add_wrench(0, WrenchSample(stamp_ns, WEIGHT + 1e-6 * k), stamp_ns)
    session.add_slip(0, SlipSample(stamp_ns - slip_age * MS, np.zeros(6)), stamp_ns)
    session.add_joint(JointSample(stamp_ns, np.array(HOME), REST, REST), stamp_ns)
    result = session.cycle(stamp_ns)
    assert result is not None
    return result


def test_a_change_reaches_the_law_without_a_kick() -> None:
    session = new_session()
    step(session, 0)
    session.state.law.start_position[0] += 0.02  # the arm is 20 mm off its goal
    efforts, stiffness = [], []
    for k in range(1, 1200):
        if k == 50:
            session.retune(params(**STIFF))
        result = step(session, k)
        efforts.append(result.command.numbers)
        stiffness.append(float(result.record.gains.gains.K_D[0]))
    whole = np.abs(efforts[-1] - efforts[20]).max()
    assert (stiffness[0], stiffness[-1]) == (5.0, 20.0)
    assert whole > 0.1, "a change without consequence proves nothing"
    assert np.abs(np.diff(efforts[20:], axis=0)).max() < 0.02 * whole


def test_a_refused_change_leaves_everything_as_it_was() -> None:
    session = new_session()
    for k in range(5):
        step(session, k)
    before = session.buffer.tobytes()
    with pytest.raises(InputError, match="k_s"):
        session.retune(params(gains__k_s=0.5, **STIFF))
    with pytest.raises(InputError, match="restart the node"):
        session.retune(params(nullspace__stiffness=3.0))
    assert session.buffer.tobytes() == before


def test_gains_that_were_changed_before_the_law_begins_are_ramped_to() -> None:
    session = new_session()
    session.retune(params(**STIFF))
    stiffness = [float(step(session, k).record.gains.gains.K_D[0]) for k in range(1000)]
    assert stiffness[0] == 5.0
    assert stiffness[-1] == 20.0
    assert all(b >= a for a, b in itertools.pairwise(stiffness))


def test_a_contact_moves_no_faster_than_the_pad_may() -> None:
    session = new_session()
    step(session, 0)
    session.retune(params(contacts__position=(0.92, 0.0, 0.0)))
    first, *rest = (step(session, k).record.gains.contact_position[0] for k in range(1, 500))
    speed = np.diff([first, *rest]).max() / 1e-3
    assert rest[-1] == pytest.approx(0.92)
    assert speed == pytest.approx(params().safety.limits.speed_linear, rel=1e-6)


def test_hold_uses_mass_inertia_and_contact_position_of_a_live_change() -> None:
    """Its torque is that of a controller that was started with the new values; before, it kept those of the start."""
    new = {
        "object__mass": 0.9, "object__inertia": (4e-3, 5e-3, 6e-3, 0.0, 0.0, 0.0),
        "contacts__position": (0.03, -0.02, 0.01), "safety__hold_stiffness": 100.0,
    }  # fmt: skip
    changed, started, kept = new_session(), new_session(**new), new_session()
    for session in (changed, started, kept):
        step(session, 0)
        session.request(Request.HOLD)
    efforts = []
    for k in range(1, 2600):
        if k == 1200:
            changed.retune(params(**new))
        efforts = [step(session, k).command.numbers for session in (changed, started, kept)]
    assert all(session.mode == Mode.HOLD for session in (changed, started, kept))
    assert np.abs(efforts[2] - efforts[1]).max() > 0.1, "the change matters"
    np.testing.assert_allclose(efforts[0], efforts[1], atol=1e-9)
