"""Message definitions for the bag: the ``ros2msg`` schema text of a type.

They are read where the message package is installed: beside the imported package (wheels, conda), in the overlays of
AMENT_PREFIX_PATH (ROS, colcon), or under `sys.prefix`.
"""

from __future__ import annotations

import functools
import os
import re
import sys
from pathlib import Path
from typing import Final

from slip_core.errors import InputError
from slip_msgs_py.qos import message_class

_DELIMITER: Final = "\n" + "=" * 80 + "\nMSG: "


@functools.cache
def find_definition(type_name: str) -> str:
    """Return the text of ``pkg/msg/Type`` as rosbag2 stores it: depth first, dependencies sorted, each once.

    Raises:
        InputError: the name is not of this form or the type is not installed.
    """
    seen = set[str]()

    def expand(package: str, name: str) -> str:
        seen.add(f"{package}/{name}")
        kind = message_class(f"{package}/msg/{name}")
        parts = [_read(package, name, kind)]
        for dependency in sorted(set(re.findall(r"\w+/\w+", " ".join(kind.get_fields_and_field_types().values())))):
            if dependency not in seen:
                parts.append(_DELIMITER + dependency + "\n" + expand(*dependency.split("/")))
        return "".join(parts)

    package, _, name = type_name.partition("/msg/")
    return expand(package, name)


def _read(package: str, name: str, kind: type) -> str:
    relative = Path("share", package, "msg", f"{name}.msg")
    prefixes = [*Path(sys.modules[kind.__module__].__file__ or "").parents]
    prefixes += [Path(entry) for entry in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if entry]
    for prefix in (*prefixes, Path(sys.prefix)):
        if (prefix / relative).is_file():
            return (prefix / relative).read_bytes().decode("utf-8")
    raise InputError(
        f"message type {package}/msg/{name}",
        got=f"no {relative}",
        expected="an installed message package",
        fix=f"install {package} or source the workspace that has it",
    )
