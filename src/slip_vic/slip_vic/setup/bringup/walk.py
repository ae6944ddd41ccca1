"""The steps of a bring-up: each measures and is judged, and the next follows only if it holds."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import yaml

from slip_core.arrays import Array, matrix_from_quat_xyzw
from slip_core.errors import InputError, SlipVicError
from slip_core.params import nested_names
from slip_core.records import new, record
from slip_core.vectors import mat
from slip_vic.setup.bringup import verdicts
from slip_vic.setup.bringup.hands import Hands
from slip_vic.setup.bringup.verdicts import Heard, Verdict
from slip_vic_controller.arm.robot import Robot
from slip_vic_controller.interfaces import WRENCH_SENSOR, fill_wrench_sensor, wrench_at_pad
from slip_vic_controller.law.arm import ARM
from slip_vic_controller.safety.validation import FUTURE_S

if TYPE_CHECKING:
    from slip_vic.setup.bringup.ros_system import RosSystem

LISTENED_S: Final = 2.0
HELD_S: Final = 2.0
LOOSE_S: Final = 5.0
WATCHED_S: Final = 0.25
CLOSELY_S: Final = 0.05
GOAL_S: Final = 30.0
STARTED_S: Final = 3.0
PROBE_M: Final = 0.03
PROBES_S: Final = (2.0, 1.4, 1.0, 0.7, 0.5, 0.4)
FIRST_M: Final = 0.03
FULL_SPEED: Final = 0.25
"""[m/s], reduced speed of ISO 10218-1, with a person beside the arm; the first motion has a tenth of it."""
QUINTIC_PEAK: Final = 1.875
SIGMAS: Final = 4.0
SLIP_SPEED: Final = 0.01  # [m/s] that counts as slip while a person pulls
AXES: Final = ("+x", "+y", "+z")


class Walk:
    """One bring-up.

    Args:
        system: the controller with its drivers.
        hands: who pushes.

    Raises:
        InputError: the slip sensor gives no velocities, or the controller's parameters and its URDF do not fit.
    """

    def __init__(self, system: RosSystem, hands: Hands) -> None:
        if system.params.slip_input != "twist":
            raise InputError("slip_input", got=system.params.slip_input, expected="twist: a bring-up integrates it")
        self._system, self._hands, self._params = system, hands, system.params
        params = system.params
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
        values = {
            name: float(f"{value:.4g}") if isinstance(value, float) else value for name, value in self.measured.items()
        }
        content = {"/**/slip_vic_controller": {"ros__parameters": nested_names(values)}}
        head = "# Measured by `slip-vic bringup`: for the controller after its own file; --params of run and check.\n"
        return head + yaml.safe_dump(content, sort_keys=False, default_flow_style=None, width=120)

    # -- nothing moves -----------------------------------------------------------------------------

    def _passive(self) -> Iterator[Verdict]:
        params, system = self._params, self._system
        yield verdicts.judge_controller(params, system.mode)
        system.set_active(False)
        self._hands.grip(firmly=True)
        heard = system.listen(LISTENED_S)
        inputs, hz = params.safety.inputs, 1.0 / params.control_period_s
        slack, future = verdicts.RATE_SLACK, FUTURE_S
        bounds = (1.0 - slack) * hz, (1.0 + slack) * hz
        yield verdicts.judge_stream("joint_states", heard.joints, *bounds, inputs.joint.age_s, future)
        wrench, slip = ("wrench", heard.wrench, inputs.wrench.age_s), ("slip", heard.slip, inputs.slip.age_s)
        for name, track, age in (wrench, slip) if self._has_wrench else (slip,):
            yield verdicts.judge_stream(name, track, 2.0 / age, math.inf, age, future)
        found, offset = verdicts.measured_sensors(heard, params)
        self.measured |= found
        self._slip_noise = found.get("slip_sensor.noise_linear", 0.0)
        n = len(params.joint_names)
        speed = float(np.abs(heard.joints.values[:, n:].mean(axis=0)).max())
        yield verdicts.judge_rest(speed, offset, params, found)
        if self._has_wrench:
            force, torque = self._wrench(heard)
            yield verdicts.judge_weight(force, torque, *self._weight(heard.position), params.wrench_sensor.bias_force)

    def _weight(self, q: Array) -> tuple[Array, Array]:
        """Return force and torque of the resting object's weight on the pad; (3,) [N], [N m] {w}."""
        params, R = self._params, self._robot.frame(q)[1]
        force = params.object.mass * np.array(params.gravity)
        p_R_o = matrix_from_quat_xyzw(params.contacts.orientation_xyzw[:4]).T
        lever = R @ p_R_o @ np.array(params.contacts.position[:3])
        return force, -np.cross(lever, force)

    def _wrench(self, heard: Heard) -> tuple[Array, Array]:
        """Return mean force and torque as the controller takes them, on world axes; (3,) [N], [N m] {w}."""
        R = self._robot.frame(heard.position)[1]
        h = wrench_at_pad(self._sensor, heard.wrench.values.mean(axis=0), mat(R))
        return R @ np.array(h.linear), R @ np.array(h.angular)

    # -- a person pushes ---------------------------------------------------------------------------

    def _by_hand(self) -> Iterator[Verdict]:
        names, hands, params = self._params.joint_names, self._hands, self._params
        before = self._system.listen(WATCHED_S)
        for joint in range(len(names)):
            turned = hands.turn(joint, self._inertia(before.position))
            yield verdicts.judge_joint(names, joint, turned.position - before.position if turned else None)
            before = self._system.listen(2.0 * WATCHED_S)
        if self._has_wrench:
            rest = self._wrench(before)[0]
            for axis, words in enumerate(AXES):
                change = self._wrench(hands.push(words, np.eye(3)[axis]))[0] - rest
                yield verdicts.judge_push(words, change, np.eye(3)[axis])
        R = self._robot.frame(before.position)[1]
        along = (R.T @ self._weight(before.position)[0]) * params.contacts.slip_axes[:3]
        for axis in (axis for axis in range(3) if params.contacts.slip_axes[axis]):
            heard = hands.pull(AXES[axis], R[:, axis], float(np.linalg.norm(along)), self._slips)
            slipped = self._slipped(joined(heard), least=self._noticed)
            yield verdicts.judge_pull(AXES[axis], slipped, np.eye(3)[axis])
            hands.grip(firmly=True)

    def _inertia(self, q: Array) -> Array:
        arm = new(ARM)
        self._robot.terms(q, np.zeros(len(q)), arm)
        return np.asarray(record(arm, ARM).M[: len(q), : len(q)])

    @property
    def _noticed(self) -> float:
        """The slip speed [m/s] that no noise explains."""
        return max(SLIP_SPEED, 6.0 * self._slip_noise)

    def _slips(self, heard: Heard) -> bool:
        return bool((np.linalg.norm(heard.slip.values[:, :3], axis=1) > self._noticed).any())

    def _slipped(self, heard: Heard, *, least: float = 0.0) -> Array:
        """Return how far the pad has moved on the object, by slip speeds above `least` [m/s]; (3,) [m] {ee}."""
        stamps, v = heard.slip.stamp, heard.slip.values[:, :3]
        steps = np.diff(stamps, prepend=stamps[:1]) * (np.linalg.norm(v, axis=1) > least)
        return np.asarray(np.nansum(v * steps[:, None], axis=0))

    # -- the controller holds the arm --------------------------------------------------------------

    def _held(self) -> Iterator[Verdict]:
        system, names = self._system, self._params.joint_names
        self._hands.ready("the controller takes the arm over and holds it, then lets its stiffness go for 5 s")
        start = system.listen(WATCHED_S).position
        system.set_active(True)
        moved, _ = self._watched(start, HELD_S)
        if np.abs(moved).max() >= verdicts.DRIFT:
            system.set_active(False)  # the drives hold the arm better than we do
        yield verdicts.judge_drift("hold", names, moved, verdicts.SAG, "with the stiffness of HOLD")
        yield verdicts.judge_mode("mode", system.mode, "HOLD")
        with self._loose():
            moved, seconds = self._watched(start + moved, LOOSE_S)
        yield verdicts.judge_drift("gravity", names, moved, verdicts.DRIFT, f"in {seconds:.1f} s without stiffness")

    def _watched(self, start: Array, seconds: float) -> tuple[Array, float]:
        """Return how far the joints are from where they were, and after how long: at once where it is too far."""
        moved, past = np.zeros(len(start)), 0.0
        while past < seconds and np.abs(moved).max() < verdicts.DRIFT:
            moved = self._system.listen(CLOSELY_S).position - start
            past += CLOSELY_S
        return moved, past

    @contextlib.contextmanager
    def _loose(self) -> Iterator[None]:
        """Take the stiffness out of HOLD for a while; it comes back whatever happens."""
        name = "safety.hold_stiffness"
        self._system.tune({name: 0.0})
        try:
            yield
        finally:
            self._system.tune({name: self._params.safety.hold_stiffness})
            self._system.listen(2.0 * WATCHED_S)

    # -- the law moves the arm ---------------------------------------------------------------------

    def _governed(self) -> Iterator[Verdict]:
        system = self._system
        system.set_active(False)
        self._hands.grip(firmly=False)
        self._hands.ready(f"the law begins, and moves the object by {1e3 * PROBE_M:.0f} mm, at most")
        system.set_active(True)
        system.listen(2.0 * WATCHED_S)
        system.ask("enable")
        try:
            for _ in range(round(STARTED_S / WATCHED_S)):
                heard = system.listen(WATCHED_S)
                if system.mode.startswith("ACTIVE"):
                    break
            yield verdicts.judge_mode("enabled", system.mode, "ACTIVE")
            yield self._friction(heard.position)
            yield self._first_motion()
        finally:
            with contextlib.suppress(SlipVicError):
                system.ask("hold")

    def _friction(self, q: Array) -> Verdict:
        """Move there and back, faster each time, until it slips or the configured friction is used."""
        here, R, _ = self._robot.frame(q)
        way, limit = PROBE_M * self._inwards(here), self._params.governor.friction_limit
        carried, events, estimate = 0.0, 0, limit
        for number, duration in enumerate(PROBES_S):
            heard = self._go(here + way * (1 - number % 2), R, duration)
            scalars = heard.scalars
            estimate, events = float(scalars["friction_limit"][-1]), int(scalars["friction_events"][-1])
            holds = scalars["slipping"] == 0.0
            carried = max(carried, float(scalars["load_commanded"][holds].max(initial=0.0)))
            enough = carried > 0.9 * self._params.governor.margin * limit
            if (number % 2 and (events or enough)) or not self._system.goal.endswith("reached"):
                break
        if events:
            self.measured["governor.friction_limit"] = estimate
        return verdicts.judge_friction(limit, estimate, carried, events, self._system.goal, self._system.mode)

    def _first_motion(self) -> Verdict:
        here, R, _ = self._robot.frame(self._system.listen(WATCHED_S).position)
        there, speed = here + FIRST_M * self._inwards(here), 0.1 * FULL_SPEED
        heard = self._go(there, R, QUINTIC_PEAK * FIRST_M / speed)
        missed = float(np.linalg.norm(self._robot.frame(heard.position)[0] - there))
        slipped = self._slipped(heard)
        doubt = SIGMAS * self._slip_noise * math.sqrt(len(heard.slip.stamp)) / heard.slip.rate
        most = verdicts.SLIPPED + doubt
        return verdicts.judge_motion(self._system.goal, self._system.mode, missed, float(np.linalg.norm(slipped)), most)

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

    def _inwards(self, position: Array) -> Array:
        """Return the horizontal direction from a place towards the arm's base; (3,)."""
        flat = -position * (1.0, 1.0, 0.0)
        return np.asarray(flat / max(float(np.linalg.norm(flat)), 1e-9))


def joined(parts: list[Heard]) -> Heard:
    """Return what was heard one after the other as one."""

    def together(name: str) -> Any:
        tracks = [getattr(part, name) for part in parts]
        return type(tracks[0])(*(np.concatenate(columns) for columns in zip(*tracks, strict=True)))

    scalars = {name: np.concatenate([part.scalars[name] for part in parts]) for name in parts[0].scalars}
    return Heard(together("joints"), together("wrench"), together("slip"), scalars)
