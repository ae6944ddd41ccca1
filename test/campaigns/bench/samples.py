"""Measured numbers with their spread: every quantity is measured once per round, beside the others."""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True, slots=True)
class Metric:
    """One quantity: a value per round.

    The median is what is reported; lowest and highest round show the noise.
    """

    name: str
    unit: str
    values: tuple[float, ...]
    note: str = ""

    @property
    def median(self) -> float:
        """Median over the rounds, NaN where there are none."""
        return statistics.median(self.values) if self.values else float("nan")

    @property
    def low(self) -> float:
        """Lowest round."""
        return min(self.values, default=float("nan"))

    @property
    def high(self) -> float:
        """Highest round."""
        return max(self.values, default=float("nan"))

    def as_dict(self) -> dict[str, Any]:
        """Return it for ``bench.json``."""
        return {
            "unit": self.unit,
            "median": self.median,
            "low": self.low,
            "high": self.high,
            "values": list(self.values),
            "note": self.note,
        }


@dataclass(slots=True)
class Rounds:
    """Raw values per name and round, and the ratios made of them."""

    values: dict[str, list[float]] = field(default_factory=dict)

    def add(self, name: str, value: float) -> None:
        """Take the value of one round."""
        self.values.setdefault(name, []).append(value)

    def metric(self, name: str, source: str, unit: str, note: str = "", scale: float = 1.0) -> Metric:
        """Return the quantity `source` as it was measured, times `scale`."""
        return Metric(name, unit, tuple(scale * value for value in self.values.get(source, ())), note)

    def ratio(self, name: str, over: str, under: str, note: str = "") -> Metric:
        """Return the ratio of two quantities, formed within each round: what slows both does not show in it."""
        pairs = zip(self.values.get(over, ()), self.values.get(under, ()), strict=True)
        return Metric(name, "", tuple(a / b for a, b in pairs), note)


def rotated(names: Sequence[str], round_number: int) -> list[str]:
    """Return the names, starting with another one each round."""
    start = round_number % len(names) if names else 0
    return [*names[start:], *names[:start]]


def relative_spread(values: Sequence[float]) -> float:
    """Return (highest - lowest) / median, 0 for fewer than two values."""
    if len(values) < 2:
        return 0.0
    return (max(values) - min(values)) / statistics.median(values)
