"""What goes wrong in a trial, and when: drawn from one seed, so that its number repeats a trial."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from slip_vic.presets import preset_names
from slip_vic.scenarios.scenario import Law, Scenario, load

JOINT, WRENCH, SLIP, EFFORT = "joint_states", "wrench", "slip_velocity", "effort_command"
TOPICS = (JOINT, WRENCH, SLIP, EFFORT)
BRIDGE, CONTROLLER = "bridge", "controller"
ON_TOPICS = (
    "drop", "duplicate", "delay", "reorder", "corrupt_values", "corrupt_bytes", "freeze_values", "freeze_message",
)  # fmt: skip
ON_NODES = ("kill", "stop")
IDEAL = "ideal"
DRIVES = {
    "effort": (IDEAL, "torque_joint", "motor_current"),
    "velocity": ("velocity_500", "velocity_125"),
    "position": ("position_250",),
}
"""Presets of drives that take efforts, velocities or positions."""
TASKS = ("path", "goal", "topic")
"""Where the reference comes from: the built-in path, goals, or a stream of references."""
RETUNED = ("gains.stiffness", "gains.k_s", "object.mass")
"""What the fault "gains" changes."""
MOST_NOISE, MOST_FRICTION, MOST_OFFSET = 0.01, 0.3, 0.2
"""Of joints that no parameter describes: velocity noise [rad/s], friction and torque offset [N m]."""
WITHOUT_WRENCH = 0.15
"""Share of the arms that have no wrench sensor."""
PERIOD_S = 0.004
LATEST_START_S, LONGEST_S = 0.6, 0.4
"""Of faults."""
GRIP_N = {"paper_planar": 2.0, "vertical_plane": 8.0, "glass_transport": 3.0}
"""Grip forces that survive most faults."""


@dataclass(frozen=True, slots=True)
class Fault:
    """One fault.

    kind, target: what and where; start_s, duration_s: when, from the beginning of the motion; size in [0, 1): how bad,
    with a meaning of its own for each kind.
    """

    kind: str
    target: str
    start_s: float
    duration_s: float
    size: float

    @property
    def name(self) -> str:
        """Kind and target, as reports count them."""
        return f"{self.kind} {self.target}".strip()

    @property
    def end_s(self) -> float:
        """When it is over."""
        return self.start_s + self.duration_s

    def at(self, t: float) -> bool:
        """Return whether it is at work at this time [s]."""
        return self.start_s <= t < self.end_s


def change_factor(size: float) -> float:
    """Return by how much a fault of this size changes a parameter: from 0.1 to 10."""
    return float(10.0 ** (2.0 * size - 1.0))


def retuned(values: Mapping[str, Any], size: float) -> dict[str, Any]:
    """Return the parameters that the fault "gains" changes, changed; values: by name."""
    factor, (stiffness, k_s, mass) = change_factor(size), RETUNED
    return {
        stiffness: [factor * k for k in values[stiffness]],
        k_s: min(factor * values[k_s], 200.0),
        mass: factor * values[mass],
    }


def all_faults() -> tuple[tuple[str, str], ...]:
    """Return every (kind, target) there is."""
    cases = [(kind, topic) for kind in ON_TOPICS for topic in TOPICS]
    cases += [(kind, node) for kind in ON_NODES for node in (BRIDGE, CONTROLLER)]
    cases += [("wrong_names", JOINT), ("wrong_frame", WRENCH), ("wrong_frame", SLIP), ("reset", BRIDGE)]
    return (
        *cases, ("clock_jump", BRIDGE), ("clock_stop", BRIDGE), ("grip", ""), ("gains", CONTROLLER),
        ("request", CONTROLLER),
    )  # fmt: skip


@dataclass(frozen=True, slots=True)
class Plan:
    """A trial: its number, what it runs, and its faults in order of their start."""

    trial: int
    seed: int
    scenario: str
    observer: bool
    controller: Law
    faults: tuple[Fault, ...]
    sensor: str = IDEAL
    drive: str = IDEAL
    task: str = "path"
    joints: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Velocity noise [rad/s], friction and offset [N m] of the joints beyond the drive's, in no parameter."""
    wrench: str = "sensor"
    """Or "none": an arm without such a sensor."""

    @property
    def interface(self) -> str:
        """What the drives take."""
        return next(interface for interface, drives in DRIVES.items() if self.drive in drives)

    @property
    def setting(self) -> str:
        """What runs, as reports count it."""
        observer = " observer" if self.observer else ""
        wrench = "" if self.wrench == "sensor" else " no_wrench_sensor"
        arm = f"{self.interface} {self.drive}{wrench} {self.sensor}"
        return f"{self.scenario} {self.controller}{observer} {self.task} {arm}"


class Verdict(NamedTuple):
    """What a trial showed.

    recovery_s: from the last fault's end to the law; None: not. objects_lost: how often the object left the pads; the
    simulation is then restarted, as an operator would.
    """

    trial: int
    faults: tuple[str, ...]
    violations: tuple[str, ...]
    recovery_s: float | None
    commands: int
    modes: Counter[str]
    objects_lost: int
    setting: str

    def text(self) -> str:
        """Return the number of the trial, its faults and its first violation."""
        return f"trial {self.trial} ({', '.join(self.faults)}): {self.violations[0]}"


def draw_faults(rng: np.random.Generator, chosen: Iterable[tuple[str, str]]) -> list[Fault]:
    """Draw when faults come and how bad they are, in the order of (kind, target)."""
    return [
        Fault(
            kind,
            target,
            start_s=float(rng.uniform(0.05, LATEST_START_S)),
            # Short ones are as likely as long ones: from one message to the longest.
            duration_s=float(np.exp(rng.uniform(np.log(0.002), np.log(LONGEST_S)))),
            size=float(rng.uniform()),
        )
        for kind, target in chosen
    ]


def make_plan(seed: int, trial: int, interface: str = "") -> Plan:
    """Draw a trial: one kind of fault in turn, so that all come up equally often, with up to two others at random.

    interface: what the arm takes; empty = drawn, too.
    """
    rng, arm = (np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(trial, *k))) for k in ((), (9,)))
    cases = all_faults()
    others = [cases[int(rng.integers(len(cases)))] for _ in range(int(rng.integers(0, 3)))]
    faults = draw_faults(rng, [cases[trial % len(cases)], *others])
    scenario = "vertical_plane" if rng.uniform() < 0.25 else "paper_planar"
    observer = bool(rng.uniform() < 0.5)
    scenario = "glass_transport" if rng.uniform() < 0.2 else scenario
    u = rng.uniform()
    controller: Law = "vic" if u < 0.5 else "governed" if u < 0.85 else "classical"
    sensors = preset_names("sensors")
    sensor = sensors[int(rng.integers(len(sensors)))]
    drawn = tuple(DRIVES)[int(rng.integers(len(DRIVES)))]
    task, drives = TASKS[int(arm.integers(len(TASKS)))], DRIVES[interface or drawn]
    joints = (0.0, 0.0, 0.0)
    if arm.uniform() < 0.5:
        noise, friction, offset = (float(arm.uniform(0.0, each)) for each in (MOST_NOISE, MOST_FRICTION, MOST_OFFSET))
        joints = noise, friction, offset
    chances = (f"wild_{task}", 0.7 * (task != "path")), ("parameter", 0.25)
    more = [kind for kind, chance in chances if arm.uniform() < chance]
    faults += draw_faults(arm, [(kind, CONTROLLER) for kind in more])
    drive = drives[int(arm.integers(len(drives)))]
    wrench = "none" if arm.uniform() < WITHOUT_WRENCH else "sensor"
    in_order = tuple(sorted(faults, key=lambda fault: fault.start_s))
    return Plan(trial, seed, scenario, observer, controller, in_order, sensor, drive, task, joints, wrench)


def realtime_scenario(
    name: str, observer: bool, controller: Law, sensor: str, assignments: Iterable[str], drive: str = IDEAL
) -> Scenario:
    """Return a scenario as campaigns run it, in real time without an end; the ideal sensor leaves the gains."""
    usual = (
        f"controller.slip_estimator={'observer' if observer else 'measured'}",
        f"controller.control_period_s={PERIOD_S}", f"bridge.control_period_s={PERIOD_S}",
        "controller.gains.k_s=100.0", "bridge.duration_s=1e6",
    )  # fmt: skip
    return load(
        name, law=controller, mode="realtime", set=(*usual, *assignments),
        sensor="" if sensor == IDEAL else sensor, drive="" if drive == IDEAL else drive,
    )  # fmt: skip


def endless_scenario(plan: Plan) -> Scenario:
    """Return a lemniscate without end, on a grip that survives most faults and that the governor is configured for."""
    usual, grip_n = load(plan.scenario, law="vic"), GRIP_N[plan.scenario]
    friction_n = usual.controller.governor.friction_limit * grip_n / usual.bridge.grip.force
    assignments = (
        f"bridge.grip.force={grip_n}", f"controller.governor.friction_limit={friction_n}",
        "bridge.expected_subscribers=0", "controller.trajectory.kind=lemniscate",
        "controller.trajectory.duration_s=1e6", "controller.trajectory.radius=0.06",
    )  # fmt: skip
    return realtime_scenario(plan.scenario, plan.observer, plan.controller, plan.sensor, assignments)
