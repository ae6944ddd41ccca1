"""The controller node of two arms on one object: one process, one cycle, one lifecycle, one request for both."""

from __future__ import annotations

from typing import Any

from slip_vic_controller.node import SlipVicController, make_controller
from slip_vic_controller.parameters.node_params import ControllerNodeParams
from slip_vic_controller.parameters.team_params import TeamParams
from slip_vic_controller.team.crew import Crew
from slip_vic_controller.team.session import SIDES, TeamSession
from slip_vic_controller.topics.arm import Place


class TeamController(SlipVicController):
    """Answers the joint states of both arms with an effort command for each; the topics of an arm are below its side.

    A wrench or slip velocity of one side is known to both controllers, so each side's topics are subscribed to once.
    """

    MODEL = TeamParams

    def arms_of(self, params: Any) -> tuple[ControllerNodeParams, ...]:
        """Return the parameters of each arm."""
        return tuple(params.arms)

    def make_crew(self) -> Crew:
        """Return the controllers of both arms."""
        pairs = zip(self.params.arms, self.params.bases, strict=True)
        return TeamSession([make_controller(arm, base) for arm, base in pairs])

    def places(self) -> tuple[Place, ...]:
        """Return what each arm is in this node."""
        crew = self.crew
        each = zip(SIDES, self.params.arms, crew.sessions, crew.seats, strict=True)
        return tuple(Place(f"{side}/", params, session, seat, 1) for side, params, session, seat in each)
