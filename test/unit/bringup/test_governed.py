"""The governor in the product's own simulation: nothing slips, and what friction cannot carry is refused."""

from dataclasses import dataclass

import numpy as np
import pytest

from slip_vic.run.in_process import ClosedLoop, run_in_process
from slip_vic.scenarios.scenario import load_scenario
from slip_vic_controller.safety.conditions import Reason
from slip_vic_controller.safety.modes import Mode
from slip_vic_controller.session.cycle_result import CycleResult

HELD_M = 1e-7
"""Slip of a grasp that holds: rounding of the friction's projection."""


@dataclass
class Run:
    """The largest slip and load over friction of a run, and its end."""

    slip_m: float
    load_ratio: float
    end: CycleResult


def run(scenario: str, *assignments: str, sensor: str = "", seconds: float) -> Run:
    """Run a scenario governed."""
    given = (*assignments, f"bridge.duration_s={seconds}")
    slip = load = 0.0
    for tick in run_in_process(load_scenario(scenario, law="governed", sensor=sensor, assignments=given)):
        slip = max(slip, float(np.linalg.norm(tick.outputs.truth.slip_displacement[:3])))
        load = max(load, float(tick.result.record.governor.load_ratio))
    return Run(slip, load, tick.result)


@pytest.mark.parametrize(
    ("scenario", "seconds"), [("paper_planar", 3.0), ("glass_transport", 2.0), ("vertical_plane", 2.0)]
)
def test_nominal_runs_do_not_slip(scenario: str, seconds: float) -> None:
    done = run(scenario, seconds=seconds)
    assert done.slip_m < HELD_M
    assert done.load_ratio <= 1.0 + 1e-9
    assert done.end.record.law.error_linear < 1e-3
    assert done.end.mode == Mode.ACTIVE, done.end.reason
    assert done.end.record.governor.friction_events == 0


def test_less_friction_is_learnt() -> None:
    """40 % less than configured, found by the slip sensor alone."""
    less = "bridge.friction.mu_s=0.3", "bridge.friction.mu_k=0.24", "controller.slip_estimator=measured"
    done = run("paper_planar", *less, sensor="optical_flow_120", seconds=4.0)
    assert 0.0 < done.slip_m < 4e-4
    assert done.end.record.governor.friction_events >= 1
    assert done.end.record.law.error_linear < 1e-3


def test_off_equals_printed_law() -> None:
    printed, off = (
        load_scenario("paper_planar", law=kind, assignments=("bridge.duration_s=0.3", *extra))
        for kind, extra in (("vic", ()), ("governed", ("controller.governor.mode=off", "controller.gains.spin=follow")))
    )  # fmt: skip
    pairs = zip(run_in_process(printed), run_in_process(off), strict=True)
    assert all(a.result.command.numbers.tobytes() == b.result.command.numbers.tobytes() for a, b in pairs)


@pytest.mark.parametrize(
    ("law", "handover", "least_m", "most_m", "lost"),
    [
        ("governed", "hold", 0.0, 5e-3, False), ("governed", "follow", 0.02, 0.3, False),
        ("governed_follow", "open", 0.0, 5e-3, True),
    ],
)  # fmt: skip
def test_hand_at_the_goal(law: str, handover: str, least_m: float, most_m: float, lost: bool) -> None:
    """A hand pulls with less than friction passes on, for a second."""
    given = f"controller.handover={handover}", "bridge.duration_s=5.0"
    loop = ClosedLoop(scenario := load_scenario("paper_planar", law=law, sensor="event_1000", assignments=given))
    places, said = [], set[str]()
    for tick in run_in_process(scenario, loop):
        places.append(tick.outputs.arms[0].joint.position.copy())
        said |= {Reason(tick.result.record.mode.reason.reason).name} if tick.time_s > 3.5 else set()
        if len(places) in (3500, 4500):
            force = 0.18 if len(places) == 3500 else 0.0
            loop.bridge.simulation.push(0, np.array([force, 0.0, 0.0, 0.0, 0.0, 0.0]), np.zeros(0))
    assert "HAND" in said
    frame = loop.controller.controller.robot.frame
    moved = np.linalg.norm(frame(places[-1])[0] - frame(places[3499])[0])
    assert least_m <= moved <= most_m
    assert (loop.bridge.lost is not None) == lost
