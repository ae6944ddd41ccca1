"""A system for the bring-up without DDS: bridge and controller in this process, and scripted errors between them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from slip_core.arrays import Array
from slip_core.params import build, flatten
from slip_core.types import JointCommand, PoseGoal
from slip_sim_bridge.params import BridgeParams
from slip_vic.run.in_process import ClosedLoop
from slip_vic.scenarios.scenario import load
from slip_vic.setup.bringup.hands import Simulated
from slip_vic.setup.bringup.heard import BRIDGE, SCALARS, Heard, Status, Track
from slip_vic.setup.bringup.walk import Verdict, Walk
from slip_vic_controller.node.task_topics import GoalWatch
from slip_vic_controller.params.controller_params import ControllerParams
from slip_vic_controller.safety.conditions import Request

BRINGUP = (
    "controller.trajectory.kind=goal", "controller.safety.auto_enable=false", "controller.governor.friction=unknown",
    "bridge.duration_s=1e6",
)  # fmt: skip
SENSORS = ("ideal", "optical_flow_120", "event_1000", "force_tactile_500", "vision_60", "vision_25", "vision_16")
DRIVES = ("torque_joint", "velocity_500", "velocity_125", "position_250")
SCENARIOS = ("paper_planar", "vertical_plane", "glass_transport")
DECIMATION = 10


def _as_they_are(outputs: Any) -> Any:
    return outputs


def _as_it_is(effort: Array, _gravity: Array) -> Array:
    return effort


@dataclass(frozen=True)
class Error:
    """Something that is wrong: assignments of controller or bridge, or what happens to messages on their way."""

    assignments: tuple[str, ...] = ()
    inputs: Callable[[Any], Any] = _as_they_are
    effort: Callable[[Array, Array], Array] = _as_it_is


class Loop:
    """A closed loop with an error in it; the methods are those of `RosSystem`."""

    def __init__(
        self,
        scenario: str = "paper_planar",
        sensor: str = "",
        seed: int = 0,
        error: Error | None = None,
        drive: str = "",
        answers_s: float = 0.0,
    ) -> None:
        self._error, self._answers_s = error or Error(), answers_s
        loaded = load(
            scenario, law="governed", sensor=sensor, drive=drive, seed=seed, set=(*BRINGUP, *self._error.assignments)
        )
        self.params, self.urdf, self.bridge_params = loaded.controller, loaded.urdf, loaded.bridge
        self.loop = ClosedLoop(loaded)
        self._goals = GoalWatch(self.loop.session)
        self.status, self.goal = Status(), ""
        self._rows: tuple[list[Any], ...] = ([], [], [], [])

    def listen(self, seconds: float, begin: Callable[[], None] = lambda: None) -> Heard:
        self._rows = ([], [], [], [])
        begin()
        self._run(seconds)
        n, (joints, wrenches, slips, scalars) = len(self.params.joint_names), self._rows
        return Heard(_track(joints, 2 * n), _track(wrenches, 6), _track(slips, 6), _track(scalars, len(SCALARS)))

    def _run(self, seconds: float) -> None:
        joints, wrenches, slips, scalars = self._rows
        for tick in range(round(seconds / self.params.control_period_s)):
            outputs = self._error.inputs(self.loop.bridge.observe())
            result = self.loop.answer(outputs)[0]
            self.status = Status(result.mode.name, result.reason)
            for line in self._goals.changes():
                self.goal = line
            now = outputs.stamp_ns * 1e-9
            joints.append((now, now, (*outputs.arms[0].joint.position, *outputs.arms[0].joint.velocity)))
            wrenches += [(now, w.stamp_ns * 1e-9, w.wrench) for w in outputs.arms[0].wrenches]
            slips += [(now, s.stamp_ns * 1e-9, _numbers(s)) for s in outputs.arms[0].slips]
            if tick % DECIMATION == 0 and len(result.command.numbers):
                found = result.scalars()
                scalars.append((now, now, [found[name] for name in SCALARS]))
            self.loop.bridge.advance([self._changed(result)])

    def _changed(self, result: Any) -> Any:
        command = result.command
        if command.interface != "effort" or not len(command.numbers):
            return command
        gravity = np.array(self.loop.session.arms[0].state.law.gravity[: len(command.numbers)])
        return JointCommand(command.stamp_ns, self._error.effort(np.array(command.numbers), gravity))

    def set_active(self, active: bool) -> None:
        self.loop.session.set_active(active)

    def ask(self, request: str, node: str = "") -> None:
        if node == BRIDGE:
            self.loop.bridge.request_reset()
        else:
            self.loop.session.request(Request[request.upper()])

    def tune(self, values: Mapping[str, Any], node: str = "") -> None:
        if node == BRIDGE:
            self.bridge_params = build(BridgeParams, flatten(self.bridge_params) | dict(values), "test")
            self.loop.bridge.change((self.bridge_params,))
        else:
            self.params = build(ControllerParams, flatten(self.params) | dict(values), "test")
            self.loop.session.retune((self.params,))
        self._run(self._answers_s)

    def send_goal(self, position: Array, rotation: Array, duration_s: float) -> None:
        self.loop.session.set_goal(PoseGoal(position, rotation, duration_s))


def _numbers(sample: Any) -> Array:
    return np.asarray(sample.pose if hasattr(sample, "pose") else sample.twist)


def _track(rows: list[Any], columns: int) -> Track:
    if not rows:
        return Track(np.empty(0), np.empty(0), np.empty((0, columns)))
    arrival, stamp, values = zip(*rows, strict=True)
    return Track(np.array(arrival), np.array(stamp), np.array(values))


def bring_up(system: Loop) -> tuple[list[Verdict], Walk]:
    walk = Walk(system, Simulated(system, system.bridge_params))
    return list(walk.steps()), walk


def _with(outputs: Any, **changed: Any) -> Any:
    """Return the outputs with something else measured by the arm."""
    return outputs._replace(arms=(outputs.arms[0]._replace(**changed),))


def _joints(turn: Array) -> Error:
    """Let the driver read other joints, or with other signs, and apply efforts so too; (n, n), its own inverse."""

    def inputs(outputs: Any) -> Any:
        joint = outputs.arms[0].joint
        read = {name: turn @ getattr(joint, name) for name in ("position", "velocity", "effort")}
        return _with(outputs, joint=replace(joint, **read))

    return Error(inputs=inputs, effort=_turned_effort(turn))


def _turned_effort(turn: Array) -> Callable[[Array, Array], Array]:
    return lambda effort, _gravity: turn @ effort


def _swapped(i: int, j: int) -> Array:
    order = np.arange(7)
    order[[i, j]] = j, i
    return np.eye(7)[order]


def _samples(kind: str, change: Callable[[Any], Any]) -> Error:
    """Let each sample of a sensor be another one; kind: slips or wrenches."""
    return Error(inputs=lambda sent: _with(sent, **{kind: tuple(map(change, getattr(sent.arms[0], kind)))}))


def _slip(turn: Array) -> Error:
    """Let the slip sensor read on other axes, or in other units; (3, 3), of linear and angular velocity, or (6, 6)."""
    six = np.kron(np.eye(2), turn) if len(turn) == 3 else turn
    return _samples("slips", lambda s: replace(s, twist=six @ s.twist))


def _stamped(kind: str, seconds: float) -> Error:
    """Let a sensor's stamps be off."""
    return _samples(kind, lambda s: replace(s, stamp_ns=s.stamp_ns + round(1e9 * seconds)))


def _held(hz: float) -> Error:
    """Let the driver repeat the slip sensor's values under new stamps."""
    last: list[Any] = [None, None]

    def change(s: Any) -> Any:
        if last[0] != (number := int(1e-9 * s.stamp_ns * hz)):
            last[:] = number, s.twist
        return replace(s, twist=last[1])

    return _samples("slips", change)


def _turned(degrees: float) -> Array:
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


SWAPPED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
ERRORS: dict[str, tuple[Error, str, str]] = {
    "wrench: sign": (Error(("controller.wrench.sign=-1",)), "weight", "wrench.sign"),
    "wrench: turned about x": (Error(("controller.wrench.rpy=[1.5708, 0, 0]",)), "weight", "90 degrees"),
    "wrench: turned about y": (Error(("controller.wrench.rpy=[0, 1.5708, 0]",)), "weight", "90 degrees"),
    "wrench: turned about z": (Error(("controller.wrench.rpy=[0, 0, 1.5708]",)), "push +x", "wrench.rpy"),
    "wrench: half a turn about z": (Error(("controller.wrench.rpy=[0, 0, 3.14159]",)), "weight", "wrench.rpy"),
    "wrench: 0.1 m off": (Error(("controller.wrench.position=[0.1, 0, 0]",)), "weight", "wrench.position"),
    "wrench: scale": (Error(("controller.wrench.force_scale=0.5",)), "weight", "wrench.force_scale"),
    "wrench: a tenth": (Error(("controller.wrench.force_scale=0.1",)), "weight", "wrench.force_scale"),
    "wrench: torque in N mm": (Error(("controller.wrench.torque_scale=1000",)), "weight", "torque_scale"),
    "wrench: tool that is not there": (Error(("controller.wrench.tool_mass=0.3",)), "weight", "tool_mass"),
    "wrench: clock 0.2 s behind": (_stamped("wrenches", -0.2), "wrench", "clocks"),
    "wrench: clock 0.2 s ahead": (_stamped("wrenches", 0.2), "wrench", "ahead"),
    "wrench: silent": (Error(("bridge.sensors.wrench.silent=true",)), "wrench", "start the driver"),
    "wrench: noise": (Error(("bridge.sensors.wrench.noise_force=0.5",)), "rest", "filter the wrench"),
    "object: mass": (Error(("bridge.object.mass=0.8",)), "weight", "object.mass"),
    "joints: 2 and 4 swapped": (_joints(_swapped(1, 3)), "weight", "joint_names"),
    "joints: 6 and 7 swapped": (_joints(_swapped(5, 6)), "weight", "joint_names"),
    "joints: efforts of 1 and 2 swapped": (Error(effort=_turned_effort(_swapped(0, 1))), "hold", "order of efforts"),
    "joints: sign of 3": (
        _joints(np.diag([1, 1, -1, 1, 1, 1, 1])), "joint arm_joint2", "calls arm_joint2 what the URDF calls arm_joint3",
    ),
    "gravity: the arm does not compensate": (
        Error(("controller.effort.gravity=robot_compensates",)), "hold", "effort.gravity"
    ),
    "gravity: twice": (Error(effort=lambda effort, gravity: effort + gravity), "hold", "effort.gravity"),
    "slip: sign": (_slip(-np.eye(3)), "slide", "force: all axes are inverted"),
    "slip: axes swapped": (_slip(SWAPPED), "slide", "force: x and y are swapped"),
    "slip: turned by 90 degrees": (_slip(_turned(90.0)), "slide", "force: it is turned by"),
    "slip: turned by 15 degrees": (_slip(_turned(15.0)), "slide", "force: it is turned by 1"),
    "slip: mm/s": (_slip(np.diag([1e3] * 3 + [1.0] * 3)), "slide", "is its unit m/s?"),
    "slip: deg/s": (_slip(np.diag([1.0] * 3 + [57.3] * 3)), "slide", "is its unit rad/s?"),
    "slip: held": (_held(30.0), "slide", "values change at 3"),
    "slip: stamps 30 ms old": (_stamped("slips", -0.03), "slide", "stamps are -30 ms off"),
    "slip: stamps 30 ms ahead": (_stamped("slips", 0.03), "slide", "stamps are +30 ms off"),
    "slip: offset": (Error(("bridge.sensors.slip.faults.bias=[0.02, 0, 0, 0, 0, 0]",)), "rest", "calibrate"),
    "slip: silent": (Error(("bridge.sensors.slip.faults.silent=true",)), "slip", "start the driver"),
    "slip: invalid": (Error(("bridge.sensors.slip.faults.invalid=true",)), "rest", "reports NaN"),
    "rate: a controller for 250 Hz": (
        Error(("controller.control_period_s=0.004",)), "joint_states", "control_period_s"
    ),
    "started as active": (Error(("controller.safety.auto_enable=true",)), "controller", "safety.auto_enable:=false"),
    "friction: none left": (
        Error(("bridge.friction.mu_s=0.08", "bridge.friction.mu_k=0.06")), "friction", "grip harder"
    ),
}  # fmt: skip
"""What is wrong, the step that finds it, and a part of what it says to do."""
