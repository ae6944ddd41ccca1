"""Bridge and controller in one process, without DDS: a run over DDS must equal it bit for bit."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

from slip_core.arrays import Array
from slip_core.types import DisplacementSample, Incident, JointCommand
from slip_sim_bridge.session import BridgeSession, TickOutputs
from slip_vic.scenarios.scenario import Scenario
from slip_vic_controller.config.controller import Controller
from slip_vic_controller.session.cycle_result import CycleResult, IncidentWatch
from slip_vic_controller.session.session import ControllerSession, Manifest


class Tick:
    """What one tick exchanged, what went wrong in it, and the command that is applied next.

    Args:
        outputs: what the bridge measured.
        results: what the controller answered, of each arm.
        incidents: what went wrong.

    Attributes:
        commands: of each arm, an empty one holds it: the controller's, until another one is set.
        grips: squeeze of each arm that is commanded next [N]; None: as before.
    """

    __slots__ = ("commands", "grips", "incidents", "outputs", "results")

    def __init__(
        self, outputs: TickOutputs, results: tuple[CycleResult, ...], incidents: tuple[Incident, ...] = ()
    ) -> None:
        self.outputs, self.results, self.incidents = outputs, results, incidents
        self.commands: list[JointCommand] = [one.command for one in self.results]
        self.grips: list[float | None] = [None] * len(results)

    @property
    def result(self) -> CycleResult:
        """What the controller of the first arm answered."""
        return self.results[0]

    @property
    def time_s(self) -> float:
        """Time of the tick [s]."""
        return self.outputs.stamp_ns * 1e-9

    @property
    def efforts(self) -> list[Array]:
        """Effort of each arm that is applied next, or that its velocity or position is made of; (n,) [N m]."""
        pairs = zip(self.commands, self.results, strict=True)
        return [one.numbers if one.interface == "effort" else result.effort for one, result in pairs]

    @property
    def effort(self) -> Array:
        """The first of `efforts`."""
        return self.efforts[0]


def answer_tick(session: ControllerSession, sent: Sequence[Any], manifest: Manifest) -> tuple[CycleResult, ...]:
    """Return the answer of each arm to a lockstep tick; sent: of each arm its `joint`, `wrenches` and `slips`."""
    for arm, own in zip(session.arms, sent, strict=True):
        for wrench in own.wrenches:
            arm.add_wrench(0, wrench)
        for slip in own.slips:
            if isinstance(slip, DisplacementSample):
                arm.add_displacement(0, slip)
            else:
                arm.add_slip(0, slip)
    for arm, own in zip(session.arms, sent, strict=True):
        arm.add_joint(own.joint)
    session.add_manifest(manifest)
    results = tuple([result for result in session.cycle() if result is not None])
    if len(results) != len(session.arms):
        raise RuntimeError("the controller did not answer a complete tick")
    return results


class ClosedLoop:
    """Bridge and controller of a scenario, joined by function calls.

    Args:
        scenario: parameters of both.
    """

    def __init__(self, scenario: Scenario) -> None:
        self.bridge = BridgeSession(scenario.bridges, scenario.urdfs)
        self.session = ControllerSession(Controller(scenario.controllers, scenario.placed, lockstep=True))

    def answer(self, outputs: TickOutputs) -> tuple[CycleResult, ...]:
        """Return the controller's answer to a tick's outputs, of each arm."""
        manifest = Manifest(outputs.tick, outputs.stamp_ns, outputs.counts[0::2], outputs.counts[1::2])
        return answer_tick(self.session, outputs.arms, manifest)


def run_in_process(scenario: Scenario, loop: ClosedLoop | None = None) -> Iterator[Tick]:
    """Run a scenario, or a loop of it, in lockstep and yield every tick, until its duration is over."""
    loop = loop or ClosedLoop(scenario)
    followed = [k for k, params in enumerate(scenario.bridges.values()) if params.grip.control == "follow"]
    watches, lost = {name: IncidentWatch() for name in scenario.controllers}, False
    while not loop.bridge.finished:
        outputs = loop.bridge.observe()
        results = loop.answer(outputs)
        found = [] if lost or loop.bridge.lost is None else [loop.bridge.lost]
        lost |= bool(found)
        for (name, watch), result in zip(watches.items(), results, strict=True):
            seen = watch.see(result)
            if seen is not None:
                found.append(replace(seen, text=f"{name}: {seen.text}") if name else seen)
        tick = Tick(outputs, results, tuple(found))
        for k in followed:
            tick.grips[k] = results[k].grip
        yield tick
        for k, grip in enumerate(tick.grips):
            if grip is not None:
                loop.bridge.simulation.set_grip_force(k, grip)
        loop.bridge.advance([*tick.commands])
