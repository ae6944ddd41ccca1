"""The bridge node of two arms on one object: topics of each arm below its side, those of the object at the root."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from slip_core.files.placed_urdf import placed_urdf
from slip_core.types import EffortCommand
from slip_msgs_py.fast_io import create_sender
from slip_msgs_py.messages import forms, to_msgs
from slip_sim_bridge.node import SlipSimBridge, arm_urdf
from slip_sim_bridge.pair.internal import internal_wrenches
from slip_sim_bridge.pair.params import SIDES, PairParams
from slip_sim_bridge.pair.simulation import PairSimulation, PairTick
from slip_sim_bridge.params import BridgeParams


class PairBridge(SlipSimBridge):
    """Publishes what both arms measure; a tick is over when the commands of both are there."""

    MODEL = PairParams

    def __init__(self, executor: Any = None) -> None:
        super().__init__(executor)
        self._radius = self.params.left.friction.torsional_radius
        self._send_total = create_sender(self, "object/wrench", forms.wrench(to_msgs.WORLD))
        self._send_internal = [
            create_sender(self, f"object/internal_wrench_{side}", forms.wrench(arm.ee_frame))
            for side, arm in zip(SIDES, self.params.arms, strict=True)
        ]

    def arms_of(self, params: Any) -> tuple[BridgeParams, ...]:
        """Return the parameters of each arm."""
        return tuple(params.arms)

    def make_session(self) -> PairSimulation:
        """Return simulation and sensors of both."""
        return PairSimulation(self.params, [arm_urdf(arm) for arm in self.params.arms])

    def places(self) -> tuple[tuple[str, BridgeParams, str], ...]:
        """Return of each arm the prefix of its topics, its parameters, and its URDF where it stands."""
        each = zip(SIDES, self.params.arms, self.params.bases, strict=True)
        return tuple(
            (f"{side}/", arm, placed_urdf(arm_urdf(arm), base.position, base.rotation)) for side, arm, base in each
        )

    def advance(self, commands: Sequence[EffortCommand | None]) -> None:
        """Apply a command of each arm for one control period."""
        self.session.advance(commands)

    def set_grip_force(self, side: int, force: float) -> None:
        """Set the grip force of one arm [N]."""
        self.session.set_grip_force(side, force)

    def disturb(self, side: int, params: BridgeParams) -> None:
        """Switch sensor faults of one arm on and off."""
        self.session.set_faults(side, params.sensors)

    def publish_more_truth(self, outputs: PairTick) -> None:
        """Send what both pads do to the object, and to each other."""
        wrenches = [reading.wrench.wrench for reading in outputs.readings]
        places, attitudes = outputs.pads
        total, parts = internal_wrenches(wrenches, places, attitudes, outputs.truth.position, self._radius)
        self._send_total.send(outputs.stamp_ns, total)
        for send, part in zip(self._send_internal, parts, strict=True):
            send.send(outputs.stamp_ns, part)
