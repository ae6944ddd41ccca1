"""A law with several values of one of its numbers, in worlds that are not in the suite."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from slip_vic.benchmark.law import find_law
from slip_vic.benchmark.suite import LOST, TUNING_SEED, World, run_world, suite
from slip_vic.run.prepare import prepare
from slip_vic.study.table import CaseResult


def cost(results: Sequence[CaseResult[World]]) -> tuple[int, float, float]:
    """Return what a value is judged by, the first number first: lost, mean log of slip over 1 mm, mean squeeze [N].

    Where the object does not arrive counts as half a loss.
    """
    lost = sum(2 if one.outcome in LOST else math.isnan(one.metrics["arrival_s"]) for one in results)
    slips = [one.metrics["slip_path_m"] for one in results if math.isfinite(one.metrics["slip_path_m"])]
    squeezes = [one.metrics["squeeze_mean_n"] for one in results if math.isfinite(one.metrics["squeeze_mean_n"])]
    slip = float(np.mean(np.log1p(1e3 * np.array(slips)))) if slips else math.inf
    return lost, slip, float(np.mean(squeezes)) if squeezes else math.inf


def tried(law: str, attribute: str, values: Sequence[float], count: int) -> Iterator[str]:
    """Yield a line for each value, and one on the best.

    Raises:
        InputError: no such law, or it has no such number.
    """
    costs = {}
    prepare()
    for value in values:
        name = f"{law}?{attribute}={value:g}"
        worlds = [world for world in suite(find_law(name), count, seed=TUNING_SEED) if world.arms == 1]
        costs[value] = cost([run_world(name, world) for world in worlds])
        lost, slip, squeeze = costs[value]
        yield f"{name}: {lost / 2:g} lost, log slip {slip:.3f}, mean squeeze {squeeze:.2f} N"
    yield f"best: {attribute}={min(costs, key=lambda value: costs[value]):g}"
