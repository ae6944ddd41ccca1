"""A law that replaces the controller's: the same loop, simulation and effort limiter.

The controller still runs to monitor the arm: the law gets its kinematics, and its FAULT ends the run if the arm runs
away. Its effort is not applied.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from functools import partial
from typing import Any, Final

import numpy as np

from slip_core.arrays import Array, matrix_from_quat_xyzw
from slip_core.params import build, flatten
from slip_core.records import Records, new, record, records
from slip_core.types import JointCommand, PadMotion, SlipSample
from slip_core.vectors import spatial
from slip_vic.experiments.law import Answer, Effort, Law, Pad, Seen, Setup
from slip_vic.run.in_process import Tick, run_in_process
from slip_vic.run.judge import LawError
from slip_vic.scenarios.scenario import Scenario
from slip_vic_controller.arm.command import (
    SENT_COMMAND,
    Interface,
    SentCommand,
    advance_motion,
    joint_acceleration,
    start_motion,
)
from slip_vic_controller.config.controller import ArmController
from slip_vic_controller.law.contact import CONTACT_SAMPLE, ContactSample
from slip_vic_controller.law.evaluation import EVALUATION, Evaluation
from slip_vic_controller.law.torque import joint_torque
from slip_vic_controller.params.controller_params import ControllerParams
from slip_vic_controller.path.paths import reference_at
from slip_vic_controller.safety.limits import limit_effort, needs_restart, start_limiter
from slip_vic_controller.session.cycle_result import CycleResult
from slip_vic_controller.state import CONFIG, ControllerConfig

WATCH: Final[dict[str, Any]] = {
    "controller": "classical", "command.interface": "effort", "governor.mode": "off", "slip_estimator": "measured",
    "joint_sensor.noise_velocity": 0.0, "joint_sensor.quantum_position": 0.0,
    "drive.delay_s": 0.0, "drive.lag_s": 0.0,
    "grip.control": "fixed", "tare.duration_s": 0.0, "safety.inputs.frozen_s": 1e3,
    "safety.load.drop_speed": 1e3, "safety.limits.error_linear": 1e3, "safety.limits.error_angular": 1e3,
}  # fmt: skip
"""Parameters of the monitoring controller: the path does not wait for the law, and samples are not filtered.

With velocity drives it would estimate the joints from its own commands, which are not applied.
"""


def numbers(what: str, given: object, size: int) -> Array:
    """Return a law's numbers as an array of this size.

    Raises:
        LawError: another shape, or numbers that are not finite.
    """
    try:
        found = np.array(given, dtype=np.float64)
    except (TypeError, ValueError):
        raise LawError(f"{what} is {given!r:.60}; expected {size} numbers") from None
    if found.shape != (size,):
        raise LawError(f"{what} has the shape {found.shape}; expected ({size},)")
    if not np.isfinite(found).all():
        raise LawError(f"{what} is not finite: {found.tolist()}")
    return found


def watched(scenario: Scenario) -> Scenario:
    """Return a scenario with the controllers that monitor its arms."""
    watching = {
        name: build(ControllerParams, flatten(params) | WATCH, f"controller {name}".strip())
        for name, params in scenario.controllers.items()
    }
    return dataclasses.replace(scenario, controllers=watching)


def driven(scenario: Scenario, law: Law, most_grip: float | None = None) -> Iterator[Tick]:
    """Run a scenario under a law to its end, and yield every tick with the law's command in it.

        run = judge(driven(scenario, MyLaw()), watched(scenario))

    Args:
        scenario: its controllers' parameters are those that the law may read.
        law: made for this run.
        most_grip: largest squeeze that is applied [N]; None: the gripper's.

    Raises:
        LawError: the law's mistake.
    """
    if most_grip is None:
        most_grip = min(params.grip.cap for params in scenario.controllers.values())
    arms, begun = [_Arm(scenario, name) for name in scenario.controllers], False
    for tick in run_in_process(watched(scenario)):
        try:
            first, *others = [arm.see(tick, k, law.needs) for k, arm in enumerate(arms)]
            if not begun:
                _guarded(law, "reset", _setup(scenario, arms[0].config, most_grip, tick))
                begun = True
            given = _guarded(law, "step", dataclasses.replace(first, others=tuple(others)) if others else first)
            answers = given if isinstance(given, tuple) else (given,)
            if len(answers) != len(arms):
                raise LawError(f"step returns {len(answers)} answers; expected {len(arms)}")
            for k, (arm, answer) in enumerate(zip(arms, answers, strict=True)):
                if not isinstance(answer, Pad | Effort | None):
                    raise LawError(f"step returns {type(answer).__name__}; expected Pad, Effort or None")
                tick.grips[k] = arm.squeeze(answer, most_grip)
                tick.commands[k] = arm.command(answer, tick, k)
        except LawError as error:
            raise LawError(f"{tick.time_s:.3f} s: {error}") from error
        yield tick


def _guarded(law: Law, method: str, argument: object) -> object:
    """Call a law; whatever it raises is a `LawError`."""
    try:
        return getattr(law, method)(argument)
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # a law is someone else's
        raise LawError(f"{method} raises {type(error).__name__}: {' '.join(str(error).split())}") from error


def _setup(scenario: Scenario, config: ControllerConfig, most_grip: float, tick: Tick) -> Setup:
    """Return the law's `Setup`; config: of the first arm."""
    params, start = next(iter(scenario.controllers.values())), tick.result.arm
    position, rotation = np.array(start.position), np.array(start.rotation)
    path, start_s = config.path, params.trajectory.start_s
    ends = path.knot[int(path.segments)] if path.segments else path.duration

    def reference(at: float) -> PadMotion:
        point = reference_at(path, float(at) - start_s, position, rotation)
        x, R, twist, acceleration = (np.array(part, dtype=float) for part in point)
        return PadMotion(x, R, twist.reshape(6), acceleration.reshape(6))

    reference(0.0)  # compiled here where it is the first one on a machine: no step of the law waits for it

    return Setup(
        reference=reference,
        duration_s=float(ends) + start_s,
        period_s=params.control_period_s,
        friction_limit=params.governor.friction_limit,
        torsional_radius=params.governor.torsional_radius,
        grip=params.grip.nominal_force,
        most_grip=most_grip,
        mass=params.object.mass,
        inertia=np.array(params.object.inertia),
        gravity=np.array(params.gravity),
        grasp_position=np.array(params.contacts.position[:3]),
        grasp_rotation=matrix_from_quat_xyzw(np.array(params.contacts.orientation_xyzw[:4])),
        parameters=scenario.controllers,
        urdfs=scenario.placed,
    )


class _Arm:
    """State of one arm between ticks."""

    def __init__(self, scenario: Scenario, name: str) -> None:
        params = scenario.controllers[name]
        self.joints = len(params.joint_names)
        self.config: ControllerConfig = record(
            ArmController(params, scenario.placed[name], lockstep=True).config, CONFIG
        )
        self.sent: SentCommand = record(new(SENT_COMMAND), SENT_COMMAND)
        self._law: Evaluation = record(new(EVALUATION), EVALUATION)
        self._samples: Records[ContactSample] = records(new(CONTACT_SAMPLE), CONTACT_SAMPLE)
        self._posture: Array | None = None
        self._slip, self._wrench, self._start_ns = np.zeros(6), np.zeros(6), -1
        self._period_s = params.control_period_s
        self._command = partial(JointCommand, interface=params.command.interface)
        self._grip = params.grip.nominal_force
        """Squeeze as configured, then as commanded [N]."""

    def see(self, tick: Tick, k: int, needs: frozenset[str]) -> Seen:
        """Return the law's `Seen` of a tick."""
        outputs, terms, n = tick.outputs.arms[k], tick.results[k].arm, self.joints
        now_ns = tick.outputs.stamp_ns
        if self._start_ns < 0:
            self._start_ns = now_ns
        for wrench in outputs.wrenches:
            if np.isfinite(wrench.wrench).all():
                self._wrench = np.array(wrench.wrench)
        slips = tuple(one for one in outputs.slips if isinstance(one, SlipSample))
        for slip in slips if "slip" in needs else ():
            if slip.valid:
                self._slip = np.array(slip.twist)
        return Seen(
            time=1e-9 * (now_ns - self._start_ns),
            q=np.array(outputs.joint.position),
            qd=np.array(outputs.joint.velocity),
            position=np.array(terms.position),
            rotation=np.array(terms.rotation),
            twist=np.array(terms.twist),
            J=np.array(terms.J[:, :n]),
            M=np.array(terms.M[:n, :n]),
            bias=np.array(terms.bias[:n]),
            wrench=self._wrench.copy() if "wrench" in needs else np.zeros(6),
            slip=self._slip.copy(),
            grip=self._grip,
            stamp_ns=now_ns,
            joint=outputs.joint,
            wrenches=outputs.wrenches if "wrench" in needs else (),
            slips=slips if "slip" in needs else (),
        )

    def squeeze(self, answer: Answer, most: float) -> float | None:
        """Return the squeeze that an answer commands, at most the allowed one [N]; None if it commands none.

        Raises:
            LawError: an invalid squeeze.
        """
        if answer is None or answer.grip is None:
            return None
        (grip,) = numbers("grip", [answer.grip], 1)
        if grip < 0.0:
            raise LawError(f"grip is {grip:g} N; expected 0 or more")
        self._grip = min(float(grip), most)
        return self._grip

    def command(self, answer: Answer, tick: Tick, k: int) -> JointCommand:
        """Return the drives' command for an answer, within their limits; nothing if there is no answer.

        Velocity and position drives get the motion of the modelled arm under the effort, as from the controller.

        Raises:
            LawError: an answer that gives no finite command.
        """
        interface, stamp_ns, result = self.config.command.interface, tick.outputs.stamp_ns, tick.results[k]
        if answer is None:
            self.sent.started = 0
            return self._command(stamp_ns, np.zeros(0))
        if isinstance(answer, Pad):
            wanted = self.torque(result, numbers("Pad.acceleration", answer.acceleration, 6))
        else:
            wanted, R = numbers("Effort.effort", answer.effort, self.joints), result.arm.rotation
            self._law.h_ee[:] = np.concatenate((R @ self._wrench[:3], R @ self._wrench[3:]))
        if interface == Interface.EFFORT:
            return JointCommand(stamp_ns, self.limited(wanted, tick, k))
        self._move(wanted, result)
        moved = self.sent.velocity if interface == Interface.VELOCITY else self.sent.position
        return self._command(stamp_ns, np.array(moved[: self.joints]))

    def _move(self, tau: Array, result: CycleResult) -> None:
        """Integrate the joint acceleration of an effort (n,) [N m] over a period, inside the limits of the motion."""
        if self.sent.started == 0:
            start_motion(self.config.command, self.sent, result.joint.position, result.joint.velocity)
        arm, qdd = result.arm, np.zeros(self.joints)
        if not joint_acceleration(self.joints, arm.M, arm.bias, arm.J, self._law.h_ee, tau, qdd):
            raise LawError("no finite acceleration of the joints at this posture")
        advance_motion(self.config.command, self.sent, qdd, result.joint.velocity, self._period_s)

    def torque(self, result: CycleResult, acceleration: Array) -> Array:
        """Return the effort of an acceleration of the pad; (6,) {w} -> (n,) [N m].

        Raises:
            LawError: at a posture without a finite effort.
        """
        q, qd = np.array(result.joint.position), np.array(result.joint.velocity)
        if self._posture is None:
            self._posture = q.copy()
        self._samples[0].wrench[:] = self._wrench
        solved, _ = joint_torque(
            self.config.law, result.arm, spatial(acceleration), self._samples, q, qd, self._posture, self._law
        )
        effort = np.array(self._law.tau[: self.joints])
        if not solved or not np.isfinite(effort).all():
            raise LawError("Pad.acceleration gives no finite effort at this posture")
        return effort

    def limited(self, wanted: Array, tick: Tick, k: int) -> Array:
        """Return the output of the control cycle's effort limiter; (n,) [N m]."""
        limits, n, now_ns = self.config.command, self.joints, tick.outputs.stamp_ns
        if needs_restart(limits, self.sent, now_ns):
            felt, gravity = np.array(tick.outputs.arms[k].joint.effort), np.array(tick.results[k].arm.gravity[:n])
            start_limiter(limits, self.sent, felt, gravity, now_ns)
        limit_effort(limits, self.sent, wanted, now_ns, np.zeros(n, np.int64))
        return np.array(self.sent.effort[:n])
