"""A system for the bring-up without DDS: bridge and controller in this process, and scripted errors between them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from slip_core.arrays import Array
from slip_core.params import build, flatten
from slip_core.types import JointCommand, PoseGoal
from slip_sim_bridge.params import BridgeParams
from slip_vic.run.in_process import ClosedLoop
from slip_vic.scenarios.scenario import load_scenario
from slip_vic.setup.bringup.hands import Simulated
from slip_vic.setup.bringup.heard import BRIDGE, SCALARS, Heard, Status, Track
from slip_vic.setup.bringup.walk import Verdict, Walk
from slip_vic_controller.node.task_topics import GoalWatch
from slip_vic_controller.params.node_params import ControllerNodeParams
from slip_vic_controller.safety.modes import Request

BRINGUP = (
    "controller.trajectory.kind=goal", "controller.safety.auto_enable=false", "controller.governor.friction=unknown",
    "bridge.duration_s=1e6",
)  # fmt: skip
SENSORS = ("ideal", "optical_flow_120", "event_1000", "force_tactile_500", "vision_60", "vision_25", "vision_16")
DRIVES = ("", "torque_joint", "velocity_500", "velocity_125", "position_250")
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
    ) -> None:
        self._error = error or Error()
        loaded = load_scenario(
            scenario,
            law="governed",
            sensor=sensor,
            drive=drive,
            seed=seed,
            assignments=(*BRINGUP, *self._error.assignments),
        )
        self.params, self.urdf, self.bridge_params = loaded.controller, loaded.urdf, loaded.bridge
        self.loop = ClosedLoop(loaded)
        self._goals = GoalWatch(self.loop.session)
        self.status, self.goal = Status(), ""
        self._given = 0

    def listen(self, seconds: float, begin: Callable[[], None] = lambda: None) -> Heard:
        begin()
        ticks = round(seconds / self.params.control_period_s)
        joints, wrenches, slips, scalars = [], [], [], []
        for tick in range(ticks):
            outputs = self._error.inputs(self.loop.observe())
            result = self.loop.control(outputs)
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
        n = len(self.params.joint_names)
        return Heard(_track(joints, 2 * n), _track(wrenches, 6), _track(slips, 6), _track(scalars, len(SCALARS)))

    def _changed(self, result: Any) -> Any:
        command = result.command
        if command.interface != "effort" or not len(command.numbers):
            return command
        gravity = np.array(self.loop.controller.state.law.gravity[: len(command.numbers)])
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
            return
        self.params = build(ControllerNodeParams, flatten(self.params) | dict(values), "test")
        self.loop.session.retune((self.params,))

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
    walk = Walk(system, Simulated(system, system.bridge_params.grip.force))
    return list(walk.steps()), walk


def _with(outputs: Any, **changed: Any) -> Any:
    """Return the outputs with something else measured by the arm."""
    return outputs._replace(arms=(outputs.arms[0]._replace(**changed),))


def _swap(i: int, j: int) -> Callable[[Any], Any]:
    """Let the driver call two joints by each other's names."""

    def swapped(v: Array) -> Array:
        v = np.array(v)
        v[[i, j]] = v[[j, i]]
        return v

    def inputs(outputs: Any) -> Any:
        joint = outputs.arms[0].joint
        swap = type(joint)(joint.stamp_ns, swapped(joint.position), swapped(joint.velocity), swapped(joint.effort))
        return _with(outputs, joint=swap)

    return inputs


def _swapped_effort(i: int, j: int) -> Callable[[Array, Array], Array]:
    def effort(values: Array, gravity: Array) -> Array:
        values[[i, j]] = values[[j, i]]
        return values

    return effort


def _slip(turn: Array) -> Callable[[Any], Any]:
    """Let the slip sensor read on other axes; (3, 3)."""

    def inputs(outputs: Any) -> Any:
        slips = tuple(
            type(s)(s.stamp_ns, np.concatenate((turn @ s.twist[:3], turn @ s.twist[3:]))) for s in outputs.arms[0].slips
        )
        return _with(outputs, slips=slips)

    return inputs


def _joint_sign(joint: int) -> Error:
    def inputs(outputs: Any) -> Any:
        sign = np.ones(len(outputs.arms[0].joint.position))
        sign[joint] = -1.0
        turned = outputs.arms[0].joint
        turned = type(turned)(turned.stamp_ns, sign * turned.position, sign * turned.velocity, sign * turned.effort)
        return _with(outputs, joint=turned)

    def effort(values: Array, gravity: Array) -> Array:
        values[joint] *= -1.0
        return values

    return Error(inputs=inputs, effort=effort)


def _late_wrench(seconds: float) -> Callable[[Any], Any]:
    """Let the wrench's clock be behind."""

    def inputs(outputs: Any) -> Any:
        late = round(1e9 * seconds)
        wrenches = tuple(type(w)(w.stamp_ns - late, w.wrench) for w in outputs.arms[0].wrenches)
        return _with(outputs, wrenches=wrenches)

    return inputs


def _slip_samples(change: Callable[[Any], Any]) -> Error:
    """Let each sample of the slip sensor be another one."""
    return Error(inputs=lambda outputs: _with(outputs, slips=tuple(map(change, outputs.arms[0].slips))))


def _scaled(linear: float, angular: float) -> Error:
    """Let the slip sensor have other units."""
    factors = np.repeat([linear, angular], 3)
    return _slip_samples(lambda s: type(s)(s.stamp_ns, factors * s.twist))


def _stamped(seconds: float) -> Error:
    """Let the slip sensor's stamps be off."""
    return _slip_samples(lambda s: type(s)(s.stamp_ns + round(1e9 * seconds), s.twist))


def _held(hz: float) -> Error:
    """Let the driver repeat the slip sensor's values under new stamps."""
    last: list[Any] = [None, None]

    def change(s: Any) -> Any:
        if last[0] != (number := int(1e-9 * s.stamp_ns * hz)):
            last[:] = number, s.twist
        return type(s)(s.stamp_ns, last[1])

    return _slip_samples(change)


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
    "wrench: clock 0.2 s behind": (Error(inputs=_late_wrench(0.2)), "wrench", "clocks"),
    "wrench: clock 0.2 s ahead": (Error(inputs=_late_wrench(-0.2)), "wrench", "ahead"),
    "wrench: silent": (Error(("bridge.sensors.wrench.silent=true",)), "wrench", "start the driver"),
    "wrench: noise": (Error(("bridge.sensors.wrench.noise_force=0.5",)), "rest", "filter the wrench"),
    "object: mass": (Error(("bridge.object.mass=0.8",)), "weight", "object.mass"),
    "joints: 2 and 4 swapped": (
        Error(inputs=_swap(1, 3), effort=_swapped_effort(1, 3)), "weight", "joint_names"
    ),
    "joints: 6 and 7 swapped": (
        Error(inputs=_swap(5, 6), effort=_swapped_effort(5, 6)), "weight", "joint_names"
    ),
    "joints: efforts of 1 and 2 swapped": (Error(effort=_swapped_effort(0, 1)), "hold", "order of efforts"),
    "joints: sign of 3": (_joint_sign(2), "joint arm_joint2", "calls arm_joint2 what the URDF calls arm_joint3"),
    "gravity: the arm does not compensate": (
        Error(("controller.effort.gravity=robot_compensates",)), "hold", "effort.gravity"
    ),
    "gravity: twice": (Error(effort=lambda effort, gravity: effort + gravity), "hold", "effort.gravity"),
    "slip: sign": (Error(inputs=_slip(-np.eye(3))), "slide", "force: all axes are inverted"),
    "slip: axes swapped": (Error(inputs=_slip(SWAPPED)), "slide", "force: x and y are swapped"),
    "slip: turned by 90 degrees": (Error(inputs=_slip(_turned(90.0))), "slide", "force: it is turned by"),
    "slip: turned by 15 degrees": (Error(inputs=_slip(_turned(15.0))), "slide", "force: it is turned by 1"),
    "slip: mm/s": (_scaled(1000.0, 1.0), "slide", "is its unit m/s?"),
    "slip: deg/s": (_scaled(1.0, 57.3), "slide", "is its unit rad/s?"),
    "slip: held": (_held(30.0), "slide", "values change at 3"),
    "slip: stamps 30 ms old": (_stamped(-0.03), "slide", "stamps are -30 ms off"),
    "slip: stamps 30 ms ahead": (_stamped(0.03), "slide", "stamps are +30 ms off"),
    "slip: offset": (Error(("bridge.sensors.slip.faults.bias=[0.02, 0, 0, 0, 0, 0]",)), "rest", "calibrate"),
    "slip: silent": (Error(("bridge.sensors.slip.faults.silent=true",)), "slip", "start the driver"),
    "slip: invalid": (Error(("bridge.sensors.slip.faults.invalid=true",)), "rest", "does not measure"),
    "rate: a controller for 250 Hz": (
        Error(("controller.control_period_s=0.004",)), "joint_states", "control_period_s"
    ),
    "started at work": (Error(("controller.safety.auto_enable=true",)), "controller", "trajectory.kind:=goal"),
    "friction: none left": (
        Error(("bridge.friction.mu_s=0.08", "bridge.friction.mu_k=0.06")), "friction", "more grip"
    ),
}  # fmt: skip
"""What is wrong, the step that finds it, and a part of what it says to do."""
