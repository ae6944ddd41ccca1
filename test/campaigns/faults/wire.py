"""Samples as messages on the wire and back, by the nodes' own code; here messages are damaged."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from rclpy.serialization import serialize_message

from slip_core.errors import InputError
from slip_core.topics import topic
from slip_msgs_py.fast_io import typed
from slip_msgs_py.messages import from_msgs, to_msgs
from slip_msgs_py.qos import message_class
from test.campaigns.faults.plan import EFFORT, JOINT, SLIP, WRENCH

BAD_NUMBERS = (math.nan, math.inf, -math.inf, 1e308, -1e308, 1e30, -1e6, 1e3, 5e-324, -5e-324, 0.0)


class Wire:
    """One topic: typed messages of samples, and samples of bytes as the receiving node makes them.

    Args:
        name: the topic.
        joint_names, frame: as in the nodes' parameters.
        interface: what the arm takes.
    """

    def __init__(self, name: str, joint_names: tuple[str, ...], frame: str, interface: str = "effort") -> None:
        self.name, self._interface = name, interface
        self._joints, self._frame = joint_names, frame
        read: dict[str, Callable[[Any], Any]] = {
            JOINT: partial(from_msgs.joint_sample, joints=joint_names),
            EFFORT: partial(from_msgs.joint_command, joints=joint_names, interface=interface),
            WRENCH: partial(from_msgs.wrench_sample, frame=frame),
            SLIP: partial(from_msgs.slip_velocity, frame=frame),
        }
        self._class, self._read = message_class(topic(name).type), read[name]

    def message(self, sample: Any) -> Any:
        """Return the typed message of a sample."""
        if self.name == JOINT:
            return to_msgs.joint_state(self._joints).message(
                sample.stamp_ns, sample.position, sample.velocity, sample.effort
            )
        if self.name == EFFORT:
            numbers = [
                sample.numbers if self._interface == field else () for field in ("position", "velocity", "effort")
            ]
            return to_msgs.joint_state(self._joints).message(sample.stamp_ns, *numbers)
        if self.name == WRENCH:
            return to_msgs.wrench(self._frame).message(sample.stamp_ns, sample.wrench)
        return to_msgs.twist(self._frame).message(sample.stamp_ns, to_msgs.slip_numbers(sample))

    def receive(self, data: bytes) -> Any | None:
        """Return the sample that the node makes of bytes, None where it refuses them."""
        try:
            return self._read(self.typed(data))
        except InputError:
            return None

    def typed(self, data: bytes) -> Any:
        """Return the typed message of bytes; InputError where they are none."""
        return typed(data, self._class)

    def damaged(self, message: Any, kind: str, rng: np.random.Generator) -> bytes:
        """Damage a typed message and return its bytes."""
        if kind == "corrupt_values":
            damage_numbers(message, rng)
        elif kind == "wrong_frame":
            message.header.frame_id = "somewhere_else"
        elif kind == "wrong_names":
            damage_names(message, rng)
        data: bytes = serialize_message(message)
        return damage_bytes(data, rng) if kind == "corrupt_bytes" else data


def damage_numbers(message: Any, rng: np.random.Generator) -> None:
    """Put bad numbers into a message where it has any; its stamp may suffer too."""
    paths = numbers_of(message)
    for _ in range(int(rng.integers(1, 4)) if paths else 0):
        owner, name, index = paths[int(rng.integers(len(paths)))]
        bad = BAD_NUMBERS[int(rng.integers(len(BAD_NUMBERS)))]
        value = bad if rng.uniform() < 0.7 else float(rng.normal() * 10.0 ** rng.integers(-3, 6))
        if index is None:
            setattr(owner, name, value)
        else:
            getattr(owner, name)[index] = value
    if rng.uniform() < 0.1:
        message.header.stamp.sec = int(rng.integers(-(2**31), 2**31))


def numbers_of(message: Any) -> list[tuple[Any, str, int | None]]:
    """Return where the floating-point numbers of a message are: (owner, name, index or None)."""
    found: list[tuple[Any, str, int | None]] = []
    for name in message.get_fields_and_field_types():
        value = getattr(message, name)
        if isinstance(value, float):
            found.append((message, name, None))
        elif hasattr(value, "get_fields_and_field_types"):
            found += numbers_of(value)
        elif hasattr(value, "typecode"):
            found += [(message, name, i) for i in range(len(value))]
    return found


def damage_names(message: Any, rng: np.random.Generator) -> None:
    """Permute, repeat, rename or cut joint names or arrays."""
    names, kind = list(message.name), int(rng.integers(5))
    if kind == 0:  # permuted together with their numbers: to be put in order
        order = rng.permutation(len(names))
        for field in ("position", "velocity", "effort"):
            values = getattr(message, field)
            if len(values) == len(names):
                setattr(message, field, [values[i] for i in order])
        message.name = [names[i] for i in order]
    elif kind == 1:
        message.name = [names[0], *names[:-1]]
    elif kind == 2:
        message.name = [f"x{name}" for name in names]
    elif kind == 3:
        message.position = message.position[:-1]
    else:
        message.name = []


def damage_bytes(data: bytes, rng: np.random.Generator) -> bytes:
    """Flip bits, cut or lengthen."""
    out, kind = bytearray(data), rng.uniform()
    if kind < 0.6:
        for _ in range(int(rng.integers(1, 9))):
            out[int(rng.integers(len(out)))] ^= 1 << int(rng.integers(8))
    elif kind < 0.85:
        out = out[: int(rng.integers(len(out)))]
    else:
        out += bytes(rng.integers(0, 256, int(rng.integers(1, 64)), dtype=np.uint8))
    return bytes(out)
