"""The laws of this suite behind the same door: a controller that gets only what `Seen` and `Setup` hold."""

from __future__ import annotations

import itertools
import math
from typing import ClassVar

import numpy as np

from slip_core.params import build, flatten
from slip_vic.experiments.law import Answer, Effort, Seen, Setup
from slip_vic.run.in_process import answer_tick
from slip_vic_controller.params.node_params import ControllerNodeParams
from slip_vic_controller.session.controller import Controller
from slip_vic_controller.session.manifest import Manifest
from slip_vic_controller.session.session import ControllerSession


class Vic:
    """The paper's law. Its efforts equal those of the control cycle in the suite's own loop to the last bit."""

    needs: ClassVar[frozenset[str]] = frozenset({"wrench", "slip"})
    several: ClassVar[bool] = True
    configured: ClassVar[str] = "vic"
    """Which of `world.OWN_LAWS` the parameters in `Setup` are for."""
    stiffness: ClassVar[float] = 1.0
    """Factor of the stiffness as configured; damping goes with its square root, so that the damping ratio stays."""

    def reset(self, setup: Setup) -> None:
        """Make the controller."""
        params = {name: self._stiffened(own) for name, own in setup.parameters.items()}
        self._session = ControllerSession(Controller(params, setup.urdfs, lockstep=True))
        self._follows = [own.grip.control == "follow" for own in params.values()]
        self._counts = np.zeros((2, len(params)), np.int64)
        self._tick = itertools.count()

    def _stiffened(self, own: ControllerNodeParams) -> ControllerNodeParams:
        if self.stiffness == 1.0:
            return own
        stiffness = [self.stiffness * value for value in own.gains.stiffness]
        damping = [math.sqrt(self.stiffness) * value for value in own.gains.damping]
        changed = {"gains.stiffness": stiffness, "gains.damping": damping}
        return build(ControllerNodeParams, flatten(own) | changed, "controller")

    def step(self, seen: Seen) -> Answer | tuple[Answer, ...]:
        """Answer as the controller does."""
        every = (seen, *seen.others)
        self._counts += [[len(one.wrenches) for one in every], [len(one.slips) for one in every]]
        manifest = Manifest(next(self._tick), seen.stamp_ns, *map(tuple, self._counts.tolist()))
        answers = tuple(
            Effort(command.numbers, result.grip if follows else None)
            if (command := result.command).interface == "effort" and len(command.numbers)
            else None
            for result, follows in zip(answer_tick(self._session, every, manifest), self._follows, strict=True)
        )
        return answers if len(answers) > 1 else answers[0]


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
