"""A controller with one arm as most tests drive it: the arm's own session, and cycles that give one result."""

from __future__ import annotations

from typing import Any

from slip_core.types import CartesianReference, JointSample, PoseGoal
from slip_vic_controller.params.controller_params import ControllerParams
from slip_vic_controller.safety.conditions import Reason
from slip_vic_controller.safety.modes import Request
from slip_vic_controller.session.controller import Controller
from slip_vic_controller.session.cycle_result import CycleResult, Health
from slip_vic_controller.session.manifest import Manifest
from slip_vic_controller.session.session import ControllerSession


def one_arm(params: ControllerParams, urdf: str, *, lockstep: bool) -> Controller:
    """Return the controller of a single arm."""
    return Controller({"": params}, {"": urdf}, lockstep=lockstep)


class OneArm:
    """A session of a controller with one arm; what is not here is the arm's (`ArmSession`)."""

    def __init__(self, controller: Controller) -> None:
        self.session = ControllerSession(controller)
        self.arm = self.session.arms[0]

    def __getattr__(self, name: str) -> Any:
        return getattr(self.arm, name)

    @property
    def buffer(self) -> Any:
        return self.session.buffer

    @property
    def task(self) -> Any:
        return self.session.task

    def add_manifest(self, manifest: Manifest) -> None:
        self.session.add_manifest(manifest)

    def set_reference(self, reference: CartesianReference) -> None:
        self.session.set_reference(reference)

    def set_goal(self, goal: PoseGoal) -> None:
        self.session.set_goal(goal)

    def set_active(self, active: bool) -> None:
        self.session.set_active(active)

    def request(self, request: Request) -> None:
        self.session.request(request)

    def retune(self, params: ControllerParams) -> None:
        self.session.retune((params,))

    def cycle(self, now_ns: int | None = None) -> CycleResult | None:
        return self.session.cycle(now_ns)[0]

    def watchdog(self, now_ns: int) -> CycleResult | None:
        return self.session.watchdog(now_ns)[0]

    def failed(self, now_ns: int) -> CycleResult | None:
        return self.session.failed(now_ns)[0]

    def answer(
        self, joint: JointSample, fault: Reason, now_ns: int, missing: int, health: Health | None
    ) -> CycleResult:
        self.arm.waiting = joint, int(fault), missing, health
        (result,) = self.session.answer(now_ns)
        assert result is not None
        return result
