"""Whether a scenario holds: gains, path, and short runs in worlds that differ from the configured one."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

from rich.markup import escape
from rich.table import Table

from slip_sim_bridge.params import BridgeParams
from slip_vic.experiments.run import Controlled, play
from slip_vic.experiments.world import NO_MISMATCH, mismatch_assignments
from slip_vic.options import Choice
from slip_vic.run.in_process import ClosedLoop
from slip_vic.scenarios.scenario import Scenario
from slip_vic_controller.law.bounds import GainReport
from slip_vic_controller.law.gains import gain_report
from slip_vic_controller.params.node_params import ControllerNodeParams


class Corner(NamedTuple):
    """A run in one wrong world: its outcome as in `run.Result`."""

    mismatch: str
    outcome: str
    reason: str
    metrics: dict[str, float]

    @property
    def holds(self) -> bool:
        """Whether nothing went wrong."""
        return self.outcome == "ok"


def gains(scenario: Scenario) -> GainReport:
    """Return the verdict on the gains, without refusing them."""
    return gain_report(next(iter(scenario.controllers.values())), refuse=False)


def run_corners(choice: Choice, mismatches: Sequence[str], report: Callable[[str], None]) -> Iterator[Corner]:
    """Run the configured world, then each mismatch, and yield outcomes; `report` gets what runs.

    Where the path is refused already there is nothing more to run.
    """
    known = choice.load()
    for name in dict.fromkeys((NO_MISMATCH, *mismatches)):
        report(name)
        corner = Corner(name, *play(Controlled(choice.load(*mismatch_assignments(name, known)))))
        yield corner
        if name == NO_MISMATCH and corner.outcome == "refused":
            return


def gain_table(scenario: Scenario, report: GainReport, sensor: str) -> Table:
    """Return the conditions on the gains."""
    params = next(iter(scenario.controllers.values()))  # the law is the same in all arms
    title = (
        f"k_s configured {report.asked:g}, used {report.used:.6g} 1/s ({params.gains.k_s_mode}, {params.slip_estimator}"
    )
    table = Table(title=f"{title}{', ' + sensor if sensor else ''})")
    for name in ("condition", "value", "limit", "margin", "verdict"):
        table.add_column(name, justify="right" if name in ("value", "limit", "margin") else "left")
    for c in report.conditions:
        verdict = "[green]holds[/]" if c.holds else "[red]fails[/]"
        table.add_row(c.name, f"{c.value:.6g}", f"{c.limit:.6g}", f"{c.margin:.3g}", verdict)
    for name, (low, high) in (("lambda_1", report.lambda_1), ("lambda_2", report.lambda_2)):
        empty = low >= high
        table.add_row(name, f"{low:.4g}", f"{high:g}", "", "[red]empty[/]" if empty else "[green]between them[/]")
    return table


def corner_table(corners: Sequence[Corner]) -> Table:
    """Return what came of the runs."""
    table = Table(title="simulated, one error at a time that the controller is not configured with")
    for name in ("world", "slip [mm]", "peak [mm]", "arrives [s]", "verdict"):
        table.add_column(escape(name), justify="left" if name in ("world", "verdict") else "right")
    for corner in corners:
        numbers = corner.metrics
        arrival = numbers["arrival_s"]
        table.add_row(
            corner.mismatch, f"{1e3 * numbers['slip_linear_m']:.3f}", f"{1e3 * numbers['slip_linear_peak_m']:.3f}",
            "does not" if math.isnan(arrival) else f"{arrival:.3f}",
            verdict_of(corner),
        )  # fmt: skip
    return table


def verdict_of(corner: Corner) -> str:
    """Return what is said of a world: an object that is held but does not come to its goal is said to."""
    if not corner.holds:
        return f"[red]{escape(corner.reason)}[/]"
    if math.isnan(corner.metrics["arrival_s"]):
        return f"[yellow]holds, but ends {1e3 * corner.metrics['final_error_m']:.1f} mm beside its goal[/]"
    return "[green]holds[/]"


def path_lines(load: PathLoad, configured: Corner) -> list[str]:
    """Return what the path takes of the friction, where, and how long the motion lasts."""
    arrival = configured.metrics["arrival_s"]
    lasts = "it does not arrive" if math.isnan(arrival) else f"it arrives after {arrival:.3f} s"
    return [
        f"path as planned: takes {load.moving.text(load.limit)}",
        f"weight alone:    takes {load.resting.text(load.limit)}",
        f"as configured:   {lasts}, slip at most {1e3 * configured.metrics['slip_linear_peak_m']:.3f} mm",
    ]


def refusal(load: PathLoad, configured: Corner) -> str:
    """Return why the path is refused, with its place; "" where it is not."""
    if configured.outcome != "refused":
        return ""
    x, y, z = load.resting.position
    return f"refused: {configured.reason}; the pad is at x {x:.3f}, y {y:.3f}, z {z:.3f} m there"


# -- what the path takes of the friction: it is run, in this process, on a pad that cannot slip ----------

FIRM = 1e4
"""Factor on the grip and on the configured friction: nothing slips, and nothing is slowed down."""
AFTER_S = 0.1
"""How much later than planned the end is reached: the governor plans first, and averages [s]."""


class Place(NamedTuple):
    """A load [N], at which time of the trajectory [s], and where the pad is then [m] {w}."""

    load: float
    time_s: float
    position: tuple[float, float, float]

    def text(self, limit: float) -> str:
        """Return the load as a share of the friction, with its place."""
        x, y, z = self.position
        where = f"at {self.time_s:.3f} s, x {x:.3f}, y {y:.3f}, z {z:.3f} m"
        return f"{100.0 * self.load / limit:.0f} % of the friction ({self.load:.3g} of {limit:.3g} N) {where}"


class PathLoad(NamedTuple):
    """Configured friction [N]; the largest load of the path as planned, and of the weight alone."""

    limit: float
    moving: Place
    resting: Place


def path_load(scenario: Scenario) -> PathLoad:
    """Return what the path as planned puts on the contact, of several arms of the most loaded one.

    A motion that comes by topic is taken as rest.
    """
    firm = dataclasses.replace(
        scenario,
        controllers={name: _counting(params) for name, params in scenario.controllers.items()},
        bridges={name: _firm(params) for name, params in scenario.bridges.items()},
    )
    loop, places = ClosedLoop(firm), [list[Place]() for _ in scenario.controllers]
    path = next(iter(scenario.controllers.values())).trajectory
    while loop.bridge.elapsed_s < path.start_s + path.duration_s + AFTER_S:
        results = loop.answer(loop.observe())
        for visited, result in zip(places, results, strict=True):
            x, y, z = result.arm.position.tolist()
            governed = result.record.governor
            visited.append(Place(float(governed.load_commanded), float(governed.path_s), (x, y, z)))
        loop.bridge.advance([result.command for result in results])
    planned, params = loop.session.task.governor, next(iter(scenario.controllers.values()))
    heaviest_s, weight = float(planned.heaviest_time), float(planned.weight_load)
    visited = max(places, key=max)
    there = min(visited, key=lambda place: abs(place.time_s - heaviest_s))
    return PathLoad(params.governor.friction_limit, max(visited), Place(weight, heaviest_s, there.position))


def _counting(params: ControllerNodeParams) -> ControllerNodeParams:
    """Return parameters with which the governor counts the load, and has no reason to do more."""
    limit = FIRM * params.governor.friction_limit
    governor = params.governor.model_copy(update={"mode": "slow_down", "friction": "known", "friction_limit": limit})
    return params.model_copy(update={"controller": "classical", "governor": governor})


def _firm(params: BridgeParams) -> BridgeParams:
    """Return the world with pads that cannot slip."""
    grip = params.grip.model_copy(update={"force": FIRM * params.grip.force})
    # friction that fell with speed, times FIRM, would divide every step of the simulation into dozens
    friction = params.friction.model_copy(update={"mu_k": params.friction.mu_s})
    return params.model_copy(update={"grip": grip, "friction": friction})
