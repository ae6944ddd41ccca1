"""Topics and services of what all arms do together: references or goals in, answers out."""

from __future__ import annotations

from typing import Any

from std_srvs.srv import Trigger

from slip_core.errors import InputError
from slip_msgs_py.fast_io import Refusals, create_receiver
from slip_msgs_py.messages import from_msgs, to_msgs
from slip_msgs_py.qos import create_publisher
from slip_vic_controller.config.controller import governed_stream
from slip_vic_controller.node.arm_topics import GO_ON, STATE_DEPTH
from slip_vic_controller.params.controller_params import ControllerParams
from slip_vic_controller.path.goals import GoalPhase, Refusal
from slip_vic_controller.safety.conditions import Mode, Request
from slip_vic_controller.session.session import ControllerSession

_PHASES = {
    GoalPhase.STOPS: "waits until the pad is at rest on its current path",
    GoalPhase.PLANS: "is planned",
    GoalPhase.MOVES: "moves",
    GoalPhase.REACHED: "reached",
}


def refusal_text(goal: Any) -> str:
    """Return why the last refused goal was refused; GOAL."""
    why, value, limit = Refusal(int(goal.refusal)), float(goal.value), float(goal.limit)
    if why == Refusal.TOO_HEAVY:
        load = f"holding the weight needs {value:.3f} N, friction can carry {limit:.3f} N"
        return f"friction cannot carry the object at {float(goal.where):.3f} s of its path: {load}"
    if why == Refusal.TOO_FAR:
        return f"it is {value:.4g} m away, the limit is {limit:g}: check unit and frame"
    if why in (Refusal.TOO_FAST, Refusal.TURNS_TOO_FAST):
        unit = "m/s" if why == Refusal.TOO_FAST else "rad/s"
        return f"it needs {value:.2f} {unit}, the limit is {limit:.2f}: allow more time"
    return "the law is not active, see controller/mode"


class GoalWatch:
    """Says what becomes of goals, where it changes."""

    def __init__(self, session: ControllerSession) -> None:
        self._session, self._last, self._last_refused = session, (0, 0), 0

    def changes(self) -> list[str]:
        """Return one line for each thing that has changed since the last call."""
        goal, lines = self._session.task.goal, []
        if goal.refused != self._last_refused:
            self._last_refused = int(goal.refused)
            lines.append(f"goal {self._last_refused} refused: {refusal_text(goal)}")
        now = int(goal.received if goal.phase == GoalPhase.STOPS else goal.number), int(goal.phase)
        if now != self._last and goal.phase != GoalPhase.RESTS:
            lines.append(f"goal {now[0]} {_PHASES[GoalPhase(now[1])]}")
        self._last = now
        return lines


class TaskTopics:
    """What the pad of a single arm is asked for; of several arms the object's centre of mass.

    Args:
        node: owner of topics and services.
        params: of the first arm.
        session: what takes references, goals and requests.
        refusals: messages that could not be read, for the report.
    """

    def __init__(self, node: Any, params: ControllerParams, session: ControllerSession, refusals: Refusals) -> None:
        self._params, self._session = params, session
        self._goals = GoalWatch(session)
        self._used = create_publisher(node, "controller/reference_used") if session.controller.first.external else None
        by_topic = params.trajectory.kind == "topic"
        if self._used is not None:
            name, read = ("reference", self._read_reference) if by_topic else ("goal", self._read_goal)
            again = self._used.publish
            create_receiver(node, name, read, again, refusals, depth=STATE_DEPTH[True], reliable=False)
        self._answers = None if by_topic or self._used is None else create_publisher(node, "controller/goal")
        for request in (Request.ENABLE, Request.HOLD, Request.RESET_FAULT, Request.TARE):
            name = f"~/{request.name.lower()}"
            node.create_service(Trigger, name, lambda _, response, r=request: self._on_request(r, response))

    @property
    def publishers(self) -> list[tuple[Any, int]]:
        """Publishers, and how many subscribers each must have before the node is ready."""
        return [] if self._used is None else [(self._used, self._params.expected_subscribers - 1)]

    def publish(self) -> None:
        """Publish what has become of a goal in this cycle."""
        if self._answers is not None:
            for line in self._goals.changes():
                self._say(line)

    def _say(self, line: str) -> None:
        if self._answers is not None:
            self._answers.publish(to_msgs.string(line))

    # -- services ----------------------------------------------------------------------------------

    def _on_request(self, request: Request, response: Any) -> Any:
        arms = self._session.arms
        faulty = next((arm for arm in arms if arm.mode == Mode.FAULT), None)
        response.success = False
        if not self._session.active:
            response.message = "not active"
        elif faulty is not None and request != Request.RESET_FAULT:
            response.message = f"in FAULT: {faulty.reason}{GO_ON}"
        elif request == Request.TARE and any(arm.mode.follows for arm in arms):
            response.message = "the law is active: call ~/hold first"
        elif request == Request.TARE and not all(arm.controller.params.tare.duration_s for arm in arms):
            response.message = "tare.duration_s is 0: there is no tare"
        else:
            self._session.request(request)
            response.success, response.message = True, f"{request.name.lower()}: decided in the next cycle"
        return response

    # -- references and goals ----------------------------------------------------------------------

    def _read_reference(self, message: Any) -> Any:
        """Use a reference, and return it: it is published again."""
        read = from_msgs.streamed_reference if governed_stream(self._params) else from_msgs.cartesian_reference
        self._session.set_reference(read(message))
        return message

    def _read_goal(self, message: Any) -> Any:
        """Use a goal, and return it: it is published again."""
        try:
            self._session.set_goal(from_msgs.pose_goal(message, self._params.trajectory.duration_s))
        except InputError as error:
            self._say(f"goal refused: {error}")
            raise
        return message
