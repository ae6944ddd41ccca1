"""What a study runs: the cases, their names, and what a mismatch changes in the simulated world."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self, cast

from slip_core.errors import UnknownName
from slip_vic.scenarios.scenario import (
    CLASSICAL,
    LAWS,
    NO_TEXTS,
    Estimator,
    Law,
    Scenario,
    Texts,
    cut_or_extend,
    load_scenario,
)

ESTIMATORS = ("measured", "observer")
NO_ESTIMATOR = "none"
"""Of a law that reads no slip sensor."""
SHARE = 0.2
NO_MISMATCH = "none"
MISMATCHES = (
    NO_MISMATCH,
    *(f"{what}{sign}" for what in ("mass", "inertia", "com", "friction", "wrench_bias") for sign in "+-"),
    "joint_friction+",
)
COULOMB = (1.0, 1.0, 0.8, 0.8, 0.4, 0.4, 0.3)
"""Friction of an arm without compensation, joints 1 to 7; further ones have the last [N m]."""


@dataclass(frozen=True, slots=True)
class Case:
    """One run: a scenario under a law, with a slip sensor and what makes a slip velocity of it.

    estimator: measured, observer, or "none" of classical impedance control, which reads no slip sensor. own: overrides
    of this case alone.
    """

    scenario: str
    law: Law
    sensor: str
    estimator: str
    mismatch: str
    seed: int
    own: tuple[str, ...] = ()

    @property
    def key(self) -> tuple[str, ...]:
        """The leading columns of the table."""
        return (self.scenario, self.law, self.sensor, self.estimator, self.mismatch, str(self.seed))

    def load(self, assignments: Sequence[str] = (), texts: Texts = NO_TEXTS) -> Scenario:
        """Return the scenario of this run: only the simulated world has the mismatch."""
        assignments = (*assignments, *self.own)
        known = load_scenario(self.scenario, sensor=self.sensor, seed=self.seed, assignments=assignments, texts=texts)
        return load_scenario(
            self.scenario,
            law=self.law,
            sensor=self.sensor,
            seed=self.seed,
            estimator=cast(Estimator, self.estimator) if self.estimator in ESTIMATORS else None,
            assignments=(*assignments, *mismatch_assignments(self.mismatch, known)),
            texts=texts,
        )


def check_names(what: str, given: Iterable[str], known: Sequence[str]) -> None:
    """Look whether all names are known.

    Raises:
        InputError: one is not; the nearest is offered.
    """
    for name in given:
        if name not in known:
            raise UnknownName(what, name, known)


def all_cases(
    scenarios: Sequence[str],
    laws: Sequence[Law],
    sensors: Sequence[str],
    estimators: Sequence[str],
    mismatches: Sequence[str],
    seeds: Iterable[int],
) -> list[Case]:
    """Return every combination; the seed runs slowest, so that a study that is stopped early has all kinds of cases.

    Raises:
        InputError: an unknown law, estimator or mismatch.
    """
    check_names("law", laws, LAWS)
    check_names("estimator", estimators, ESTIMATORS)
    check_names("mismatch", mismatches, MISMATCHES)
    return [
        Case(scenario, law, sensor, estimator, mismatch, seed)
        for seed, scenario, mismatch, sensor, law in itertools.product(seeds, scenarios, mismatches, sensors, laws)
        for estimator in ((NO_ESTIMATOR,) if law in CLASSICAL else estimators)
    ]


@dataclass(frozen=True, slots=True)
class Asked:
    """What a study was asked for: all combinations, or every n-th of them from the i-th on (shard i of n, from 1).

    seeds: how many, from `first_seed` on.
    """

    scenarios: tuple[str, ...]
    laws: tuple[Law, ...]
    sensors: tuple[str, ...]
    estimators: tuple[str, ...]
    mismatches: tuple[str, ...]
    seeds: int
    shard: tuple[int, int] = (1, 1)
    first_seed: int = 0

    @classmethod
    def read(cls, values: Mapping[str, Any]) -> Self:
        """Return what was asked from its fields as JSON has them."""
        scenarios, laws, sensors, estimators, mismatches = (
            tuple(values[name]) for name in ("scenarios", "laws", "sensors", "estimators", "mismatches")
        )
        first, shards = values["shard"]
        seeds, first_seed = int(values["seeds"]), int(values["first_seed"])
        return cls(scenarios, laws, sensors, estimators, mismatches, seeds, (int(first), int(shards)), first_seed)

    def cases(self) -> list[Case]:
        """Return the cases in their order.

        Raises:
            InputError: an unknown law, estimator or mismatch.
        """
        first, shards = self.shard
        seeds = range(self.first_seed, self.first_seed + self.seeds)
        whole = all_cases(self.scenarios, self.laws, self.sensors, self.estimators, self.mismatches, seeds)
        return whole[first - 1 :: shards]


def coulomb_of(joints: int) -> list[float]:
    """Return COULOMB of the joints of an arm (n,) [N m]."""
    values: list[float] = cut_or_extend(list(COULOMB), joints)
    return values


def mismatch_assignments(name: str, known: Scenario) -> list[str]:
    """Return what a mismatch sets in the bridge; a wrench bias is a share of the grip force along the pad's x.

    More friction of the joints is SHARE of COULOMB, beside what their drives have.
    """
    if name == NO_MISMATCH:
        return []
    what, factor = name[:-1], 1.0 + SHARE * (1.0 if name[-1] == "+" else -1.0)
    bridge = known.first
    if what == "mass":
        return [f"bridge.object.mass={bridge.object.mass * factor}"]
    if what == "inertia":
        return [f"bridge.object.inertia={[value * factor for value in bridge.object.inertia]}"]
    if what == "com":
        return [
            f"{name}.bridge.contacts.position={own}" if name else f"bridge.contacts.position={own}"
            for name, params in known.bridges.items()
            for own in [[value * factor for value in params.contacts.position[:3]]]
        ]
    if what == "joint_friction":
        found = []
        for name, params in known.bridges.items():
            own = params.drive.of_joints("coulomb", len(params.joint_names))
            more = [a + SHARE * b for a, b in zip(own, coulomb_of(len(own)), strict=True)]
            found.append(f"{name + '.' if name else ''}bridge.drive.coulomb={more}")
        return found
    if what == "friction":
        friction = bridge.friction
        return [f"bridge.friction.mu_s={friction.mu_s * factor}", f"bridge.friction.mu_k={friction.mu_k * factor}"]
    bias = bridge.grip.force * (factor - 1.0)
    return [f"bridge.sensors.wrench.bias={[bias, 0.0, 0.0, 0.0, 0.0, 0.0]}"]
