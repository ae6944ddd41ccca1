"""An arm of which nothing is configured but a tare: what HOLD, the tare and the law do with what they measure."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from slip_vic.run.in_process import ClosedLoop
from slip_vic.scenarios.scenario import Law, Scenario, load
from slip_vic_controller.arm.tare import MOVED
from slip_vic_controller.safety.conditions import Mode, Request, follows
from slip_vic_controller.session.cycle_result import CycleResult
from test.support.watched_loop import WatchedLoop

TARE = "controller.tare.duration_s=0.1"
OFFSET = [0.05, 0.17, -0.01, 0.18, 0.12, 0.12, -0.19]


def scenario_of(name: str, *assignments: str, law: Law = "governed", drive: str = "ideal") -> Scenario:
    return load(name, law=law, drive=drive, sensor="event_1000", seed=2, set=assignments)


def loop(name: str, *assignments: str, law: Law = "governed", drive: str = "ideal") -> ClosedLoop:
    return ClosedLoop(scenario_of(name, *assignments, law=law, drive=drive))


def until(of: ClosedLoop, wanted: Callable[[Mode], bool], most: int = 700) -> CycleResult:
    """Return the first result in a mode that is wanted."""
    for _ in range(most):
        outputs = of.bridge.observe()
        result = of.answer(outputs)[0]
        if wanted(result.mode):
            return result
        of.bridge.advance([result.command])
    raise AssertionError(f"the mode stays {result.mode}: {result.reason}")


def test_hold_bears_torque_offsets() -> None:
    """Of 0.19 N m at the wrist, where HOLD alone gives way by 0.1 rad and a sheet slides off its pads."""
    of = loop("paper_planar", TARE, f"bridge.drive.offset={OFFSET}")
    start, turned = of.bridge.simulation.observe(0).joint.position.copy(), 0.0
    for _ in range(500):
        of.bridge.advance([of.answer(of.bridge.observe())[0].command])
        turned = max(turned, float(np.abs(of.bridge.simulation.observe(0).joint.position - start).max()))
    assert turned < 0.03
    assert np.abs(of.session.arms[0].state.estimate.effort[:7] - OFFSET).max() < 0.05


@pytest.mark.parametrize("share", [-0.35, 0.35])
def test_law_uses_tared_mass(share: float) -> None:
    known = load("vertical_plane", law="vic").controller.object
    of = loop("vertical_plane", TARE, f"bridge.object.mass={(1.0 + share) * known.mass}", "bridge.grip.force=9.0")
    result = until(of, follows)
    used = result.record.gains.object
    assert used.mass == pytest.approx((1.0 + share) * known.mass, rel=1e-3)
    assert used.inertia[0, 0] == pytest.approx((1.0 + share) * known.inertia[0], rel=1e-3)
    assert result.mode in (Mode.ACTIVE, Mode.DEGRADED)


def inverted(arm: Any) -> Any:
    return arm._replace(wrenches=tuple(replace(w, wrench=-w.wrench) for w in arm.wrenches))


@pytest.mark.parametrize(
    ("world", "sensed", "mode", "words", "mass"),
    [
        ((), inverted, Mode.HOLD, "opposite sign", -0.5),
        (("bridge.object.mass=1.0",), None, Mode.HOLD, "object.mass is 0.5, the wrench at rest shows", 1.0),
    ],
)
def test_tare_moves_no_joint(world: tuple[str, ...], sensed: Any, mode: Mode, words: str, mass: float) -> None:
    """An inverted wrench threw the object after 1.17 s."""
    run = WatchedLoop(scenario_of("paper_planar", TARE, *world, drive="torque_joint"))
    start, moved = run.loop.bridge.simulation.observe(0).joint.position.copy(), 0.0
    for _ in range(600):
        result = run.cycle(sensed)
        moved = max(moved, float(np.abs(run.loop.bridge.simulation.observe(0).joint.position - start).max()))
    assert words in result.reason
    assert result.record.mode.reason.value == pytest.approx(mass, rel=1e-3)
    assert result.mode == mode
    assert moved < MOVED


def test_too_heavy_stays_refused() -> None:
    """No drive holds 5 kg here: the arm sinks to where it could be held, and no command may begin there by itself."""
    run = WatchedLoop(scenario_of("paper_planar", TARE, "object.mass=5.0", drive="torque_joint"))
    for _ in range(330):
        result = run.cycle(None)
        assert not len(result.numbers)
    assert result.mode == Mode.WAITING_INPUT
    assert "holding arm and object needs" in result.reason
    run.loop.session.arms[0].request(Request.ENABLE)
    assert len(run.cycle(None).numbers), "it can be held where it is now"
