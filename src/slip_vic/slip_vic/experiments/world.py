"""A world as data: what differs from the configuration, and by which names its rows are found."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

from slip_vic.run.versions import digest
from slip_vic.scenarios.scenario import NO_TEXTS, Estimator, Law, Scenario, Texts, load_scenario

NO_MISMATCH = "none"


@dataclass(frozen=True, slots=True)
class World:
    """One world. Equal worlds give equal rows under the same law.

    set, number: the set it belongs to and its number there; scenario, sensor: names or files; seed: of the sensors'
    noise; settings: assignments to parameters of both nodes, in their order; arms: how many hold the object. For tables
    alone, because `settings` has what they do: motion, drive, mismatch.
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

    @classmethod
    def read(cls, values: Mapping[str, Any]) -> Self:
        """Return a world from its fields as JSON or a table has them."""
        return cls(**{**values, "settings": tuple(values["settings"])})

    @property
    def digest(self) -> str:
        """Digest of everything that a run depends on."""
        return digest(part.encode() for part in (self.scenario, self.sensor, str(self.seed), *self.settings))

    def load(
        self, law: Law, estimator: Estimator | None = None, more: Sequence[str] = (), texts: Texts = NO_TEXTS
    ) -> Scenario:
        """Return the scenario with a law of the controller; `more` are further assignments.

        Raises:
            InputError: unknown scenario, sensor or parameter; a value that is not allowed.
        """
        return load_scenario(
            self.scenario,
            law=law,
            sensor=self.sensor,
            seed=self.seed,
            estimator=estimator if self.sensor else None,
            assignments=(*self.settings, *more),
            texts=texts,
        )


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
