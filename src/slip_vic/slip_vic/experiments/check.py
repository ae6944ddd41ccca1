"""Whether a scenario holds: gains, and short runs in worlds that differ from the configured one."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from slip_vic.experiments.run import Row, kind_of, play, row_of
from slip_vic.experiments.world import NO_MISMATCH, World, mismatch_assignments
from slip_vic.options import Choice
from slip_vic.scenarios.reach import judge_inertia
from slip_vic.scenarios.scenario import Scenario, load_scenario
from slip_vic_controller.law.bounds import GainReport
from slip_vic_controller.law.gains import gain_report
from slip_vic_controller.robot import Robot


def judged(scenario: Scenario) -> GainReport:
    """Return the verdict on the gains of the first arm, with the inertia that they find there."""
    name, params = next(iter(scenario.controllers.items()))
    armature = params.drive.of_joints("armature", len(params.joint_names))
    robot = Robot(scenario.placed[name], params.ee_frame, params.joint_names, params.gravity, armature)
    report = gain_report(params, refuse=False)
    wrist = judge_inertia(robot, np.array(scenario.bridges[name].initial_position), params)
    return report._replace(conditions=(*report.conditions, wrist))


def hindered(row: Row) -> str:
    """Return why a simulated world does not hold; empty where the object arrives."""
    if row["outcome"] != "ok":
        return row["reason"]
    off = 1e3 * float(row["off_goal_m"])
    return "" if kind_of(row) == "arrived" else f"does not arrive: ends {off:.3g} mm from its goal"


def gain_lines(report: GainReport) -> Iterator[str]:
    """Yield a line on k_s and on each condition."""
    yield f"k_s configured {report.asked:g}, used {report.used:.6g} of {report.accepted:.6g} 1/s"
    for one in report.conditions:
        numbers = f"{one.value:.6g}, limit {one.limit:.6g}, margin {one.margin:.3g}"
        yield f"{one.name} {'holds' if one.holds else 'fails'}: {numbers}; {one.reason}"


def run_worlds(choice: Choice, mismatches: Sequence[str], report: Callable[[str], None]) -> Iterator[Row]:
    """Run the configured world, then each mismatch, and yield their rows; `report` gets what runs.

    Where the path is refused already there is nothing more to run.
    """
    known = load_scenario(**choice)
    settings = {name: mismatch_assignments(name, known) for name in (NO_MISMATCH, *mismatches)}
    for number, (name, own) in enumerate(settings.items()):
        report(name)
        world = World(choice["scenario"], choice["sensor"], number=number, mismatch=name, law=choice["law"])
        wrong = load_scenario(**choice | {"assignments": (*choice["assignments"], *own)})
        row = row_of(world, *play(wrong.ticks(), wrong))
        yield row
        if row["outcome"] == "refused":
            return
