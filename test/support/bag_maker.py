"""Bags made without ROS: messages encoded by an independent library, written by our writer."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_typestore

from slip_bags.format import QosProfile, TopicInfo
from slip_bags.recorder import find_definition
from slip_bags.writer import BagWriter

STORE = get_typestore(Stores.ROS2_JAZZY)
START_NS = 1_700_000_000_000_000_000
PERIOD_NS = 1_000_000
SUITE_TOPICS = {
    "/joint_states": "sensor_msgs/msg/JointState",
    "/wrench": "geometry_msgs/msg/WrenchStamped",
    "/slip_velocity": "geometry_msgs/msg/TwistStamped",
    "/object_state": "nav_msgs/msg/Odometry",
    "/clock": "rosgraph_msgs/msg/Clock",
    "/effort_controller/commands": "std_msgs/msg/Float64MultiArray",
    "/controller/ledger": "std_msgs/msg/Int64MultiArray",
    "/controller/reference_pose": "geometry_msgs/msg/PoseStamped",
    "/reference": "trajectory_msgs/msg/MultiDOFJointTrajectory",
    "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
    "/robot_description": "std_msgs/msg/String",
}
_INTEGERS = {f"{sign}int{bits}": (sign, bits) for sign in ("", "u") for bits in (8, 16, 32, 64)}


def random_message(type_name: str, rng: np.random.Generator, sizes: int | None = None) -> Any:
    """Return a random message; sequences have `sizes` elements, or each 0 to 3."""
    names = [name for name in STORE.types[type_name].__dataclass_fields__ if name != "__msgtype__"]
    fields = dict(STORE.fielddefs[type_name][1])
    return STORE.types[type_name](**{name: _random(fields[name], rng, sizes) for name in names if name in fields})


def _random(node: Any, rng: np.random.Generator, sizes: int | None) -> Any:
    kind, detail = node
    if kind == Nodetype.BASE:
        return _scalar(detail[0], rng)
    if kind == Nodetype.NAME:
        return random_message(detail, rng, sizes)
    element, length = detail
    if kind == Nodetype.SEQUENCE:
        wanted = int(rng.integers(0, 4)) if sizes is None else sizes
        length = min(length, wanted) if length else wanted
    values = [_random(element, rng, sizes) for _ in range(length)]
    if element[0] == Nodetype.BASE and element[1][0] != "string":
        return np.array(values, dtype=_numpy(element[1][0]))
    return values


def _numpy(name: str) -> str:
    return {"byte": "uint8", "char": "uint8", "octet": "uint8"}.get(name, name)


def _scalar(name: str, rng: np.random.Generator) -> Any:
    if name == "string":
        return "".join(rng.choice(list("abcé_ 0")) for _ in range(int(rng.integers(0, 6))))
    if name == "bool":
        return bool(rng.integers(0, 2))
    if name in ("float32", "float64"):
        return float(np.dtype(name).type(rng.normal()))
    if name == "byte":
        return int(rng.integers(0, 128))  # the encoder takes a single byte for signed
    sign, bits = _INTEGERS[_numpy(name)]
    low, high = (0, 2**bits) if sign else (-(2 ** (bits - 1)), 2 ** (bits - 1))
    return int(rng.integers(low, high, dtype=np.dtype(_numpy(name))))


def encode(message: Any) -> bytes:
    """Return the CDR bytes of a message of `STORE`."""
    return bytes(STORE.serialize_cdr(message, message.__msgtype__))


def comparable(value: Any) -> Any:
    """Return a message's values as plain nested tuples, whatever library decoded it."""
    if dataclasses.is_dataclass(value):
        return tuple(
            (field.name.rstrip("_"), comparable(getattr(value, field.name)))
            for field in dataclasses.fields(value)
            if field.name != "__msgtype__" and not field.name.isupper()
        )
    if hasattr(value, "__slots__") and not isinstance(value, str | bytes | np.generic | np.ndarray):
        return tuple((name, comparable(getattr(value, name))) for name in value.__slots__)
    if isinstance(value, list | tuple | np.ndarray | bytes) or type(value).__name__ == "array":
        return tuple(comparable(item) for item in value)
    return value.item() if isinstance(value, np.generic) else value


def make_bag(
    folder: Path,
    *,
    count: int = 200,
    topics: dict[str, str] | None = None,
    custom_data: dict[str, str] | None = None,
    attachments: dict[str, bytes] | None = None,
    flush_every: int = 50,
    qos: Sequence[QosProfile] = (QosProfile(),),
) -> dict[str, list[tuple[int, int, int, Any]]]:
    """Write a bag; return per topic (log time, publish time, sequence, message) of everything in it."""
    rng = np.random.default_rng(1)
    topics = SUITE_TOPICS if topics is None else topics
    writer = BagWriter(folder, custom_data, attachments)
    content: dict[str, list[tuple[int, int, int, Any]]] = {name: [] for name in topics}
    for name, type_name in topics.items():
        writer.add_topic(TopicInfo(name, type_name, tuple(qos)), find_definition(type_name))
    for index in range(count):
        for offset, (name, type_name) in enumerate(topics.items()):
            message = random_message(type_name, rng)
            log_time = START_NS + index * PERIOD_NS + offset * 1000
            writer.write(name, log_time, log_time - 50_000, index + 1, encode(message))
            content[name].append((log_time, log_time - 50_000, index + 1, message))
        if flush_every and index % flush_every == flush_every - 1:
            writer.flush()
    writer.close()
    return content
