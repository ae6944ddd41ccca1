"""What a study runs: the cases, their names, and what a mismatch changes in the simulated world."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

from slip_core.errors import UnknownName
from slip_vic.scenarios.scenario import NO_TEXTS, Estimator, Law, Scenario, Texts, load_scenario

CLASSICAL, MEASURED, OBSERVER, GOVERNED = "classical", "measured", "observer", "governed"
ESTIMATORS = (CLASSICAL, MEASURED, OBSERVER, GOVERNED)
SLIP_FROM: dict[str, Estimator | None] = {
    CLASSICAL: None, MEASURED: "measured", OBSERVER: "observer", GOVERNED: "observer"
}  # fmt: skip
SHARE = 0.2
NO_MISMATCH = "none"
MISMATCHES = (
    NO_MISMATCH,
    *(f"{what}{sign}" for what in ("mass", "inertia", "com", "friction", "wrench_bias") for sign in "+-"),
)


@dataclass(frozen=True, slots=True)
class Case:
    """One run. estimator "classical" is classical impedance control, which reads no slip sensor; "governed" is the
    reference governor above the law with the observer.
    """

    scenario: str
    sensor: str
    estimator: str
    mismatch: str
    seed: int

    @property
    def controller(self) -> Law:
        """Which control law."""
        if self.estimator == CLASSICAL:
            return "classical"
        return "governed" if self.estimator == GOVERNED else "vic"

    @property
    def key(self) -> tuple[str, ...]:
        """The leading columns of the table."""
        return (self.scenario, self.controller, self.sensor, self.estimator, self.mismatch, str(self.seed))

    def load(self, assignments: Sequence[str] = (), texts: Texts = NO_TEXTS) -> Scenario:
        """Return the scenario of this run: only the simulated world has the mismatch, the controller knows nothing."""
        known = load_scenario(self.scenario, sensor=self.sensor, seed=self.seed, assignments=assignments, texts=texts)
        return load_scenario(
            self.scenario,
            law=self.controller,
            sensor=self.sensor,
            seed=self.seed,
            estimator=SLIP_FROM[self.estimator],
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
    sensors: Sequence[str],
    estimators: Sequence[str],
    mismatches: Sequence[str],
    seeds: Iterable[int],
) -> list[Case]:
    """Return every combination; the seed runs slowest, so that a study that is stopped early has all kinds of cases.

    Raises:
        InputError: an unknown estimator or mismatch.
    """
    check_names("estimator", estimators, ESTIMATORS)
    check_names("mismatch", mismatches, MISMATCHES)
    product = itertools.product(seeds, scenarios, mismatches, sensors, estimators)
    return [
        Case(scenario, sensor, estimator, mismatch, seed) for seed, scenario, mismatch, sensor, estimator in product
    ]


@dataclass(frozen=True, slots=True)
class Asked:
    """What a study was asked for: all combinations, or every n-th of them from the i-th on (shard i of n, from 1).

    seeds: how many, from `first_seed` on.
    """

    scenarios: tuple[str, ...]
    sensors: tuple[str, ...]
    estimators: tuple[str, ...]
    mismatches: tuple[str, ...]
    seeds: int
    shard: tuple[int, int] = (1, 1)
    first_seed: int = 0

    @classmethod
    def read(cls, values: Mapping[str, Any]) -> Self:
        """Return what was asked from its fields as JSON has them."""
        scenarios, sensors, estimators, mismatches = (
            tuple(values[name]) for name in ("scenarios", "sensors", "estimators", "mismatches")
        )
        first, shards = values["shard"]
        seeds, first_seed = int(values["seeds"]), int(values["first_seed"])
        return cls(scenarios, sensors, estimators, mismatches, seeds, (int(first), int(shards)), first_seed)

    def cases(self) -> list[Case]:
        """Return the cases in their order.

        Raises:
            InputError: an unknown estimator or mismatch.
        """
        first, shards = self.shard
        seeds = range(self.first_seed, self.first_seed + self.seeds)
        whole = all_cases(self.scenarios, self.sensors, self.estimators, self.mismatches, seeds)
        return whole[first - 1 :: shards]


def mismatch_assignments(name: str, known: Scenario) -> list[str]:
    """Return what a mismatch sets in the bridge; a wrench bias is a share of the grip force along the pad's x."""
    if name == NO_MISMATCH:
        return []
    what, factor = name[:-1], 1.0 + SHARE * (1.0 if name[-1] == "+" else -1.0)
    bridge = known.bridge
    if what == "mass":
        return [f"bridge.object.mass={bridge.object.mass * factor}"]
    if what == "inertia":
        return [f"bridge.object.inertia={[value * factor for value in bridge.object.inertia]}"]
    if what == "com":
        own = [value * factor for value in bridge.contacts.position[:3]]
        return [f"bridge.contacts.position={own + list(bridge.contacts.position[3:])}"]
    if what == "friction":
        friction = bridge.friction
        return [f"bridge.friction.mu_s={friction.mu_s * factor}", f"bridge.friction.mu_k={friction.mu_k * factor}"]
    bias = bridge.grip.force * (factor - 1.0)
    return [f"bridge.sensors.wrench.bias={[bias, 0.0, 0.0, 0.0, 0.0, 0.0]}"]
