"""The memory of the controller between ticks: one frozen value, so the law can be restarted anywhere."""

from __future__ import annotations

from typing import NamedTuple

from slip_core.arrays import Array
from slip_vic_controller.core.delays import Delays
from slip_vic_controller.core.grasp import SlipDisplacement
from slip_vic_controller.core.observer_memory import ObserverMemory
from slip_vic_controller.core.packing import slips_of
from slip_vic_controller.core.ramp import Ramp


class ControllerState(NamedTuple):
    """What `step` needs of the past; all arrays read-only.

    stamp_ns: of the last tick; start_ns, start_position (3,) [m], start_rotation (3, 3): origin of the trajectory {w};
    posture (n,) [rad]: of the null space; memory: attitude error and slip displacements, packed; position (n,) [rad]:
    the last finite joint position, for the safe command; delays: of the slip samples; observer: of the slip observer,
    where there is one; ramp: gains and payload under way, None = those configured.
    """

    stamp_ns: int
    start_ns: int
    start_position: Array
    start_rotation: Array
    posture: Array
    memory: Array
    position: Array
    delays: Delays
    observer: ObserverMemory | None
    ramp: Ramp | None

    @property
    def slips(self) -> tuple[SlipDisplacement, ...]:
        """Slip displacement of every contact."""
        return slips_of(self.memory)

    @property
    def attitude_error(self) -> Array:
        """Orientation error, for its branch; (3,) [rad] {w}."""
        return self.memory[:3]
