"""A scenario with one arm or with two, as `run` and `demo` take it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

from slip_core.errors import InputError
from slip_vic.pair.scenario import BY_LAW, PairScenario, is_pair, load_pair
from slip_vic.scenarios.scenario import Estimator, Law, Mode, Scenario, load_scenario, urdf_assignment


def load_any(
    name_or_path: str,
    *,
    law: Law,
    mode: Mode = "lockstep",
    seed: int = 0,
    sensor: str = "",
    drive: str = "",
    estimator: Estimator | None = None,
    assignments: Iterable[str] = (),
    urdf_file: Path | None = None,
    parameters: Mapping[str, Any] = MappingProxyType({}),
) -> Scenario | PairScenario:
    """Read a scenario, apply the controller's `parameters` and then assignments.

    Raises:
        InputError: as of `load_scenario` and `load_pair`; parameters of one arm for two.
    """
    if is_pair(name_or_path):
        if parameters:
            raise InputError(
                "--params", got=f"{name_or_path}, which has two arms", expected="a scenario with one arm",
                fix="--set left.controller.NAME=VALUE, and the same for right",
            )  # fmt: skip
        given = (*urdf_assignment(urdf_file), *assignments)
        return load_pair(
            name_or_path, law=BY_LAW[law], mode=mode, seed=seed, sensor=sensor, drive=drive, assignments=given
        )
    return load_scenario(
        name_or_path,
        law=law,
        mode=mode,
        seed=seed,
        sensor=sensor,
        drive=drive,
        estimator=estimator,
        assignments=assignments,
        urdf_file=urdf_file,
        parameters=parameters,
    )
