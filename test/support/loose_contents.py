"""Contents that move in the object, as water in a glass: prints the table of docs/results.md."""

from __future__ import annotations

import math

import numpy as np

from slip_core.arrays import Array
from slip_sim_bridge.params import PushParams
from slip_vic.scenarios.scenario import Law, load_scenario
from test.support.failing_sensors import DRIVES
from test.support.untold_drivers import LASTS_MS, SCENARIOS
from test.support.watched_loop import Watched, WatchedLoop

DAMPING = 0.02  # share of critical damping
SHARES, FREQUENCIES = (0.2, 0.4), (1.5, 3.0)  # of the object's mass; [Hz]


class LooseContents:
    """A part of the object's mass that swings across gravity on a spring, at the object's centre of mass.

    Args:
        mass: of the part [kg].
        frequency: of its swinging in an object at rest [Hz].
        gravity: (3,) {w} [m/s^2].
        period: of the control cycle [s].
    """

    def __init__(self, mass: float, frequency: float, gravity: Array, period: float) -> None:
        self._mass, self._period, self._weight = mass, period, mass * gravity
        self._stiffness = (2.0 * math.pi * frequency) ** 2
        self._damping = 2.0 * DAMPING * 2.0 * math.pi * frequency
        down = gravity / max(float(np.linalg.norm(gravity)), 1e-9)
        self._across = np.eye(3) - np.outer(down, down)
        self._offset, self._velocity, self._last = np.zeros(3), np.zeros(3), np.zeros(3)

    def push(self, position: Array, velocity: Array, grip: Array) -> PushParams:
        """Return what the part does to the object, whose centre moves so; grip: where the arm holds it; (3,) {w}."""
        shaken = self._across @ (velocity - self._last) / self._period
        self._last = velocity.copy()
        spring = self._stiffness * self._offset + self._damping * self._velocity
        self._velocity -= self._period * (spring + shaken)
        self._offset += self._period * self._velocity
        force = self._mass * (self._stiffness * self._offset + self._damping * self._velocity) + self._weight
        return PushParams(wrench=(*map(float, force), *map(float, np.cross(position - grip, force))))


def with_loose_contents(
    share: float, frequency: float, scenario: str, drive: str, law: Law, lasts_ms: int = LASTS_MS
) -> Watched:
    """Return what comes of an object of which a share swings at this frequency [Hz]; the controller knows its mass."""
    mass = load_scenario(scenario).first.object.mass
    rigid = (f"bridge.object.mass={(1.0 - share) * mass}",)
    loaded = load_scenario(scenario, law=law, drive=drive, sensor="event_1000", assignments=rigid)
    run = WatchedLoop(loaded)
    bridge, params = run.loop.bridge, loaded.controller
    contents = LooseContents(share * mass, frequency, np.array(params.gravity), params.control_period_s)

    def swing(arm: object) -> object:
        readings = bridge.simulation.observe(0)
        truth = readings.truth
        bridge.set_push(0, contents.push(truth.position, truth.twist[:3], readings.pad[0]))
        return arm

    return run.watch(lasts_ms, swing)


def main() -> None:
    """Print the table: slip [mm]."""
    print(f"| share | frequency | law | scenario | {' | '.join(DRIVES)} |")
    print("|---" * (4 + len(DRIVES)) + "|")
    laws: tuple[Law, ...] = ("governed", "vic", "classical")
    for share in SHARES:
        for frequency in FREQUENCIES:
            for law in laws:
                for scenario in SCENARIOS:
                    runs = [with_loose_contents(share, frequency, scenario, drive, law) for drive in DRIVES]
                    cells = " | ".join(f"{1e3 * run.slip:.1f}" for run in runs)
                    print(f"| {100.0 * share:.0f} % | {frequency} Hz | {law} | {scenario} | {cells} |", flush=True)


if __name__ == "__main__":
    main()
