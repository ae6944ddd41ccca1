"""Record the reference bags of the repository again: short runs of all laws, over DDS; verified before they replace.

python tools/reference_bags.py [FOLDER]
"""

from __future__ import annotations

import math
import shutil
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from slip_bags.reader import Bag
from slip_core.arms import prefix_of
from slip_core.errors import ProtocolError
from slip_vic.replay.run_data import read_run
from slip_vic.replay.verify import verify_run
from slip_vic.run.data import read_data
from slip_vic.run.launcher import Launcher
from slip_vic.run.metrics import summarise
from slip_vic.scenarios.scenario import Law, Scenario, load

SEED: Final = 0
COMMAND: Final = "python tools/reference_bags.py"
LARGEST_BYTES: Final = 1_000_000
OF_AN_ARM: Final = ("joint_states", "controller/ledger", "slip_truth")
"""Topics with a message in every tick, beside the command, the clock and the object's state."""


@dataclass(frozen=True, slots=True)
class Reference:
    """One run of the reference bags; `what` it shows, beside its scenario. The fields are options of `slip-vic run`."""

    name: str
    scenario: str
    law: Law
    what: str
    assignments: tuple[str, ...] = ()
    sensor: str = ""
    drive: str = ""

    def load(self) -> Scenario:
        """Return the scenario as it is run."""
        return load(self.scenario, law=self.law, seed=SEED, set=self.assignments, sensor=self.sensor, drive=self.drive)

    def command(self) -> str:
        """Return what a user types for the same run."""
        given = {"sensor": self.sensor, "drive": self.drive}
        words = [f"slip-vic run --scenario {self.scenario} --law {self.law} --seed {SEED}"]
        words += [f"--{option} {value}" for option, value in given.items() if value]
        words += [f"--set {assignment}" for assignment in self.assignments]
        return " ".join((*words, f"--record {self.name}"))


def _lasting(seconds: float) -> str:
    return f"bridge.duration_s={seconds}"


def _slow(seconds: float) -> tuple[str, ...]:
    """Return assignments for a control rate of 250 Hz, so that a run has few cycles."""
    return _lasting(seconds), "bridge.control_period_s=0.004", "controller.control_period_s=0.004"


REFERENCES: Final = (
    Reference(
        "grip_follows", "paper_planar", "governed_follow",
        "A gripper that squeezes as little as it can, and friction that falls to half on the way.",
        (*_slow(1.6), "bridge.friction.falls_at_s=1.0", "bridge.friction.falls_to=0.5"),
        "vision_60", "velocity_500",
    ),
    Reference(
        "tare_pushed", "glass_transport", "governed", "Something pushes a joint during the tare: FAULT.",
        (*_slow(0.3), "bridge.push.effort=[0,0,0,20,0,0,0]"), "optical_flow_120", "torque_joint",
    ),
    Reference(
        "flag_waypoints", "vertical_plane", "vic",
        "Waypoints, angles as roll, pitch and yaw, and a sensor that reports only whether it slips.",
        (
            *_slow(0.8), "bridge.friction.mu_s=0.45", "bridge.friction.mu_k=0.4", "bridge.slip_input=flag",
            "controller.slip_input=flag", "controller.slip_estimator=measured", "controller.attitude=rpy",
            "controller.trajectory.kind=waypoints", "controller.trajectory.duration_s=0.6",
            "controller.trajectory.waypoints=[0.05,0,0,0,0,0.2,0.05,0.05,0,0,0,0]",
        ),
    ),
    Reference(
        "unknown_lemniscate", "paper_planar", "governed",
        "A lemniscate with unknown friction; the governor only slows it down.",
        (
            *_slow(1.2), "controller.governor.friction=unknown", "controller.governor.mode=slow_down",
            "controller.trajectory.kind=lemniscate",
        ),
        "force_tactile_500",
    ),
    Reference(
        "lifted_chips", "paper_planar", "governed",
        "A slip sensor that reads zero, and less friction than configured: the wrench shows the slip.",
        (
            *_slow(1.6), "bridge.friction.mu_s=0.3", "bridge.friction.mu_k=0.25",
            "bridge.sensors.slip.faults.lifted_chips=3",
        ),
        "vision_60", "motor_current",
    ),
    Reference(
        "paper_planar_classical", "paper_planar", "classical",
        "Classical impedance control: the arm keeps its path, and the object slips.", (_lasting(1.0),),
    ),
    Reference(
        "paper_planar_vic", "paper_planar", "vic",
        "Variable impedance control: stiffness fades with slip and compensation drives it to zero.", (_lasting(1.0),),
    ),
    Reference(
        "governed_joint_torques", "glass_transport", "governed",
        "Governed, with joint torque sensors, a 60 Hz camera and a third of the friction, which is learnt.",
        (_lasting(0.8), "bridge.friction.mu_s=0.14", "bridge.friction.mu_k=0.1225"), "vision_60", "torque_joint",
    ),
    Reference(
        "vic_bad_sensor", "paper_planar", "vic",
        "Position interface, and a slip sensor that loses nine of ten samples and has outliers: HOLD, and back.",
        (
            "controller.slip_estimator=observer", _lasting(0.6), "bridge.sensors.slip.faults.dropout_probability=0.9",
            "bridge.sensors.slip.faults.outlier_probability=0.1",
        ),
        drive="position_250",
    ),
    Reference(
        "two_arms_governed", "pane_two_arms_flat", "governed", "Two arms with velocity interfaces.",
        (_lasting(0.5),), drive="velocity_500",
    ),
)  # fmt: skip


def _every_tick(scenario: Scenario) -> list[str]:
    """Return the topics of which a run in lockstep has a message in every tick."""
    first = next(iter(scenario.controllers.values()))
    command = f"{first.command.interface}_command"
    prefixes, names = map(prefix_of, scenario.controllers), (*OF_AN_ARM, command)
    names += ("grip_command",) if first.grip.control == "follow" else ()
    return ["/clock", "/object_state", *(f"/{prefix}{name}" for prefix in prefixes for name in names)]


def make_references(folder: Path, tell: Callable[[str], None]) -> None:
    """Record all reference bags again, verify each, and only then replace those in `folder`, with their README.

    Raises:
        ProtocolError: a run lost messages or cannot be reproduced; nothing is replaced then.
    """
    staging = folder / ".new"
    shutil.rmtree(staging, ignore_errors=True)
    staging.mkdir(parents=True)
    try:
        rows = []
        for reference in REFERENCES:
            loaded = reference.load()
            result = Launcher(loaded, bag=staging / reference.name).run()
            bag = Bag(staging / reference.name)
            verdict = verify_run(read_run(bag))
            size = bag.size_bytes
            short = [t for t in _every_tick(loaded) if bag.topic(t).message_count != result.ticks]
            if size > LARGEST_BYTES:
                raise ProtocolError(f"reference bag {reference.name}: {size} bytes, expected at most {LARGEST_BYTES}")
            if result.lost or short or not verdict.identical:
                why = verdict.text()
                raise ProtocolError(f"reference bag {reference.name}: {result.lost} lost, short: {short}; {why}")
            tell(f"{reference.name}: {verdict.text()}")
            numbers = summarise(read_data(staging / reference.name).arm(""))
            slip = f"{1e3 * numbers['slip_linear_m']:.2f} mm, {math.degrees(numbers['slip_angular_rad']):.2f} deg"
            what = f"{' '.join(loaded.description.split())} {reference.what}"
            told = f"{size / 2**20:.2f} MiB | {result.messages} | {slip} | {what} | `{reference.command()}`"
            rows.append(f"| `{reference.name}` | {told} |")
        (staging / "README.md").write_text(_readme(rows), encoding="utf-8")
        for item in sorted(staging.iterdir()):
            target = folder / item.name
            shutil.rmtree(target) if target.is_dir() else target.unlink(missing_ok=True)
            item.replace(target)
    finally:
        shutil.rmtree(staging, ignore_errors=True)


def _readme(rows: list[str]) -> str:
    return "\n".join(
        [
            "# Reference bags",
            "",
            f"Made by `{COMMAND}` (seed {SEED}, lockstep over DDS). Each is what the command beside it writes. A test",
            "verifies every command to the last bit, so it notices any change of numbers in the controller. Record",
            "them again only where the change is intended. Open them with `slip-vic bag info` or Foxglove.",
            "",
            "| bag | size | messages | slip at the end | what it shows | command |",
            "|---|---|---|---|---|---|",
            *rows,
            "",
        ]
    )


if __name__ == "__main__":
    make_references(Path(sys.argv[1] if len(sys.argv) > 1 else "bags"), print)
