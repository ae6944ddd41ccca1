"""The memory of the controller between ticks: one frozen value, so the law can be restarted anywhere."""

from __future__ import annotations

from typing import NamedTuple

from slip_msgs_py.arrays import Array
from slip_vic_controller.core.delays import Delays
from slip_vic_controller.core.grasp import SlipDisplacement
from slip_vic_controller.core.observer import ObserverState
from slip_vic_controller.core.ramp import Ramp


class ControllerState(NamedTuple):
    """What `step` needs of the past; all arrays read-only.

    stamp_ns: of the last tick; start_ns, start_position (3,) [m], start_rotation (3, 3): origin of the trajectory {w};
    posture (n,) [rad]: of the null space; slips: displacement of every contact; attitude_error (3,) [rad]: for its
    branch; position (n,) [rad]: the last finite joint position, for the safe command; delays: of the slip samples;
    observer: of the slip observer, where there is one; ramp: gains and payload under way, None = those configured.
    """

    stamp_ns: int
    start_ns: int
    start_position: Array
    start_rotation: Array
    posture: Array
    slips: tuple[SlipDisplacement, ...]
    attitude_error: Array
    position: Array
    delays: Delays
    observer: ObserverState | None
    ramp: Ramp | None
