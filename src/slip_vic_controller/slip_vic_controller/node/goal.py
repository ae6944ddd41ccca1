"""Goals to the outside: taken from the topic, and what becomes of them said in one line each."""

from __future__ import annotations

from typing import Any

from slip_core.errors import InputError
from slip_msgs_py.fast_io import Refusals
from slip_msgs_py.messages import from_msgs, to_msgs
from slip_msgs_py.qos import create_publisher, create_subscription
from slip_vic_controller.path.goals import GoalPhase, Refusal
from slip_vic_controller.session.session import ControllerSession

GOAL_DEPTH = 10
_PHASES = {
    GoalPhase.STOPS: "waits until the pad is at rest on the path that it is on",
    GoalPhase.PLANS: "is planned",
    GoalPhase.MOVES: "moves",
    GoalPhase.REACHED: "reached",
}


def refusal_text(goal: Any) -> str:
    """Return why the last refused goal was refused; GOAL."""
    why, value, limit = Refusal(int(goal.refusal)), float(goal.value), float(goal.limit)
    if why == Refusal.TOO_HEAVY:
        load = f"holding the weight needs {value:.3f} N, friction can carry {limit:.3f} N"
        return f"friction cannot carry the object where its path is at {float(goal.where):.3f} s: {load}"
    if why == Refusal.TOO_FAR:
        return f"it is {value:.4g} m away, at most {limit:g} are taken: check unit and frame"
    if why == Refusal.TOO_FAST:
        return f"it needs {value:.2f} m/s, the limit is {limit:.2f}: allow more time"
    if why == Refusal.TURNS_TOO_FAST:
        return f"it needs {value:.2f} rad/s, the limit is {limit:.2f}: allow more time"
    return "the law is not at work, see controller/mode"


class GoalInterface:
    """Takes goals and publishes what becomes of them where it changes.

    Args:
        node: owner of the topics.
        session: what takes goals.
        refusals: messages that could not be read, for the report.
        used: publisher of what was taken.
        duration_s: of goals that say none.
    """

    def __init__(self, node: Any, session: ControllerSession, refusals: Refusals, used: Any, duration_s: float) -> None:
        self._session, self._refusals, self._used, self._duration_s = session, refusals, used, duration_s
        self._topic = create_publisher(node, "controller/goal")
        self._last, self._last_refused = (0, 0), 0
        create_subscription(node, "goal", self._on_goal, depth=GOAL_DEPTH, reliable=False)

    def _on_goal(self, message: Any) -> None:
        try:
            goal = from_msgs.pose_goal(message, self._duration_s)
        except InputError as error:
            self._refusals.add("goal", error)
            self._say(f"goal refused: {error}")
            return
        self._used.publish(message)
        self._session.set_goal(goal)

    def publish(self) -> None:
        """Say what has changed in this cycle."""
        for line in self.changes():
            self._say(line)

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

    def _say(self, line: str) -> None:
        self._topic.publish(to_msgs.string(line))
