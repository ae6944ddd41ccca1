"""Both arms and their controller in one process and no DDS."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from slip_core.arrays import Array
from slip_core.types import CartesianReference, DisplacementSample, EffortCommand
from slip_sim_bridge.session import BridgeSession, TickOutputs
from slip_vic.pair.scenario import PairScenario
from slip_vic_controller.session import ControllerSession, CycleResult, Manifest


@dataclass(frozen=True, slots=True)
class TeamTick:
    """What one tick exchanged, left first."""

    outputs: TickOutputs
    results: tuple[CycleResult, ...]


class Leader:
    """Leads the right pad by the left one: as far away as at first, with its velocity, one cycle later.

    Args:
        team: whose right arm is led.
    """

    def __init__(self, team: ControllerSession) -> None:
        self._team = team
        self._apart: tuple[Array, Array] | None = None

    def lead(self, results: tuple[CycleResult, ...]) -> None:
        """Set the right arm's reference of the next cycle from where the left arm is in this one."""
        left, right = (result.arm for result in results)
        R, twist = np.array(left.rotation), np.array(left.twist)
        if self._apart is None:
            self._apart = R.T @ (right.position - left.position), R.T @ right.rotation
        lever = R @ self._apart[0]
        v = np.concatenate((twist[:3] + np.cross(twist[3:], lever), twist[3:]))
        reference = CartesianReference(left.position + lever, R @ self._apart[1], v, np.zeros(6))
        self._team.arms[1].set_own_reference(reference)


class TeamLoop:
    """Simulation and controller of a scenario, joined by function calls."""

    def __init__(self, scenario: PairScenario) -> None:
        self.bridge: BridgeSession = scenario.bridge_session()
        self.team: ControllerSession = scenario.team()
        self._leader = Leader(self.team) if scenario.leader else None

    def control(self, outputs: TickOutputs) -> tuple[CycleResult, ...]:
        """Return the controller's answer to a tick's outputs."""
        team = self.team
        for arm, sent in zip(team.arms, outputs.arms, strict=True):
            for wrench in sent.wrenches:
                arm.add_wrench(0, wrench)
            for slip in sent.slips:
                if isinstance(slip, DisplacementSample):
                    arm.add_displacement(0, slip)
                else:
                    arm.add_slip(0, slip)
        for arm, sent in zip(team.arms, outputs.arms, strict=True):
            arm.add_joint(sent.joint)
        team.add_manifest(Manifest(outputs.tick, outputs.stamp_ns, outputs.counts[0::2], outputs.counts[1::2]))
        results = team.cycle()
        answered = tuple(result for result in results if result is not None)
        if len(answered) != len(team.arms):
            raise RuntimeError("the controller did not answer a complete tick")
        if self._leader is not None:
            self._leader.lead(answered)
        return answered


def run_pair(scenario: PairScenario, late_ticks: int = 0) -> Iterator[TeamTick]:
    """Run a scenario in lockstep and yield every tick, until its duration is over.

    late_ticks: control periods that every command is on its way, which neither side can see from stamps.
    """
    loop = TeamLoop(scenario)
    nothing: tuple[EffortCommand | None, ...] = (None, None)
    on_the_way = deque([nothing] * late_ticks)
    while not loop.bridge.finished:
        outputs = loop.bridge.observe()
        results = loop.control(outputs)
        yield TeamTick(outputs, results)
        on_the_way.append(tuple(result.command for result in results))
        loop.bridge.advance(on_the_way.popleft())
