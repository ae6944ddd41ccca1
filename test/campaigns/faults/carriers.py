"""How a fault acts on what travels: on samples in process, on the bytes of messages over DDS."""

from __future__ import annotations

import dataclasses
from typing import Any, Protocol

import numpy as np

from slip_core.stamps import stamp_of, with_stamp
from test.campaigns.faults.wire import Wire


class Carrier(Protocol):
    """What a channel needs to know of the things it carries."""

    def damage(self, item: Any, kind: str, rng: np.random.Generator) -> Any | None:
        """Return what is left of an item, None where the receiver gets nothing."""

    def restamp(self, item: Any, like: Any) -> Any:
        """Return an item with the stamp of another one."""

    def plainly_bad(self, item: Any) -> bool:
        """Return whether nobody can take a damaged item for a good one."""


class SampleCarrier:
    """Samples: they become messages where they are damaged, and samples again by the node's own code."""

    def __init__(self, wire: Wire) -> None:
        self._wire = wire

    def damage(self, item: Any, kind: str, rng: np.random.Generator) -> Any | None:
        """Return the sample that the node makes of the damaged message."""
        return self._wire.receive(self._wire.damaged(self._wire.message(item), kind, rng))

    def restamp(self, item: Any, like: Any) -> Any:
        """Return the sample with another one's stamp."""
        return dataclasses.replace(item, stamp_ns=like.stamp_ns)

    def plainly_bad(self, item: Any) -> bool:
        """Return whether a number is not finite."""
        arrays = (getattr(item, name) for name in ("position", "velocity", "wrench", "twist") if hasattr(item, name))
        return not all(np.isfinite(array).all() for array in arrays)


class BytesCarrier:
    """Serialised messages."""

    def __init__(self, wire: Wire) -> None:
        self._wire = wire
        self._samples = SampleCarrier(wire)

    def damage(self, item: Any, kind: str, rng: np.random.Generator) -> Any | None:
        """Return the damaged message's bytes."""
        return self._wire.damaged(self._wire.typed(item), kind, rng)

    def restamp(self, item: Any, like: Any) -> Any:
        """Return the message with another one's stamp."""
        return with_stamp(item, stamp_of(like))

    def plainly_bad(self, item: Any) -> bool:
        """Return whether the receiving node refuses it, or a number is not finite."""
        sample = self._wire.receive(item)
        return sample is None or self._samples.plainly_bad(sample)
