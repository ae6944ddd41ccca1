"""The controller's state as text and back, to the last bit: so a recorded run can be replayed from its middle."""

from __future__ import annotations

import base64
import binascii
import hashlib
import json
import zlib

import numpy as np

from slip_core.arrays import Array
from slip_core.errors import InputError
from slip_core.records import place
from slip_vic_controller.contact.config import MOST_ROWS
from slip_vic_controller.contact.layouts import ROW, ROW_SIZE
from slip_vic_controller.state import ARM_SIZE, ARM_STATE, TASK_SIZE, TASK_STATE

LAYOUT = hashlib.sha256(repr((TASK_STATE.descr, ARM_STATE.descr, ROW.descr)).encode()).hexdigest()[:16]
"""Which software a state is of."""
LARGEST = 8 * (TASK_SIZE + ARM_SIZE + MOST_ROWS * ROW_SIZE)
"""[bytes] A state with the longest history there is."""
_CYCLES = TASK_SIZE + place(ARM_STATE, "cycles").start


def to_text(state: Array) -> str:
    """Return a snapshot of an arm as text: the cycle it begins with, its bytes, compressed, and their layout's name."""
    packed = base64.b64encode(zlib.compress(state.tobytes(), 1)).decode()
    cycle = int(state.view(np.int64)[_CYCLES])
    return json.dumps({"layout": LAYOUT, "cycle": cycle, "state": packed}, separators=(",", ":"))


def number_name(index: int) -> str:
    """Return the name of a number in a snapshot: the fields that hold it, and its place in the last one."""
    if index >= TASK_SIZE + ARM_SIZE:
        return f"history[{index - TASK_SIZE - ARM_SIZE}]"
    layout, rest, words = (TASK_STATE, index, "task") if index < TASK_SIZE else (ARM_STATE, index - TASK_SIZE, "arm")
    while layout.names is not None:
        fields = ((name, *layout.fields[name][:2]) for name in layout.names)  # type: ignore[index]
        name, held, offset = next(field for field in reversed(list(fields)) if field[2] // 8 <= rest)
        layout, rest, words = held.base, rest - offset // 8, f"{words}.{name}"
        if held.shape:
            element, rest = divmod(rest, layout.itemsize // 8)
            words += f"[{element}]"
    return words


def cycle_of(text: str) -> int | None:
    """Return the cycle that a snapshot begins with, None where it is of other software."""
    try:
        data = json.loads(text)
        return int(data["cycle"]) if data["layout"] == LAYOUT else None
    except (ValueError, KeyError, TypeError, RecursionError):
        return None


def from_text(text: str) -> Array:
    """Return the snapshot of an arm from a text.

    Raises:
        InputError: not such a text, or one of other software.
    """
    try:
        data = json.loads(text)
        if data["layout"] != LAYOUT:
            raise ValueError(f"layout {data['layout']}")
        unpacking = zlib.decompressobj()
        state = unpacking.decompress(base64.b64decode(data["state"], validate=True), LARGEST)
        if not unpacking.eof:
            raise ValueError(f"cut, or more than {LARGEST} bytes")
        return np.frombuffer(state).copy()
    except (ValueError, KeyError, TypeError, binascii.Error, zlib.error, RecursionError) as error:
        got = f"{type(error).__name__} {error}"
        raise InputError("controller state", got=got, expected="a state of this software") from None
