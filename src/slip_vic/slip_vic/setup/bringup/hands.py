"""The hand that pushes, pulls and grips: a person's, on request, or that of the simulated arm."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Final

import click

from slip_core.arrays import Array
from slip_sim_bridge.params import HOLD_STIFFNESS
from slip_vic.setup.bringup.heard import BRIDGE, Heard

if TYPE_CHECKING:
    from slip_vic.setup.bringup.ros_system import RosSystem

SETTLED_S: Final = 0.3
READ_S: Final = 0.2
BY_HAND_S: Final = 4.0
PUSH_N: Final = 3.0
NO_TORQUE: Final = (0.0, 0.0, 0.0)
TURN: Final = 0.03  # [rad, m]
FIRM_N: Final = 40.0
CARRIES: Final = 4.0  # times the weight: slip then points within 15 degrees of the pull
STEPS: Final = 20
GROWTH: Final = 1.12
STEP_S: Final = 0.06
SEEN_S: Final = 0.14  # until a slow sensor has reported it


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

    def pull(self, words: str, direction: Array, weight: float, slips: Callable[[Heard], bool]) -> list[Heard]:
        """Ask for a pull through the pads until it slips; direction: (3,) {w}; weight: along the pads [N]."""
        return [self._during(f"pull the object through the pads, some millimetres along {words} of ee_frame", 0.0)]

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
        self._friction = system.params.governor.friction_limit / system.params.grip.nominal_force

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

    def pull(self, words: str, direction: Array, weight: float, slips: Callable[[Heard], bool]) -> list[Heard]:
        """Jerk harder each time, until it slips, on a grip that carries so much that the weight hardly turns it."""
        carried = max(CARRIES * weight, self._friction * self._grip)
        self._tune("grip.force", carried / self._friction)
        heard: list[Heard] = []
        for step in range(STEPS):
            jerk = partial(
                self._tune, "push.wrench", [*(0.6 * GROWTH**step * carried * direction).tolist(), *NO_TORQUE]
            )
            try:  # it may slip before the simulation has answered
                heard.append(self._system.listen(STEP_S, jerk))
            finally:
                heard.append(self._system.listen(SEEN_S, partial(self._tune, "push.wrench", [0.0] * 6)))
            if slips(heard[-2]) or slips(heard[-1]):
                break
        return heard

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
