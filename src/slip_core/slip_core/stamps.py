"""Stamps: integer nanoseconds inside, sec and nanosec at the border."""

from __future__ import annotations

from typing import Any

NS_PER_S = 1_000_000_000


def split_ns(stamp_ns: int) -> tuple[int, int]:
    """Return (sec, nanosec) of a stamp in nanoseconds."""
    return divmod(stamp_ns, NS_PER_S)


def stamp_to_ns(stamp: Any) -> int:
    """Return the nanoseconds of a builtin_interfaces/Time, decoded by ROS or by a bag reader."""
    return int(stamp.sec) * NS_PER_S + int(stamp.nanosec)


def seconds_to_ns(seconds: float) -> int:
    """Return the nearest whole nanosecond."""
    return round(seconds * NS_PER_S)
