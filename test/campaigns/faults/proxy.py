"""Stands between bridge and controller on every topic, and lets messages suffer; raw bytes, real DDS."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterable
from functools import partial
from typing import Any

import numpy as np

from slip_core.stamps import stamp_of, with_stamp
from slip_msgs_py.qos import create_publisher, create_subscription
from test.campaigns.faults.carriers import BytesCarrier
from test.campaigns.faults.channel import Channel
from test.campaigns.faults.plan import BRIDGE, EFFORT, JOINT, TOPICS, Fault, Plan
from test.campaigns.faults.wire import Wire

PLANT = "plant"  # namespace of the bridge's side
KEPT = 20_000  # messages kept for the bag of a violation: about ten seconds


def remappings(prefixes: Iterable[str]) -> list[str]:
    """Return the ROS arguments that put the bridge behind the proxy; prefixes: of each arm's topics."""
    names = (f"{prefix}{name}" for prefix in prefixes for name in TOPICS)
    return [word for name in names for word in ("-r", f"{name}:={PLANT}/{name}")]


class Proxy:
    """Forwards four topics of each arm.

    Args:
        node: owner of the endpoints.
        wires: by the name of the topic, with the arm's prefix.
        on_forward: called with (topic, message, sent at [steady ns], whether it may count) of what is handed on.
        on_state: called with (topic, message) of every joint state as the bridge sent it.
    """

    def __init__(
        self,
        node: Any,
        wires: dict[str, Wire],
        on_forward: Callable[[str, bytes, int, bool], None],
        on_state: Callable[[str, bytes], None],
    ) -> None:
        self._wires = wires
        self._carriers = {name: BytesCarrier(wire) for name, wire in wires.items()}
        self._on_forward, self._on_state = on_forward, on_state
        self.kept: deque[tuple[int, str, bytes]] = deque(maxlen=KEPT)
        self._start_ns = 0
        self._offset_ns = 0
        self._clock_faults: tuple[Fault, ...] = ()
        self._standing_ns: int | None = None
        self._publishers = {}
        for name, wire in wires.items():
            source, sink = (name, f"{PLANT}/{name}") if wire.name == EFFORT else (f"{PLANT}/{name}", name)
            self._publishers[name] = create_publisher(node, wire.name, actual_name=sink)
            create_subscription(
                node, wire.name, partial(self._take, name), depth=100, reliable=True, actual_name=source, raw=True
            )
        self.set_plan(None, 0)

    def set_plan(self, plan: Plan | None, start_ns: int, *, cut_here: bool = False) -> None:
        """Begin a trial at this steady time, or forward everything untouched.

        cut_here: a cut of the network is for the proxy to play, by dropping everything.
        """
        faults = () if plan is None else plan.faults
        seed, trial = (0, 0) if plan is None else (plan.seed, plan.trial)
        self._start_ns = start_ns
        self._clock_faults = tuple(f for f in faults if f.kind in ("clock_jump", "clock_stop") and f.target == BRIDGE)
        self._jumped: set[Fault] = set()
        self._channels = {
            name: Channel(
                self._carriers[name],
                tuple(fault for fault in faults if fault.target == name or (cut_here and fault.kind == "cut")),
                np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(trial, 2 + i))),
            )
            for i, name in enumerate(self._wires)
        }

    def flush(self) -> None:
        """Hand on what is due."""
        now_ns = time.monotonic_ns()
        for name, channel in self._channels.items():
            for delivery in channel.arrivals(now_ns):
                self._publishers[name].publish(delivery.sample)
                self._on_forward(name, delivery.sample, delivery.measured_ns, delivery.clean)

    def _take(self, name: str, data: bytes) -> None:
        now_ns = time.monotonic_ns()
        self.kept.append((time.time_ns(), name, data))
        if self._wires[name].name == EFFORT:
            shown = with_stamp(data, stamp_of(data) - self._offset_ns) if self._offset_ns else data
        else:
            if self._wires[name].name == JOINT:
                self._on_state(name, data)
            shown = self._with_clock(data, (now_ns - self._start_ns) * 1e-9)
        self._channels[name].send(shown, (now_ns - self._start_ns) * 1e-9, now_ns)
        self.flush()

    def _with_clock(self, data: bytes, t: float) -> bytes:
        """Show the message with the clock that the faults make of the bridge's."""
        for fault in self._clock_faults:
            if fault.kind == "clock_jump" and t >= fault.start_s and fault not in self._jumped:
                self._jumped.add(fault)
                self._offset_ns += clock_jump_ns(fault)
            elif fault.kind == "clock_stop" and fault.at(t):
                if self._standing_ns is None:
                    self._standing_ns = stamp_of(data) + self._offset_ns
                return with_stamp(data, self._standing_ns)
        self._standing_ns = None
        return with_stamp(data, stamp_of(data) + self._offset_ns) if self._offset_ns else data


def clock_jump_ns(fault: Fault) -> int:
    """Return how far the clock jumps, from 10 ms to 100 s, forward or back."""
    sign = 1 if fault.size > 0.5 else -1
    return sign * round(1e9 * 10.0 ** (4.0 * abs(2.0 * fault.size - 1.0) - 2.0))
