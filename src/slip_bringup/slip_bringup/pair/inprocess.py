"""Both arms and their controller in one process and no DDS."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

from slip_bringup.pair.scenario import PairScenario
from slip_core.types import EffortCommand
from slip_sim_bridge.pair.simulation import PairSimulation, PairTick
from slip_vic_controller.session import CycleResult, Manifest
from slip_vic_controller.team.session import SIDES, TeamSession


@dataclass(frozen=True, slots=True)
class TeamTick:
    """What one tick exchanged, left first."""

    outputs: PairTick
    results: tuple[CycleResult, ...]


class TeamLoop:
    """Simulation and controller of a scenario, joined by function calls."""

    def __init__(self, scenario: PairScenario) -> None:
        self.simulation: PairSimulation = scenario.simulation()
        self.team: TeamSession = scenario.team()

    def control(self, outputs: PairTick) -> tuple[CycleResult, ...]:
        """Return the controller's answer to a tick's outputs."""
        team = self.team
        for side in range(len(SIDES)):
            for wrench in outputs.wrenches[side]:
                team.add_wrench(side, wrench)
            for slip in outputs.slips[side]:
                team.add_slip(side, slip)
        for side in range(len(SIDES)):
            team.add_joint(side, outputs.joints[side])
        team.add_manifest(Manifest(outputs.tick, outputs.stamp_ns, outputs.counts[0::2], outputs.counts[1::2]))
        results = team.cycle()
        answered = tuple(result for result in results if result is not None)
        if len(answered) != len(SIDES):
            raise RuntimeError("the controller did not answer a complete tick")
        return answered


def run_pair(scenario: PairScenario, late_ticks: int = 0) -> Iterator[TeamTick]:
    """Run a scenario in lockstep and yield every tick, until its duration is over.

    late_ticks: control periods that every command is on its way, which neither side can see from stamps.
    """
    loop = TeamLoop(scenario)
    nothing: tuple[EffortCommand | None, ...] = (None, None)
    on_the_way = deque([nothing] * late_ticks)
    while not loop.simulation.finished:
        outputs = loop.simulation.observe()
        results = loop.control(outputs)
        yield TeamTick(outputs, results)
        on_the_way.append(tuple(result.command for result in results))
        loop.simulation.advance(on_the_way.popleft())
