"""The governor in the product's own simulation: nothing slips, and what friction cannot carry is refused."""

import numpy as np
import pandas as pd
import pytest

from slip_vic.run.in_process import ClosedLoop, run_in_process
from slip_vic.run.run import Run
from slip_vic.scenarios.scenario import load
from slip_vic_controller.safety.conditions import Reason

HELD_M = 1e-7
"""Slip of a grasp that holds: rounding of the friction's projection."""


def run(scenario: str, *assignments: str, sensor: str = "", seconds: float) -> tuple[Run, pd.Series]:
    """Return a governed run, and its last tick."""
    given = (*assignments, f"bridge.duration_s={seconds}")
    done = load(scenario, law="governed", sensor=sensor, set=given).run()
    return done, done.frame().iloc[-1]


@pytest.mark.parametrize(
    ("scenario", "seconds"), [("paper_planar", 3.0), ("glass_transport", 2.0), ("vertical_plane", 2.0)]
)
def test_nominal_runs_do_not_slip(scenario: str, seconds: float) -> None:
    done, end = run(scenario, seconds=seconds)
    assert done.worst("slip_linear_peak_m") < HELD_M
    assert done.frame()["load_ratio"].max() <= 1.0 + 1e-9
    assert np.linalg.norm(end[["e_x", "e_y", "e_z"]].astype(float)) < 1e-3
    assert done.modes[""][-1][1] == "ACTIVE"
    assert end["friction_events"] == 0


def test_less_friction_is_learnt() -> None:
    """40 % less than configured, found by the slip sensor alone."""
    less = "bridge.friction.mu_s=0.3", "bridge.friction.mu_k=0.24", "controller.slip_estimator=measured"
    done, end = run("paper_planar", *less, sensor="optical_flow_120", seconds=4.0)
    assert 0.0 < done.worst("slip_linear_peak_m") < 4e-4
    assert end["friction_events"] >= 1
    assert np.linalg.norm(end[["e_x", "e_y", "e_z"]].astype(float)) < 1e-3


def test_off_equals_printed_law() -> None:
    printed, off = (
        load("paper_planar", law=kind, set=("bridge.duration_s=0.3", *extra))
        for kind, extra in (("vic", ()), ("governed", ("controller.governor.mode=off", "controller.gains.spin=follow")))
    )  # fmt: skip
    pairs = zip(run_in_process(printed), run_in_process(off), strict=True)
    assert all(a.result.command.numbers.tobytes() == b.result.command.numbers.tobytes() for a, b in pairs)


@pytest.mark.parametrize(
    ("law", "handover", "pull", "least_m", "most_m", "lost"),
    [
        ("governed", "hold", 0.18, 0.0, 5e-3, False), ("governed", "follow", 0.18, 0.02, 0.3, False),
        ("governed_follow", "open", 0.18, 0.0, 5e-3, True), ("governed_follow", "follow", 2.0, 0.1, 0.3, False),
        ("governed_follow", "open", 0.05, 0.0, 5e-3, False),
    ],
)  # fmt: skip
def test_hand_at_the_goal(law: str, handover: str, pull: float, least_m: float, most_m: float, lost: bool) -> None:
    """A hand pulls with what friction passes on, for a second; what the wrench may be off by is no hand."""
    given = f"controller.handover={handover}", "bridge.duration_s=5.0"
    loop = ClosedLoop(scenario := load("paper_planar", law=law, sensor="event_1000", set=given))
    places, said = [], set[str]()
    for tick in run_in_process(scenario, loop):
        places.append(tick.outputs.arms[0].joint.position.copy())
        said |= {Reason(tick.result.record.mode.reason.reason).name} if tick.time_s > 3.5 else set()
        if len(places) in (3500, 4500):
            force = pull if len(places) == 3500 else 0.0
            loop.bridge.simulation.push(0, np.array([force, 0.0, 0.0, 0.0, 0.0, 0.0]), np.zeros(0))
    assert ("HAND" in said) == (pull > scenario.controller.wrench_sensor.bias_force)
    frame = loop.session.arms[0].controller.robot.frame
    moved = np.linalg.norm(frame(places[-1])[0] - frame(places[3499])[0])
    assert least_m <= moved <= most_m
    assert (loop.bridge.lost is not None) == lost
