"""Stamps: integer nanoseconds inside, sec and nanosec at the border."""

from __future__ import annotations

import struct
from typing import Final, Protocol

NS_PER_S = 1_000_000_000
_IN_HEADER: Final = 4  # of a serialised message: behind four bytes that say how it is written


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


def stamp_of(data: bytes, at: int = _IN_HEADER) -> int:
    """Return the stamp [ns] in a serialised message, of either byte order; at: where, if it does not begin with it."""
    sec, nanosec = _form(data).unpack_from(data, at)
    return int(sec) * NS_PER_S + int(nanosec)


def with_stamp(data: bytes, stamp_ns: int) -> bytes:
    """Return a serialised message with another stamp [ns] in its header, cut to what a stamp can hold."""
    sec, nanosec = split_ns(stamp_ns)
    stamp = _form(data).pack(min(max(sec, -(2**31)), 2**31 - 1), nanosec)
    return data[:_IN_HEADER] + stamp + data[_IN_HEADER + len(stamp) :]


def _form(data: bytes) -> struct.Struct:
    return _LITTLE if data[1] & 1 else _BIG


_LITTLE: Final = struct.Struct("<iI")
_BIG: Final = struct.Struct(">iI")
