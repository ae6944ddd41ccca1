"""What a scenario's path takes of the friction, and where: it is run, in this process, on a pad that cannot slip."""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

from slip_sim_bridge.params import BridgeParams
from slip_vic.run.in_process import ClosedLoop
from slip_vic.scenarios.scenario import Scenario
from slip_vic_controller.parameters.node_params import ControllerNodeParams

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
