"""What a node asks of its controllers, whether it has one arm or two; and the answers of one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from slip_core.types import DisplacementSample, JointSample, SlipSample, WrenchSample
from slip_vic_controller.params import ControllerParams
from slip_vic_controller.safety.modes import Request
from slip_vic_controller.session import Controller, ControllerSession, CycleResult, Manifest

Results = tuple[CycleResult | None, ...]
"""One for each arm; None where it was not answered."""


class Seat(Protocol):
    """Where the samples of one arm go; contact 0 is its own pad. Arguments as of `ControllerSession`."""

    def add_joint(self, sample: JointSample, now_ns: int | None = None) -> None:
        """Take a joint state."""

    def add_wrench(self, contact: int, sample: WrenchSample, now_ns: int | None = None) -> None:
        """Take a wrench."""

    def add_slip(self, contact: int, sample: SlipSample, now_ns: int | None = None) -> None:
        """Take a slip velocity."""

    def add_displacement(self, contact: int, sample: DisplacementSample, now_ns: int | None = None) -> None:
        """Take where a pad is on the object."""


class Crew(Protocol):
    """The controllers of one node."""

    @property
    def sessions(self) -> tuple[ControllerSession, ...]:
        """One for each arm."""

    @property
    def seats(self) -> tuple[Seat, ...]:
        """One for each arm."""

    def add_manifest(self, manifest: Manifest) -> None:
        """Take the list of what belongs to the current lockstep cycle."""

    def cycle(self, now_ns: int | None = None) -> Results:
        """Answer what has come."""

    def watchdog(self, now_ns: int) -> Results:
        """Answer where joint states have stayed away for too long."""

    def failed(self, now_ns: int) -> Results:
        """Go to FAULT because the node has failed."""

    def set_active(self, active: bool) -> None:
        """Start anew, or answer without effort until then."""

    def request(self, request: Request) -> None:
        """Ask for a mode."""

    def retune(self, params: Sequence[ControllerParams]) -> None:
        """Let gains and payload of each arm ramp to these; refused as a whole."""


class OneArm:
    """A controller that is alone.

    Args:
        controller: of the arm.
    """

    def __init__(self, controller: Controller) -> None:
        self._session = ControllerSession(controller)
        self.sessions = (self._session,)
        self.seats: tuple[Seat, ...] = self.sessions

    def add_manifest(self, manifest: Manifest) -> None:
        """Take the list of what belongs to the current lockstep cycle."""
        self._session.add_manifest(manifest)

    def cycle(self, now_ns: int | None = None) -> Results:
        """Answer a complete set of inputs."""
        return (self._session.cycle(now_ns),)

    def watchdog(self, now_ns: int) -> Results:
        """Answer where joint states have stayed away for too long."""
        return (self._session.watchdog(now_ns),)

    def failed(self, now_ns: int) -> Results:
        """Go to FAULT."""
        return (self._session.failed(now_ns),)

    def set_active(self, active: bool) -> None:
        """Start anew, or answer without effort until then."""
        self._session.set_active(active)

    def request(self, request: Request) -> None:
        """Ask for a mode."""
        self._session.request(request)

    def retune(self, params: Sequence[ControllerParams]) -> None:
        """Let gains and payload ramp to these."""
        self._session.retune(params[0])
