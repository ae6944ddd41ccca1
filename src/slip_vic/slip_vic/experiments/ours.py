"""The laws of this suite behind the same door: a controller that gets only what `Seen` and `Setup` hold."""

from __future__ import annotations

import itertools
from typing import ClassVar

import numpy as np

from slip_vic.experiments.law import Answer, Effort, Seen, Setup
from slip_vic.run.in_process import answer_tick
from slip_vic_controller.config.controller import Controller
from slip_vic_controller.session.session import ControllerSession, Manifest


class Vic:
    """The paper's law. Its efforts equal those of the control cycle in the suite's own loop to the last bit."""

    needs: ClassVar[frozenset[str]] = frozenset({"wrench", "slip"})
    several: ClassVar[bool] = True
    configured: ClassVar[str] = "vic"
    """Law of `scenario.LAWS` that the parameters in `Setup` are for."""

    def reset(self, setup: Setup) -> None:
        """Make the controller."""
        self._session = ControllerSession(Controller(setup.parameters, setup.urdfs, lockstep=True))
        self._follows = [own.grip.control == "follow" for own in setup.parameters.values()]
        self._counts = np.zeros((2, len(setup.parameters)), np.int64)
        self._tick = itertools.count()

    def step(self, seen: Seen) -> tuple[Answer, ...]:
        """Answer as the controller does."""
        every = (seen, *seen.others)
        self._counts += [[len(one.wrenches) for one in every], [len(one.slips) for one in every]]
        manifest = Manifest(next(self._tick), seen.stamp_ns, *map(tuple, self._counts.tolist()))
        return tuple(
            Effort(command.numbers, result.grip if follows else None)
            if (command := result.command).interface == "effort" and len(command.numbers)
            else None
            for result, follows in zip(answer_tick(self._session, every, manifest), self._follows, strict=True)
        )


class Classical(Vic):
    """Impedance control that reads no slip sensor."""

    configured = "classical"


class Governed(Vic):
    """The paper's law below the reference governor."""

    configured = "governed"


class GovernedFollow(Governed):
    """Governed, and the grip follows the load."""

    needs = frozenset({"wrench", "slip", "grip"})
    configured = "governed_follow"
