"""Both sides in one process and no DDS: the reference that a run over DDS must equal bit for bit."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator

import numpy as np

from slip_core.arrays import Array
from slip_core.incidents import Incident
from slip_core.types import DisplacementSample, EffortCommand
from slip_sim_bridge.session import TickOutputs
from slip_vic.scenarios.scenario import Scenario
from slip_vic_controller.incidents import IncidentWatch
from slip_vic_controller.session import Controller, ControllerSession, CycleResult, Manifest


class Tick:
    """What one tick exchanged, what went wrong in it, and the effort that is applied next.

    Args:
        outputs: what the bridge measured.
        result: what the controller answered.
        incidents: what went wrong.

    Attributes:
        efforts: of each arm, (n,) [N m], empty holds the arm: what the controller commands, until another one is set.
    """

    __slots__ = ("efforts", "incidents", "outputs", "results")

    def __init__(self, outputs: TickOutputs, result: CycleResult, incidents: tuple[Incident, ...] = ()) -> None:
        self.outputs, self.results, self.incidents = outputs, (result,), incidents
        self.efforts: list[Array] = [one.command.effort for one in self.results]

    @property
    def result(self) -> CycleResult:
        """What the controller of the first arm answered."""
        return self.results[0]

    @property
    def time_s(self) -> float:
        """Time of the tick [s]."""
        return self.outputs.stamp_ns * 1e-9

    @property
    def effort(self) -> Array:
        """Effort of the first arm that is applied next; (n,) [N m]."""
        return self.efforts[0]

    @effort.setter
    def effort(self, effort: Array) -> None:
        self.efforts[0] = np.asarray(effort, dtype=np.float64)


class ClosedLoop:
    """Bridge and controller of a scenario, joined by function calls.

    Args:
        scenario: parameters of both.
    """

    def __init__(self, scenario: Scenario) -> None:
        self.bridge = scenario.bridge_session()
        controller = Controller({"": scenario.controller}, {"": scenario.urdf}, lockstep=True)
        self.session = ControllerSession(controller)
        (self.controller,) = self.session.arms

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
        self.session.add_manifest(Manifest(outputs.tick, outputs.stamp_ns, outputs.counts[0::2], outputs.counts[1::2]))
        (result,) = self.session.cycle()
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
        tick = Tick(outputs, result, tuple(incident for incident in found if incident is not None))
        yield tick
        if scenario.bridge.grip.control == "follow":
            loop.bridge.set_grip_force(0, result.grip)
        on_the_way.append(EffortCommand(result.command.stamp_ns, tick.effort))
        loop.bridge.advance([on_the_way.popleft()])
