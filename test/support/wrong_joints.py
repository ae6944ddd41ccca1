"""What the arm does when a joint measures wrongly, or its torque is not the commanded one: prints the table of
docs/results.md."""

from __future__ import annotations

import dataclasses
import sys
from collections import Counter
from typing import Any, NamedTuple

import numpy as np

from slip_vic.scenarios import scenario_names
from slip_vic.scenarios.scenario import Law
from slip_vic_controller.safety.modes import Request
from test.campaigns.faults import trial as trials
from test.campaigns.faults.channel import Channel
from test.campaigns.faults.plan import DRIVES, JOINT, Fault, Plan
from test.support.one_arm import OneArm

LASTS_S, LAST_S, AT_REST = 3.0, 0.3, 0.1
FROM_S, HELD_S = (0.6, 1.2), 3.0
SEEDS = 20
DRIFT, OFFSET, FRICTION = 0.05, 2.0, (0.3, 1.0)  # rad/s, N m, N m
MEASURED = (
    "velocity of the wrong sign", "velocity stuck at 0", "position stuck", "position drifts",
    "position and velocity stuck", "all joints stuck", "all joints not finite",
)  # fmt: skip
TORQUES = ("offset of 2 N m", "friction of 0.3 to 1 N m")


class Seen(NamedTuple):
    """What a run shows: fastest joint in all and at the end [rad/s], mode at the end, whether its reason names the
    joint, objects lost."""

    fastest: float
    at_end: float
    mode: str
    names_joint: bool
    lost: int


class Wrong(Channel):
    """Joint states in which one joint, the fault's size, is measured wrongly in the way of its kind."""

    _since: tuple[int, Any] | None = None

    def _suffer(self, fault: Fault, sample: Any, now_ns: int, measured_ns: int) -> None:
        joint, q, qd = int(fault.size), sample.position.copy(), sample.velocity.copy()
        begun_ns, first = self._since = self._since or (now_ns, sample)
        stuck = slice(None) if fault.kind == "all joints stuck" else joint
        if fault.kind == "velocity of the wrong sign":
            qd[joint] *= -1.0
        elif fault.kind == "velocity stuck at 0":
            qd[joint] = 0.0
        elif fault.kind == "position stuck":
            q[joint] = first.position[joint]
        elif fault.kind == "position drifts":
            q[joint] += DRIFT * 1e-9 * (now_ns - begun_ns)
        elif fault.kind == "all joints not finite":
            q[:] = np.nan
        elif fault.kind in MEASURED:
            q[stuck], qd[stuck] = first.position[stuck], first.velocity[stuck]
        self._put(dataclasses.replace(sample, position=q, velocity=qd), now_ns, measured_ns, True)


class Watched(trials.Trial):
    """A trial whose true joint velocities are kept."""

    def __init__(self, plan: Plan, offset: float) -> None:
        super().__init__(plan)
        self.speeds: list[float] = []
        drive, n = self._bridge_params.drive, len(self._bridge_params.joint_names)
        wrong = np.array(drive.of_joints("offset", n))
        wrong[int(plan.faults[0].size)] += offset
        self._bridge_params = self._bridge_params.model_copy(
            update={"drive": drive.model_copy(update={"offset": tuple(wrong.tolist())})}
        )

    def _observe(self, t: float) -> None:
        if self._plan.faults[0].kind == TORQUES[1] and self._plan.faults[0].start_s <= t < HELD_S:
            self.controller.request(Request.HOLD)
        super()._observe(t)
        self.speeds.append(float(np.abs(self._bridge.simulation.observe(0).joint.velocity).max()))

    @property
    def controller(self) -> OneArm:
        """The controller at the end."""
        assert self._controller is not None
        return self._controller


def drawn(kind: str, drive: str, seed: int) -> Plan:
    """Draw a run with this fault, which lasts."""
    rng = np.random.default_rng((len(kind), seed))
    name = scenario_names(1)[int(rng.integers(len(scenario_names(1))))]
    joint, from_s = int(rng.integers(7)), float(rng.uniform(*FROM_S))
    friction = float(rng.uniform(*FRICTION)) if kind == TORQUES[1] else 0.0
    laws: tuple[Law, Law] = ("vic", "governed")
    return Plan(
        seed, seed, name, bool(rng.integers(2)), laws[int(rng.integers(2))], (Fault(kind, JOINT, from_s, 10.0, joint),),
        drive=drive, joints=(0.0, friction, 0.0),
    )  # fmt: skip


def seen(plan: Plan) -> Seen:
    """Run a plan."""
    fault = plan.faults[0]
    sign = 1.0 if plan.trial % 2 else -1.0
    trial = Watched(plan, sign * OFFSET if fault.kind == TORQUES[0] else 0.0)
    outcome = trial.run()
    arm = trial.controller.session.arms[0]
    joint, last = arm.controller.robot.joint_names[int(fault.size)], round(LAST_S / 0.004)
    speeds = trial.speeds
    return Seen(
        max(speeds), max(speeds[-last:]), arm.mode.name, joint in arm.reason, outcome.objects_lost
    )  # fmt: skip


def main() -> None:
    """Print a row for each fault and drive."""
    vars(trials).update(Channel=Wrong, DURATION_S=LASTS_S)
    only = sys.argv[1:]
    print("| fault | drive | fastest joint: median, most | not at rest | modes at the end | names the joint | lost |")
    print("|---|---|---|---|---|---|---|")
    for kind in (*MEASURED, *TORQUES):
        for drive in (drive for interface in DRIVES.values() for drive in interface):
            if only and not (drive in only or kind in only):
                continue
            if kind == TORQUES[0] and drive not in DRIVES["effort"]:
                continue
            runs = [seen(drawn(kind, drive, seed)) for seed in range(SEEDS)]
            fastest = [run.fastest for run in runs]
            modes = ", ".join(f"{n} {mode}" for mode, n in Counter(run.mode for run in runs).most_common())
            named = sum(run.names_joint for run in runs if run.mode == "FAULT")
            moving = [run for run in runs if run.mode in ("HOLD", "FAULT") and run.at_end > AT_REST]
            print(
                f"| {kind} | {drive} | {np.median(fastest):.1f}, {max(fastest):.1f} | {len(moving)} | {modes} | "
                f"{named} | {sum(run.lost > 0 for run in runs)} |", flush=True,
            )  # fmt: skip


if __name__ == "__main__":
    main()
