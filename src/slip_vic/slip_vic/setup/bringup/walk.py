"""The steps of a bring-up: each measures, judges and has a fix; the next follows only if it holds."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from slip_core.arrays import Array
from slip_core.errors import InputError, SlipVicError
from slip_core.params import build
from slip_core.records import new, record
from slip_core.vectors import mat
from slip_sim_bridge.params import HOLD_STIFFNESS
from slip_vic.scenarios.parameter_files import commented_file
from slip_vic.scenarios.scenario import NODES
from slip_vic.setup.bringup.hands import Hands, weight_on_pad
from slip_vic.setup.bringup.heard import Heard, Status, Track, joined
from slip_vic.setup.slip_sensor import SLIP_SPEED, slide_mistake
from slip_vic_controller.interfaces import WRENCH_SENSOR, fill_wrench_sensor, wrench_at_pad
from slip_vic_controller.law.arm import ARM
from slip_vic_controller.robot import Robot

if TYPE_CHECKING:
    from slip_vic.setup.bringup.ros_system import RosSystem

LISTENED_S: Final = 2.0
WATCHED_S: Final = 0.25
CLOSELY_S: Final = 0.05
HELD_S, LOOSE_S, STARTED_S, GOAL_S = 2.0, 5.0, 3.0, 30.0
MOTION_M: Final = 0.03
DURATIONS_S: Final = (2.0, 1.4, 1.0, 0.7, 0.5, 0.4)
"""Of the motions there and back: the first one peaks at 28 mm/s, a ninth of the reduced speed of ISO 10218-1."""
RATE_SLACK: Final = 0.2
RESTING_SPEED: Final = 0.02  # [rad/s], of the mean, which noise of a velocity does not move
NO_NOISE: Final = 1e-9  # rounding, not a sensor's noise
SLIP_OFFSET: Final = 5e-3  # [m/s]: half of what opens the law's gate with its default steepness
SIGMAS: Final = 4.0
NOISE_SHARE: Final = 0.4  # of the friction limit: above it white noise alone looks like slip (docs/sensors.md)
WEIGHT_SLACK: Final = 0.2
LEVER_SLACK: Final = 0.03  # [m] between the weight's line of action and that of the measured wrench
TURNED: Final = math.radians(10.0)  # of a weight
ASKEW: Final = math.radians(35.0)  # of a push by hand
LEAST_TURN: Final = 0.01  # [rad, m]: of a joint that is moved by hand
LEAST_PUSH: Final = 0.5  # [N]
SLID, SPUN = 0.015, 0.1  # [m], [rad]: by which the simulated hand moves and turns that of the arm
LEAST_SLIDE: Final = 5e-3  # [m]
SAG: Final = 0.02  # [rad, m]: in HOLD with its stiffness
DRIFT: Final = 0.05  # [rad, m]: in 5 s without stiffness
MISSED: Final = 0.01  # [m]: of the first motion's goal
SLIPPED: Final = 2e-3  # [m]: of the first motion
AXES: Final = ("+x", "+y", "+z")


class Verdict(NamedTuple):
    """Measured and expected values of a step, and what to do; an empty fix: the step holds."""

    step: str
    measured: str
    expected: str
    fix: str = ""

    @property
    def holds(self) -> bool:
        """Whether the bring-up may continue."""
        return not self.fix

    def __str__(self) -> str:
        """Return one line."""
        if self.holds:
            return f"{self.step}: {self.measured} (expected {self.expected})"
        return f"{self.step}: got {self.measured}, expected {self.expected}; {self.fix}"


def judge(step: str, measured: str, expected: str, *faults: tuple[bool | np.bool_, str]) -> Verdict:
    """Return the verdict with the fix of the first fault that applies."""
    return Verdict(step, measured, expected, next((fix for applies, fix in faults if applies), ""))


class Walk:
    """One bring-up.

    Args:
        system: the controller with its drivers.
        hands: who pushes.

    Attributes:
        measured: parameters by name.

    Raises:
        InputError: the slip sensor gives no velocities, or the controller's parameters and its URDF do not fit.
    """

    def __init__(self, system: RosSystem, hands: Hands) -> None:
        self._system, self._hands, self._params = system, hands, system.params
        params = system.params
        if params.slip_input != "twist":
            raise InputError("slip_input", got=params.slip_input, expected="twist: a bring-up integrates it")
        self._robot = Robot(system.urdf, params.ee_frame, params.joint_names, params.gravity)
        self._sensor = record(new(WRENCH_SENSOR), WRENCH_SENSOR)
        fill_wrench_sensor(self._sensor, params, self._robot)
        self._has_wrench = params.wrench.source == "sensor"
        self.measured: dict[str, Any] = {}

    def steps(self) -> Iterator[Verdict]:
        """Yield the verdict of each step, up to the first that does not hold; the arm is left in HOLD."""
        for step in self._passive, self._by_hand, self._held, self._governed:
            for verdict in step():
                yield verdict
                if not verdict.holds:
                    return

    def parameter_file(self) -> str:
        """Return what was measured, as a ROS parameter file of the controller."""
        values = {name: float(f"{value:.4g}") for name, value in self.measured.items()}
        head = "# Measured by `slip-vic bringup`: for the controller after its own file; --params of run and check.\n"
        node, model = NODES["controller"]
        return head + commented_file(build(model, values, "measured"), node, tuple(values))

    # -- nothing moves -----------------------------------------------------------------------------

    def _passive(self) -> Iterator[Verdict]:
        params, system = self._params, self._system
        yield self._controller()
        system.set_active(False)
        self._hands.grip(firmly=True)
        heard = system.listen(LISTENED_S)
        inputs, hz = params.safety.inputs, 1.0 / params.control_period_s
        bounds = (1.0 - RATE_SLACK) * hz, (1.0 + RATE_SLACK) * hz
        yield stream("joint_states", heard.joints, *bounds, inputs.age_s, inputs.age_s)
        if self._has_wrench:
            yield stream("wrench", heard.wrench, 2.0 / inputs.age_s, math.inf, inputs.age_s, inputs.age_s)
        yield stream("slip", heard.slip, 2.0 / inputs.slip_age_s, math.inf, inputs.slip_age_s, inputs.age_s)
        yield self._rest(heard)
        if self._has_wrench:
            yield self._weighed(heard)

    def _controller(self) -> Verdict:
        """Judge whether the controller was started as a bring-up needs it."""
        params, mode = self._params, self._system.status.mode
        kind, governor = params.trajectory.kind, params.governor.mode
        friction, auto = params.governor.friction, params.safety.auto_enable
        return judge(
            "controller",
            f"trajectory.kind {kind}, governor.mode {governor}, governor.friction {friction}, "
            f"safety.auto_enable {str(auto).lower()}, mode {mode or 'inactive'}",
            "goal, slow_down, unknown, false, and a law that is not active",
            (
                kind != "goal" or governor == "off" or friction != "unknown" or auto,
                "start it with trajectory.kind:=goal, governor.mode:=slow_down, governor.friction:=unknown and "
                "safety.auto_enable:=false",
            ),
            (mode in ("ACTIVE", "DEGRADED", "FAULT"), "call ~/hold, or ~/reset_fault after a fault"),
        )

    def _rest(self, heard: Heard) -> Verdict:
        """Measure the sensors at rest. A reading that never changes (a dead band) has no noise to measure."""
        params, wrench, slip, noise = self._params, heard.wrench, heard.slip, dict[str, float]()
        if self._has_wrench:
            deviation = wrench.values.std(axis=0)
            noise["wrench_sensor.noise_force"] = params.wrench.force_scale * float(deviation[:3].max())
            noise["wrench_sensor.noise_torque"] = params.wrench.torque_scale * float(deviation[3:].max())
        valid, offset = slip.values[np.isfinite(slip.values).all(axis=1)] * params.contacts.slip_axes[:6], math.nan
        if len(valid):
            offset, deviation = float(np.linalg.norm(valid.mean(axis=0)[:3])), valid.std(axis=0)
            noise["slip_sensor.noise_linear"] = float(deviation[:3].max())
            noise["slip_sensor.noise_angular"] = float(deviation[3:].max())
        found = {name: value for name, value in noise.items() if value > NO_NOISE}
        found["slip_sensor.rate_hz"] = 0.0 if slip.rate > (1.0 - RATE_SLACK) * heard.joints.rate else slip.rate
        found["slip_sensor.latency_s"] = max(0.0, float(np.median(slip.arrival - slip.stamp)))
        self.measured |= found
        self._slip_noise = found.get("slip_sensor.noise_linear", 0.0)
        speed = float(np.abs(heard.joints.values[:, len(params.joint_names) :].mean(axis=0)).max())
        force, torque = (found.get(f"wrench_sensor.noise_{name}", 0.0) for name in ("force", "torque"))
        most = NOISE_SHARE * params.governor.friction_limit
        felt = f"wrench noise {force:.4f} N, {torque:.5f} N m" if self._has_wrench else "no wrench sensor"
        return judge(
            "rest",
            f"joints at {speed:.4f} rad/s, {felt}; slip {1e3 * offset:.2f} mm/s, "
            f"noise {1e3 * self._slip_noise:.2f} mm/s, {1e3 * found['slip_sensor.latency_s']:.1f} ms late",
            f"below {RESTING_SPEED} rad/s, {most:.3g} N ({NOISE_SHARE:g} of governor.friction_limit), "
            f"{1e3 * SLIP_OFFSET:.0f} mm/s",
            (not speed < RESTING_SPEED, "let the arm come to rest"),
            (math.isnan(offset), "the slip sensor reports NaN: see its own messages"),
            (not offset < SLIP_OFFSET, "the slip sensor reports slip at rest: calibrate it; is its unit m/s?"),
            (not force < most, "filter the wrench in the driver, or grip harder and set governor.friction_limit"),
        )

    def _weighed(self, heard: Heard) -> Verdict:
        """Judge the wrench at rest against the weight of the object."""
        (force, torque), rotation = self._wrench(heard), self._robot.frame(heard.position)[1]
        expected_force, expected_torque = np.split(weight_on_pad(self._params, rotation), 2)
        weight, size = float(np.linalg.norm(expected_force)), float(np.linalg.norm(force))
        bias = self._params.wrench_sensor.bias_force
        slack = max(WEIGHT_SLACK * weight, 2.0 * bias)
        lever = float(np.linalg.norm(torque - expected_torque)) / max(weight, 2.0 * bias)
        turn, off = angle(force, expected_force), bool(np.linalg.norm(force - expected_force) > slack)
        return judge(
            "weight",
            f"force {_text(force)} N, and a torque that is {1e3 * lever:.0f} mm of lever off",
            f"{_text(expected_force)} N +- {slack:.2f}, and at most {1e3 * LEVER_SLACK:.0f} mm, by object.mass",
            (off and np.linalg.norm(force + expected_force) < slack, "the force is reversed: change wrench.sign"),
            (
                off and turn > TURNED and abs(size - weight) < slack,
                f"it is turned by {math.degrees(turn):.0f} degrees: correct wrench.frame, wrench.rpy or joint_names",
            ),
            (off and turn > ASKEW, "unload and zero the sensor; then check wrench.frame, wrench.rpy, wrench.tool_mass"),
            (
                off,
                f"{size:.3g} N instead of {weight:.3g} N: zero the sensor unloaded; then check wrench.force_scale, "
                "wrench.tool_mass or object.mass",
            ),
            (
                lever > LEVER_SLACK,
                "correct wrench.torque_scale, wrench.position, wrench.rpy, wrench.tool_com or contacts.position",
            ),
        )

    def _wrench(self, heard: Heard) -> tuple[Array, Array]:
        """Return mean force and torque as the controller takes them, on world axes; (3,) [N], [N m] {w}."""
        R = self._robot.frame(heard.position)[1]
        h = wrench_at_pad(self._sensor, heard.wrench.values.mean(axis=0), mat(R))
        return R @ np.array(h.linear), R @ np.array(h.angular)

    # -- a person pushes ---------------------------------------------------------------------------

    def _by_hand(self) -> Iterator[Verdict]:
        hands, before = self._hands, self._system.listen(WATCHED_S)
        for joint in range(len(self._params.joint_names)):
            turned = hands.turn(joint, self._inertia(before.position))
            yield self._turned(joint, turned.position - before.position if turned else None)
            before = self._system.listen(2.0 * WATCHED_S)
        if self._has_wrench:
            rest = self._wrench(before)[0]
            for axis, direction in zip(AXES, np.eye(3), strict=True):
                yield self._pushed(axis, self._wrench(hands.push(axis, direction))[0] - rest, direction)
        yield self._slid(before)

    def _slid(self, before: Heard) -> Verdict:
        """Judge the slip sensor by the motion of the pad on an object that is held fast."""
        params, q, heard = self._params, before.position, list[Heard]()
        axes, radius = np.array(params.contacts.slip_axes[:6], float), params.governor.torsional_radius
        R, J = self._robot.frame(q)[1:]
        for k in np.flatnonzero(axes):
            way = np.zeros(6)
            way[3 * (k // 3) :][:3] = (SLID if k < 3 else SPUN) * R[:, k % 3]
            lean = HOLD_STIFFNESS * self._inertia(q) @ np.linalg.pinv(J) @ way
            slid = self._hands.slide(AXES[k % 3], bool(k >= 3), lean, R)
            heard += [slid] if slid is not None else []
        step, expected = "slide", "the motion of the pad on the object"
        if not heard:
            return Verdict(step, "not moved: the drives resist the simulated hand", expected)
        (joints, _, slip, _), scale = joined(heard), axes * np.repeat([1.0, radius], 3)
        noticed = max(SLIP_SPEED, 6.0 * self._slip_noise)
        words, to_do, moved, read = slide_mistake(self._robot, joints, slip, scale, noticed)
        return judge(
            step,
            f"slip_velocity {words}" if words else f"{1e3 * read:.0f} mm of {1e3 * moved:.0f} mm slid",
            expected,
            (moved < LEAST_SLIDE, "move the hand further, with the object held fast"),
            (read == 0.0, "no slip was measured: grip more lightly, and check the sensor"),
            (bool(words), to_do),
        )

    def _turned(self, joint: int, moved: Array | None) -> Verdict:
        """Judge which joint has moved, and which way, when one was turned by hand in its positive sense."""
        names = self._params.joint_names
        step, name = f"joint {names[joint]}", names[joint]
        expected = f"{name} by more than {LEAST_TURN:+g}, the others by less than half of it"
        if moved is None:
            return Verdict(step, "not turned: its drive resists the simulated hand", expected)
        most, others = int(np.abs(moved).argmax()), np.delete(moved, joint)
        return judge(
            step, f"{names[most]} by {moved[most]:+.3f}", expected,
            (abs(moved[most]) < LEAST_TURN, "the joint moved too little: turn it further, or release its brake"),
            (
                most != joint,
                f"the driver calls {name} what the URDF calls {names[most]}: correct the driver's joint names",
            ),
            (moved[joint] < 0.0, "the sign is inverted: invert the axis in the URDF, or the sign in the driver"),
            (
                (np.abs(others) > 0.5 * abs(moved[joint])).any(),
                "other joints moved too: turn this one alone, or check whether the driver couples joints",
            ),
        )  # fmt: skip

    def _pushed(self, axis: str, change: Array, direction: Array) -> Verdict:
        """Judge how the force of the object on the robot changed when it was pushed; (3,) [N] {w}, (3,) {w}."""
        turn = angle(change, direction)
        return judge(
            f"push {axis}",
            f"force {_text(change)} N, {math.degrees(turn):.0f} degrees off",
            f"{_text(direction)}, at most {math.degrees(ASKEW):.0f} degrees off",
            (
                float(np.linalg.norm(change)) < LEAST_PUSH,
                f"no push was measured: push harder than {LEAST_PUSH:g} N, or set wrench.force_scale",
            ),
            (turn > math.pi - ASKEW, "the force is reversed: change wrench.sign, or turn wrench.rpy by 180 degrees"),
            (turn > ASKEW, "the force is turned: correct wrench.frame or wrench.rpy"),
        )

    def _inertia(self, q: Array) -> Array:
        arm = new(ARM)
        self._robot.terms(q, np.zeros(len(q)), arm)
        return np.asarray(record(arm, ARM).M[: len(q), : len(q)])

    # -- the controller holds the arm --------------------------------------------------------------

    def _held(self) -> Iterator[Verdict]:
        system, stiffness = self._system, "safety.hold_stiffness"
        self._hands.ready("the controller takes over and holds the arm, then drops its stiffness for 5 s")
        start = system.listen(WATCHED_S).position
        system.set_active(True)
        moved, _ = self._watched(start, HELD_S)
        if np.abs(moved).max() >= DRIFT:
            system.set_active(False)  # the drives hold the arm better than we do
        yield self._drifted("hold", moved, SAG, "with the stiffness of HOLD")
        yield _in_mode("mode", system.status, "HOLD")
        system.tune({stiffness: 0.0})
        try:
            moved, seconds = self._watched(start + moved, LOOSE_S)
        finally:
            system.tune({stiffness: self._params.safety.hold_stiffness})
            system.listen(2.0 * WATCHED_S)
        yield self._drifted("gravity", moved, DRIFT, f"in {seconds:.1f} s without stiffness")

    def _watched(self, start: Array, seconds: float) -> tuple[Array, float]:
        """Return how far the joints are from where they were, and after how long: at once where it is too far."""
        moved, past = np.zeros(len(start)), 0.0
        while past < seconds and np.abs(moved).max() < DRIFT:
            moved = self._system.listen(CLOSELY_S).position - start
            past += CLOSELY_S
        return moved, past

    def _drifted(self, step: str, moved: Array, most: float, condition: str) -> Verdict:
        """Judge how far the joints have moved in HOLD; (n,) [rad, m]."""
        worst = int(np.abs(moved).argmax())
        return judge(
            step,
            f"{self._params.joint_names[worst]} moved by {moved[worst]:+.4f} {condition}",
            f"at most {most:g}",
            (
                not np.abs(moved).max() < most,
                "change effort.gravity; else check the URDF's masses, object.mass, wrench bias, order of efforts",
            ),
        )

    # -- the law moves the arm ---------------------------------------------------------------------

    def _governed(self) -> Iterator[Verdict]:
        system = self._system
        system.set_active(False)
        self._hands.grip(firmly=False)
        self._hands.ready(f"the law starts and moves the object by at most {1e3 * MOTION_M:.0f} mm")
        system.set_active(True)
        system.listen(2.0 * WATCHED_S)
        system.ask("enable")
        try:
            for _ in range(round(STARTED_S / WATCHED_S)):
                heard = system.listen(WATCHED_S)
                if system.status.mode == "ACTIVE":
                    break
            yield _in_mode("enabled", system.status, "ACTIVE")
            here, R, _ = self._robot.frame(heard.position)
            inwards = -here * (1.0, 1.0, 0.0)
            there = here + MOTION_M * inwards / max(float(np.linalg.norm(inwards)), 1e-9)
            yield self._first_motion(there, R)
            yield self._friction(here, there, R)
        finally:
            with contextlib.suppress(SlipVicError):
                system.ask("hold")

    def _first_motion(self, there: Array, rotation: Array) -> Verdict:
        heard = self._go(there, rotation, DURATIONS_S[0])
        goal, status = self._system.goal, self._system.status
        missed = float(np.linalg.norm(self._robot.frame(heard.position)[0] - there))
        steps = np.diff(heard.slip.stamp, prepend=heard.slip.stamp[:1])
        slipped = float(np.linalg.norm(np.nansum(heard.slip.values[:, :3] * steps[:, None], axis=0)))
        most = SLIPPED + SIGMAS * self._slip_noise * math.sqrt(len(heard.slip.stamp)) / heard.slip.rate
        return judge(
            "first motion",
            f"{goal}, {1e3 * missed:.1f} mm from it, slip {1e3 * slipped:.2f} mm, {status.mode}",
            f"reached within {1e3 * MISSED:.0f} mm, slip below {1e3 * most:.1f} mm, ACTIVE",
            (
                not goal.endswith("reached") or status.mode != "ACTIVE",
                f"see controller/mode ({status}) and controller/goal; docs/faults.md has the fix",
            ),
            (
                not missed < MISSED,
                "zero the unloaded wrench sensor; else correct object.mass, or raise gains.stiffness",
            ),
            (not slipped < most, "grip harder; check governor.friction_limit and the slip sensor"),
        )

    def _friction(self, here: Array, there: Array, rotation: Array) -> Verdict:
        """Move back and there, faster each time, until it slips or the configured friction is used."""
        limit, system = self._params.governor.friction_limit, self._system
        carried, events, estimate = 0.0, 0, limit
        for number, duration in enumerate(DURATIONS_S[1:]):
            limits, loads, counts, slipping = self._go((here, there)[number % 2], rotation, duration).scalars.values.T
            estimate, events = float(limits[-1]), int(counts[-1])
            carried = max(carried, float(loads[slipping == 0.0].max(initial=0.0)))
            if events or carried > 0.9 * self._params.governor.margin * limit or not system.goal.endswith("reached"):
                break
        if events:
            self.measured["governor.friction_limit"] = estimate
        reached = system.goal.endswith("reached")
        found = f"F^ {estimate:.3f} N, carried {carried:.3f} N, {events} slips"
        return judge(
            "friction",
            found if reached else f"{system.goal or 'no answer to the goal'} ({system.status})",
            f"goals reached, with at least a fifth of governor.friction_limit ({limit:.3g} N)",
            (not reached, "grip harder; if the law has stopped, docs/faults.md has the fix for the reason"),
            (
                estimate < 0.2 * limit,
                "grip harder, or correct governor.friction_limit; check the slip sensor for false slip",
            ),
        )

    def _go(self, position: Array, rotation: Array, duration_s: float) -> Heard:
        """Send a goal and return what was heard until it was reached or refused."""
        system, heard = self._system, []
        before = system.goal
        system.send_goal(position, rotation, duration_s)
        for _ in range(round(GOAL_S / WATCHED_S)):
            heard.append(system.listen(WATCHED_S))
            if system.goal != before and ("refused" in system.goal or system.goal.endswith("reached")):
                break
        heard.append(system.listen(WATCHED_S))
        return joined(heard)


def stream(name: str, track: Track, least_hz: float, most_hz: float, oldest_s: float, ahead_s: float) -> Verdict:
    """Judge rate, order and age of the messages of a topic at rest.

    oldest_s, ahead_s: largest age at arrival, against the newest joint stamp, and most by which it may be ahead.
    """
    rates = f"at least {least_hz:.0f}" if math.isinf(most_hz) else f"{least_hz:.0f} to {most_hz:.0f}"
    expected = f"{rates} Hz, stamps in order, {-1e3 * ahead_s:.0f} to {1e3 * oldest_s:.0f} ms old"
    if len(track.stamp) < 3:
        missing = "start the driver, or remap its topic in the controller; compare the QoS"
        return Verdict(name, f"{len(track.stamp)} messages", expected, missing)
    hz, age, back = track.rate, track.arrival - track.stamp, int((np.diff(track.stamp) < 0.0).sum())
    return judge(
        name,
        f"{hz:.0f} Hz, {1e3 * np.median(age):.1f} ms old (99 %: {1e3 * np.quantile(age, 0.99):.1f}), "
        f"{back} stamps that go back",
        expected,
        (not track.stamp.any(), "all stamps are zero: let the driver stamp its measurements"),
        (back > 0, "look for a second driver, or one that stamps out of order"),
        (not np.median(age) < oldest_s, "synchronise the clocks (chrony, ptp), or find the cause of the delay"),
        (not np.median(age) > -ahead_s, "the clock is ahead of the joint states: synchronise both (chrony, ptp)"),
        (not least_hz <= hz, "raise the driver's rate, or adapt control_period_s or safety.inputs.*"),
        (not hz <= most_hz, "set control_period_s to the driver's rate"),
    )


def _in_mode(step: str, status: Status, wanted: str) -> Verdict:
    return judge(step, str(status), wanted, (status.mode != wanted, "docs/faults.md has the fix for this reason"))


def angle(a: Array, b: Array) -> float:
    """Return the angle between two vectors; (3,) -> [rad], a right angle where one is zero."""
    lengths = float(np.linalg.norm(a) * np.linalg.norm(b))
    return math.acos(max(-1.0, min(1.0, float(a @ b) / lengths))) if lengths > 0.0 else 0.5 * math.pi


def _text(v: Array) -> str:
    return "(" + ", ".join(f"{x:.2f}" for x in v) + ")"
