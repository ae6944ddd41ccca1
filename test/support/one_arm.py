"""A controller with one arm as most tests drive it: the arm's own session, and cycles that give one result."""

from __future__ import annotations

from typing import Any

from slip_core.types import JointSample
from slip_vic_controller.config.controller import Controller
from slip_vic_controller.params.controller_params import ControllerParams
from slip_vic_controller.safety.conditions import Reason
from slip_vic_controller.session.cycle_result import CycleResult, Health
from slip_vic_controller.session.session import ControllerSession


def one_arm(params: ControllerParams, urdf: str, *, lockstep: bool) -> Controller:
    """Return the controller of a single arm."""
    return Controller({"": params}, {"": urdf}, lockstep=lockstep)


OF_SESSION = ("buffer", "task", "add_manifest", "set_reference", "set_goal", "set_active", "request")


class OneArm:
    """A session of a controller with one arm; what is neither here nor in `OF_SESSION` is the arm's (`ArmSession`)."""

    def __init__(self, controller: Controller) -> None:
        self.session = ControllerSession(controller)
        self.arm = self.session.arms[0]

    def __getattr__(self, name: str) -> Any:
        return getattr(self.session if name in OF_SESSION else self.arm, name)

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
