"""What ``slip-vic tune`` does: Optuna proposes gains, an engine runs them, the best are tried on unseen seeds.

The runs of every set of parameters are rows of one file. A proposal depends on the sets before it alone: a search that
was stopped proposes the same again, and finds its runs in the file.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

import optuna
from optuna.distributions import FloatDistribution

from slip_core.params import flatten
from slip_vic.experiments.engines import ENGINES
from slip_vic.experiments.rows import FILE
from slip_vic.experiments.run import Row
from slip_vic.experiments.runner import fill
from slip_vic.experiments.world import World, combined
from slip_vic.scenarios.parameter_files import commented_file
from slip_vic.scenarios.scenario import NODES, Scenario
from slip_vic_controller.law.gains import gain_report

EFFORT_RATE: Final = 1.2
LATER_S: Final = 0.3
"""What less slip may cost against the default: a factor on the largest effort rate, and how much later the latest
arrival is [s]."""
DECADE: Final = 10.0
"""A gamma is searched from its default over this to its default times this."""
K_S_RANGE: Final = 20.0
"""k_s is searched from what the sensor's delay allows over this up to what it allows."""
MARGIN: Final = (0.7, 1.0)
LEVER_M: Final = 0.03
"""Length that makes turning in the grasp comparable with sliding, as gains.characteristic_length."""

SEARCHED: Final = ("gains.gamma_kp", "gains.gamma_ko", "gains.gamma_dp", "gains.gamma_do")

Values = Mapping[str, float]
"""Parameters of the controller by their names."""
Space = Mapping[str, FloatDistribution]


def search_space(scenario: Scenario) -> tuple[Space, Values]:
    """Return what is searched around the parameters of a scenario, and where that begins."""
    params = next(iter(scenario.controllers.values()))  # what is searched is the same for all arms
    values = flatten(params)
    allowed = gain_report(params, refuse=False).used
    space = {"gains.k_s": FloatDistribution(allowed / K_S_RANGE, allowed, log=True)}
    for name in SEARCHED:
        if (gamma := values[name]) > 0.0:
            space[name] = FloatDistribution(gamma / DECADE, gamma * DECADE, log=True)
    if params.governor.mode != "off":
        space["governor.margin"] = FloatDistribution(*MARGIN)
    return space, {name: min(values[name], one.high) for name, one in space.items()}


def assignments(values: Values) -> tuple[str, ...]:
    """Return the overrides that set these parameters."""
    return tuple(f"controller.{name}={value!r}" for name, value in values.items())


def tried(worlds: Sequence[World], law: str, name: str, values: Values) -> list[World]:
    """Return worlds with these parameters under a law, as a set of this name."""
    more = assignments(values)
    return [replace(world, set=name, settings=(*world.settings, *more), law=law) for world in worlds]


def worst_mm(rows: Sequence[Row]) -> float:
    """Return the worst slip of some runs at their end [mm], turning by `LEVER_M`; infinite where one is not ok."""
    slips = [math.hypot(float(row["slip_linear_m"]), LEVER_M * float(row["slip_angular_rad"])) for row in rows]
    kept = (1e3 * slip if row["outcome"] == "ok" else math.inf for row, slip in zip(rows, slips, strict=True))
    return max(kept, default=0.0)


def cost(rows: Sequence[Row], defaults: Sequence[Row]) -> float:
    """Return what the search makes small [mm]: the worst slip, and a metre for each run not ok or beyond the bounds.

    defaults: the rows of the same worlds with the default parameters.
    """
    rate, arrival = "effort_rate_rms_n_m_s", "arrival_s"
    known = [row for row in defaults if row["outcome"] == "ok"]
    most = {rate: EFFORT_RATE * _most(known, rate), arrival: _most(known, arrival) + LATER_S}
    good = [row for row in rows if row["outcome"] == "ok" and all(_most([row], name) <= most[name] for name in most)]
    return worst_mm(good) + 1e3 * (len(rows) - len(good))


def _most(rows: Sequence[Row], metric: str) -> float:
    """Return the largest number of some rows; infinite where one has none, as where it does not arrive."""
    return max((math.inf if math.isnan(value := float(row[metric])) else value for row in rows), default=math.inf)


def search(
    space: Space, default: Values, trials: int, rows_of: Callable[[str, Values], Sequence[Row]]
) -> list[optuna.trial.FrozenTrial]:
    """Return all trials of a search, the default first; rows_of: runs a named set of parameters."""
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    study = optuna.create_study(sampler=optuna.samplers.TPESampler(seed=0))
    study.enqueue_trial(dict(default))
    defaults: Sequence[Row] = ()
    for _ in range(trials):
        trial = study.ask(dict(space))
        rows = rows_of(f"trial {trial.number}", trial.params)
        defaults = defaults or rows
        study.tell(trial, cost(rows, defaults))
    return study.trials


def run_tune(
    base: World, law: str, mismatches: Sequence[str], seeds: int, trials: int, out: Path, engine: str, jobs: int
) -> str:
    """Search, and write ``controller.yaml``; return one line on what was found.

    Args:
        base: scenario, sensor and assignments.
        law: vic or governed.
        mismatches, seeds: of the worlds of the search; the result is tried on as many seeds more.
        trials: how many sets of parameters are tried.
        out: folder that gets rows and parameter file.
        engine: where, with so many `jobs`.

    Raises:
        InputError: an unknown name, a bad override, or parameters that were found and that `check` refuses.
    """
    seen, unseen = (
        combined((base.scenario,), (base.sensor,), mismatches, of, settings=base.settings)
        for of in (range(seeds), range(seeds, 2 * seeds))
    )
    loaded = base.load(law)
    loaded.check()
    with ENGINES[engine](jobs) as workers:

        def rows_of(worlds: Sequence[World], name: str, values: Values) -> Sequence[Row]:
            return fill(out / FILE, name, tried(worlds, law, name, values), workers)[0]

        found = search(*search_space(loaded), trials, lambda name, values: rows_of(seen, name, values))
        best = min(found, key=lambda trial: trial.value)
        before, after = (
            worst_mm(rows_of(unseen, f"unseen {name}", values))
            for name, values in (("default", {}), ("tuned", best.params))
        )
    tuned, file = base.load(law, assignments(best.params)), out / "controller.yaml"
    file.write_text(commented_file(tuned.controller, NODES["controller"][0]), encoding="utf-8")
    tuned.check()
    gain_report(next(iter(tuned.controllers.values())))
    return (
        f"trial {best.number} of {len(found)}: worst slip {found[0].value:.3g} -> {best.value:.3g} mm, on unseen seeds "
        f"{before:.3g} -> {after:.3g} mm; {file}"
    )
