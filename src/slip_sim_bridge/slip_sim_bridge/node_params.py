"""Parameters of the bridge node: those of the simulation, and how the node runs."""

from __future__ import annotations

from slip_core.params import parameter
from slip_sim_bridge.sim.params import BridgeParams


class BridgeNodeParams(BridgeParams):
    """Everything the bridge node can be told."""

    wait_for: tuple[str, ...] = parameter(
        ("controller",),
        "peers whose `<peer>/ready` must be seen before time starts; empty starts at once (realtime only)",
    )
    peer_timeout_s: float = parameter(15.0, "how long to wait for the peers", unit="s", gt=0.0)
    lockstep_timeout_s: float = parameter(5.0, "longest wait for the command of a lockstep tick", unit="s", gt=0.0)
    command_timeout_s: float = parameter(
        0.03,
        "age of the last command, from the state it answers, above which the arm holds its posture by itself: no loop "
        "over the network is stable with more delay",
        unit="s",
        gt=0.0,
    )
    duration_s: float = parameter(8.0, "simulated time of a run", unit="s", gt=0.0)
    stop_after_duration: bool = parameter(True, "end the process after duration_s; false runs until stopped")
