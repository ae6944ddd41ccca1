"""One topic between two nodes, with its faults, in virtual time."""

from __future__ import annotations

import dataclasses
from typing import Any, NamedTuple

import numpy as np

from test.campaigns.faults.plan import Fault
from test.campaigns.faults.wire import Wire

DAMAGED = ("corrupt_values", "corrupt_bytes", "wrong_names", "wrong_frame")
_LONGEST_DELAY_S = 0.3


class Delivery(NamedTuple):
    """A sample on its way: when it arrives, when it was measured, and whether it may count."""

    due_ns: int
    measured_ns: int
    order: int
    sample: Any
    clean: bool


class Channel:
    """Carries samples.

    Args:
        wire: the topic; a damaged sample becomes a message and a sample again by the node's own code.
        faults: those of this topic.
        rng: this channel's randomness.
    """

    def __init__(self, wire: Wire, faults: tuple[Fault, ...], rng: np.random.Generator) -> None:
        self._wire, self._faults, self._rng = wire, faults, rng
        self._waiting: list[Delivery] = []
        self._held: tuple[Any, int] | None = None
        self._frozen: tuple[Any, int] | None = None
        self._count = 0

    def send(self, sample: Any, t: float, now_ns: int, measured_ns: int | None = None) -> None:
        """Take a sample at trial time t [s]; None: it was measured now."""
        measured_ns = now_ns if measured_ns is None else measured_ns
        faults = [fault for fault in self._faults if fault.at(t)] if self._faults else []
        if not faults:
            self._frozen = None
            self._release(now_ns)
            self._put(sample, now_ns, measured_ns, True)
            return
        self._suffer(faults[0], sample, now_ns, measured_ns)

    def arrivals(self, now_ns: int) -> list[Delivery]:
        """Return what arrives by now, in order of arrival."""
        if not self._waiting:
            return []
        due = sorted((d for d in self._waiting if d.due_ns <= now_ns), key=lambda d: (d.due_ns, d.order))
        self._waiting = [d for d in self._waiting if d.due_ns > now_ns]
        return due

    def _suffer(self, fault: Fault, sample: Any, now_ns: int, measured_ns: int) -> None:
        rng, kind = self._rng, fault.kind
        chance = 1.0 if fault.size > 0.5 else 2.0 * fault.size
        hit = rng.uniform() < chance
        if kind in ("freeze_values", "freeze_message"):
            self._frozen = (sample, measured_ns) if self._frozen is None else self._frozen
            same, since_ns = self._frozen
            if kind == "freeze_values":  # they have time limits of their own
                same, since_ns = dataclasses.replace(same, stamp_ns=sample.stamp_ns), measured_ns
            self._put(same, now_ns, since_ns, True)
        elif not hit:
            self._put(sample, now_ns, measured_ns, True)
        elif kind == "duplicate":
            for _ in range(1 + int(rng.integers(1, 4))):
                self._put(sample, now_ns, measured_ns, True)
        elif kind == "delay":
            delay_ns = int(1e9 * _LONGEST_DELAY_S * fault.size * rng.uniform())
            self._put(sample, now_ns + delay_ns, measured_ns, True)
        elif kind == "reorder":
            if self._held is None:
                self._held = sample, measured_ns
            else:
                self._put(sample, now_ns, measured_ns, True)
                self._release(now_ns)
        elif kind in DAMAGED:
            damaged = self._wire.receive(self._wire.damaged(self._wire.message(sample), kind, rng))
            if damaged is not None:
                self._put(damaged, now_ns, measured_ns, _is_finite(damaged))

    def _release(self, now_ns: int) -> None:
        if self._held is not None:
            sample, measured_ns = self._held
            self._put(sample, now_ns, measured_ns, True)
            self._held = None

    def _put(self, sample: Any, due_ns: int, measured_ns: int, clean: bool) -> None:
        self._count += 1
        self._waiting.append(Delivery(due_ns, measured_ns, self._count, sample, clean))


def _is_finite(sample: Any) -> bool:
    """Return whether all numbers of a sample are finite."""
    arrays = (getattr(sample, name) for name in ("position", "velocity", "wrench", "twist") if hasattr(sample, name))
    return all(np.isfinite(array).all() for array in arrays)
