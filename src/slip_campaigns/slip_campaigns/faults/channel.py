"""One topic between two nodes, with its faults; time is an argument, virtual or real."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from slip_campaigns.faults.carriers import Carrier
from slip_campaigns.faults.plan import Fault

_DAMAGED = ("corrupt_values", "corrupt_bytes", "wrong_names", "wrong_frame")
_LONGEST_DELAY_S = 0.3


@dataclasses.dataclass(frozen=True, slots=True)
class Delivery:
    """A sample on its way: when it arrives, when it was sent, and whether it may count."""

    due_ns: int
    sent_ns: int
    order: int
    sample: Any
    clean: bool


class Channel:
    """Carries samples.

    Args:
        carrier: of what is carried.
        faults: those of this topic.
        rng: this channel's randomness.
    """

    def __init__(self, carrier: Carrier, faults: tuple[Fault, ...], rng: np.random.Generator) -> None:
        self._carrier, self._faults, self._rng = carrier, faults, rng
        self._waiting: list[Delivery] = []
        self._held: tuple[Any, int] | None = None
        self._frozen: Any = None
        self._count = 0

    def send(self, sample: Any, t: float, now_ns: int) -> None:
        """Take a sample at trial time t [s]."""
        faults = [fault for fault in self._faults if fault.at(t)]
        if not faults:
            self._frozen = None
            self._release(now_ns)
            self._put(sample, now_ns, True)
            return
        for fault in faults[:1]:
            self._suffer(fault, sample, now_ns)

    def arrivals(self, now_ns: int) -> list[Delivery]:
        """Return what arrives by now, in order of arrival."""
        due = sorted((d for d in self._waiting if d.due_ns <= now_ns), key=lambda d: (d.due_ns, d.order))
        self._waiting = [d for d in self._waiting if d.due_ns > now_ns]
        return due

    def _suffer(self, fault: Fault, sample: Any, now_ns: int) -> None:
        rng, kind = self._rng, fault.kind
        chance = 1.0 if fault.size > 0.5 else 2.0 * fault.size
        hit = rng.uniform() < chance
        if kind in ("freeze_values", "freeze_message"):
            self._frozen = sample if self._frozen is None else self._frozen
            same = self._frozen
            if kind == "freeze_values":
                same = self._carrier.restamp(same, sample)
            # Frozen values have time limits of their own; a message that is repeated is no new sample.
            self._put(same, now_ns, kind == "freeze_values" or same is sample)
        elif kind == "cut":
            pass  # nothing comes through
        elif not hit:
            self._put(sample, now_ns, True)
        elif kind == "duplicate":
            for _ in range(1 + int(rng.integers(1, 4))):
                self._put(sample, now_ns, True)
        elif kind == "delay":
            self._put(sample, now_ns, True, int(1e9 * _LONGEST_DELAY_S * fault.size * rng.uniform()))
        elif kind == "reorder":
            if self._held is None:
                self._held = sample, now_ns
            else:
                self._put(sample, now_ns, True)
                self._release(now_ns)
        elif kind in _DAMAGED:
            damaged = self._carrier.damage(sample, kind, rng)
            if damaged is not None:
                self._put(damaged, now_ns, not self._carrier.plainly_bad(damaged))

    def _release(self, now_ns: int) -> None:
        if self._held is not None:
            sample, sent_ns = self._held
            self._put(sample, sent_ns, True, now_ns - sent_ns)
            self._held = None

    def _put(self, sample: Any, sent_ns: int, clean: bool, delay_ns: int = 0) -> None:
        self._count += 1
        due_ns = sent_ns + delay_ns
        self._waiting.append(Delivery(due_ns, sent_ns, self._count, sample, clean))
