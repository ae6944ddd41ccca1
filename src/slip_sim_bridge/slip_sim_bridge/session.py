"""The bridge between ticks: simulation, sensors, run length and resets of N arms, without ROS.

The node and the in-process loop run this same class.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from slip_core.arrays import Array
from slip_core.errors import InputError
from slip_core.stamps import seconds_to_ns
from slip_core.types import DisplacementSample, Incident, JointCommand, JointSample, SlipSample, WrenchSample
from slip_sim_bridge.params import BridgeParams
from slip_sim_bridge.sensors.suite import SensorSuite
from slip_sim_bridge.simulation import Readings, Simulation


class ArmOutputs(NamedTuple):
    """What one arm measures at a tick; wrenches and slips of its contact that are due now, oldest first.

    slips: as `slip_input` says slip velocities, flags (all ones or zeros), or displacements.
    readings: the truth behind the measurements.
    """

    joint: JointSample
    wrenches: tuple[WrenchSample, ...]
    slips: tuple[SlipSample | DisplacementSample, ...]
    readings: Readings


class TickOutputs(NamedTuple):
    """What the bridge publishes at one tick.

    counts: per arm, wrench and slip samples published so far: what a lockstep controller waits for.
    """

    tick: int
    stamp_ns: int
    counts: tuple[int, ...]
    arms: tuple[ArmOutputs, ...]

    @property
    def truth(self) -> Any:
        """Ground truth by name as `Grasp` has it; the slip is that of the first arm's pad."""
        return self.arms[0].readings.truth

    def internal_wrenches(self, radius: float) -> list[Array]:
        """Return the internal part of each pad's wrench as `internal_wrenches` does; radius: rho [m]."""
        each = [arm.readings for arm in self.arms]
        places, attitudes = [one.truth.pad_position for one in each], [one.truth.pad_rotation for one in each]
        wrenches = [one.wrench.wrench for one in each]
        return internal_wrenches(wrenches, places, attitudes, self.truth.object_position, radius)


def internal_wrenches(
    wrenches: Sequence[Array], places: Sequence[Array], attitudes: Sequence[Array], centre: Array, radius: float
) -> list[Array]:
    """Return the internal part of each contact's wrench, on its pad's axes; (6,) each [N, N m].

    h_int,i = h_i - W G_i^T (sum_j G_j W G_j^T)^-1 sum_j G_j h_j with W = diag(1, 1, 1, rho^2, rho^2, rho^2),
    from the true geometry.

    Args:
        wrenches: of the object on each pad; (6,) pad axes.
        places, attitudes: of the pads; (3,) [m], (3, 3) {w}.
        centre: of the object's mass (3,) [m] {w}.
        radius: rho [m].
    """
    n, r, R = len(places), np.array(places) - centre, np.array(attitudes)
    W = np.array([1.0] * 3 + [radius * radius] * 3)
    G = np.tile(np.eye(6), (n, 1, 1))
    G[:, 3:, :3] = np.cross(r[:, np.newaxis], np.eye(3)).transpose(0, 2, 1)
    world = (np.array(wrenches).reshape(n, 2, 3) @ R.transpose(0, 2, 1)).reshape(n, 6)
    total = np.einsum("kij,kj->i", G, world)
    y = np.linalg.solve(np.einsum("kij,j,klj->il", G, W, G), total)
    internal = world - W * np.einsum("kji,j->ki", G, y)
    return list((internal.reshape(n, 2, 3) @ R).reshape(n, 6))


class BridgeSession:
    """Simulation and sensors, one tick after the other.

    Args:
        params: of each arm by its name; "" is the name of an only arm.
        urdfs: of each arm by its name, without a base.

    Raises:
        InputError: parameters and URDFs that do not fit.
    """

    def __init__(self, params: Mapping[str, BridgeParams], urdfs: Mapping[str, str]) -> None:
        self.simulation = Simulation(params, urdfs)
        self._arms = tuple(params.values())
        self._sensors = self._new_sensors()
        self._start_ns = self.simulation.stamp_ns
        self._duration_ns = seconds_to_ns(self._arms[0].duration_s)
        self._oldest_ns = [seconds_to_ns(arm.command_timeout_s) for arm in self._arms]
        self._counts = [0] * (2 * len(self._arms))
        self._interfaces = [arm.drive.interface for arm in self._arms]
        self._reset_wanted = False
        self.tick = 0

    def start_at(self, stamp_ns: int) -> None:
        """Let time begin at this stamp [ns]; before the first tick."""
        self.simulation.start_at(stamp_ns)
        self._start_ns = stamp_ns

    @property
    def elapsed_s(self) -> float:
        """Simulated time since the start [s]."""
        return (self.simulation.stamp_ns - self._start_ns) * 1e-9

    @property
    def finished(self) -> bool:
        """Whether the run's duration is over."""
        return self.simulation.stamp_ns - self._start_ns >= self._duration_ns

    @property
    def lost(self) -> Incident | None:
        """When and how the object left the first pad; None while all hold it."""
        if self.simulation.loss is None:
            return None
        stamp_ns, text = self.simulation.loss
        return Incident("lost", 1e-9 * (stamp_ns - self._start_ns), text)

    def change(self, params: Sequence[BridgeParams]) -> None:
        """Take changed run-time parameters of each arm from the next tick on: sensor faults, a hand's push, the grip.

        Raises:
            InputError: a grip force beyond what a parameter may have.
        """
        for index, (before, now) in enumerate(zip(self._arms, params, strict=True)):
            self._sensors[index].set_faults(now.sensors)
            self.simulation.push(index, np.array(now.push.wrench), np.array(now.push.effort))
            if now.grip.force != before.grip.force:
                self.simulation.set_grip_force(index, now.grip.force)
        self._arms = tuple(params)

    def _new_sensors(self) -> list[SensorSuite]:
        """Return sensors at their start, noise included; faults are as they are switched."""
        return [SensorSuite(arm.model_copy(update={"seed": arm.seed + index})) for index, arm in enumerate(self._arms)]

    def request_reset(self) -> None:
        """Put everything back before the next tick, the grip force of the start too; time, pushes and faults stay."""
        self._reset_wanted = True

    def observe(self) -> TickOutputs:
        """Measure everything at the present stamp; once per tick."""
        if self._reset_wanted:
            self._reset_wanted = False
            self.simulation.reset()
            self._sensors = self._new_sensors()
        arms, counts = [], self._counts
        for index, sensors in enumerate(self._sensors):
            readings = self.simulation.observe(index)
            wrenches = sensors.wrench.update(readings.wrench)
            slips = sensors.slip.update(sensors.slip_truth(readings))
            counts[2 * index] += len(wrenches)
            counts[2 * index + 1] += len(slips)
            arms.append(ArmOutputs(sensors.joint.update(readings.joint), wrenches, slips, readings))
        return TickOutputs(self.tick, self.simulation.stamp_ns, tuple(counts), tuple(arms))

    def advance(self, commands: Sequence[JointCommand | None]) -> None:
        """Apply a command of each arm for one control period; None, an empty or a too old one holds that arm."""
        self.simulation.step([self._accepted(index, command) for index, command in enumerate(commands)])
        self.tick += 1

    def _accepted(self, index: int, command: JointCommand | None) -> Array | None:
        """Return the numbers of a command that counts.

        Raises:
            InputError: a command of another interface than the arm's drives have.
        """
        if command is None:
            return None
        if command.interface != self._interfaces[index]:
            raise InputError(
                "parameter drive.interface", got=f"{self._interfaces[index]}, and a {command.interface} command",
                expected="what the controller sends", fix="command.interface of the controller",
            )  # fmt: skip
        age_ns = self.simulation.stamp_ns - command.stamp_ns
        return command.numbers if len(command.numbers) and 0 <= age_ns <= self._oldest_ns[index] else None
