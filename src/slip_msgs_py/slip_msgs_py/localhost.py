"""DDS on this machine only, unless configured otherwise.

ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST limits whom a node looks for, not who finds it: its sockets are open on every
interface, and a machine that names this one in its ROS_STATIC_PEERS reads and writes every topic. A profile of Fast DDS
binds them to 127.0.0.1.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Final

RANGE: Final = "ROS_AUTOMATIC_DISCOVERY_RANGE"
PROFILES: Final = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")
OTHERWISE: Final = (*PROFILES, "ROS_STATIC_PEERS")
"""Environment variables by which a user says with whom to talk, beside the range."""


def stay_on_this_machine() -> None:
    """Bind what this process does in DDS to 127.0.0.1, where the environment does not say otherwise.

    To be called before rclpy starts.
    """
    if os.environ.setdefault(RANGE, "LOCALHOST") == "LOCALHOST" and not any(os.environ.get(name) for name in OTHERWISE):
        os.environ[PROFILES[0]] = str(Path(__file__).with_name("localhost.xml"))
