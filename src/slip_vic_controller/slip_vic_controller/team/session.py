"""The controller of two arms between cycles: one session each, samples to both, one cycle for both."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from slip_core.arrays import Array, matrix_from_quat_xyzw
from slip_core.errors import InputError
from slip_core.types import CartesianReference, DisplacementSample, JointSample, SlipSample, WrenchSample
from slip_vic_controller.arrival import is_silent
from slip_vic_controller.params import ControllerParams
from slip_vic_controller.safety.faults import Fault
from slip_vic_controller.safety.modes import Request
from slip_vic_controller.safety.reasons import ACTIVATION
from slip_vic_controller.session import Controller, ControllerSession, CycleResult, Health, Manifest
from slip_vic_controller.team.crew import Results, Seat

SIDES = ("left", "right")
NOT_ANSWERED: Results = (None, None)


class Asked(NamedTuple):
    """What a cycle asks of one arm; as of `ControllerSession.answer`."""

    joint: JointSample
    fault: Fault
    now_ns: int
    missing: int
    health: Health | None = None


class TeamSeat:
    """One side of a team: its samples go to both controllers.

    Args:
        team: whose.
        side: 0 left, 1 right.
    """

    def __init__(self, team: TeamSession, side: int) -> None:
        self._team, self._side = team, side

    def add_joint(self, sample: JointSample, now_ns: int | None = None) -> None:
        """Take a joint state."""
        self._team.add_joint(self._side, sample, now_ns)

    def add_wrench(self, _contact: int, sample: WrenchSample, now_ns: int | None = None) -> None:
        """Take a wrench of the own pad."""
        self._team.add_wrench(self._side, sample, now_ns)

    def add_slip(self, _contact: int, sample: SlipSample, now_ns: int | None = None) -> None:
        """Take a slip velocity of the own pad."""
        self._team.add_slip(self._side, sample, now_ns)

    def add_displacement(self, _contact: int, sample: DisplacementSample, now_ns: int | None = None) -> None:
        """Take where the own pad is on the object."""
        self._team.add_displacement(self._side, sample, now_ns)


class TeamSession:
    """Runs the control cycle of both arms when a joint state of each is there.

    A wrench or slip velocity of one side is contact 0 of its own controller and contact 1 of the other's, where that
    one knows of two contacts.

    Args:
        controllers: left and right; both in lockstep, or none.

    Raises:
        InputError: they do not fit each other.
    """

    def __init__(self, controllers: Sequence[Controller]) -> None:
        if len({controller.lockstep for controller in controllers}) != 1 or len(controllers) != len(SIDES):
            raise InputError("controllers of a team", got=f"{len(controllers)}", expected="two, both in one mode")
        self.sessions = tuple(ControllerSession(controller) for controller in controllers)
        self.seats: tuple[Seat, ...] = tuple(TeamSeat(self, side) for side in range(len(SIDES)))
        self._lockstep = controllers[0].lockstep
        self._overdue = [False] * len(SIDES)  # its own next joint state has come while one waited for the partner
        self._ahead: int | None = None  # who was answered alone, for a joint state that the partner has yet to bring
        from slip_vic_controller.team.cycle import team_cycle  # compiled here, so that one arm waits for nothing of two

        self._cycle = team_cycle

    def add_joint(self, side: int, sample: JointSample, now_ns: int | None = None) -> None:
        """Take a joint state of one side."""
        self._overdue[side] = self.sessions[side].waiting is not None
        self.sessions[side].add_joint(sample, now_ns)

    def add_wrench(self, side: int, sample: WrenchSample, now_ns: int | None = None) -> None:
        """Take a wrench of one side."""
        for session, contact in self._know(side):
            session.add_wrench(contact, sample, now_ns)

    def add_slip(self, side: int, sample: SlipSample, now_ns: int | None = None) -> None:
        """Take a slip velocity of one side."""
        for session, contact in self._know(side):
            session.add_slip(contact, sample, now_ns)

    def add_displacement(self, side: int, sample: DisplacementSample, now_ns: int | None = None) -> None:
        """Take where the pad of one side is on the object."""
        for session, contact in self._know(side):
            session.add_displacement(contact, sample, now_ns)

    def _know(self, side: int) -> Iterator[tuple[ControllerSession, int]]:
        """Yield the controllers that know the pad of one side, and its number there."""
        for of, session in enumerate(self.sessions):
            contact = 0 if of == side else 1
            if contact < session.contacts:
                yield session, contact

    def add_manifest(self, manifest: Manifest) -> None:
        """Take the list of what belongs to the current lockstep cycle: the left pad's samples, then the right one's."""
        for side, session in enumerate(self.sessions):
            own = [(counts[side], counts[1 - side]) for counts in (manifest.wrench_counts, manifest.slip_counts)]
            wrenches, slips = (counts[: session.contacts] for counts in own)
            session.add_manifest(Manifest(manifest.tick, manifest.stamp_ns, wrenches, slips))

    def set_reference(self, side: int, reference: CartesianReference) -> None:
        """Use this reference of a pad from the next cycle on."""
        self.sessions[side].set_reference(reference)

    def set_object_reference(self, reference: CartesianReference) -> None:
        """Use this reference of the object's centre of mass from the next cycle on: each pad where it was grasped."""
        R, v, w = reference.rotation, reference.twist[:3], reference.twist[3:]
        a, alpha = reference.acceleration[:3], reference.acceleration[3:]
        for side, session in enumerate(self.sessions):
            grasp = session.controller.params.contacts
            r = R @ np.array(grasp.position[:3])
            twist = np.concatenate((v + np.cross(w, r), w))
            acceleration = np.concatenate((a + np.cross(alpha, r) + np.cross(w, np.cross(w, r)), alpha))
            rotation = R @ matrix_from_quat_xyzw(grasp.orientation_xyzw[:4])
            self.set_reference(side, CartesianReference(reference.position + r, rotation, twist, acceleration))

    def request(self, request: Request) -> None:
        """Ask for a mode, of both arms; the next cycle decides."""
        for session in self.sessions:
            session.request(request)

    def set_active(self, active: bool) -> None:
        """Start anew, or answer without effort until then; a fault stays."""
        for session in self.sessions:
            session.set_active(active)

    def retune(self, params: Sequence[ControllerParams]) -> None:
        """Let gains and payload of each arm ramp to these.

        Raises:
            InputError: one of them is refused; nothing has happened then.
        """
        left, right = self.sessions
        before = left.tuned
        left.retune(params[0])
        try:
            right.retune(params[1])
        except InputError:
            left.retune(before)
            raise

    def cycle(self, now_ns: int | None = None) -> Results:
        """Answer what has come: both arms, or one that is alone because the other's joint states stay away.

        An arm that is alone holds. Lockstep answers both, when each has all that belongs to the stamp.

        Args:
            now_ns: steady time; None, and lockstep, take the stamps of the joint states.
        """
        if self._lockstep or now_ns is None:
            if not all(session.complete() for session in self.sessions):
                return NOT_ANSWERED
            now_ns = None
        waiting = [session.waiting for session in self.sessions]
        if all(one is not None for one in waiting):
            self._overdue, self._ahead = [False] * len(SIDES), None
            return self._together([one for one in waiting if one is not None], now_ns)
        assert now_ns is not None, "complete sessions have a joint state"
        return tuple(self._alone(side, now_ns) for side in range(len(SIDES)))

    def watchdog(self, now_ns: int) -> Results:
        """Answer arms whose joint states have stayed away for too long, and those that waited for them."""
        return NOT_ANSWERED if self._lockstep else self.cycle(now_ns)

    def failed(self, now_ns: int) -> Results:
        """Go to FAULT with both because the node has failed; return commands where the law has begun."""
        return tuple(session.failed(now_ns) for session in self.sessions)

    def answer(self, asked: Sequence[Asked]) -> tuple[CycleResult, ...]:
        """Run one cycle of both arms."""
        records = [session.prepare(*one) for session, one in zip(self.sessions, asked, strict=True)]
        buffers: list[Array] = []
        for session, (inputs, outputs) in zip(self.sessions, records, strict=True):
            buffers += [session.controller.config, session.buffer, inputs, outputs]
        self._cycle(*buffers)
        return tuple(
            CycleResult(session.controller, one.joint, inputs, outputs)
            for session, one, (inputs, outputs) in zip(self.sessions, asked, records, strict=True)
        )

    def _together(self, joints: Sequence[tuple[JointSample, Fault]], now_ns: int | None) -> tuple[CycleResult, ...]:
        return self.answer(
            [
                Asked(joint, fault, joint.stamp_ns if now_ns is None else now_ns, 0 if session.active else ACTIVATION)
                for session, (joint, fault) in zip(self.sessions, joints, strict=True)
            ]
        )

    def _alone(self, side: int, now_ns: int) -> CycleResult | None:
        """Answer an arm whose partner is silent or holds; return what the watchdog says where it is silent itself.

        A partner that is not silent is waited for, so that both are answered together: while both follow the law until
        its joint state comes, while it holds until the own next one does.
        """
        session, other = self.sessions[side], self.sessions[1 - side]
        if session.waiting is None:
            return session.watchdog(now_ns)
        if not other.begun:
            return None
        if not is_silent(other.controller.config, other.buffer, now_ns) and self._ahead != 1 - side:
            if other.mode.follows or not self._overdue[side]:
                return None
            self._ahead = side
        else:
            self._ahead = None
        self._overdue[side] = False
        before, session.state.outside = int(session.state.outside), int(Fault.OTHER_ARM)
        joint, fault = session.waiting
        result = session.answer(joint, fault, now_ns, 0 if session.active else ACTIVATION, None)
        session.state.outside = before
        return result
