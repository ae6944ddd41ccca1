"""Topics of what all arms do together: references, joint trajectories or goals in, what becomes of them out."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from slip_core.errors import InputError
from slip_msgs_py.fast_io import Refusals
from slip_msgs_py.messages import from_msgs
from slip_msgs_py.qos import create_publisher, create_subscription
from slip_vic_controller.config import governed_stream
from slip_vic_controller.node.goal import GoalInterface
from slip_vic_controller.params.node_params import ControllerNodeParams
from slip_vic_controller.session.cycle_result import CycleResult
from slip_vic_controller.session.session import ControllerSession

if TYPE_CHECKING:
    from slip_vic_controller.node.joint_trajectory import JointTrajectoryInput

REFERENCE_DEPTH = 10


class TaskTopics:
    """References or goals of the pad of a single arm; of several arms those of the object's centre of mass.

    Args:
        node: owner of the topics.
        params: of the first arm.
        session: what takes references and goals.
        refusals: messages that could not be read, for the report.
    """

    def __init__(self, node: Any, params: ControllerNodeParams, session: ControllerSession, refusals: Refusals) -> None:
        self._params, self._session, self._refusals = params, session, refusals
        self._goals: GoalInterface | None = None
        self._trajectories: JointTrajectoryInput | None = None
        self._used = create_publisher(node, "controller/reference_used") if session.controller.external else None
        if session.reference_from_topic:
            create_subscription(node, "reference", self._on_reference, depth=REFERENCE_DEPTH, reliable=False)
            if len(session.arms) == 1:
                from slip_vic_controller.node.joint_trajectory import JointTrajectoryInput  # splines: 14 MiB

                self._trajectories = JointTrajectoryInput(node, params, session, refusals, self._on_reference)
        elif session.controller.external:
            self._goals = GoalInterface(node, session, refusals, self._used, params.trajectory.duration_s)

    @property
    def publishers(self) -> list[tuple[Any, int]]:
        """Publishers, and how many subscribers each must have before the node is ready."""
        return [] if self._used is None else [(self._used, self._params.expected_subscribers - 1)]

    def publish(self, result: CycleResult) -> None:
        """Publish what has changed in this cycle; result: of the first arm that was answered."""
        if self._trajectories is not None:
            self._trajectories.publish(result)
        if self._goals is not None:
            self._goals.publish()

    def _on_reference(self, message: Any) -> None:
        assert self._used is not None
        try:
            read = from_msgs.streamed_reference if governed_stream(self._params) else from_msgs.cartesian_reference
            self._session.set_reference(read(message))
        except InputError as error:
            self._refusals.add("reference", error)
            return
        self._used.publish(message)
