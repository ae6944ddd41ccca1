"""The controller's memory as text and back, to the last bit: so a recorded run can be replayed from its middle.

JSON with the shortest decimals that give the same doubles; named tuples by name and fields, arrays with their shape.
"""

from __future__ import annotations

import json
from enum import IntEnum
from importlib import import_module
from types import ModuleType
from typing import Any

import numpy as np

from slip_core.arrays import readonly
from slip_core.errors import InputError

_MODULES = tuple(
    import_module(f"slip_vic_controller.core.{name}")
    for name in (
        "delays",
        "fallback",
        "impedance",
        "lateness",
        "modes",
        "object_dynamics",
        "observer_memory",
        "output_gate",
        "path_time",
        "ramp",
        "state",
        "supervisor_state",
    )
)


def to_text(value: Any) -> str:
    """Return a memory as text.

    Implements: ours: the state of a cycle is part of the bag.
    """
    return json.dumps(_encoded(value), separators=(",", ":"))


def from_text(text: str) -> Any:
    """Return the memory of a text.

    Raises:
        InputError: not such a text, or one of other software.

    Implements: ours: the inverse of `to_text`.
    """
    try:
        return _decoded(json.loads(text))
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        got = f"{type(error).__name__} {error}"
        raise InputError("controller state", got=got, expected="a state of this software") from None


def _encoded(value: Any) -> Any:
    if value is None or isinstance(value, bool | str):
        return value
    if isinstance(value, IntEnum):
        return {"enum": type(value).__name__, "value": int(value)}
    if isinstance(value, int | float):
        return value
    if isinstance(value, np.ndarray):
        return {"array": value.ravel().tolist(), "shape": value.shape}
    if isinstance(value, tuple) and hasattr(value, "_fields"):
        return {"name": type(value).__name__, "fields": [_encoded(item) for item in value]}
    if isinstance(value, tuple):
        return [_encoded(item) for item in value]
    raise TypeError(f"no form for {type(value).__name__}")


def _decoded(data: Any) -> Any:
    if isinstance(data, list):
        return tuple(_decoded(item) for item in data)
    if not isinstance(data, dict):
        return data
    if "array" in data:
        return readonly(np.array(data["array"], dtype=np.float64).reshape(data["shape"]))
    if "enum" in data:
        return _CLASSES[data["enum"]](data["value"])
    return _CLASSES[data["name"]](*[_decoded(item) for item in data["fields"]])


def _own_classes(module: ModuleType) -> dict[str, Any]:
    return {
        name: item
        for name, item in vars(module).items()
        if isinstance(item, type) and item.__module__ == module.__name__ and issubclass(item, tuple | IntEnum)
    }


_CLASSES: dict[str, Any] = {name: item for module in _MODULES for name, item in _own_classes(module).items()}
