"""The hand that pushes, pulls and grips: a person's, on request, or that of the simulated arm."""

from __future__ import annotations

import time
from functools import partial
from typing import TYPE_CHECKING, Final

import click

from slip_core.arrays import Array
from slip_sim_bridge.params import HOLD_STIFFNESS
from slip_vic.setup.bringup.heard import BRIDGE, Heard, joined

if TYPE_CHECKING:
    from slip_vic.setup.bringup.ros_system import RosSystem

SETTLED_S: Final = 0.3
READ_S: Final = 0.2
BY_HAND_S: Final = 4.0
PUSH_N: Final = 3.0
NO_TORQUE: Final = (0.0, 0.0, 0.0)
TURN: Final = 0.03  # [rad, m]
FIRM_N: Final = 40.0
LIGHTLY: Final = 1e-3  # of the grip of use: the object stays where it is supported


class Person:
    """Asks the person beside the arm.

    Args:
        system: to listen to.
        names: of the joints.
    """

    def __init__(self, system: RosSystem, names: tuple[str, ...]) -> None:
        self._system, self._names = system, names

    def ready(self, words: str) -> None:
        """Wait for Enter."""
        click.prompt(f"  {words}: switch in the hand, then Enter", default="", show_default=False)

    def turn(self, joint: int, inertia: Array) -> Heard:
        """Ask for a few degrees of one joint in its positive sense; inertia: (n, n), in this posture."""
        how = "" if self._system.params.command.interface == "effort" else ", from the pendant or in free drive,"
        return self._during(f"turn {self._names[joint]}{how} by a few degrees in its positive sense, and keep it there")

    def push(self, words: str, direction: Array) -> Heard:
        """Ask for a push of the object; direction: (3,) {w}."""
        return self._during(f"push the object steadily along {words} of the arm's base")

    def slide(self, words: str, turns: bool, lean: Array, support: Array) -> Heard:
        """Ask for a motion of the hand with the object held fast, some 10 mm or 20 degrees."""
        what = "turn the hand by some 20 degrees about" if turns else "move the hand by some 10 mm along"
        return self._during(f"grip lightly, hold the object fast, {what} {words} of ee_frame and back", 0.0)

    def grip(self, *, firmly: bool) -> None:
        """Ask for a grip, firm or as in use, with the object where it belongs."""
        how = "firmly" if firmly else "with the force of use, at contacts.position"
        click.prompt(f"  let the gripper hold the object {how}, then Enter", default="", show_default=False)

    def _during(self, words: str, settle_s: float = 1.0) -> Heard:
        click.prompt(f"  {words}: Enter, then {settle_s + BY_HAND_S:.0f} s", default="", show_default=False)
        time.sleep(settle_s)
        return self._system.listen(BY_HAND_S)


class Simulated:
    """The hand of the simulated arm: its parameters `push.wrench`, `push.effort` and `grip.force`.

    Args:
        system: with a simulated arm.
        grip: its `grip.force`, the force of use [N].
    """

    def __init__(self, system: RosSystem, grip: float) -> None:
        self._system, self._grip = system, grip

    def ready(self, words: str) -> None:
        """Continue: nobody stands beside a simulated arm."""

    def turn(self, joint: int, inertia: Array) -> Heard | None:
        """Push all joints such that one moves alone; None: drives with their own loop hold against it."""
        if self._system.params.command.interface != "effort":
            return None
        return self._leaning("push.effort", (HOLD_STIFFNESS * TURN * inertia[:, joint]).tolist())

    def push(self, words: str, direction: Array) -> Heard:
        """Push with `PUSH_N`."""
        return self._leaning("push.wrench", [*(PUSH_N * direction).tolist(), *NO_TORQUE])

    def slide(self, words: str, turns: bool, lean: Array, support: Array) -> Heard | None:
        """Lean on the arm with an effort (n,) [N m], and support the object (6,) [N, N m] {w}; None: see `turn`."""
        if self._system.params.command.interface != "effort":
            return None
        self._system.tune({"grip.force": LIGHTLY * self._grip, "push.wrench": support.tolist()}, BRIDGE)
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
        self._tune("grip.force", FIRM_N if firmly else self._grip)
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
