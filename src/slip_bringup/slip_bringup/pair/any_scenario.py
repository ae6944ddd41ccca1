"""A scenario with one arm or with two, as `run` and `demo` take it."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from slip_bringup.pair.scenario import BY_CONTROLLER, PairScenario, is_pair, load_pair
from slip_bringup.scenario import ControllerKind, Mode, Scenario, load_scenario, urdf_assignment


def load_any(
    name_or_path: str,
    *,
    controller: ControllerKind,
    mode: Mode = "lockstep",
    seed: int = 0,
    assignments: Iterable[str] = (),
    urdf_file: Path | None = None,
) -> Scenario | PairScenario:
    """Read a scenario and apply assignments.

    Raises:
        InputError: as of `load_scenario` and `load_pair`.
    """
    if is_pair(name_or_path):
        given = (*urdf_assignment(urdf_file), *assignments)
        return load_pair(name_or_path, law=BY_CONTROLLER[controller], mode=mode, seed=seed, assignments=given)
    return load_scenario(
        name_or_path, controller=controller, mode=mode, seed=seed, assignments=assignments, urdf_file=urdf_file
    )
