"""What surrounds a process: an installed ROS, how DDS sends, and a parent that listens to its events.

By default DDS sends by UDP alone, and on this machine only. ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST limits whom a node
looks for, not who finds it: its sockets are open on every interface, and a machine that names this one in its
ROS_STATIC_PEERS reads and writes every topic. A profile of Fast DDS binds them to 127.0.0.1.

Shared memory is left out: a process that is killed while it holds a lock there blocks every later writer, the
controller too, and a node that starts where a killed one listened may receive nothing.

An event is one line of JSON on stdout, only where the parent set `EVENTS_VARIABLE` = "1" in the child's environment.
"""

from __future__ import annotations

import importlib.util
import json
import os
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, Literal, NamedTuple, get_args

from slip_core.errors import InputError, printable

RANGE: Final = "ROS_AUTOMATIC_DISCOVERY_RANGE"
LOCALHOST: Final = "LOCALHOST"
LOCALHOST_ONLY: Final = "ROS_LOCALHOST_ONLY"  # deprecated, and stronger than the range
PEERS: Final = "ROS_STATIC_PEERS"
PROFILES: Final = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")
TRANSPORTS: Final = "FASTDDS_BUILTIN_TRANSPORTS"
RMW: Final = "RMW_IMPLEMENTATION"


def choose_transport() -> bool:
    """Set in the environment how this process and its children send, unless the user has set it.

    To be called before rclpy starts. Return whether DDS stays on this machine, as far as is known.
    """
    profile = str(Path(__file__).with_name("localhost.xml"))
    if any(os.environ.get(name) for name in PROFILES):
        return os.environ.get(PROFILES[0]) == profile
    if os.environ.get(LOCALHOST_ONLY) == "1":
        os.environ |= {LOCALHOST_ONLY: "0", RANGE: LOCALHOST}
    here = os.environ.setdefault(RANGE, LOCALHOST) == LOCALHOST and not os.environ.get(PEERS)
    if here and os.environ.get(RMW, "rmw_fastrtps_cpp").startswith("rmw_fastrtps"):
        # With LOCALHOST rmw_fastrtps adds shared memory, whatever a profile sets.
        os.environ |= {RANGE: "SYSTEM_DEFAULT", PROFILES[0]: profile}
    else:
        os.environ.setdefault(TRANSPORTS, "UDPv4")
    return here


def check_ros() -> None:
    """Look for ROS.

    Raises:
        InputError: this Python has none.
    """
    if importlib.util.find_spec("rclpy") is None:
        raise no_ros()


def no_ros() -> InputError:
    """Return the error of a Python without ROS, with its fix."""
    return InputError(
        "ROS 2", got="no rclpy in this Python", expected="ROS 2 Jazzy",
        fix="pip install '.[ros]' in a clone, or source /opt/ros/jazzy/setup.bash before the start",
    )  # fmt: skip


def is_of_ros(error: ModuleNotFoundError) -> bool:
    """Return whether a module is missing because ROS is not installed."""
    name = (error.name or "").partition(".")[0]
    ours = name.startswith(("rcl", "rosidl", "rpyutils", "builtin_interfaces", "ament_")) or name.endswith("_msgs")
    return ours and importlib.util.find_spec("rclpy") is None


EVENTS_VARIABLE: Final = "SLIP_VIC_EVENTS"

Kind = Literal["progress", "incident", "warning", "done"]
"""The bridge has simulated so far (`sim_time_s`, `ticks`). The run went wrong (the fields of `Incident`). Something is
not as wished (`text`, one line). The process has finished its work (its results by name)."""


class Event(NamedTuple):
    """What happened, and what belongs to it by name, as JSON can hold it."""

    kind: Kind
    values: Mapping[str, Any]


def decode(line: str) -> Event | None:
    """Return the event of a line; None where the line is something else."""
    if not line.startswith('{"event"'):
        return None
    try:
        values = json.loads(line)
    except ValueError:
        return None
    kind = values.pop("event")
    return Event(kind, values) if kind in get_args(Kind) else None


def wanted() -> bool:
    """Return whether a parent listens to the events of this process."""
    return os.environ.get(EVENTS_VARIABLE) == "1"


def emit(kind: Kind, /, **values: Any) -> None:
    """Tell the parent, where one listens."""
    if wanted():
        print(json.dumps({"event": kind, **values}), flush=True)


def warn(source: str, text: str) -> None:
    """Tell the parent of a warning; where none listens, print it to stderr with its source."""
    if wanted():
        emit("warning", text=text)
    else:
        print(printable(f"warning: {source}: {text}"), file=sys.stderr, flush=True)
