"""A world as data: what differs from the configuration, and by which names its rows are found."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from importlib import resources
from typing import Any, Final, Literal, NamedTuple

from slip_core.errors import UnknownName
from slip_core.files.plain_yaml import read_yaml
from slip_vic.run.versions import digest
from slip_vic.scenarios.scenario import Law, Scenario, load_scenario

Track = Literal["", "capped", "free"]
"""Tracks of the benchmark. capped: the object would break, the squeeze is at most what the scenario has. free: what the
gripper can. "": none; the controller's laws then run as the controller, not through the interface of foreign ones."""


class OwnLaw(NamedTuple):
    """A law of the controller as `load_scenario` configures it; observer: of a sensor."""

    law: Law
    observer: bool = True


OWN_LAWS: Final[Mapping[str, OwnLaw]] = {
    "classical": OwnLaw("classical", observer=False),
    "printed": OwnLaw("printed", observer=False),
    "vic": OwnLaw("vic"),
    "governed": OwnLaw("governed"),
    "governed_follow": OwnLaw("governed_follow"),
}
"""Laws of the controller by their names. ``?parameter=value`` behind one changes a parameter of the controller,
``vic?slip_estimator=measured``."""
KEY: Final = (
    "set", "world", "law", "scenario", "sensor", "drive", "motion", "mismatch", "seed", "arms", "track", "digest",
)  # fmt: skip
"""Columns of a row that name its run; world: the number in its set."""
Key = tuple[str, ...]
SHARE: Final = 0.2
"""Relative error of a mismatch."""
NO_MISMATCH: Final = "none"
MISMATCHES: Final = (
    NO_MISMATCH,
    *(f"{what}{sign}" for what in ("mass", "inertia", "com", "friction", "wrench_bias") for sign in "+-"),
)


@dataclass(frozen=True, slots=True)
class World:
    """One world, and the law that runs in it. Equal ones give equal rows.

    set, number: the set it belongs to and its number there; scenario, sensor: names or files; seed: of the sensors'
    noise; settings: assignments to parameters of both nodes, in their order; arms: how many hold the object; track: see
    `Track`; frozen: the digest that a set was published with; fastest_s: the fastest slip-free time that a suite has
    found, infinite where there is none [s]; law: a name, `module:Class` or `file.py:Class`. For
    tables alone, because `settings` has what they do: motion, drive, mismatch.
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
        parts = (self.scenario, self.sensor, str(self.seed), *self.settings)
        return self.frozen or digest(part.encode() for part in parts)

    def load(self, name: str, more: Sequence[str] = ()) -> Scenario:
        """Return the scenario with a law of the controller by its name, see `OWN_LAWS`; `more` are further assignments.

        Raises:
            InputError: unknown scenario, sensor, law or parameter; a value that is not allowed.
        """
        base, _, change = name.partition("?")
        if base not in OWN_LAWS:
            raise UnknownName("law", base, OWN_LAWS)
        own, changes = OWN_LAWS[base], (f"controller.{change}",) if change else ()
        observer = ("controller.slip_estimator=observer",) if own.observer and self.sensor else ()
        return load_scenario(
            self.scenario,
            law=own.law,
            sensor=self.sensor,
            seed=self.seed,
            assignments=(*observer, *self.settings, *changes, *more),
        )


def combined(
    scenarios: Sequence[str],
    sensors: Sequence[str],
    mismatches: Sequence[str],
    seeds: Iterable[int],
    drives: Mapping[str, Sequence[str]],
    assignments: Sequence[str] = (),
) -> list[World]:
    """Return every combination; the seed runs slowest, so that a study that is stopped early has all kinds of worlds.

    Args:
        scenarios, sensors, mismatches: names.
        seeds: of the sensors' noise.
        drives: settings of each drive by its name, "" for that of the scenario.
        assignments: of every world, behind those of its drive.

    Raises:
        InputError: an unknown name, a bad assignment.
    """
    known = {
        (scenario, drive): load_scenario(scenario, assignments=(*settings, *assignments))
        for scenario in scenarios
        for drive, settings in drives.items()
    }
    return [
        World(
            scenario, sensor, seed,
            (*drives[drive], *assignments, *mismatch_assignments(mismatch, known[scenario, drive])),
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
    what, factor = name[:-1], 1.0 + SHARE * (1.0 if name[-1] == "+" else -1.0)
    bridge = known.first
    if what == "mass":
        return [f"bridge.object.mass={bridge.object.mass * factor}"]
    if what == "inertia":
        return [f"bridge.object.inertia={[value * factor for value in bridge.object.inertia]}"]
    if what == "com":
        moved = {arm: [value * factor for value in own.contacts.position[:3]] for arm, own in known.bridges.items()}
        return [f"{f'{arm}.' if arm else ''}bridge.contacts.position={position}" for arm, position in moved.items()]
    if what == "friction":
        friction = bridge.friction
        return [f"bridge.friction.mu_s={friction.mu_s * factor}", f"bridge.friction.mu_k={friction.mu_k * factor}"]
    bias = bridge.grip.force * (factor - 1.0)
    return [f"bridge.sensors.wrench.bias={[bias, 0.0, 0.0, 0.0, 0.0, 0.0]}"]


def parameter_of(setting: str) -> str:
    """Return the parameter of an assignment without the arm: ``left.bridge.drive.gain=1`` is ``bridge.drive.gain``."""
    name = setting.partition("=")[0]
    arm, _, rest = name.partition(".")
    return name if arm in ("controller", "bridge", "mismatch") else rest


def renamed(settings: Sequence[str], table: Mapping[str, str | None]) -> tuple[str, ...]:
    """Return settings in today's names; table: new name of a parameter by its old one, None where it is gone."""
    found = []
    for setting in settings:
        old = parameter_of(setting)
        new = table.get(old, old)
        if new is not None:
            name, equals, value = setting.partition("=")
            found.append(f"{name.removesuffix(old)}{new}{equals}{value}")
    return tuple(found)


def frozen_worlds(rows: Iterable[Mapping[str, Any]]) -> list[World]:
    """Return worlds that were stored as data, in today's names of parameters (renamed.yaml)."""
    text = resources.files("slip_vic.experiments").joinpath("renamed.yaml").read_text(encoding="utf-8")
    table = read_yaml(text) or {}
    return [World(**{**row, "settings": renamed(row["settings"], table)}) for row in rows]
