"""Gains and payload that change while the law runs: no kick, refused as a whole; k_s gives way to measured delays."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest

from slip_core.errors import InputError
from slip_core.params import build
from slip_vic_controller.params.controller_params import ControllerParams
from slip_vic_controller.safety.conditions import Mode, Request
from slip_vic_controller.session.cycle_result import CycleResult
from test.support.made_up import MadeUp

REST = np.zeros(7)
LET_BE = {"safety__load__drop_speed": 10.0, "safety__inputs__frozen_s": 5.0}
"""An arm that stands still whatever its effort, with a wrench to match, would be taken for what it is."""
STIFF = {"gains__stiffness": (20.0,) * 6, "gains__damping": (5.0,) * 6}
WEIGHT = np.array([0.0, 0.0, -4.9, 0.0, 0.0, 0.0])


def params(**values: Any) -> ControllerParams:
    given = {name.replace("__", "."): value for name, value in (LET_BE | values).items()}
    return build(ControllerParams, given, "test")


def new_session(**values: Any) -> MadeUp:
    return MadeUp(**LET_BE, **values)


def step(made_up: MadeUp) -> CycleResult:
    """Answer a joint state at rest, a millisecond later."""
    return made_up.cycle(made_up.joint(velocity=REST), WEIGHT, np.zeros(6))


def test_a_change_reaches_the_law_without_a_kick() -> None:
    made_up = new_session()
    step(made_up)
    made_up.state.law.start_position[0] += 0.02  # the arm is 20 mm off its goal
    efforts, stiffness = [], []
    for k in range(1, 1200):
        if k == 50:
            made_up.session.retune(params(**STIFF))
        result = step(made_up)
        efforts.append(result.command.numbers)
        stiffness.append(float(result.record.gains.gains.K_D[0]))
    whole = np.abs(efforts[-1] - efforts[20]).max()
    assert (stiffness[0], stiffness[-1]) == (5.0, 20.0)
    assert whole > 0.1, "a change without consequence proves nothing"
    assert np.abs(np.diff(efforts[20:], axis=0)).max() < 0.02 * whole


def test_a_refused_change_leaves_everything_as_it_was() -> None:
    made_up = new_session()
    for _ in range(5):
        step(made_up)
    before = made_up.session.buffer.tobytes()
    with pytest.raises(InputError, match="k_s"):
        made_up.session.retune(params(gains__k_s=0.5, **STIFF))
    with pytest.raises(InputError, match="restart the node"):
        made_up.session.retune(params(nullspace__stiffness=3.0))
    with pytest.raises(InputError, match=r"holding arm and object needs .* N m on .*, its limit is"):
        made_up.session.retune(params(object__mass=100.0))
    assert made_up.session.buffer.tobytes() == before


def test_gains_that_were_changed_before_the_law_begins_are_ramped_to() -> None:
    made_up = new_session()
    made_up.session.retune(params(**STIFF))
    stiffness = [float(step(made_up).record.gains.gains.K_D[0]) for k in range(1000)]
    assert stiffness[0] == 5.0
    assert stiffness[-1] == 20.0
    assert all(b >= a for a, b in itertools.pairwise(stiffness))


def test_a_contact_moves_no_faster_than_the_pad_may() -> None:
    made_up = new_session()
    step(made_up)
    made_up.session.retune(params(contacts__position=(0.92, 0.0, 0.0)))
    first, *rest = (step(made_up).record.gains.contact_position[0] for k in range(1, 500))
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
    for made_up in (changed, started, kept):
        step(made_up)
        made_up.session.request(Request.HOLD)
    efforts = []
    for k in range(1, 2600):
        if k == 1200:
            changed.session.retune(params(**new))
        changed.state.hold.posture[:] = started.state.hold.posture  # which follows the joints where efforts are limited
        efforts = [step(made_up).command.numbers for made_up in (changed, started, kept)]
    assert all(made_up.session.mode == Mode.HOLD for made_up in (changed, started, kept))
    assert np.abs(efforts[2] - efforts[1]).max() > 0.1, "the change matters"
    np.testing.assert_allclose(efforts[0], efforts[1], atol=1e-9)
