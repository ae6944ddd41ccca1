"""What a scenario's path takes of the friction, and where: it is run, in this process, on a pad that cannot slip."""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

from slip_vic.run.in_process import ClosedLoop
from slip_vic.scenarios.scenario import Scenario

FIRM = 1e4
"""Factor on the grip and on the friction that is told: nothing slips, and nothing is slowed down."""
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
    """Friction that is told [N]; the largest load of the path as planned, and of the weight alone."""

    limit: float
    moving: Place
    resting: Place


def path_load(scenario: Scenario) -> PathLoad:
    """Return what the path as planned asks of the contact; a motion that comes by topic is taken as rest."""
    known, world = scenario.controller, scenario.bridge
    told = known.governor.friction_limit
    governor = known.governor.model_copy(
        update={"mode": "slow_down", "friction": "known", "friction_limit": FIRM * told}
    )  # the governor counts the load, and has no reason to do more
    grip = world.grip.model_copy(update={"force": FIRM * world.grip.force})
    # friction that fell with speed, times FIRM, would divide every step of the simulation into dozens
    friction = world.friction.model_copy(update={"mu_k": world.friction.mu_s})
    firm = dataclasses.replace(
        scenario,
        controller=known.model_copy(update={"controller": "classical", "governor": governor}),
        bridge=world.model_copy(update={"grip": grip, "friction": friction}),
    )
    loop, places = ClosedLoop(firm), list[Place]()
    path = known.trajectory
    while loop.bridge.elapsed_s < path.start_s + path.duration_s + AFTER_S:
        outputs = loop.observe()
        result = loop.control(outputs)
        x, y, z = result.arm.position.tolist()
        governed = result.record.governor
        places.append(Place(float(governed.load_commanded), float(governed.path_s), (x, y, z)))
        loop.bridge.advance([result.command])
    planned = loop.session.task.governor
    heaviest_s = float(planned.heaviest_time)
    there = min(places, key=lambda place: abs(place.time_s - heaviest_s))
    return PathLoad(told, max(places), Place(float(planned.weight_load), heaviest_s, there.position))
