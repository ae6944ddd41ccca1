"""The checks of a bring-up: measured numbers in, a verdict with its fix out. Nothing here listens, waits or moves."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np

from slip_core.arrays import Array
from slip_vic_controller.params.controller_params import ControllerParams

RATE_SLACK: Final = 0.2
RESTING_SPEED: Final = 0.02  # [rad/s], of the mean, which noise of a velocity does not move
NO_NOISE: Final = 1e-9  # rounding, not a sensor's noise
SLIP_OFFSET: Final = 5e-3  # [m/s]: half of what opens the law's gate with its default steepness
NOISE_SHARE: Final = 0.4  # of the friction limit: above it white noise alone looks like slip (docs/sensors.md)
WEIGHT_SLACK: Final = 0.2
LEVER_SLACK: Final = 0.03  # [m] between the weight's line of action and that of the measured wrench
TURNED: Final = math.radians(10.0)  # of a weight
ASKEW: Final = math.radians(35.0)  # of a push by hand
LEAST_TURN: Final = 0.01  # [rad, m]: of a joint that is moved by hand
LEAST_PUSH: Final = 0.5  # [N]
SAG: Final = 0.02  # [rad, m]: in HOLD with its stiffness
DRIFT: Final = 0.05  # [rad, m]: in 5 s without stiffness
MISSED: Final = 0.01  # [m]: of the first motion's goal
SLIPPED: Final = 2e-3  # [m]: of the first motion


class Track(NamedTuple):
    """Samples of one topic: newest joint stamp when each arrived [s] (k,), own stamp [s] (k,), numbers (k, m)."""

    arrival: Array
    stamp: Array
    values: Array

    @property
    def rate(self) -> float:
        """Rate by stamps [Hz]; NaN where there are fewer than two. Gaps, in which nobody listened, do not count."""
        steps = np.diff(np.unique(self.stamp))
        return 1.0 / float(steps[steps < 3.0 * np.median(steps)].mean()) if len(steps) else math.nan


class Heard(NamedTuple):
    """The messages of some time.

    joints: positions, then velocities (k, 2 n) [rad, rad/s]; wrench: as the driver gives it (k, 6) [N, N m];
    slip: twists (k, 6) [m/s, rad/s]; scalars: by name (k,).
    """

    joints: Track
    wrench: Track
    slip: Track
    scalars: Mapping[str, Array]

    @property
    def position(self) -> Array:
        """Mean joint positions of the last tenth; (n,) [rad]."""
        q = self.joints.values[:, : self.joints.values.shape[1] // 2]
        return np.asarray(q[-max(1, len(q) // 10) :].mean(axis=0))


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


def judge_controller(params: ControllerParams, mode: str) -> Verdict:
    """Judge whether the controller was started as a bring-up needs it."""
    trajectory, governor, auto = params.trajectory.kind, params.governor, params.safety.auto_enable
    right = trajectory == "goal" and governor.mode != "off" and governor.friction == "unknown" and not auto
    return judge(
        "controller",
        f"trajectory.kind {trajectory}, governor.mode {governor.mode}, governor.friction {governor.friction}, "
        f"safety.auto_enable {str(auto).lower()}, mode {mode.partition(':')[0] or 'inactive'}",
        "goal, slow_down, unknown, false, and a law that is not active",
        (
            not right,
            "start it with trajectory.kind:=goal, governor.mode:=slow_down, governor.friction:=unknown and "
            "safety.auto_enable:=false",
        ),
        (mode.startswith(("ACTIVE", "DEGRADED", "FAULT")), "call ~/hold, or ~/reset_fault after a fault"),
    )


def judge_stream(name: str, track: Track, least_hz: float, most_hz: float, oldest_s: float, future_s: float) -> Verdict:
    """Judge rate, order and age of the messages of a topic.

    Args:
        name: of the topic.
        track: its messages at rest.
        least_hz, most_hz: bounds of the rate.
        oldest_s: largest age at arrival, against the newest joint stamp; future_s: how far it may be ahead.
    """
    rates = f"at least {least_hz:.0f}" if math.isinf(most_hz) else f"{least_hz:.0f} to {most_hz:.0f}"
    expected = f"{rates} Hz, stamps in order, {-1e3 * future_s:.0f} to {1e3 * oldest_s:.0f} ms old"
    if len(track.stamp) < 3:
        missing = (True, "start the driver, or remap its topic in the controller; compare the QoS")
        return judge(name, f"{len(track.stamp)} messages", expected, missing)
    hz, age = track.rate, track.arrival - track.stamp
    back = int((np.diff(track.stamp) < 0.0).sum())
    return judge(
        name,
        f"{hz:.0f} Hz, {1e3 * np.median(age):.1f} ms old (99 %: {1e3 * np.quantile(age, 0.99):.1f}), "
        f"{back} stamps that go back",
        expected,
        (not track.stamp.any(), "let the driver stamp what it measures: all stamps are zero"),
        (back > 0, "two drivers, or one that stamps late?"),
        (not np.median(age) < oldest_s, "synchronise the clocks (chrony, ptp), or look for what delays it"),
        (not np.median(age) > -future_s, "its clock is ahead of the joint states': synchronise them (chrony, ptp)"),
        (not least_hz <= hz, "raise the driver's rate, or set control_period_s or safety.inputs to it"),
        (not hz <= most_hz, "set control_period_s to the driver's rate"),
    )


def measured_sensors(heard: Heard, params: ControllerParams) -> tuple[Mapping[str, float], float]:
    """Return the sensors' values at rest by parameter, and the mean slip speed [m/s], NaN without a valid reading.

    A reading that never changes (a dead band) has no noise to measure: the parameter keeps its value.
    """
    wrench, slip, noise = heard.wrench, heard.slip, dict[str, float]()
    if params.wrench.source == "sensor":
        deviation = wrench.values.std(axis=0)
        noise["wrench_sensor.noise_force"] = params.wrench.force_scale * float(deviation[:3].max())
        noise["wrench_sensor.noise_torque"] = params.wrench.torque_scale * float(deviation[3:].max())
    valid = slip.values[np.isfinite(slip.values).all(axis=1)] * np.array(params.contacts.slip_axes[:6])
    offset = float(np.linalg.norm(valid.mean(axis=0)[:3])) if len(valid) else math.nan
    if len(valid):
        deviation = valid.std(axis=0)
        noise["slip_sensor.noise_linear"] = float(deviation[:3].max())
        noise["slip_sensor.noise_angular"] = float(deviation[3:].max())
    found = {name: value for name, value in noise.items() if value > NO_NOISE}
    found["slip_sensor.rate_hz"] = 0.0 if slip.rate > (1.0 - RATE_SLACK) * heard.joints.rate else slip.rate
    found["slip_sensor.latency_s"] = max(0.0, float(np.median(slip.arrival - slip.stamp)))
    return found, offset


def judge_rest(speed: float, offset: float, params: ControllerParams, found: Mapping[str, float]) -> Verdict:
    """Judge the readings while nothing moves.

    Args:
        speed: largest mean speed of a joint [rad/s].
        offset: mean slip speed [m/s]; NaN: no valid reading.
        params: of the controller.
        found: of `measured_sensors`.
    """
    noise, most = found.get("wrench_sensor.noise_force", 0.0), NOISE_SHARE * params.governor.friction_limit
    latency, torque = 1e3 * found["slip_sensor.latency_s"], found.get("wrench_sensor.noise_torque", 0.0)
    felt = f"wrench noise {noise:.4f} N, {torque:.5f} N m" if params.wrench.source == "sensor" else "no wrench sensor"
    return judge(
        "rest",
        f"joints at {speed:.4f} rad/s, {felt}; slip {1e3 * offset:.2f} mm/s, "
        f"noise {1e3 * found.get('slip_sensor.noise_linear', 0.0):.2f} mm/s, {latency:.1f} ms late",
        f"below {RESTING_SPEED} rad/s, {most:.3g} N ({NOISE_SHARE:g} of governor.friction_limit), "
        f"{1e3 * SLIP_OFFSET:.0f} mm/s",
        (not speed < RESTING_SPEED, "let the arm come to rest"),
        (math.isnan(offset), "the slip sensor reports that it does not measure: see its own messages"),
        (
            not offset < SLIP_OFFSET,
            "the slip sensor reads slip where there is none: calibrate it, or set measured.dead_band_linear",
        ),
        (not noise < most, "filter the wrench in its driver, or grip harder and set governor.friction_limit"),
    )


def judge_weight(force: Array, torque: Array, expected_force: Array, expected_torque: Array, bias: float) -> Verdict:
    """Judge the wrench at rest against the weight of the object.

    Args:
        force, torque: of the object on the robot, as the controller uses it; (3,) [N], [N m] {w}.
        expected_force, expected_torque: of its weight; (3,).
        bias: size of the force error that is expected [N].
    """
    weight, size = float(np.linalg.norm(expected_force)), float(np.linalg.norm(force))
    slack = max(WEIGHT_SLACK * weight, 2.0 * bias)
    lever = float(np.linalg.norm(torque - expected_torque)) / max(weight, 2.0 * bias)
    turn, off = angle(force, expected_force), bool(np.linalg.norm(force - expected_force) > slack)
    return judge(
        "weight",
        f"force {_text(force)} N, and a torque that is {1e3 * lever:.0f} mm of lever off",
        f"{_text(expected_force)} N +- {slack:.2f}, and at most {1e3 * LEVER_SLACK:.0f} mm, by object.mass",
        (off and np.linalg.norm(force + expected_force) < slack, "it points the other way: change wrench.sign"),
        (
            off and turn > TURNED and abs(size - weight) < slack,
            f"it is turned by {math.degrees(turn):.0f} degrees: wrench.frame or wrench.rpy, or joint_names",
        ),
        (off and turn > ASKEW, "unload the sensor and zero it; then wrench.frame, wrench.rpy, wrench.tool_mass"),
        (
            off and not weight / 3.0 < size < 3.0 * weight,
            f"it is {size:.3g} N for {weight:.3g} N: wrench.force_scale, or wrench.tool_mass",
        ),
        (off, f"it is {size - weight:+.2f} N off: wrench.tool_mass, object.mass, or zero the unloaded sensor"),
        (
            lever > LEVER_SLACK,
            "wrench.torque_scale, wrench.position, wrench.rpy, wrench.tool_com or contacts.position",
        ),
    )


def judge_joint(names: Sequence[str], joint: int, moved: Array | None) -> Verdict:
    """Judge which joint has moved, and which way, when one was turned by hand in its positive sense.

    Args:
        names: of the joints.
        joint: the one that was turned.
        moved: by how much each of them has; (n,) [rad, m]; None: the simulated hand cannot turn it.
    """
    step = f"joint {names[joint]}"
    expected = f"{names[joint]} by more than {LEAST_TURN:+g}, the others by less than half of it"
    if moved is None:
        return Verdict(step, "not turned: its drive holds against the simulated hand", expected)
    most = int(np.abs(moved).argmax())
    return judge(
        step,
        f"{names[most]} by {moved[most]:+.3f}",
        expected,
        (abs(moved[most]) < LEAST_TURN, "it did not move enough: turn it further, or release its brake"),
        (
            most != joint,
            f"the driver calls {names[joint]} what the URDF calls {names[most]}: correct the driver's joint names",
        ),
        (moved[joint] < 0.0, "its sign is the other one: turn the axis in the URDF, or the sign in the driver"),
        (
            (np.abs(np.delete(moved, joint)) > 0.5 * abs(moved[joint])).any(),
            "others moved with it: turn it alone, or check whether joints are coupled in the driver",
        ),
    )


def judge_push(axis: str, change: Array, direction: Array) -> Verdict:
    """Judge how the wrench changed when the object was pushed.

    Args:
        axis: name of the direction.
        change: of the force of the object on the robot; (3,) [N] {w}.
        direction: of the push; (3,) {w}.
    """
    turn = angle(change, direction)
    return judge(
        f"push {axis}",
        f"force {_text(change)} N, {math.degrees(turn):.0f} degrees off",
        f"{_text(direction)}, at most {math.degrees(ASKEW):.0f} degrees off",
        (
            float(np.linalg.norm(change)) < LEAST_PUSH,
            f"no push was measured: push harder than {LEAST_PUSH:g} N, or set wrench.force_scale",
        ),
        (turn > math.pi - ASKEW, "it points the other way: change wrench.sign, or turn wrench.rpy by half a turn"),
        (turn > ASKEW, "it is turned: wrench.frame or wrench.rpy"),
    )


def judge_pull(axis: str, slipped: Array, direction: Array) -> Verdict:
    """Judge the slip sensor's readings when the object was pulled through the pads.

    Args:
        axis: name of the direction.
        slipped: integral of the readings above the noise; (3,) [m] {ee}, zero where there are none.
        direction: in which the object was pulled; (3,) {ee}.
    """
    turn, far = angle(slipped, -direction), float(np.linalg.norm(slipped))
    return judge(
        f"pull {axis}",
        f"{1e3 * far:.1f} mm along {_text(slipped / max(far, 1e-12))}",
        "the pad moves on the object the other way",
        (far == 0.0, "no slip was measured: pull further, or grip less"),
        (turn > math.pi - ASKEW, "it reads the object relative to the pad: change the sign of all its readings"),
        (turn > ASKEW, "its axes are not those of ee_frame: turn them in the driver"),
    )


def judge_drift(step: str, names: Sequence[str], moved: Array, most: float, condition: str) -> Verdict:
    """Judge how far the joints have moved in HOLD; moved: (n,) [rad, m]; most: the bound; condition: with or without
    its stiffness.
    """
    worst = int(np.abs(moved).argmax())
    return judge(
        step,
        f"{names[worst]} moved by {moved[worst]:+.4f} {condition}",
        f"at most {most:g}",
        (
            not np.abs(moved).max() < most,
            "change effort.gravity; else the URDF's masses, object.mass, the wrench's bias, or the order of efforts",
        ),
    )


def judge_mode(step: str, mode: str, wanted: str) -> Verdict:
    """Judge the controller's mode."""
    return judge(
        step, mode or "no mode", wanted,
        (not mode.startswith(wanted), "docs/troubleshooting.md has the fix for this reason"),
    )  # fmt: skip


def judge_friction(configured: float, estimate: float, carried: float, events: int, goal: str, mode: str) -> Verdict:
    """Judge the friction after the probing motions.

    Args:
        configured: governor.friction_limit [N].
        estimate: F^ at the end [N]; carried: largest commanded load without slip [N].
        events: how often it has slipped.
        goal: state of the last goal; mode: at its end.
    """
    reached = goal.endswith("reached")
    found = f"F^ {estimate:.3f} N, carried {carried:.3f} N, {events} slips"
    return judge(
        "friction",
        found if reached else f"{goal or 'no answer to the goal'} ({mode})",
        f"goals that are reached, with at least a fifth of governor.friction_limit ({configured:.3g} N)",
        (not reached, "more grip; where the law has stopped, docs/troubleshooting.md has the fix for the reason"),
        (
            estimate < 0.2 * configured,
            "more grip, or set governor.friction_limit; a sensor that reports slip where there is none does this too",
        ),
    )


def judge_motion(goal: str, mode: str, missed: float, slipped: float, most: float) -> Verdict:
    """Judge the first governed motion.

    Args:
        goal: its state.
        mode: at its end.
        missed: distance from the goal [m].
        slipped: how far the pad moved on the object, by the slip sensor; most: with its noise [m].
    """
    return judge(
        "first motion",
        f"{goal}, {1e3 * missed:.1f} mm from it, slip {1e3 * slipped:.2f} mm, {mode.partition(':')[0]}",
        f"reached within {1e3 * MISSED:.0f} mm, slip below {1e3 * most:.1f} mm, ACTIVE",
        (
            not goal.endswith("reached") or not mode.startswith("ACTIVE"),
            f"see controller/mode ({mode}) and controller/goal",
        ),
        (
            not missed < MISSED,
            "zero the unloaded wrench sensor; else object.mass, or gains.stiffness too low for the sensor's bias",
        ),
        (not slipped < most, "more grip; check governor.friction_limit and the slip sensor"),
    )


def angle(a: Array, b: Array) -> float:
    """Return the angle between two vectors; (3,) -> [rad], a right angle where one is zero."""
    lengths = float(np.linalg.norm(a) * np.linalg.norm(b))
    return math.acos(max(-1.0, min(1.0, float(a @ b) / lengths))) if lengths > 0.0 else 0.5 * math.pi


def _text(v: Array) -> str:
    return "(" + ", ".join(f"{x:.2f}" for x in v) + ")"
