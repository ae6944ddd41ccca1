"""Two arms on one object in one controller: one path, one mode, and what each knows of the other."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from slip_core.arrays import matrix_from_quat_xyzw
from slip_sim_bridge.session import internal_wrenches
from slip_vic.run.in_process import ClosedLoop, Tick, run_in_process
from slip_vic.scenarios.scenario import LAWS, Scenario, load
from slip_vic_controller.config.controller import Controller
from slip_vic_controller.safety.conditions import Mode, Request

UPRIGHT, FLAT = "pane_two_arms_upright", "pane_two_arms_flat"
SOON = ("controller.trajectory.start_s=0.0",)


def ticks(loop: ClosedLoop, count: int) -> Iterator[Tick]:
    """Run a loop for some ticks."""
    for _ in range(count):
        outputs = loop.bridge.observe()
        results = loop.answer(outputs)
        yield Tick(outputs, results)
        loop.bridge.advance([result.command for result in results])


def slipped(loop: ClosedLoop) -> list[float]:
    """Return how far each pad has slipped [m]."""
    truths = [loop.bridge.simulation.observe(side).truth for side in range(2)]
    return [float(np.linalg.norm(truth.slip_displacement[:3])) for truth in truths]


def grasped(scenario: Scenario, tick: Tick) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Return where both pads are on the object and how they stand {w}: grasp and slip, without the pads' deflection."""
    x_o, R_o, places, attitudes = tick.outputs.truth.object_position, tick.outputs.truth.object_rotation, [], []
    for arm, reading in zip(scenario.bridges.values(), [arm.readings for arm in tick.outputs.arms], strict=True):
        slip = reading.truth.slip_displacement
        R_p = R_o @ matrix_from_quat_xyzw(arm.contacts.orientation_xyzw)
        places.append(x_o + R_o @ np.array(arm.contacts.position) + R_p @ slip[:3])
        attitudes.append(R_p @ Rotation.from_rotvec(np.array(slip[3:])).as_matrix())
    return places, attitudes


@pytest.mark.parametrize(("law", "bias"), [("classical", 0.2), ("governed", 0.0)])
def test_internal_force_is_no_bias(law: str, bias: float) -> None:
    """Half of a bias is taken off each wrench, so that their sum is right."""
    biased = f"left.bridge.sensors.wrench.bias=[0.0, 0.0, {bias}, 0.0, 0.0, 0.0]"
    loop = ClosedLoop(load(FLAT, law=law, drive="velocity_500", set=(biased,)))
    for tick in ticks(loop, 405):
        results = tick.results
    assert all(result.mode.follows for result in results)
    turned = [np.array(result.arm.rotation) for result in results]
    found = [R @ arm.state.tare.wrench.bias[:3] for R, arm in zip(turned, loop.session.arms, strict=True)]
    np.testing.assert_allclose(np.sum(found, axis=0), [0.0, 0.0, bias], atol=0.01)
    np.testing.assert_allclose(found[0], found[1], atol=0.01)


def test_arms_weigh_together() -> None:
    """Together: a share of what their wrenches add up to, and no torque of it, since torques are not compared."""
    mass = 1.3 * load(FLAT, law="vic").controllers["left"].object.mass
    heavier = (f"bridge.object.mass={mass}", "controller.tare.duration_s=0.3")
    loop = ClosedLoop(load(FLAT, law="classical", set=heavier))
    for tick in ticks(loop, 800):
        results = tick.results
    assert all(result.mode.follows for result in results), [result.reason for result in results]
    for arm in loop.session.arms:
        assert arm.state.tare.mass_share == pytest.approx(0.3, abs=0.02)


def test_perfect_sensors_show_internal_wrench() -> None:
    for name in (UPRIGHT, FLAT):
        scenario = load(name, law="vic", set=(*SOON, "controller.trajectory.duration_s=0.8"))
        worst, largest = 0.0, 0.0
        for k, tick in enumerate(run_in_process(scenario)):
            wrenches = [arm.readings.wrench.wrench for arm in tick.outputs.arms]
            centre = tick.outputs.truth.object_position
            true = internal_wrenches(wrenches, *grasped(scenario, tick), centre, 0.015)
            bent = tick.outputs.internal_wrenches(0.015)
            for side, result in enumerate(tick.results):
                worst = max(worst, float(np.abs(result.record.law.h_int - true[side]).max()))
                largest = max(largest, float(np.abs(bent[side] - true[side]).max()))
            if k == 100:
                break
        assert worst < 1e-6, name
        assert largest < 5e-3, name  # what the deflection of the pads, which no sensor sees, makes of it


def test_both_pads_follow_the_object_path() -> None:
    scenario = load(UPRIGHT, law="vic", set=SOON)
    start, far, way = None, 0.0, []
    for k, tick in enumerate(run_in_process(scenario)):
        left, right = (result.record.reference for result in tick.results)
        apart = left.rotation.T @ (right.position - left.position)
        turned = left.rotation.T @ right.rotation
        start = (apart, turned, left.position.copy()) if start is None else start
        way.append((right.position.copy(), right.twist.copy(), right.acceleration.copy()))
        np.testing.assert_allclose(apart, start[0], atol=1e-9)
        np.testing.assert_allclose(turned, start[1], atol=1e-9)
        far = max(far, float(np.linalg.norm(left.position - start[2])))
        if k == 500:
            break
    assert far > 0.02
    x, v, a = (np.array(column) for column in zip(*way, strict=True))
    np.testing.assert_allclose((x[2:] - x[:-2]) / 2e-3, v[1:-1, :3], atol=1e-5)  # velocity and acceleration agree
    np.testing.assert_allclose((v[2:] - v[:-2]) / 2e-3, a[1:-1], atol=1e-4)


def test_weaker_pad_governs_both() -> None:
    loop = ClosedLoop(load(UPRIGHT, law="governed", set=(*SOON, "controller.trajectory.duration_s=1.2")))
    slowed = False
    for k, tick in enumerate(ticks(loop, 400)):
        left, right = (result.record.governor for result in tick.results)
        if k == 5:
            loop.session.arms[1].state.pad.contact.F_median = 5.5  # one pad is known to be weaker
        assert (left.path_s, left.path_rate) == (right.path_s, right.path_rate)
        slowed = slowed or (k > 20 and left.path_rate < 0.999)
        if k > 20:
            assert left.friction_limit == right.friction_limit == 5.5
            assert left.load_commanded <= 5.5
    assert slowed
    assert max(slipped(loop)) == 0.0


def test_slip_is_shared() -> None:
    loop = ClosedLoop(load(FLAT, law="governed", set=SOON))
    left, right = (result.record.governor for result in list(ticks(loop, 150))[-1].results)
    assert left.load_commanded > 0.05
    assert right.load_commanded == pytest.approx(left.load_commanded, rel=0.1)  # what each learns friction from
    now_ns = loop.bridge.simulation.stamp_ns
    estimate = loop.session.arms[1].state.pad.contact
    estimate.slipping, estimate.slip_ns = 1, now_ns  # what a slip sample of the right pad leaves
    seen = [[result.record.governor.slipping for result in tick.results] for tick in ticks(loop, 100)]
    assert seen[1] == [1.0, 1.0]
    assert seen[-1] == [0.0, 0.0]
    assert max(slipped(loop)) == 0.0


def test_fault_of_one_holds_other() -> None:
    loop = ClosedLoop(load(UPRIGHT, law="vic", set=(*SOON, "controller.safety.resume_after_s=0.05")))
    list(ticks(loop, 60))
    loop.session.arms[0].request(Request.FAILED)
    modes = [tuple(result.mode for result in tick.results) for tick in ticks(loop, 300)]
    assert {mode for mode, _ in modes} == {Mode.FAULT}
    assert {mode for _, mode in modes} == {Mode.HOLD}
    loop.session.request(Request.RESET_FAULT)
    list(ticks(loop, 2))
    loop.session.request(Request.ENABLE)
    assert all(result.mode.follows for result in list(ticks(loop, 3))[-1].results)


@pytest.mark.parametrize("law", ["vic", "classical"])
def test_user_holds_both(law: str) -> None:
    """Each arm then carries its share, also the one that knows its own wrench alone: none of them moves."""
    loop = ClosedLoop(load(UPRIGHT, law=law, set=SOON))
    list(ticks(loop, 300))
    loop.session.request(Request.HOLD)
    run = list(ticks(loop, 1500))
    seen = [tuple(result.mode for result in tick.results) for tick in run]
    assert all(a == b for a, b in seen)
    assert seen[10][0] == Mode.DEGRADED
    assert seen[-1][0] == Mode.HOLD
    assert max(slipped(loop)) < 1e-5
    held = [tick.outputs for tick in run[[a for a, _ in seen].index(Mode.HOLD) :]]
    assert max(float(np.abs(arm.joint.velocity).max()) for outputs in held for arm in outputs.arms) < 0.02


def test_late_wrenches_lower_kappa() -> None:
    late = ("bridge.sensors.wrench.latency_s=0.008",)
    loop = ClosedLoop(load(UPRIGHT, law="vic", set=late))
    record = list(ticks(loop, 60))[-1].results[0].record
    assert record.gains.gains.kappa == pytest.approx(0.38 * 0.4 / (1.0e4 * 0.009**2))
    assert record.gains.gains.kappa < 0.2


def test_laws_set_contacts_and_gains() -> None:
    for law, name in itertools.product(LAWS, (FLAT, UPRIGHT)):
        scenario = load(name, law=law)
        left, right = scenario.controllers.values()
        both = law not in ("classical", "printed")
        assert len(left.contacts.position) == (6 if both else 3)
        assert (left.gains.spin == "bounded") == (law.startswith("governed") or (name == FLAT and law != "printed"))
        assert (left.gains.kappa > 0.0) == (law in ("vic", "governed", "governed_follow"))
        if both:
            assert left.contacts.position[:3] == right.contacts.position[3:]
        Controller(scenario.controllers, scenario.placed, lockstep=True)
