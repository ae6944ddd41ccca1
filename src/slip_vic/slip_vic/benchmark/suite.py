"""The suite carry-2026.1: worlds that are drawn from a frozen seed, and one of them under a law."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np

from slip_core.arrays import Array
from slip_core.errors import SlipVicError
from slip_vic.benchmark.driven import Driven
from slip_vic.benchmark.law import FoundLaw, find_law
from slip_vic.run.judge import judge
from slip_vic.run.track import Track
from slip_vic.run.versions import digest
from slip_vic.scenarios import scenario_names
from slip_vic.scenarios.scenario import Estimator, Law, Scenario
from slip_vic.study.lottery import Entry, Ticket, draw, draw_arms, with_drive
from slip_vic.study.table import CaseResult, Layout

SUITE: Final = "carry-2026.1"
SEED: Final = 20261
TUNING_SEED: Final = 20260
"""Of the worlds on which laws are tuned; none of them is in the suite."""
COUNTS: Final = {1: 300, 2: 60}
"""Worlds with so many arms."""
DIGEST: Final = "8e44fee3abe2ed8c"
"""Of all worlds of the suite: `digest_of(SEED)`."""
AFTER_S: Final = 2.0
"""Simulated time after the end of the path as given [s]: a law that slows down may take it."""
TARE_S: Final = 0.3
"""How long laws of this project read their sensors at rest before they begin [s]."""
SINCE: Final = (
    "controller.drive.coulomb=", "controller.governor.reserve=", "bridge.sensors.joint.velocity=true",
    "controller.drive.armature=[]", "bridge.drive.armature=[]",
)  # fmt: skip
"""What presets of drives configure since the suite was frozen."""

Grip = Literal["capped", "free"]
"""The two tracks. capped: the object would break, the squeeze is at most what the scenario has. free: what the gripper
can. A law that needs `grip` runs in the second one, others in the first."""

KEY: Final = ("track", "arms", "scenario", "motion", "sensor", "drive", "digest", "world")
METRICS: Final = (
    "slip_path_m", "slip_path_rad", "arrival_s", "final_error_m", "final_error_rad", "squeeze_peak_n",
    "squeeze_mean_n", "effort_rate_rms_n_m_s", "step_p99_s",
)  # fmt: skip
"""slip_path_*: length of the way that the pad slides and turns on the object; final_error_*: at the end; squeeze_*:
as commanded, of the arm with most; step_p99_s: time of a step of the law, which differs from run to run. Of several
arms the worst."""
LAYOUT: Final = Layout(KEY, METRICS)
TIMED: Final = ("step_p99_s",)
"""Metrics that are not the same in each run."""
LOST: Final = ("lost", "fault", "failed", "crashed")
"""Outcomes in which the object does not arrive; failed: the law did what a law must not do."""
SHORT_M: Final = 0.02
"""Farther than this from the goal at the end, the object has not been carried there [m]."""


@dataclass(frozen=True, slots=True)
class World:
    """A world by its number from 1 on; arms: how many; track: see `Grip`."""

    track: Grip
    arms: int
    number: int
    ticket: Ticket

    @property
    def drive(self) -> str:
        """The interface of its drives with all troubles at once, or "ideal"."""
        return "drawn" if self.ticket.trouble == "all" else "ideal"

    @property
    def digest(self) -> str:
        """Digest of everything that makes it, as it was written when the suite was frozen."""
        ticket = self.ticket
        parts = (ticket.scenario, ticket.sensor, str(ticket.seed), *as_frozen(ticket.world))
        return digest(part.encode() for part in parts)

    @property
    def key(self) -> tuple[str, ...]:
        """The leading columns of the table, `KEY`."""
        ticket = self.ticket
        names = (ticket.scenario, ticket.kind, ticket.sensor, self.drive)
        return (self.track, str(self.arms), *names, self.digest, str(self.number))

    def load(self, configured: Law) -> Scenario:
        """Return the scenario with the controller's parameters of this law.

        A law of this project reads its sensors at rest first, as the presets of drives have it.
        """
        estimator: Estimator | None = None if configured == "classical" or self.arms > 1 else "observer"
        loaded = self.ticket.load(Entry("", configured, estimator))
        own = next(iter(loaded.controllers.values())).trajectory
        lasts = min(own.start_s + own.duration_s + AFTER_S, loaded.duration_s)
        tare = f"controller.tare.duration_s={TARE_S}"
        return self.ticket.load(Entry("", configured, estimator, (f"bridge.duration_s={lasts}", tare)))


def worlds(track: Grip, arms: int, count: int, seed: int = SEED) -> Iterator[World]:
    """Yield the first worlds of a track.

    Of one arm every second one has drives, joints and sensors with all troubles at once (`study.lottery.draw_drive`).
    A world in which friction does not carry the weight at rest is not taken.
    """
    number, pairs = 0, scenario_names(2)
    for drawn in itertools.count():
        if number == count:
            return
        if arms > 1:
            ticket = draw_arms(drawn, seed, pairs[drawn % len(pairs)])
        else:
            ticket = draw(drawn, seed)
            ticket = without_tare(with_drive(ticket, seed)) if drawn % 2 else ticket
        if ticket.feasible:
            number += 1
            yield World(track, arms, number, ticket)


def as_frozen(world: Sequence[str]) -> list[str]:
    """Return a world as it was written when the suite was frozen, for its digest.

    Since then presets of drives configure more (`SINCE`), which changes no world, and the bridge has `drive.coulomb`
    one place earlier.
    """
    lines = [one for one in world if not one.startswith(SINCE)]
    for k in range(1, len(lines)):
        if lines[k].startswith("bridge.drive.interface=") and lines[k - 1].startswith("bridge.drive.coulomb="):
            lines[k - 1], lines[k] = lines[k], lines[k - 1]
    return lines


def without_tare(ticket: Ticket) -> Ticket:
    """Return a world of which no tare is part: that is the law's own."""
    return replace(ticket, world=tuple(one for one in ticket.world if not one.startswith("controller.tare.")))


def digest_of(seed: int) -> str:
    """Return the digest of all worlds of a seed."""
    return digest(
        world.digest.encode() for arms, count in COUNTS.items() for world in worlds("capped", arms, count, seed)
    )


def suite(
    law: FoundLaw, count: int, track: Grip | None = None, seed: int = SEED, arms: Sequence[int] = tuple(COUNTS)
) -> list[World]:
    """Return the first `count` worlds with one arm, and with two where the law answers for several.

    track: None: that of the law.
    """
    own: Grip = track or ("free" if "grip" in law.kind.needs else "capped")
    arms = [n for n in arms if n == 1 or law.several]
    return [world for n in arms for world in worlds(own, n, min(count, COUNTS[n]), seed)]


def run_world(law: str, world: World) -> CaseResult[World]:
    """Run a world under a law; whatever goes wrong becomes a row.

    Outcomes are those of `slip_vic.run.judge.Outcome`, refused, failed, and stays: the pad is at the start all the
    time, which of a closed path is its goal too.
    """
    try:
        kind = find_law(law).kind
        scenario = world.load(getattr(kind, "configured", "classical"))
        driven = Driven(scenario, kind(), most_grip(world.track, scenario))
        track = Track(driven.scenario, whole=False)
        verdict = judge(driven.ticks(), track)
    except SlipVicError as error:
        return LAYOUT.failed(world, "refused", str(error))
    except Exception as error:  # a class of someone else's
        return LAYOUT.failed(world, "failed", f"{type(error).__name__}: {error}")
    outcome, reason = ("failed", driven.failure) if driven.failure else (verdict.outcome, verdict.reason)
    if not track.ticks:
        return LAYOUT.failed(world, outcome, reason)
    arrival = math.nan if outcome in LOST else verdict.worst("arrival_s")
    if arrival == 0.0:  # of a closed path, whose goal is where it starts
        outcome, reason, arrival = "stays", "the pad does not leave the start", math.nan
    paths = [slip_path(series.time, series.slip_velocity) for series in track.series()]
    numbers = {
        "slip_path_m": max(path[0] for path in paths),
        "slip_path_rad": max(path[1] for path in paths),
        "arrival_s": arrival,
        "final_error_m": verdict.worst("final_error_m"),
        "final_error_rad": verdict.worst("final_error_rad"),
        "squeeze_peak_n": float(max(driven.grips)),
        "squeeze_mean_n": float(np.mean(driven.grips)),
        "effort_rate_rms_n_m_s": verdict.worst("effort_rate_rms_n_m_s"),
        "step_p99_s": float(np.quantile(driven.step_s, 0.99)),
    }
    return CaseResult(world, outcome, reason, numbers)


def slip_path(time: Array, velocity: Array) -> tuple[float, float]:
    """Return the length of the way that slip velocities (N, 6) go [m], [rad]: their trapezoids."""
    linear, angular = (np.linalg.norm(part, axis=1) for part in (velocity[:, :3], velocity[:, 3:]))
    return float(np.trapezoid(linear, time)), float(np.trapezoid(angular, time))


def most_grip(track: Grip, scenario: Scenario) -> float:
    """Return the largest squeeze of a track [N]; that of the scenario where its gripper has no more."""
    nominal = max(params.grip.nominal_force for params in scenario.controllers.values())
    if track == "capped":
        return nominal
    return max(nominal, min(params.grip.force_limit for params in scenario.controllers.values()))
