"""Whether a scenario holds: gains, and short runs in worlds that differ from the configured one."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from slip_vic.experiments.run import Row, kind_of, play, row_of
from slip_vic.experiments.world import NO_MISMATCH, World, mismatch_assignments
from slip_vic.options import Choice
from slip_vic.scenarios.scenario import Scenario, load
from slip_vic_controller.law.bounds import GainReport
from slip_vic_controller.law.gains import gain_report, judge_inertia
from slip_vic_controller.robot import Robot


def judged(scenario: Scenario) -> GainReport:
    """Return the verdict on the gains of the first arm, with the inertia that they find there."""
    name, params = next(iter(scenario.controllers.items()))
    armature = params.drive.of_joints("armature", len(params.joint_names))
    robot = Robot(scenario.placed[name], params.ee_frame, params.joint_names, params.gravity, armature)
    report = gain_report(params, refuse=False)
    wrist = judge_inertia(params, robot.joint_names, robot.inertia)
    return report._replace(conditions=(*report.conditions, wrist))


def hindered(row: Row) -> str:
    """Return why a simulated world does not hold; empty where the object arrives."""
    if row["outcome"] != "ok":
        return row["reason"]
    off = 1e3 * float(row["off_goal_m"])
    return "" if kind_of(row) == "arrived" else f"does not arrive: ends {off:.3g} mm from its goal"


def run_worlds(choice: Choice, mismatches: Sequence[str]) -> Iterator[Row]:
    """Run the configured world, then each mismatch, and yield their rows.

    Where the path is refused already there is nothing more to run.
    """
    known = load(**choice)
    settings = {name: mismatch_assignments(name, known) for name in (NO_MISMATCH, *mismatches)}
    for number, (name, own) in enumerate(settings.items()):
        world = World(choice["scenario"], choice["sensor"], number=number, mismatch=name, law=choice["law"])
        wrong = load(**choice | {"set": (*choice["set"], *own)})
        row = row_of(world, *play(wrong.ticks(), wrong))
        yield row
        if row["outcome"] == "refused":
            return
