"""The controller between cycles: parameters, Pinocchio's call, samples in and results out; `cycle` does the rest.

A controller has one or more arms, which hold one object; the name of a single arm is "". The node, the in-process loop,
bag replay and the fault campaign all run this same class.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from slip_core.arrays import Array, matrix_from_quat_xyzw
from slip_core.errors import InputError
from slip_core.matrices import product
from slip_core.params import flatten
from slip_core.records import record, records
from slip_core.types import CartesianReference, PoseGoal
from slip_vic_controller.config.controller import governed_stream
from slip_vic_controller.cycle.cycle import cycle
from slip_vic_controller.law.gains import gain_report
from slip_vic_controller.params.controller_params import ControllerParams
from slip_vic_controller.safety.modes import Request
from slip_vic_controller.session.arm_session import ArmSession
from slip_vic_controller.session.controller import Controller
from slip_vic_controller.session.cycle_result import CycleResult
from slip_vic_controller.session.manifest import Manifest
from slip_vic_controller.sizes import ROOM
from slip_vic_controller.state import (
    CONFIG,
    CONFIG_SIZE,
    INPUTS_SIZE,
    OUTPUTS_SIZE,
    TASK_SIZE,
    TASK_STATE,
    ControllerConfig,
    TaskState,
)

MOST = 1e3
"""Most of anything that a reference may have, in SI units; numbers that are not finite lead to HOLD."""


RETUNABLE = ("gains.", "object.", "contacts.position", "safety.hold_stiffness")
"""Parameters that ramp while the law runs."""


Results = tuple[CycleResult | None, ...]
"""One for each arm; None where it was not answered."""


class ControllerSession:
    """Runs the control cycle whenever a set of inputs is complete: a joint state of every arm, and what belongs to it.

    Contact 0 of an arm is its own pad. Further contacts are the pads of the other arms in their order; of a single arm
    they have topics of their own.

    Args:
        controller: parameters and arms.
    """

    def __init__(self, controller: Controller) -> None:
        self.controller = controller
        self.buffer = controller.new_state()
        self.active = True
        self.task: TaskState = record(self.buffer[:TASK_SIZE], TASK_STATE)
        self._lockstep, self.config = controller.lockstep, controller.config
        self._governed_stream = governed_stream(controller.first.params)
        self._ahead: frozenset[int] = frozenset()  # answered for joint states that other arms have yet to bring
        self.arms = tuple(ArmSession(self, name, k) for k, name in enumerate(controller.arms))
        pads = max(len(self.arms), self.arms[0].contacts)
        self.manifest: Manifest | None = None
        self.wrench_counts, self.slip_counts = [0] * pads, [0] * pads
        self._taring = tuple(arm for arm in self.arms if arm.controller.params.tare.duration_s > 0.0)
        for arm in self.arms:
            arm.routes = tuple(tuple(self._routes(arm.index, contact)) for contact in range(arm.contacts))

    def _routes(self, own: int, contact: int) -> Iterator[tuple[ArmSession, int]]:
        """Yield the arms that read a contact of an arm, and its number there."""
        yield self.arms[own], contact
        for arm in self.arms if contact == 0 else ():
            number = own + 1 if own < arm.index else own
            if arm.index != own and number < arm.contacts:
                yield arm, number

    def config_of(self, index: int) -> Array:
        """Return the CONFIG of an arm."""
        return self.config[index * CONFIG_SIZE :][:CONFIG_SIZE]

    def configure(self, index: int, change: Callable[[ControllerConfig], None]) -> None:
        """Change the CONFIG of an arm; sessions that share the controller keep theirs."""
        config = self.config.copy()
        change(records(config, CONFIG)[index])
        if config.tobytes() != self.config.tobytes():
            config.setflags(write=False)
            self.config = config
            for arm in self.arms:
                arm.config = self.config_of(arm.index)

    # -- inputs of the object ----------------------------------------------------------------------

    def add_manifest(self, manifest: Manifest) -> None:
        """Take the list of what belongs to the current lockstep cycle: the pads' samples, in the order of the arms."""
        self.manifest = manifest

    def set_reference(self, reference: CartesianReference) -> None:
        """Use this reference from the next cycle on; governed, follow it as soon as friction admits.

        Of one arm it is that of the pad; of several that of the object's centre of mass, which every pad keeps to.

        Raises:
            InputError: numbers that no arm can follow, which are errors of a unit or a frame; nothing has changed then.
        """
        for what in ("position", "twist", "acceleration"):
            largest = float(np.abs(getattr(reference, what)).max())
            if math.isfinite(largest) and largest > MOST:
                raise InputError(f"reference: {what}", got=f"{largest:.3g}", expected=f"at most {MOST:g}")
        task = self.task
        task.taken += 1
        given: Any = task.reference
        if self._governed_stream:
            stream = task.stream
            if stream.queued == ROOM:
                for k in range(ROOM - 1):
                    stream.queue[k] = stream.queue[k + 1]
                stream.queued -= 1
            item = stream.queue[int(stream.queued)]
            item.stamp_ns, given = reference.stamp_ns, item.reference
            stream.queued += 1
        else:
            task.reference_known = 1
        of_pad = self._of_first_pad(reference)
        given.position, given.rotation = of_pad.position, of_pad.rotation
        given.twist, given.acceleration = of_pad.twist, of_pad.acceleration

    def set_goal(self, goal: PoseGoal) -> None:
        """Come to rest at this pose; the next cycle begins it, waits until the pad is at rest, or refuses it.

        Of one arm it is the pose of the pad; of several that of the object's centre of mass.
        """
        task = self.task.goal
        r, R = self._grasp(goal.rotation)
        task.received, task.pending = task.received + 1, 1
        task.to_position, task.to_rotation, task.duration = goal.position + r, R, goal.duration_s
        self.task.taken += 1

    def _grasp(self, rotation: Array) -> tuple[Array, Array]:
        """Return lever [m] and attitude of the first pad {w}; rotation: of what references and goals move."""
        if len(self.arms) == 1:
            return np.zeros(3), rotation
        contacts = self.controller.first.params.contacts
        own = matrix_from_quat_xyzw(contacts.orientation_xyzw[:4])
        return product(rotation, np.array(contacts.position[:3])), product(rotation, own)

    def _of_first_pad(self, reference: CartesianReference) -> CartesianReference:
        """Return the reference of the first pad where the object moves by a reference."""
        if len(self.arms) == 1:
            return reference
        (r, R), w, alpha = self._grasp(reference.rotation), reference.twist[3:], reference.acceleration[3:]
        twist = np.concatenate((reference.twist[:3] + np.cross(w, r), w))
        linear = reference.acceleration[:3] + np.cross(alpha, r) + np.cross(w, np.cross(w, r))
        acceleration = np.concatenate((linear, alpha))
        return CartesianReference(reference.position + r, R, twist, acceleration, reference.stamp_ns)

    # -- requests and parameters -------------------------------------------------------------------

    def set_active(self, active: bool) -> None:
        """Start again, or answer without effort until then; a fault stays."""
        self.active = active
        for arm in self.arms:
            arm.state.law.known = 0

    def request(self, request: Request) -> None:
        """Request a mode of all arms; the next cycle decides."""
        for arm in self.arms:
            arm.request(request)

    def retune(self, params: Sequence[ControllerParams]) -> None:
        """Let gains and payload of each arm ramp to those of `params`, and HOLD use them, from the next cycle on.

        Raises:
            InputError: the values are refused as a whole, or something else has changed; nothing has happened then.
        """
        targets = []
        for arm, wanted in zip(self.arms, params, strict=True):
            now = flatten(arm.tuned)
            for name, value in flatten(wanted).items():
                if value != now[name] and not name.startswith(RETUNABLE):
                    raise InputError(
                        f"parameter {name}", got=value, expected=f"{now[name]!r} while the law runs",
                        fix="restart the node",
                    )  # fmt: skip
            targets.append(gain_report(wanted).gains)
        for arm, wanted, target in zip(self.arms, params, targets, strict=True):
            arm.ramp_to(wanted, target)

    # -- cycles ------------------------------------------------------------------------------------

    def cycle(self, now_ns: int | None = None) -> Results:
        """Answer what has come: all arms, or in real time those whose partners' joint states stay away.

        Arms that are answered without the others hold.

        Args:
            now_ns: steady time; None, and lockstep, take the stamps of the joint states.
        """
        if self._lockstep or now_ns is None:
            for arm in self.arms:
                if not arm.complete():
                    return (None,) * len(self.arms)
            return self.answer(None)
        for arm in self.arms:  # nearly always all wait: no list is made for that
            if arm.waiting is None:
                break
        else:
            self._ahead = frozenset()
            return self.answer(now_ns)
        late = [arm for arm in self.arms if arm.waiting is None]
        if len(late) == len(self.arms) == 1:
            return (None,)
        results = tuple([None if arm.waiting is not None else arm.watchdog(now_ns) for arm in self.arms])
        ready = [arm for arm in self.arms if arm.waiting is not None]
        if not ready or not self._may_go_alone(ready, late, now_ns):
            return results
        return tuple(own or result for own, result in zip(self.answer(now_ns), results, strict=True))

    def _may_go_alone(self, ready: Sequence[ArmSession], late: Sequence[ArmSession], now_ns: int) -> bool:
        """Return whether arms are answered whose partners are silent or hold.

        A partner that is not silent is waited for, so that all are answered together: while they follow the law until
        its joint state comes, while it holds until the next one of an arm that waits does.
        """
        if not all(arm.begun for arm in late):
            return False
        awaited = [arm for arm in late if not arm.silent(now_ns) and arm.index not in self._ahead]
        if not awaited:
            self._ahead = frozenset()
            return True
        if any(arm.mode.follows for arm in awaited) or not any(arm.overdue for arm in ready):
            return False
        self._ahead = frozenset(arm.index for arm in ready)
        return True

    def answer(self, now_ns: int | None) -> Results:
        """Run one cycle on the joint states that wait for it; an arm where none waits is not answered.

        now_ns: the controller's clock; None takes the stamps of the joint states.
        """
        exchange = self.new_exchange()
        joints = [arm.prepare(now_ns, exchange) for arm in self.arms]
        answered = cycle(self.config, self.buffer, exchange)
        for arm in self._taring:
            arm.use_tare()
        exchange.setflags(write=False)
        results: list[CycleResult | None] = []
        for arm, joint in zip(self.arms, joints, strict=True):
            commands = bool(answered >> arm.index & 1)
            results.append(None if joint is None else arm.result(joint, exchange, commands))
        return tuple(results)

    def new_exchange(self) -> Array:
        """Return INPUTS and OUTPUTS of all arms for a cycle, zeros."""
        return np.zeros(len(self.arms) * (INPUTS_SIZE + OUTPUTS_SIZE))

    def watchdog(self, now_ns: int) -> Results:
        """Answer arms whose joint states have stayed away for too long, and those that waited for them."""
        if self._lockstep:
            return (None,) * len(self.arms)
        return self.cycle(now_ns) if len(self.arms) > 1 else (self.arms[0].watchdog(now_ns),)

    def failed(self, now_ns: int) -> Results:
        """Go to FAULT with all arms because the node has failed; return commands where the law has begun."""
        return tuple(arm.failed(now_ns) for arm in self.arms)
