"""The rules of a bring-up: numbers in, a verdict with words out. Nothing here listens, waits or moves anything."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np

from slip_core.arrays import Array
from slip_vic_controller.params.controller_params import ControllerParams

RATE_SLACK: Final = 0.2
RESTING_SPEED: Final = 0.02  # [rad/s], of the mean: noise of a velocity does not count
NO_NOISE: Final = 1e-9  # what is below it is rounding, not a sensor's noise
SLIP_OFFSET: Final = 5e-3  # [m/s]: half of what the law's gate opens by with its default steepness
NOISE_SHARE: Final = 0.4  # of the friction limit: above it white noise alone looks like slip (docs/sensors.md)
WEIGHT_SLACK: Final = 0.2
LEVER_SLACK: Final = 0.03  # [m]: a weight that seems to hang further off than this has a wrong torque
TURNED: Final = math.radians(10.0)  # of a weight
ASKEW: Final = math.radians(35.0)  # of a push by hand
LEAST_TURN: Final = 0.01  # [rad, m]: of a joint that is moved by hand
LEAST_PUSH: Final = 0.5  # [N]
SIZE_SLACK: Final = 0.3  # of a push whose size is known
SAG: Final = 0.02  # [rad, m]: in HOLD with its stiffness
DRIFT: Final = 0.05  # [rad, m]: in 5 s without stiffness
MISSED: Final = 0.01  # [m]: of the first motion's goal
SLIPPED: Final = 2e-3  # [m]: of the first motion


class Endpoint(NamedTuple):
    """One input of the controller as it is found: who publishes it, and what a first message says of itself.

    topic: its full name; publishers: how many; kinds: their types; wanted: the type that is wanted; frame: of the
    first message, wanted_frame: "" where any will do; names: of the joints in it.
    """

    topic: str
    publishers: int
    kinds: tuple[str, ...]
    wanted: str
    frame: str = ""
    wanted_frame: str = ""
    names: tuple[str, ...] = ()


class Track(NamedTuple):
    """Samples of one topic: newest joint stamp when each arrived [s] (k,), own stamp [s] (k,), numbers (k, m)."""

    arrival: Array
    stamp: Array
    values: Array


class Heard(NamedTuple):
    """What was heard for a time.

    joints: positions, then velocities (k, 2 n) [rad, rad/s]; wrench: as the driver gives it (k, 6) [N, N m];
    slip: twists (k, 6) [m/s, rad/s], poses (k, 7) [m] or flags (k, m), as `slip_input` says; scalars: by name (k,).
    """

    joints: Track
    wrench: Track
    slip: Track
    scalars: Mapping[str, Array]

    @property
    def position(self) -> Array:
        """Mean joint positions of the last tenth of what was heard; (n,) [rad]."""
        q = self.joints.values[:, : self.joints.values.shape[1] // 2]
        return np.asarray(q[-max(1, len(q) // 10) :].mean(axis=0))


class Verdict(NamedTuple):
    """What a step measured, what it expects, and what to do where it is not so; no fix: it is so."""

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


def judge_controller(params: ControllerParams, mode: str) -> Verdict:
    """Judge whether the controller was started such that a bring-up can lead it."""
    trajectory, governor, auto = params.trajectory.kind, params.governor, params.safety.auto_enable
    measured = (
        f"trajectory.kind {trajectory}, governor.mode {governor.mode}, governor.friction {governor.friction}, "
        f"safety.auto_enable {str(auto).lower()}, mode {mode.partition(':')[0] or 'inactive'}"
    )
    expected = "goal, slow_down, unknown, false, and a law that is not at work"
    right = trajectory == "goal" and governor.mode != "off" and governor.friction == "unknown" and not auto
    fix = ""
    if not right:
        fix = (
            "start it with trajectory.kind:=goal, governor.mode:=slow_down, governor.friction:=unknown and "
            "safety.auto_enable:=false"
        )
    elif mode.startswith(("ACTIVE", "DEGRADED", "FAULT")):
        fix = "call ~/hold, or ~/reset_fault after a fault"
    return Verdict("controller", measured, expected, fix)


def judge_topics(endpoints: Sequence[Endpoint], joint_names: Sequence[str]) -> Verdict:
    """Judge who publishes the inputs, with which type, in which frame, with which joints."""
    expected = "one publisher each, of the right type, frame and joints"
    for end in endpoints:
        others = [kind for kind in end.kinds if kind != end.wanted]
        missing = [name for name in joint_names if end.names and name not in end.names]
        said, fix = "", ""
        if others:
            said, fix = (
                f"{end.topic} of type {others[0]}",
                f"publish {end.wanted}, or use an adapter as in examples/tactile_adapters",
            )
        elif not end.publishers:
            said, fix = (
                f"no publisher on {end.topic}",
                f"start the driver, or remap: -r {end.topic.split('/')[-1]}:=/ITS_TOPIC",
            )
        elif end.publishers > 1:
            said, fix = f"{end.publishers} publishers on {end.topic}", "stop all but one"
        elif end.wanted_frame and end.frame not in ("", end.wanted_frame):
            said = f"{end.topic} in frame {end.frame}"
            fix = f"it is taken to be {end.wanted_frame}: set wrench.frame and its place, or let the driver publish it"
        elif missing:
            said, fix = f"no joint {missing[0]} in {end.topic}", f"set joint_names; it has {', '.join(end.names)}"
        if fix:
            return Verdict("topics", said, expected, fix)
    return Verdict("topics", ", ".join(end.topic for end in endpoints), expected)


def judge_stream(name: str, track: Track, least_hz: float, most_hz: float, oldest_s: float, future_s: float) -> Verdict:
    """Judge rate, order and age of what comes on a topic.

    Args:
        name: of the topic.
        track: what came while all was at rest.
        least_hz, most_hz: bounds of the rate.
        oldest_s: largest age at arrival, against the newest joint stamp; future_s: how far it may be ahead.
    """
    expected = f"{_span(least_hz, most_hz)} Hz, stamps in order, {-1e3 * future_s:.0f} to {1e3 * oldest_s:.0f} ms old"
    if len(track.stamp) < 3:
        return Verdict(name, f"{len(track.stamp)} messages", expected, "is the driver running, with QoS that matches?")
    steps = np.diff(track.stamp)
    if not track.stamp.any():
        return Verdict(name, "stamps that are zero", expected, "let the driver stamp what it measures")
    hz, age = rate(track), track.arrival - track.stamp
    measured = f"{hz:.0f} Hz, {1e3 * np.median(age):.1f} ms old (99 %: {1e3 * np.quantile(age, 0.99):.1f})"
    fix = ""
    if (steps < 0.0).any():
        measured, fix = f"stamps that go back {int((steps < 0.0).sum())} times", "two drivers, or one that stamps late?"
    elif not np.median(age) < oldest_s:
        fix = "synchronise the clocks (chrony, ptp), or look for what delays it"
    elif not np.median(age) > -future_s:
        fix = "its clock is ahead of the joint states': synchronise them (chrony, ptp)"
    elif not least_hz <= hz:
        fix = "raise the driver's rate, or set control_period_s or safety.inputs to it"
    elif not hz <= most_hz:
        fix = "set control_period_s to the driver's rate"
    return Verdict(name, measured, expected, fix)


def _span(low: float, high: float) -> str:
    return f"at least {low:.0f}" if math.isinf(high) else f"{low:.0f} to {high:.0f}"


def rate(track: Track) -> float:
    """Return the rate by stamps [Hz]; nan where there are no two of them. Gaps, which we did not hear, do not count."""
    steps = np.diff(np.unique(track.stamp))
    return 1.0 / float(steps[steps < 3.0 * np.median(steps)].mean()) if len(steps) else math.nan


def measured_sensors(
    joints: Track, wrench: Track, slip: Track, params: ControllerParams
) -> tuple[Mapping[str, float], tuple[float, float]]:
    """Return what is measured of the sensors at rest, by parameter, and mean and deviation of the slip speed [m/s].

    A reading that never changes (a dead band) says nothing of the noise: what the parameters tell stays.
    """
    noise, scales = {}, params.wrench
    if scales.source == "sensor":
        deviation = wrench.values.std(axis=0)
        noise["wrench_sensor.noise_force"] = scales.force_scale * float(deviation[:3].max())
        noise["wrench_sensor.noise_torque"] = scales.torque_scale * float(deviation[3:].max())
    offset, speeds = (0.0, (0.0, 0.0)) if params.slip_input == "flag" else _slip_noise(slip, params)
    noise |= {"slip_sensor.noise_linear": speeds[0], "slip_sensor.noise_angular": speeds[1]}
    found = {name: value for name, value in noise.items() if value > NO_NOISE}
    hz = rate(slip)
    found["slip_sensor.rate_hz"] = 0.0 if hz > (1.0 - RATE_SLACK) * rate(joints) else hz
    found["slip_sensor.latency_s"] = max(0.0, float(np.median(slip.arrival - slip.stamp)))
    return found, (offset, speeds[0])


def _slip_noise(slip: Track, params: ControllerParams) -> tuple[float, tuple[float, float]]:
    """Return the mean slip speed [m/s], and its deviation, linear and angular [m/s], [rad/s]."""
    axes = np.array(params.contacts.slip_axes[:6])
    if params.slip_input == "twist":
        v = slip.values[np.isfinite(slip.values).all(axis=1)]
    else:  # of the quaternion twice the vector part is the turn, where turns are small
        place = np.hstack((slip.values[:, :3], 2.0 * slip.values[:, 3:6]))
        v = np.diff(place, axis=0) * rate(slip)
    if not len(v):
        return math.nan, (0.0, 0.0)
    noise = v.std(axis=0) * axes
    mean = float(np.linalg.norm(v.mean(axis=0)[:3] * axes[:3]))
    return mean, (float(noise[:3].max()), float(noise[3:].max()))


def judge_rest(speed: float, offset: float, params: ControllerParams, found: Mapping[str, float]) -> Verdict:
    """Judge what the sensors read while nothing moves.

    Args:
        speed: largest mean speed of a joint [rad/s].
        offset: mean slip speed [m/s]; nan: no valid reading.
        params: of the controller.
        found: of `measured_sensors`.
    """
    noise, most = found.get("wrench_sensor.noise_force", 0.0), NOISE_SHARE * params.governor.friction_limit
    latency, torque = 1e3 * found["slip_sensor.latency_s"], found.get("wrench_sensor.noise_torque", 0.0)
    felt = f"wrench noise {noise:.4f} N, {torque:.5f} N m" if params.wrench.source == "sensor" else "no wrench sensor"
    measured = (
        f"joints at {speed:.4f} rad/s, {felt}; slip {1e3 * offset:.2f} mm/s, "
        f"noise {1e3 * found.get('slip_sensor.noise_linear', 0.0):.2f} mm/s, {latency:.1f} ms late"
    )
    expected = (
        f"below {RESTING_SPEED} rad/s, {most:.3g} N ({NOISE_SHARE:g} of governor.friction_limit), "
        f"{1e3 * SLIP_OFFSET:.0f} mm/s"
    )
    fix = ""
    if not speed < RESTING_SPEED:
        fix = "let the arm come to rest"
    elif math.isnan(offset):
        fix = "the slip sensor reports that it does not measure: look at its own messages"
    elif not offset < SLIP_OFFSET:
        fix = "the slip sensor reads slip where there is none: calibrate it, or set measured.dead_band_linear"
    elif not noise < most:
        fix = "filter the wrench in its driver, or grip harder and set governor.friction_limit"
    return Verdict("rest", measured, expected, fix)


def judge_weight(force: Array, torque: Array, expected_force: Array, expected_torque: Array, bias: float) -> Verdict:
    """Judge the wrench at rest against the weight of the object.

    Args:
        force, torque: of the object on the robot, as the controller takes it; (3,) [N], [N m] {w}.
        expected_force, expected_torque: of its weight; (3,).
        bias: size of a force error that is expected [N].
    """
    weight, size = float(np.linalg.norm(expected_force)), float(np.linalg.norm(force))
    slack = max(WEIGHT_SLACK * weight, 2.0 * bias)
    lever = float(np.linalg.norm(torque - expected_torque)) / max(weight, 2.0 * bias)
    measured = f"force {_text(force)} N, and a torque that is {1e3 * lever:.0f} mm of lever off"
    expected = (
        f"{_text(expected_force)} N +- {slack:.2f}, and at most {1e3 * LEVER_SLACK:.0f} mm: object.mass hangs there"
    )
    fix = ""
    if np.linalg.norm(force - expected_force) > slack:
        turn = angle(force, expected_force)
        if np.linalg.norm(force + expected_force) < slack:
            fix = "it points the other way: change wrench.sign"
        elif turn > TURNED and abs(size - weight) < slack:
            fix = f"it is turned by {math.degrees(turn):.0f} degrees: wrench.frame or wrench.rpy, or joint_names"
        elif turn > ASKEW:
            fix = "unload the sensor and zero it; then wrench.frame, wrench.rpy, wrench.tool_mass"
        elif size > 3.0 * weight or size < weight / 3.0:
            fix = f"it is {size / weight:.3g} times the weight: wrench.force_scale, or wrench.tool_mass"
        else:
            fix = f"it is {size - weight:+.2f} N off: wrench.tool_mass, object.mass, or zero the unloaded sensor"
    elif lever > LEVER_SLACK:
        fix = "wrench.torque_scale, wrench.position, wrench.rpy, wrench.tool_com or contacts.position"
    return Verdict("weight", measured, expected, fix)


def judge_joint(names: Sequence[str], joint: int, moved: Array | None) -> Verdict:
    """Judge which joint has moved, and which way, when one was turned by hand in its positive sense.

    Args:
        names: of the joints.
        joint: the one that was turned.
        moved: by how much each of them has; (n,) [rad, m]; None: no hand can turn it.
    """
    step = f"joint {names[joint]}"
    expected = f"{names[joint]} by more than {LEAST_TURN:+g}, the others by less than half of it"
    if moved is None:
        return Verdict(step, "not turned: its drive holds against the simulated hand", expected)
    most = int(np.abs(moved).argmax())
    measured = f"{names[most]} by {moved[most]:+.3f}"
    fix = ""
    if abs(moved[most]) < LEAST_TURN:
        fix = "it did not move enough: turn it further, or release its brake"
    elif most != joint:
        fix = f"the driver calls {names[joint]} what the URDF calls {names[most]}: put its joint names right"
    elif moved[joint] < 0.0:
        fix = "its sign is that of the other sense: turn the axis in the URDF, or the sign in the driver"
    elif (np.abs(np.delete(moved, joint)) > 0.5 * abs(moved[joint])).any():
        fix = "others moved with it: turn it alone, or look whether joints are coupled in the driver"
    return Verdict(step, measured, expected, fix)


def judge_push(axis: str, change: Array, direction: Array, size: float | None) -> Verdict:
    """Judge how the wrench changed when the object was pushed.

    Args:
        axis: what the direction is called.
        change: of the force of the object on the robot; (3,) [N] {w}.
        direction: of the push; (3,) {w}.
        size: of the push [N]; None: by hand.
    """
    strength, turn = float(np.linalg.norm(change)), angle(change, direction)
    measured = f"force {_text(change)} N, {math.degrees(turn):.0f} degrees off"
    known = "" if size is None else f" of {size:g} N +- {100.0 * SIZE_SLACK:.0f} %"
    expected = f"{_text(direction)}{known}, at most {math.degrees(ASKEW):.0f} degrees off"
    fix = ""
    if strength < LEAST_PUSH:
        fix = f"no push was felt: push harder than {LEAST_PUSH:g} N, or set wrench.force_scale"
    elif turn > math.pi - ASKEW:
        fix = "it points the other way: change wrench.sign, or turn wrench.rpy by half a turn"
    elif turn > ASKEW:
        fix = "it is turned: wrench.frame or wrench.rpy"
    elif size is not None and abs(strength / size - 1.0) > SIZE_SLACK:
        fix = f"it is {strength / size:.3g} times the push: wrench.force_scale"
    return Verdict(f"push {axis}", measured, expected, fix)


def judge_pull(axis: str, slipped: Array | None, direction: Array, flagged: bool) -> Verdict:
    """Judge what the slip sensor read when the object was pulled through the pads.

    Args:
        axis: what the direction is called.
        slipped: how far the pad has moved on the object, by its readings; (3,) [m] {ee}; None where it gives flags.
        direction: in which the object was pulled; (3,) {ee}.
        flagged: whether it has reported slip.
    """
    expected = "the pad moves on the object the other way"
    if slipped is None:
        fix = "" if flagged else "the flag never rose: look at the sensor's threshold and at the message's names"
        return Verdict(f"pull {axis}", "a flag" if flagged else "no flag", "a flag", fix)
    turn, far = angle(slipped, -direction), float(np.linalg.norm(slipped))
    measured = f"{1e3 * far:.1f} mm along {_text(slipped / max(far, 1e-12))}"
    fix = ""
    if not flagged:
        fix = "no slip was read: pull further, or grip less"
    elif turn > math.pi - ASKEW:
        fix = "it reads the object relative to the pad: turn the sign of all its readings"
    elif turn > ASKEW:
        fix = "its axes are not those of ee_frame: turn them in the driver"
    return Verdict(f"pull {axis}", measured, expected, fix)


def judge_sag(names: Sequence[str], moved: Array) -> Verdict:
    """Judge how far the arm has gone when the controller took it over in HOLD; (n,) [rad, m]."""
    return _drifted("hold", names, moved, SAG, "with the stiffness of HOLD")


def judge_drift(names: Sequence[str], moved: Array, seconds: float) -> Verdict:
    """Judge how far the arm has gone in HOLD without stiffness; (n,) [rad, m]."""
    return _drifted("gravity", names, moved, DRIFT, f"in {seconds:.1f} s without stiffness")


def _drifted(step: str, names: Sequence[str], moved: Array, most: float, when: str) -> Verdict:
    worst = int(np.abs(moved).argmax())
    measured, expected = f"{names[worst]} moved by {moved[worst]:+.4f} {when}", f"at most {most:g}"
    fix = ""
    if not np.abs(moved).max() < most:
        fix = "change effort.gravity; else the URDF's masses, object.mass, the wrench's bias, or the order of efforts"
    return Verdict(step, measured, expected, fix)


def judge_mode(step: str, mode: str, wanted: Sequence[str]) -> Verdict:
    """Judge the controller's mode."""
    fix = "" if mode.startswith(tuple(wanted)) else "docs/troubleshooting.md has the fix for this reason"
    return Verdict(step, mode or "no mode", " or ".join(wanted), fix)


def judge_friction(configured: float, estimate: float, carried: float, events: int, goal: str, mode: str) -> Verdict:
    """Judge what the probing motions have shown of the friction.

    Args:
        configured: governor.friction_limit [N].
        estimate: F^ in the end [N]; carried: largest load that was asked without slip [N].
        events: how often it has slipped.
        goal: what became of the last goal; mode: at its end.
    """
    slipped = f"slipped {events} times" if events else "never slipped"
    measured = f"F^ {estimate:.3f} N, carried {carried:.3f} N, {slipped}"
    expected = f"goals that are reached, with at least a fifth of governor.friction_limit ({configured:.3g} N)"
    fix = ""
    if not goal.endswith("reached"):
        measured = f"{goal or 'no answer to the goal'} ({mode})"
        fix = "more grip; where the law has stopped, docs/troubleshooting.md has the fix for the reason"
    elif estimate < 0.2 * configured:
        fix = "more grip, or set governor.friction_limit; a sensor that reports slip where there is none does this too"
    return Verdict("friction", measured, expected, fix)


def judge_motion(goal: str, mode: str, missed: float, slipped: float, doubt: float, speed: float) -> Verdict:
    """Judge the first governed motion.

    Args:
        goal: what became of it.
        mode: at its end.
        missed: distance from the goal [m].
        slipped: how far the pad moved on the object, by the slip sensor [m]; doubt: what its noise alone adds up to.
        speed: largest speed of the motion as planned [m/s].
    """
    measured = f"{goal}, {1e3 * missed:.1f} mm beside it, slip {1e3 * slipped:.2f} mm, {mode.partition(':')[0]}"
    most = SLIPPED + doubt
    expected = (
        f"reached at {1e3 * speed:.0f} mm/s, within {1e3 * MISSED:.0f} mm, slip below {1e3 * most:.1f} mm, ACTIVE"
    )
    fix = ""
    if not goal.endswith("reached") or not mode.startswith("ACTIVE"):
        fix = f"see controller/mode ({mode}) and controller/goal"
    elif not missed < MISSED:
        fix = "zero the unloaded wrench sensor; else object.mass, or gains.stiffness too low for the sensor's bias"
    elif not slipped < most:
        fix = "more grip; look at governor.friction_limit and at the slip sensor"
    return Verdict("first motion", measured, expected, fix)


def angle(a: Array, b: Array) -> float:
    """Return the angle between two vectors; (3,) -> [rad], a right angle where one is zero."""
    lengths = float(np.linalg.norm(a) * np.linalg.norm(b))
    return math.acos(max(-1.0, min(1.0, float(a @ b) / lengths))) if lengths > 0.0 else 0.5 * math.pi


def _text(v: Array) -> str:
    return "(" + ", ".join(f"{x:.2f}" for x in v) + ")"
