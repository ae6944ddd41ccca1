"""Message definitions for the bag: the ``ros2msg`` schema text of a type.

They are read where the message package is installed, as `find_file` finds it.
"""

from __future__ import annotations

import functools
import re
from typing import Final

from slip_core.files.resources import read_text
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
        parts = [read_text(f"package://{package}/msg/{name}.msg", f"message type {package}/msg/{name}")]
        for dependency in sorted(set(re.findall(r"\w+/\w+", " ".join(kind.get_fields_and_field_types().values())))):
            if dependency not in seen:
                parts.append(_DELIMITER + dependency + "\n" + expand(*dependency.split("/")))
        return "".join(parts)

    package, _, name = type_name.partition("/msg/")
    return expand(package, name)
