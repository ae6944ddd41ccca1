"""Both sides in one process and no DDS: the reference that a run over DDS must equal bit for bit."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from slip_bringup.scenario import Scenario
from slip_sim_bridge.session import BridgeSession, TickOutputs
from slip_vic_controller.core.controller import VicController
from slip_vic_controller.core.inputs import Manifest
from slip_vic_controller.core.session import ControllerSession, CycleResult


@dataclass(frozen=True, slots=True)
class Tick:
    """What one tick exchanged."""

    outputs: TickOutputs
    result: CycleResult


def run_in_process(scenario: Scenario) -> Iterator[Tick]:
    """Run a scenario in lockstep and yield every tick, until its duration is over."""
    bridge = BridgeSession(scenario.bridge, scenario.urdf)
    controller = ControllerSession(VicController(scenario.controller, scenario.urdf), lockstep=True)
    while not bridge.finished:
        outputs = bridge.observe()
        for contact in range(bridge.contacts):
            for wrench in outputs.wrenches[contact]:
                controller.inputs.add_wrench(contact, wrench)
            for slip in outputs.slips[contact]:
                controller.inputs.add_slip(contact, slip)
        controller.inputs.add_joint(outputs.joint)
        controller.inputs.add_manifest(
            Manifest(outputs.tick, outputs.stamp_ns, outputs.counts[0::2], outputs.counts[1::2])
        )
        result = controller.cycle()
        if result is None:
            raise RuntimeError("the controller did not answer a complete tick")
        yield Tick(outputs, result)
        bridge.advance(result.command)
