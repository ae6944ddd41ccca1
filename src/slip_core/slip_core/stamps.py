"""Stamps: integer nanoseconds inside, sec and nanosec at the border."""

from __future__ import annotations

from typing import Protocol

NS_PER_S = 1_000_000_000


class Stamp(Protocol):
    """A builtin_interfaces/Time, decoded by ROS or by a bag reader."""

    sec: int
    nanosec: int


def split_ns(stamp_ns: int) -> tuple[int, int]:
    """Return (sec, nanosec) of a stamp in nanoseconds."""
    return divmod(stamp_ns, NS_PER_S)


def stamp_to_ns(stamp: Stamp) -> int:
    """Return the nanoseconds of a stamp."""
    return int(stamp.sec) * NS_PER_S + int(stamp.nanosec)


def seconds_to_ns(seconds: float) -> int:
    """Return the nearest whole nanosecond."""
    return round(seconds * NS_PER_S)
