"""The bridge between ticks: simulation, sensors, run length and resets, without ROS.

The node and the in-process loop run this same class.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from slip_core.arrays import Array, readonly
from slip_core.incidents import Incident
from slip_core.stamps import seconds_to_ns
from slip_core.types import EffortCommand, JointSample, ObjectTruth, WrenchSample
from slip_sim_bridge.params import BridgeParams, PushParams
from slip_sim_bridge.sensors.params import SensorsParams
from slip_sim_bridge.sensors.suite import SensorSuite
from slip_sim_bridge.simulation import GraspSimulation, Readings

NO_EFFORT = readonly(np.zeros(0))


class ArmOutputs(NamedTuple):
    """What one arm measures at a tick; as of `TickOutputs`."""

    joint: JointSample
    wrenches: tuple[tuple[WrenchSample, ...], ...]
    slips: tuple[tuple[Any, ...], ...]
    readings: Readings


class TickOutputs(NamedTuple):
    """What the bridge publishes at one tick; wrenches and slips per contact, those that are due now, oldest first.

    slips: as `slip_input` says slip velocities, flags (all ones or zeros), or displacements.
    counts: per contact, wrench and slip samples published so far: what a lockstep controller waits for.
    readings: what the sensors were shown.
    """

    tick: int
    stamp_ns: int
    joint: JointSample
    wrenches: tuple[tuple[WrenchSample, ...], ...]
    slips: tuple[tuple[Any, ...], ...]
    counts: tuple[int, ...]
    readings: Readings

    @property
    def arms(self) -> tuple[ArmOutputs, ...]:
        """What each arm measures: there is one."""
        return (ArmOutputs(self.joint, self.wrenches, self.slips, self.readings),)

    @property
    def truth(self) -> ObjectTruth:
        """Ground truth of the object at this tick."""
        return self.readings.truth


class BridgeSession:
    """Simulation and sensors, one tick after the other.

    Args:
        params: parameters of the bridge.
        urdf_text: the arm.
    """

    def __init__(self, params: BridgeParams, urdf_text: str) -> None:
        self._params = params
        self.simulation = GraspSimulation(params, urdf_text)
        self._sensors = SensorSuite(params)
        self._start_ns = self.simulation.stamp_ns
        self._duration_ns = seconds_to_ns(params.duration_s)
        self._oldest_ns = seconds_to_ns(params.command_timeout_s)
        self._wrench_count = 0
        self._slip_count = 0
        self._reset_wanted = False
        self._largest_change = params.effort_rate * params.control_period_s
        self.tick = 0
        self.contacts = 1

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
        return self._params.stop_after_duration and self.simulation.stamp_ns - self._start_ns >= self._duration_ns

    @property
    def lost(self) -> Incident | None:
        """When and how the object left the pads; None while it is held."""
        loss = self.simulation.loss
        return None if loss is None else Incident("lost", 1e-9 * (loss.stamp_ns - self._start_ns), loss.text)

    def set_grip_force(self, force: float) -> None:
        """Set the grip force from the next tick on; [N].

        Raises:
            InputError: negative or not finite.
        """
        self.simulation.set_grip_force(force)

    def set_push(self, push: PushParams) -> None:
        """Let a hand lean on arm and object from the next tick on."""
        self.simulation.push(np.array(push.wrench), np.array(push.effort))

    def set_faults(self, sensors: SensorsParams) -> None:
        """Switch sensor faults on and off from the next measurement on."""
        self._sensors.set_faults(sensors)

    def request_reset(self) -> None:
        """Put everything back before the next tick; time goes on."""
        self._reset_wanted = True

    def observe(self) -> TickOutputs:
        """Measure everything at the present stamp; once per tick."""
        if self._reset_wanted:
            self._reset_wanted = False
            self.simulation.reset()
            self._sensors.reset()
        sensors, readings = self._sensors, self.simulation.observe()
        wrenches = tuple(sensors.wrench.update(readings.wrench))
        if sensors.displacement is None:
            slips: tuple[Any, ...] = tuple(sensors.slip.update(readings.slip))
        else:
            slips = tuple(sensors.displacement.update(readings.truth))
        self._wrench_count += len(wrenches)
        self._slip_count += len(slips)
        counts = self._wrench_count, self._slip_count
        joint, stamp_ns = sensors.joint.update(readings.joint), readings.joint.stamp_ns
        return TickOutputs(self.tick, stamp_ns, joint, (wrenches,), (slips,), counts, readings)

    def advance(self, command: EffortCommand | None) -> None:
        """Apply a command for one control period; None, an empty one, or one too old or not finite holds the arm.

        The effort at the joints changes no faster than `effort_rate`, as that of a drive.
        """
        self.simulation.step(self._accepted(command), self._largest_change)
        self.tick += 1

    def _accepted(self, command: EffortCommand | None) -> Array | None:
        """Return the effort of a command that counts."""
        if command is None or not len(command.effort):
            return None
        age_ns = self.simulation.stamp_ns - command.stamp_ns
        return command.effort if 0 <= age_ns <= self._oldest_ns else None
