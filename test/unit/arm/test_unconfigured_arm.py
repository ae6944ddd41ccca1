"""An arm of which nothing is configured but a tare: what HOLD, the tare and the law do with what they measure."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from slip_vic.run.in_process import ClosedLoop
from slip_vic.scenarios.scenario import Law, Scenario, load_scenario
from slip_vic_controller.safety.modes import Mode, follows
from slip_vic_controller.session.cycle_result import CycleResult
from test.support.watched_loop import WatchedLoop, with_joints

TARE = "controller.tare.duration_s=0.1"
OFFSET = [0.05, 0.17, -0.01, 0.18, 0.12, 0.12, -0.19]


def scenario_of(name: str, *assignments: str, law: Law = "governed", drive: str = "ideal") -> Scenario:
    return load_scenario(name, law=law, drive=drive, sensor="event_1000", seed=2, assignments=assignments)


def loop(name: str, *assignments: str, law: Law = "governed", drive: str = "ideal") -> ClosedLoop:
    return ClosedLoop(scenario_of(name, *assignments, law=law, drive=drive))


def until(of: ClosedLoop, wanted: Callable[[Mode], bool], most: int = 700) -> CycleResult:
    """Return the first result in a mode that is wanted."""
    for _ in range(most):
        outputs = of.observe()
        result = of.control(outputs)
        if wanted(result.mode):
            return result
        of.bridge.advance([result.command])
    raise AssertionError(f"the mode stays {result.mode}: {result.reason}")


def test_hold_does_not_tilt_under_torque_offsets() -> None:
    """Of 0.19 N m at the wrist, where HOLD alone gives way by 0.1 rad and a sheet slides off its pads."""
    of = loop("paper_planar", TARE, f"bridge.drive.offset={OFFSET}")
    start, turned = of.bridge.simulation.observe(0).joint.position.copy(), 0.0
    for _ in range(500):
        of.bridge.advance([of.control(of.observe()).command])
        turned = max(turned, float(np.abs(of.bridge.simulation.observe(0).joint.position - start).max()))
    assert turned < 0.03
    assert np.abs(of.controller.state.estimate.effort[:7] - OFFSET).max() < 0.05


def test_velocity_noise_far_above_the_configured_one_does_not_keep_the_tare_from_ending() -> None:
    of = loop("vertical_plane", "bridge.sensors.joint.noise_velocity=0.009", TARE, drive="torque_joint")
    until(of, follows)
    assert of.controller.state.tare.rough


@pytest.mark.parametrize("law", ["governed", "vic"])
@pytest.mark.parametrize("drive", ["ideal", "torque_joint"])
def test_one_wrong_velocity_is_no_collision_and_no_noise(drive: str, law: Law) -> None:
    """At rest, where noise is measured, and in motion: 20 rad/s in one sample made the object fall, and FAULT."""
    slips = []
    for size in (0.0, 20.0):
        wrong, run = size * (np.arange(7) == 3), WatchedLoop(scenario_of("vertical_plane", TARE, law=law, drive=drive))
        for k in range(700):
            off = wrong if k in (20, 500) else 0.0
            result = run.cycle(lambda arm, off=off: with_joints(arm, arm.joint.position, arm.joint.velocity + off))
        assert result.mode.follows, result.reason
        slips.append(run.slip)
    assert slips[1] < slips[0] + 0.5e-3


def test_an_arm_rests_in_a_fault_that_comes_before_its_noise_is_known() -> None:
    """FAULT damps joint velocities as HOLD does: with too little noise configured it kept the wrist moving."""
    of = loop("glass_transport", "bridge.sensors.joint.noise_velocity=0.009", TARE, drive="torque_joint")
    until(of, lambda mode: mode is Mode.HOLD)
    of.controller.set_publishers({}, 2)
    fastest = 0.0
    for k in range(500):
        result = of.control(of.observe())
        of.bridge.advance([result.command])
        if k >= 400:
            fastest = max(fastest, float(np.abs(of.bridge.simulation.observe(0).joint.velocity).max()))
    assert result.mode is Mode.FAULT
    assert fastest < 0.01


@pytest.mark.parametrize("share", [-0.35, 0.35])
def test_the_law_works_with_the_mass_that_the_tare_has_found(share: float) -> None:
    known = load_scenario("vertical_plane").controller.object
    of = loop("vertical_plane", TARE, f"bridge.object.mass={(1.0 + share) * known.mass}", "bridge.grip.force=9.0")
    result = until(of, follows)
    used = result.record.gains.object
    assert used.mass == pytest.approx((1.0 + share) * known.mass, rel=1e-3)
    assert used.inertia[0, 0] == pytest.approx((1.0 + share) * known.inertia[0], rel=1e-3)
    assert result.mode in (Mode.ACTIVE, Mode.DEGRADED)
