"""Whose hand pushes: a person's, asked for it, or that of the simulated arm."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING, Any, Final

import click
import numpy as np

from slip_core.arrays import Array
from slip_vic.setup.bringup.verdicts import Heard

if TYPE_CHECKING:
    from slip_vic.setup.bringup.ros_system import RosSystem

SETTLED_S: Final = 0.3
LOOKED_S: Final = 0.2
BY_HAND_S: Final = 4.0
PUSH_N: Final = 3.0
TURN: Final = 0.03  # [rad, m]
FIRM_N: Final = 40.0
CARRIES: Final = 4.0  # times the weight: slip then points within 15 degrees of the pull
STEPS: Final = 20
GROWTH: Final = 1.12
STEP_S: Final = 0.06
SEEN_S: Final = 0.14  # until a slow sensor has reported it


class Person:
    """Asks the person beside the arm to push, to pull, and to take the object again.

    Attributes:
        size: of a push [N], None where it is not known.
    """

    size: float | None = None

    def __init__(self, system: RosSystem, names: tuple[str, ...]) -> None:
        self._system, self._names = system, names

    def ready(self, words: str) -> None:
        """Wait until the arm may do what is said."""
        click.prompt(f"  {words}: switch in the hand, then Enter", default="", show_default=False)

    def turn(self, joint: int, inertia: Array) -> Heard:
        """Ask for a few degrees of one joint in its positive sense; inertia: (n, n), of the arm as it stands."""
        how = "" if self._system.params.command.interface == "effort" else ", from the pendant or in free drive,"
        words = f"turn {self._names[joint]}{how} by a few degrees in its positive sense, and keep it there"
        return self._during(words)

    def push(self, words: str, direction: Array) -> Heard:
        """Ask for a push of the object; direction (3,) {w}."""
        return self._during(f"push the object steadily along {words} of the arm's base")

    def pull(self, words: str, direction: Array, weight: float, slips: Callable[[Heard], bool]) -> list[Heard]:
        """Ask for a pull through the pads until it slips; direction (3,) {w}; weight: along the pads [N]."""
        return [self._during(f"pull the object through the pads, some millimetres along {words} of ee_frame", 0.0)]

    def grip(self, firmly: bool) -> None:
        """Let the gripper hold the object firmly, or as it will in use, with the object where it belongs."""
        how = "firmly" if firmly else "with the force that it will have in use, at contacts.position"
        click.prompt(f"  let the gripper hold the object {how}, then Enter", default="", show_default=False)

    def _during(self, words: str, settle_s: float = 1.0) -> Heard:
        click.prompt(f"  {words}: Enter, then {settle_s + BY_HAND_S:.0f} s", default="", show_default=False)
        time.sleep(settle_s)
        return self._system.listen(BY_HAND_S)


class Simulated:
    """The hand of the simulated arm: its parameters `push.wrench`, `push.effort` and `grip.force`.

    Args:
        system: with a simulated arm.
        stiffness: with which that arm holds itself, over the joint inertia [1/s2].
        friction: over the grip force, as the controller is configured.
        grip: force in use [N].
    """

    size: float | None = PUSH_N

    def __init__(self, system: RosSystem, stiffness: float, friction: float, grip: float) -> None:
        self._system, self._stiffness, self._friction, self._grip = system, stiffness, friction, grip

    def ready(self, words: str) -> None:
        """Continue: a simulated arm has no person beside it."""

    def turn(self, joint: int, inertia: Array) -> Heard | None:
        """Lean on all joints such that one moves alone; None: drives with a loop of their own hold against it."""
        if self._system.params.command.interface != "effort":
            return None
        effort = self._stiffness * TURN * inertia[:, joint]
        with self._leaning("push.effort", effort):
            self._system.listen(SETTLED_S)
            return self._system.listen(LOOKED_S)

    def push(self, words: str, direction: Array) -> Heard:
        """Push with `PUSH_N`."""
        with self._leaning("push.wrench", _wrench(PUSH_N * direction)):
            self._system.listen(SETTLED_S)
            return self._system.listen(LOOKED_S)

    def pull(self, words: str, direction: Array, weight: float, slips: Callable[[Heard], bool]) -> list[Heard]:
        """Jerk harder each time, until it slips; the grip carries so much that the weight hardly turns the slip."""
        carried = max(CARRIES * weight, self._friction * self._grip)
        self._system.tune_bridge({"grip.force": carried / self._friction})
        heard: list[Heard] = []
        for step in range(STEPS):
            jerk = partial(self._push, 0.6 * GROWTH**step * carried * direction)
            try:  # it may slip before the simulation has answered
                heard.append(self._system.listen(STEP_S, jerk))
            finally:
                heard.append(self._system.listen(SEEN_S, partial(self._push, np.zeros(3))))
            if slips(heard[-2]) or slips(heard[-1]):
                break
        return heard

    def grip(self, firmly: bool) -> None:
        """Put the object back where it belongs, then grip: the simulated arm begins with a grip of its own."""
        self._system.reset_bridge()
        self._system.listen(SETTLED_S)
        self._system.tune_bridge({"grip.force": FIRM_N if firmly else self._grip})
        self._system.listen(SETTLED_S)

    def _push(self, force: Array) -> None:
        self._system.tune_bridge({"push.wrench": _wrench(force).tolist()})

    @contextmanager
    def _leaning(self, name: str, value: Array) -> Iterator[None]:
        """Set a parameter of the simulated arm to a value, and to zeros at the end."""
        self._system.tune_bridge({name: value.tolist()})
        try:
            yield
        finally:
            self._system.tune_bridge({name: [0.0] * len(value)})


Hands = Person | Simulated


def simulated_hand(system: RosSystem, bridge: Mapping[str, Any]) -> Simulated:
    """Return the hand of a simulated arm, of which `hold.stiffness` and `grip.force` are known."""
    known = system.params
    friction = known.governor.friction_limit / known.grip.nominal_force
    return Simulated(system, bridge["hold.stiffness"], friction, bridge["grip.force"])


def _wrench(force: Array) -> Array:
    """Return the wrench of a force without a torque; (6,) [N, N m]."""
    return np.concatenate((force, np.zeros(3)))


def unit(axis: int) -> Array:
    """Return a unit vector; (3,)."""
    return np.eye(3)[axis]
