"""The bridge's list of the samples that belong to a lockstep cycle."""

from __future__ import annotations

from typing import Any, NamedTuple

from slip_core.errors import InputError


class Manifest(NamedTuple):
    """The bridge's list of what belongs to a lockstep cycle: samples published so far, per contact."""

    tick: int
    stamp_ns: int
    wrench_counts: tuple[int, ...]
    slip_counts: tuple[int, ...]

    @staticmethod
    def decode(_stamp_ns: int, numbers: Any) -> Manifest:
        """Read [tick, sec, nanosec, wrench count, slip count, ... per contact] of a message without a stamp.

        Raises:
            InputError: a list of another length.
        """
        data = numbers.tolist()
        if len(data) < 5 or len(data) % 2 == 0:
            raise InputError("lockstep tick", got=f"{len(data)} numbers", expected="3, and 2 more per contact")
        return Manifest(data[0], data[1] * 1_000_000_000 + data[2], tuple(data[3::2]), tuple(data[4::2]))
