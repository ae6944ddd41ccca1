"""Message definitions for the bag: the ``ros2msg`` schema text of a type, and its generated class.

They are read where the message package is installed: beside the imported package (wheels, conda), in the overlays of
AMENT_PREFIX_PATH (ROS, colcon), or under `sys.prefix`.
"""

from __future__ import annotations

import functools
import importlib
import importlib.util
import os
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from slip_core.errors import InputError
from slip_msgs_py.messages.layout import parse_fields

_DELIMITER: Final = "\n" + "=" * 80 + "\nMSG: "


@functools.cache
def find_definition(type_name: str) -> str:
    """Return the text of ``pkg/msg/Type`` as rosbag2 stores it: depth first, dependencies sorted, each once.

    Raises:
        InputError: the name is not of this form or the type is not installed.
    """
    package, name = _split(type_name)
    seen = {f"{package}/{name}"}

    def expand(package: str, name: str) -> str:
        text = _read(package, name)
        parts = [text]
        for dependency in dependencies(text, package):
            if dependency not in seen:
                seen.add(dependency)
                parts.append(_DELIMITER + dependency + "\n" + expand(*dependency.split("/")))
        return "".join(parts)

    return expand(package, name)


def message_class(type_name: str) -> type:
    """Return the generated class of ``pkg/msg/Type``.

    Raises:
        InputError: the name is not of this form, or the type is not installed.
    """
    package, name = _split(type_name)
    try:
        return getattr(importlib.import_module(f"{package}.msg"), name)
    except (ImportError, AttributeError) as error:
        raise InputError(f"message type {type_name}", got=error, expected="an installed message package") from None


def _split(type_name: str) -> tuple[str, str]:
    match = re.fullmatch(r"([a-zA-Z]\w*)/msg/([a-zA-Z]\w*)", type_name)
    if match is None:
        raise InputError("message type", got=type_name, expected="package/msg/Name, e.g. sensor_msgs/msg/JointState")
    return match[1], match[2]


def dependencies(text: str, package: str) -> list[str]:
    """Return the types a .msg text refers to as ``pkg/Name``, sorted; unqualified names belong to `package`."""
    return sorted(
        {field.type_name for field in parse_fields(text, package, f"a message of {package}") if "/" in field.type_name}
    )


def _read(package: str, name: str) -> str:
    relative = Path("share", package, "msg", f"{name}.msg")
    for prefix in _prefixes(package):
        path = prefix / relative
        if path.is_file():
            return path.read_bytes().decode("utf-8")
    raise InputError(
        f"message type {package}/msg/{name}",
        got=f"no {relative}",
        expected="an installed message package",
        fix=f"install {package} or source the workspace that has it",
    )


def _prefixes(package: str) -> Iterator[Path]:
    try:
        spec = importlib.util.find_spec(package)
    except (ImportError, ValueError):
        spec = None
    if spec is not None and spec.origin:
        yield from Path(spec.origin).parents
    yield from (Path(entry) for entry in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if entry)
    yield Path(sys.prefix)
