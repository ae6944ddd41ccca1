"""A run's bag made without DDS: the in-process loop, its messages encoded by an independent library."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from slip_bags.format import QosProfile, TopicInfo
from slip_bags.recorder import find_definition
from slip_bags.writer import BagWriter
from slip_core.params import build, flatten
from slip_msgs_py.messages.from_msgs import cartesian_reference, pose_goal
from slip_vic.replay.run_data import RecordedRun
from slip_vic.run.in_process import ClosedLoop, Tick
from slip_vic.scenarios.scenario import NODES, Scenario, ros_parameter_file
from slip_vic_controller.params.controller_params import ControllerParams
from test.support.bag_maker import STORE, encode

TYPES = STORE.types
TOPICS = {
    "/joint_states": "sensor_msgs/msg/JointState",
    "/wrench": "geometry_msgs/msg/WrenchStamped",
    "/slip_velocity": "geometry_msgs/msg/TwistStamped",
    "/effort_command": "sensor_msgs/msg/JointState",
    "/velocity_command": "sensor_msgs/msg/JointState",
    "/controller/ledger": "std_msgs/msg/Int64MultiArray",
    "/controller/reference_used": "trajectory_msgs/msg/MultiDOFJointTrajectory",
    "/parameter_events": "rcl_interfaces/msg/ParameterEvent",
}
NONE = np.zeros(0)


def attachments(scenario: Scenario) -> dict[str, bytes]:
    return {
        "arm.urdf": scenario.urdf.encode(),
        "controller.params.yaml": ros_parameter_file(scenario.controller, NODES["controller"][0]).encode(),
    }


def with_parameters(runs: Mapping[str, RecordedRun], **changed: object) -> dict[str, RecordedRun]:
    """Return the run of an only arm with other parameters of its controller."""
    params = build(ControllerParams, flatten(runs[""].params) | changed, "test")
    return {"": replace(runs[""], params=params)}


def record_run(
    folder: Path,
    scenario: Scenario,
    *,
    skip: Iterable[tuple[str, int]] = (),
    first: int = 0,
    attached: Mapping[str, bytes] | None = None,
    change: Any = lambda tick, effort: effort,
    retune: Mapping[int, Mapping[str, float]] | None = None,
    goals: Mapping[int, Any] | None = None,
) -> None:
    """Record a run; `skip` names messages (topic, number) that are lost, `change` alters recorded efforts.

    `retune` gives parameters that change before a tick, `goals` messages (goals or references) that come before one.
    """
    writer = BagWriter(folder, attachments=attachments(scenario) if attached is None else attached)
    numbers = dict.fromkeys(TOPICS, 0)
    lost = set(skip)
    for name, type_name in TOPICS.items():
        writer.add_topic(TopicInfo(name, type_name, (QosProfile(),)), find_definition(type_name))
    for index, tick in enumerate(run(scenario, retune or {}, goals or {})):
        if index in (goals or {}):
            time_ns = 10**18 + index * 10**6 - 6000
            numbers["/controller/reference_used"] += 1
            used = numbers["/controller/reference_used"]
            writer.write("/controller/reference_used", time_ns, time_ns, used, encode(goals[index]))
        if index in (retune or {}):
            time_ns = 10**18 + index * 10**6 - 5000
            numbers["/parameter_events"] += 1
            event = encode(_event(retune[index]))
            writer.write("/parameter_events", time_ns, time_ns, numbers["/parameter_events"], event)
        if index < first:
            continue
        for offset, (topic, message) in enumerate(messages(tick, scenario, change)):
            numbers[topic] += 1
            time_ns = 10**18 + index * 10**6 + offset * 1000
            if (topic, numbers[topic]) not in lost:
                writer.write(topic, time_ns, time_ns, numbers[topic], encode(message))
    writer.close()


def goal_message(position: Any, quat: Any, duration_s: float, twist: Any = None, stamp_ns: int = 0) -> Any:
    """Return a MultiDOFJointTrajectory with one point; twist: with acceleration, 12 numbers; None = at rest."""
    vector, twist_type = TYPES["geometry_msgs/msg/Vector3"], TYPES["geometry_msgs/msg/Twist"]
    pose = TYPES["geometry_msgs/msg/Transform"](
        vector(*map(float, position)), TYPES["geometry_msgs/msg/Quaternion"](*map(float, quat))
    )
    motion = (
        [] if twist is None else [twist_type(*_vectors(np.asarray(part, float))) for part in (twist[:6], twist[6:])]
    )
    after = TYPES["builtin_interfaces/msg/Duration"](int(duration_s), round(1e9 * (duration_s % 1.0)))
    point = TYPES["trajectory_msgs/msg/MultiDOFJointTrajectoryPoint"]([pose], motion[:1], motion[1:], after)
    header = TYPES["std_msgs/msg/Header"](TYPES["builtin_interfaces/msg/Time"](*divmod(stamp_ns, 10**9)), "")
    return TYPES["trajectory_msgs/msg/MultiDOFJointTrajectory"](header, ["ee"], [point])


def run(scenario: Scenario, retune: Mapping[int, Mapping[str, float]], goals: Mapping[int, Any]) -> Iterable[Tick]:
    loop = ClosedLoop(scenario)
    values = flatten(scenario.controller)
    while not loop.bridge.finished:
        outputs = loop.bridge.observe()
        if outputs.tick in retune:
            values |= retune[outputs.tick]
            loop.session.retune((build(ControllerParams, values, "test"),))
        if outputs.tick in goals:
            controller, trajectory = loop.session, scenario.controller.trajectory
            if trajectory.kind == "goal":
                controller.set_goal(pose_goal(goals[outputs.tick], trajectory.duration_s))
            else:
                controller.set_reference(cartesian_reference(goals[outputs.tick]))
        result = loop.answer(outputs)[0]
        yield Tick(outputs, (result,))
        loop.bridge.advance([result.command])


def _event(values: Mapping[str, float]) -> Any:
    inner = TYPES["rcl_interfaces/msg/ParameterValue"]
    empty = [False, 0, 0.0, "", NONE.astype(np.uint8), NONE.astype(bool), NONE.astype(np.int64), NONE, []]
    changed = [
        TYPES["rcl_interfaces/msg/Parameter"](name, inner(3, False, 0, value, *empty[3:]))
        for name, value in values.items()
    ]
    time = TYPES["builtin_interfaces/msg/Time"](0, 0)
    return TYPES["rcl_interfaces/msg/ParameterEvent"](time, "/slip_vic_controller", [], changed, [])


def messages(tick: Tick, scenario: Scenario, change: Any) -> Iterable[tuple[str, Any]]:
    names = list(scenario.controller.joint_names)
    joint, result = tick.outputs.arms[0].joint, tick.result
    yield "/joint_states", _joint_state(joint.stamp_ns, names, joint.position, joint.velocity, joint.effort)
    for wrench in tick.outputs.arms[0].wrenches:
        parts = _vectors(wrench.wrench)
        inner = TYPES["geometry_msgs/msg/Wrench"](*parts)
        yield "/wrench", TYPES["geometry_msgs/msg/WrenchStamped"](_header(wrench.stamp_ns), inner)
    for slip in tick.outputs.arms[0].slips:
        inner = TYPES["geometry_msgs/msg/Twist"](*_vectors(slip.twist))
        yield "/slip_velocity", TYPES["geometry_msgs/msg/TwistStamped"](_header(slip.stamp_ns), inner)
    interface, command = scenario.controller.command.interface, change(tick, np.array(result.command.numbers))
    fields = [command if interface == kind else NONE for kind in ("position", "velocity", "effort")]
    yield f"/{interface}_command", _joint_state(result.command.stamp_ns, names, *fields)
    layout = TYPES["std_msgs/msg/MultiArrayLayout"]([], 0)
    numbers = np.array([*result.ledger, *result.decision], dtype=np.int64)
    yield "/controller/ledger", TYPES["std_msgs/msg/Int64MultiArray"](layout, numbers)


def _header(stamp_ns: int) -> Any:
    return TYPES["std_msgs/msg/Header"](TYPES["builtin_interfaces/msg/Time"](*divmod(stamp_ns, 10**9)), "ee")


def _vectors(six: np.ndarray) -> tuple[Any, Any]:
    vector = TYPES["geometry_msgs/msg/Vector3"]
    return vector(*six[:3].tolist()), vector(*six[3:].tolist())


def _joint_state(stamp_ns: int, names: list[str], *arrays: np.ndarray) -> Any:
    return TYPES["sensor_msgs/msg/JointState"](_header(stamp_ns), names, *(np.array(array) for array in arrays))
