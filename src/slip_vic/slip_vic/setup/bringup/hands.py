"""The hand that pushes, pulls and grips: a person's, on request, or that of the simulated arm."""

from __future__ import annotations

import time
from functools import partial
from typing import TYPE_CHECKING, Final

import click
import numpy as np

from slip_core.arrays import Array, matrix_from_quat_xyzw
from slip_sim_bridge.params import HOLD_STIFFNESS, BridgeParams
from slip_vic.setup.bringup.heard import BRIDGE, Heard, joined

if TYPE_CHECKING:
    from slip_vic.setup.bringup.ros_system import RosSystem
    from slip_vic_controller.params.controller_params import ControllerParams

SETTLED_S: Final = 0.3
READ_S: Final = 0.2
BY_HAND_S: Final = 4.0
PUSH_N: Final = 3.0
NO_TORQUE: Final = (0.0, 0.0, 0.0)
TURN: Final = 0.03  # [rad, m]
FIRM_N: Final = 40.0
LIGHTLY: Final = 1e-3  # of the grip of use: the object stays where it is supported


def weight_on_pad(params: BridgeParams | ControllerParams, rotation: Array) -> Array:
    """Return the wrench of the resting object on the pad; rotation of {ee} in {w} (3, 3) -> (6,) [N, N m] {w}."""
    force = params.object.mass * np.array(params.gravity)
    p_R_o = matrix_from_quat_xyzw(params.contacts.orientation_xyzw[:4]).T
    lever = rotation @ p_R_o @ np.array(params.contacts.position[:3])
    return np.concatenate((force, -np.cross(lever, force)))


class Person:
    """Asks the person beside the arm.

    Args:
        system: to listen to.
    """

    def __init__(self, system: RosSystem) -> None:
        self._system = system

    def ready(self, words: str) -> None:
        """Wait for Enter."""
        click.prompt(f"  {words}: switch in the hand, then Enter", default="", show_default=False)

    def turn(self, joint: int, inertia: Array) -> Heard:
        """Ask for a few degrees of one joint in its positive sense; inertia: (n, n), in this posture."""
        params = self._system.params
        how = "" if params.command.interface == "effort" else ", with the pendant or in free drive,"
        return self._during(
            f"turn {params.joint_names[joint]}{how} by a few degrees in its positive direction, and hold it there"
        )

    def push(self, words: str, direction: Array) -> Heard:
        """Ask for a push of the object; direction: (3,) {w}."""
        return self._during(f"push the object steadily along {words} of the arm's base")

    def slide(self, words: str, turns: bool, lean: Array, rotation: Array) -> Heard:
        """Ask for a motion of the hand with the object held fast, some 10 mm or 20 degrees."""
        what = "turn the hand by some 20 degrees about" if turns else "move the hand by some 10 mm along"
        return self._during(f"grip lightly, hold the object fast, {what} {words} of ee_frame and back", 0.0)

    def grip(self, *, firmly: bool) -> None:
        """Ask for a grip, firm or as in use, with the object where it belongs."""
        how = "firmly" if firmly else "with its usual force, at contacts.position"
        click.prompt(f"  let the gripper hold the object {how}, then Enter", default="", show_default=False)

    def _during(self, words: str, settle_s: float = 1.0) -> Heard:
        click.prompt(f"  {words}: Enter, then {settle_s + BY_HAND_S:.0f} s", default="", show_default=False)
        time.sleep(settle_s)
        return self._system.listen(BY_HAND_S)


class Simulated:
    """The hand of the simulated arm: its parameters `push.wrench`, `push.effort` and `grip.force`.

    Args:
        system: with a simulated arm.
        simulated: its parameters.
    """

    def __init__(self, system: RosSystem, simulated: BridgeParams) -> None:
        self._system, self._simulated = system, simulated

    def ready(self, words: str) -> None:
        """Continue: a simulated arm needs no person."""

    def turn(self, joint: int, inertia: Array) -> Heard | None:
        """Push all joints such that one moves alone; None: drives with their own loop hold against it."""
        if self._system.params.command.interface != "effort":
            return None
        return self._leaning("push.effort", (HOLD_STIFFNESS * TURN * inertia[:, joint]).tolist())

    def push(self, words: str, direction: Array) -> Heard:
        """Push with `PUSH_N`."""
        return self._leaning("push.wrench", [*(PUSH_N * direction).tolist(), *NO_TORQUE])

    def slide(self, words: str, turns: bool, lean: Array, rotation: Array) -> Heard | None:
        """Lean on the arm with an effort (n,) [N m], and support the object; rotation of {ee} {w}; None: see `turn`.

        The support is exactly the object's weight: any other force moves the object for as long as the grip is light.
        """
        if self._system.params.command.interface != "effort":
            return None
        support = -weight_on_pad(self._simulated, rotation)
        self._system.tune({"grip.force": LIGHTLY * self._simulated.grip.force, "push.wrench": support.tolist()}, BRIDGE)
        try:
            there = self._system.listen(SETTLED_S, partial(self._tune, "push.effort", lean.tolist()))
            back = self._system.listen(SETTLED_S, partial(self._tune, "push.effort", [0.0] * len(lean)))
        finally:
            self._tune("push.effort", [0.0] * len(lean))
            self._tune("push.wrench", [0.0] * 6)
            self.grip(firmly=True)
        return joined((there, back))

    def grip(self, *, firmly: bool) -> None:
        """Put the object back where it belongs, then grip: a reset begins with the simulation's own grip."""
        self._system.ask("reset", BRIDGE)
        self._system.listen(SETTLED_S)
        self._tune("grip.force", FIRM_N if firmly else self._simulated.grip.force)
        self._system.listen(SETTLED_S)

    def _leaning(self, name: str, value: list[float]) -> Heard:
        try:
            self._tune(name, value)
            self._system.listen(SETTLED_S)
            return self._system.listen(READ_S)
        finally:
            self._tune(name, [0.0] * len(value))

    def _tune(self, name: str, value: float | list[float]) -> None:
        self._system.tune({name: value}, BRIDGE)


Hands = Person | Simulated
