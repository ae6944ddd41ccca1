"""Both sides in one process and no DDS: the reference that a run over DDS must equal bit for bit."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

from slip_core.incidents import Incident
from slip_core.types import DisplacementSample, EffortCommand
from slip_sim_bridge.session import TickOutputs
from slip_vic.scenarios.scenario import Scenario
from slip_vic_controller.incidents import IncidentWatch
from slip_vic_controller.session import Controller, ControllerSession, CycleResult, Manifest


@dataclass(frozen=True, slots=True)
class Tick:
    """What one tick exchanged, and what went wrong in it."""

    outputs: TickOutputs
    result: CycleResult
    incidents: tuple[Incident, ...] = ()


class ClosedLoop:
    """Bridge and controller of a scenario, joined by function calls.

    Args:
        scenario: parameters of both.
    """

    def __init__(self, scenario: Scenario) -> None:
        self.bridge = scenario.bridge_session()
        self.controller = ControllerSession(Controller(scenario.controller, scenario.urdf, lockstep=True))

    def observe(self) -> TickOutputs:
        """Return what the bridge measures now."""
        return self.bridge.observe()

    def control(self, outputs: TickOutputs) -> CycleResult:
        """Return the controller's answer to a tick's outputs."""
        controller, (arm,) = self.controller, outputs.arms
        for wrench in arm.wrenches:
            controller.add_wrench(0, wrench)
        for slip in arm.slips:
            if isinstance(slip, DisplacementSample):
                controller.add_displacement(0, slip)
            else:
                controller.add_slip(0, slip)
        controller.add_joint(arm.joint)
        controller.add_manifest(Manifest(outputs.tick, outputs.stamp_ns, outputs.counts[0::2], outputs.counts[1::2]))
        result = controller.cycle()
        if result is None:
            raise RuntimeError("the controller did not answer a complete tick")
        return result


def run_in_process(scenario: Scenario, late_ticks: int = 0) -> Iterator[Tick]:
    """Run a scenario in lockstep and yield every tick, until its duration is over.

    late_ticks: control periods that every command is on its way, which neither side can see from stamps.
    """
    loop = ClosedLoop(scenario)
    on_the_way = deque[EffortCommand | None]([None] * late_ticks)
    watch, lost = IncidentWatch(), False
    while not loop.bridge.finished:
        outputs = loop.observe()
        result = loop.control(outputs)
        found = (loop.bridge.lost if not lost else None, watch.see(result))
        lost |= found[0] is not None
        yield Tick(outputs, result, tuple(incident for incident in found if incident is not None))
        if scenario.bridge.grip.control == "follow":
            loop.bridge.set_grip_force(0, result.grip)
        on_the_way.append(result.command)
        loop.bridge.advance([on_the_way.popleft()])
