"""A planner's joint trajectory from the topic: followed as references of the pad, what becomes of it in one line."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from slip_core.errors import InputError
from slip_msgs_py.fast_io import Refusals
from slip_msgs_py.messages import from_msgs, to_msgs
from slip_msgs_py.qos import create_publisher, create_subscription
from slip_vic_controller.config import governed_stream
from slip_vic_controller.params.node_params import ControllerNodeParams
from slip_vic_controller.path.joint_path import JointFeed, JointPath, Points, checked
from slip_vic_controller.session.cycle_result import CycleResult
from slip_vic_controller.session.session import ControllerSession

TRAJECTORY_DEPTH = 10
AHEAD, SAMPLES = 2.0, 12
"""Previews of the governor that wait at most, and references in each."""
MOST_POINTS = 2000


class JointTrajectoryInput:
    """Takes the trajectories of one arm.

    Args:
        node: owner of the topics.
        params: of the arm.
        session: what follows references.
        refusals: messages that could not be read, for the report.
        give: takes each reference as a message.
    """

    def __init__(
        self, node: Any, params: ControllerNodeParams, session: ControllerSession, refusals: Refusals,
        give: Callable[[Any], None],
    ) -> None:  # fmt: skip
        self._params, self._robot, self._refusals, self._give = params, session.controller.first.robot, refusals, give
        self._topic = create_publisher(node, "controller/goal")
        self._last: CycleResult | None = None
        self._feed: JointFeed | None = None
        create_subscription(node, "joint_trajectory", self._on_trajectory, depth=TRAJECTORY_DEPTH, reliable=False)

    def _on_trajectory(self, message: Any) -> None:
        try:
            self._feed = self._taken(message)
        except InputError as error:
            self._refusals.add("joint_trajectory", error)
            self._say(f"trajectory refused: {error}")
            return
        self._say(f"trajectory of {len(message.points)} points, {self._feed.path.duration:.3f} s, moves")

    def _taken(self, message: Any) -> JointFeed:
        last, what = self._last, "joint_trajectory"
        if last is None or not last.mode.follows:
            mode = last.mode.name if last else "no joint state"
            raise InputError(what, got=mode, expected="the law at work, see controller/mode")
        if self._feed is not None:
            raise InputError(what, got="another while one moves", expected="one at a time; ~/hold ends it")
        if len(message.points) > MOST_POINTS:
            raise InputError(what, got=f"{len(message.points)} points", expected=f"{MOST_POINTS} at most")
        path = JointPath(checked(Points(*from_msgs.joint_trajectory(message)), what), self._robot)
        path.check_motion(last.joint.position, self._robot.velocity_limit)
        preview_s = self._params.governor.preview_s if governed_stream(self._params) else 0.0
        return JointFeed(path, last.joint.stamp_ns, preview_s / SAMPLES, AHEAD * preview_s)

    def publish(self, result: CycleResult) -> None:
        """Give the reference that is due after a cycle."""
        self._last = result
        feed = self._feed
        if feed is None:
            return
        governor = result.record.governor
        if not result.mode.follows:
            self._feed = None
            self._say(f"trajectory ends on the way: {result.mode.name}, {result.reason}")
        elif (reference := feed.next(result.joint.stamp_ns, float(governor.stream_waits))) is not None:
            self._give(to_msgs.reference(reference))
        elif feed.ended and governor.stream_waits == 0.0:
            self._feed = None
            self._say("trajectory reached")

    def _say(self, line: str) -> None:
        self._topic.publish(to_msgs.string(line))
