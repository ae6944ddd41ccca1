"""Two arms in worlds that their controllers do not know: random mismatch, every law in the same worlds."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from rich.table import Table

from slip_vic.pair.measures import Judged, judge
from slip_vic.pair.scenario import Law, load_pair

BASE_RAD, BASE_M, LATE_S = 0.3 * np.pi / 180.0, 0.002, 0.01
WEAKEST, MASS = 0.87, 0.1
FASTEST_S, SLOWEST_S = 1.2, 2.0


@dataclass(frozen=True, slots=True)
class World:
    """One draw: scenario, and the assignments that make its world."""

    number: int
    scenario: str
    assignments: tuple[str, ...]


def draw(number: int, seed: int, scenarios: Sequence[str]) -> World:
    """Return world `number` of a seed: its numbers depend on these two alone.

    Base of the right arm within 0.3 deg about every axis and 2 mm, its reference up to 10 ms late, friction of its pad
    0.87 to 1 of the left one's, mass within 10 %, motion in 1.2 to 2 s.
    """
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(number,)))
    turn, shift = rng.uniform(-BASE_RAD, BASE_RAD, 3), rng.uniform(-BASE_M, BASE_M, 3)
    late, weak, mass = rng.uniform(0.0, LATE_S), rng.uniform(WEAKEST, 1.0), rng.uniform(1.0 - MASS, 1.0 + MASS)
    return World(
        number,
        scenarios[number % len(scenarios)],
        (
            f"mismatch.base_rotation={turn.tolist()}",
            f"mismatch.base_position={shift.tolist()}",
            f"mismatch.late_s={late}",
            f"mismatch.friction={weak}",
            f"mismatch.mass={mass}",
            f"controller.trajectory.duration_s={rng.uniform(FASTEST_S, SLOWEST_S)}",
        ),
    )


def play(task: tuple[World, Law, tuple[str, ...]]) -> tuple[World, Law, Judged]:
    """Run one world with one law."""
    world, law, assignments = task
    return world, law, judge(load_pair(world.scenario, law=law, assignments=(*world.assignments, *assignments)))


def run_draws(
    count: int, seed: int, scenarios: Sequence[str], laws: Sequence[Law], jobs: int, assignments: tuple[str, ...] = ()
) -> Iterator[tuple[World, Law, Judged]]:
    """Yield every world with every law, in their order."""
    tasks = [(world, law, assignments) for world in (draw(k, seed, scenarios) for k in range(count)) for law in laws]
    if jobs == 1:
        yield from map(play, tasks)
        return
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        yield from pool.map(play, tasks, chunksize=4)


def summary(results: Sequence[tuple[World, Law, Judged]]) -> Table:
    """Return the table: how many panes are lost, and what the others have slipped."""
    table = Table(title="two arms, random mismatch")
    names = ("scenario", "law", "runs", "lost", "slip mm (median, 95 %, most)", "internal N (median, most)", "path mm")
    for name in names:
        table.add_column(name, justify="left" if name in ("scenario", "law") else "right")
    for scenario in dict.fromkeys(world.scenario for world, _, _ in results):
        for law in dict.fromkeys(law for _, law, _ in results):
            runs = [judged for world, of, judged in results if world.scenario == scenario and of == law]
            kept = [run for run in runs if run.outcome == "ok"]
            row = [scenario, law, str(len(runs)), str(len(runs) - len(kept)), "", "", ""]
            if kept:
                slip = 1e3 * np.array([max(run.slip) for run in kept])
                internal = np.array([run.internal for run in kept])
                row[4] = f"{np.median(slip):.3f}, {np.percentile(slip, 95):.3f}, {slip.max():.3f}"
                row[5] = f"{np.median(internal):.3f}, {internal.max():.3f}"
                row[6] = f"{1e3 * max(run.path for run in kept):.1f}"
            table.add_row(*row)
    return table


def write_results(path: Path, results: Sequence[tuple[World, Law, Judged]]) -> None:
    """Write one row per world and law."""
    with path.open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        names = ("slip_left_m", "slip_right_m", "internal_n", "steady_n", "load_left", "load_right", "path_m")
        rows.writerow(("number", "scenario", "law", "outcome", "reason", *names, "world"))
        for world, law, judged in results:
            numbers = (*judged.slip, judged.internal, judged.steady, *judged.load, judged.path)
            rows.writerow(
                (
                    world.number,
                    world.scenario,
                    law,
                    judged.outcome,
                    judged.reason,
                    *numbers,
                    " ".join(world.assignments),
                )
            )
