"""A world as data: what differs from the configuration, and by which names its rows are found."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import Final, Literal, cast

import numpy as np

from slip_core.errors import UnknownName
from slip_core.params import flatten
from slip_vic.run.versions import digest
from slip_vic.scenarios.scenario import Law, Scenario, load

Track = Literal["", "capped", "free"]
"""Tracks of the benchmark. capped: the object would break, the squeeze is at most what the scenario has. free: what the
gripper can. "": none; the controller's laws then run as the controller, not through the interface of foreign ones."""


BLIND: Final = ("classical", "printed")
"""Laws of the controller without the observer of a slip sensor."""
KEY: Final = (
    "set", "world", "law", "scenario", "sensor", "drive", "motion", "mismatch", "seed", "arms", "track", "digest",
)  # fmt: skip
"""Columns of a row that name its run; world: the number in its set."""
Key = tuple[str, ...]
SHARE: Final = 0.2
"""Relative error of a mismatch."""
NO_MISMATCH: Final = "none"
SCALED: Final = {
    "mass": ("object.mass",), "inertia": ("object.inertia",), "com": ("contacts.position",),
    "friction": ("friction.mu_s", "friction.mu_k"),
}  # fmt: skip
"""Parameters of the bridge that a mismatch changes by SHARE."""
MISMATCHES: Final = (NO_MISMATCH, *(f"{what}{sign}" for what in (*SCALED, "wrench_bias") for sign in "+-"))


@dataclass(frozen=True, slots=True)
class World:
    """One world, and the law that runs in it. Equal ones give equal rows.

    set, number: the set it belongs to and its number there; scenario, sensor, drive: names or files; seed: of the
    sensors' noise; settings: assignments to parameters of both nodes, in their order; arms: how many hold the object;
    track: see `Track`; frozen: the digest that a set was published with, whose settings have what the drive does;
    fastest_s: the fastest slip-free time that a suite has found, infinite where there is none [s]; law: a name,
    `module:Class` or `file.py:Class`. For tables alone, because `settings` has what they do: motion, mismatch.
    """

    scenario: str
    sensor: str = ""
    seed: int = 0
    settings: tuple[str, ...] = ()
    set: str = "study"
    number: int = 0
    arms: int = 1
    motion: str = "scenario"
    drive: str = ""
    mismatch: str = NO_MISMATCH
    track: Track = ""
    frozen: str = ""
    fastest_s: float = 0.0
    law: str = ""

    @property
    def key(self) -> Key:
        """The leading cells of its row."""
        cells = asdict(self) | {"world": self.number, "digest": self.digest}
        return tuple(str(cells[name]) for name in KEY)

    @property
    def digest(self) -> str:
        """Digest of everything that makes the world; of a published set the one that it was published with."""
        parts = (self.scenario, self.sensor, self.drive, str(self.seed), *self.settings)
        return self.frozen or digest(part.encode() for part in parts)

    @property
    def preset_drive(self) -> str:
        """Its drive as a preset or file; empty for a published world, whose settings have what the drive does."""
        return "" if self.frozen else self.drive

    def load(self, name: str, more: Sequence[str] = ()) -> Scenario:
        """Return the scenario with a law of the controller by its name; `more` are further assignments.

        ``?parameter=value`` behind the name changes a parameter of the controller, ``vic?slip_estimator=measured``.

        Raises:
            InputError: unknown scenario, sensor, law or parameter; a value that is not allowed.
        """
        base, _, change = name.partition("?")
        changes = (f"controller.{change}",) if change else ()
        observer = ("controller.slip_estimator=observer",) if self.sensor and base not in BLIND else ()
        return load(
            self.scenario,
            law=cast("Law", base),
            sensor=self.sensor,
            drive=self.preset_drive,
            seed=self.seed,
            set=(*observer, *self.settings, *changes, *more),
        )


def combined(
    scenarios: Sequence[str],
    sensors: Sequence[str],
    mismatches: Sequence[str],
    seeds: Iterable[int],
    drives: Sequence[str] = ("",),
    settings: tuple[str, ...] = (),
) -> list[World]:
    """Return every combination; the seed runs slowest, so that a study that is stopped early has all kinds of worlds.

    Args:
        scenarios, sensors, mismatches, drives: names.
        seeds: of the sensors' noise.
        settings: of every world.

    Raises:
        InputError: an unknown name, a bad setting.
    """
    known = {pair: load(pair[0], drive=pair[1], set=settings) for pair in itertools.product(scenarios, drives)}
    return [
        World(
            scenario, sensor, seed, (*settings, *mismatch_assignments(mismatch, known[scenario, drive])),
            number=seed, arms=len(known[scenario, drive].controllers), drive=drive, mismatch=mismatch,
        )
        for seed, scenario, drive, mismatch, sensor in itertools.product(seeds, scenarios, drives, mismatches, sensors)
    ]  # fmt: skip


def mismatch_assignments(name: str, known: Scenario) -> list[str]:
    """Return what a mismatch sets in the bridge; a wrench bias is a share of the grip force along the pad's x.

    Raises:
        InputError: there is no such mismatch; the nearest is offered.
    """
    if name not in MISMATCHES:
        raise UnknownName("mismatch", name, MISMATCHES)
    if name == NO_MISMATCH:
        return []
    what, factor, settings = name[:-1], 1.0 + SHARE * (1.0 if name[-1] == "+" else -1.0), []
    for arm, own in known.bridges.items():
        values = flatten(own)
        found = {one: (np.array(values[one]) * factor).tolist() for one in SCALED.get(what, ())}
        if what == "wrench_bias":
            found["sensors.wrench.bias"] = [own.grip.force * (factor - 1.0), 0.0, 0.0, 0.0, 0.0, 0.0]
        settings += [f"{arm and arm + '.'}bridge.{one}={value}" for one, value in found.items()]
    return settings
