"""The bridge node: publishes what the simulated arm and its sensors measure, applies the efforts that come back.

A thin shell around `slip_sim_bridge.session`: topics, clock, lockstep and pacing; no physics here.
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable
from dataclasses import asdict
from functools import partial
from typing import Any

import numpy as np
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from std_srvs.srv import Trigger

from slip_core.arms import by_arm, prefix_of
from slip_core.errors import InputError, ProtocolError
from slip_core.files.urdf import on_base
from slip_core.files.urdf_file import arm_urdf
from slip_core.stamps import split_ns
from slip_core.types import Incident, JointCommand
from slip_msgs_py.environment import emit
from slip_msgs_py.executor import Spinner
from slip_msgs_py.fast_io import Refusals, create_sender
from slip_msgs_py.messages import to_msgs
from slip_msgs_py.node_shell import GuardedNode, set_up_process
from slip_msgs_py.qos import SAID_AGAIN_S, create_publisher, create_subscription, missing_endpoints
from slip_msgs_py.ros_params import OWN_TIME, allow_changes, declare_arms
from slip_sim_bridge.arm_topics import ArmTopics
from slip_sim_bridge.pacing import Pacer
from slip_sim_bridge.params import BridgeParams, object_urdf
from slip_sim_bridge.session import BridgeSession, TickOutputs

PROGRESS_EVERY_S = 0.1
STOP_CHECK_S = 0.03
FIRST_TICK_S = 0.05  # real time: how long the first state waits for its command before it is sent again
LATENCIES_KEPT = 100_000


class SlipSimBridge(GuardedNode, Node):
    """Publishes joint states, wrench and slip of each arm, truth and clock; waits for or samples effort commands.

    Topics and parameters of an only arm have no prefix; those of several, which `arms` names, are below their names.
    A tick that fails ends the run; a callback that fails is reported, and the run ends with its failure.
    """

    def __init__(self) -> None:
        super().__init__(
            "slip_sim_bridge", automatically_declare_parameters_from_overrides=True, parameter_overrides=[*OWN_TIME]
        )
        self.params: Any = declare_arms(self, BridgeParams)
        self._params: dict[str, BridgeParams] = by_arm(self.params)
        self.session = BridgeSession(self._params, {name: arm_urdf(arm) for name, arm in self._params.items()})
        allow_changes(self, self.params, self._on_change)
        self._common = next(iter(self._params.values()))
        self._lockstep = self._common.mode == "lockstep"
        self._stamp_ns = -1
        self._outputs: TickOutputs
        self._over = False
        self._failure: Exception | None = None
        self._pacer: Pacer | None = None
        self._latencies = deque[float](maxlen=LATENCIES_KEPT)
        self._refusals = Refusals(self.get_logger().error)
        self._lost: Incident | None = None
        self._controller_ready = False
        self._executor = EventsExecutor()
        self._spinner = Spinner(self._executor)
        for note in self.session.simulation.notes:
            self.get_logger().warning(note)
        self._create_endpoints()
        self._executor.add_node(self)

    def _on_change(self, wanted: Any) -> None:
        self.session.change(tuple(by_arm(wanted).values()))
        self.params = wanted

    def _create_endpoints(self) -> None:
        common = self._common
        placed = {name: on_base(arm_urdf(arm), arm.base) for name, arm in self._params.items()}
        self._arms = tuple(
            ArmTopics(
                self, prefix_of(name), arm, placed[name], self._refusals, partial(self._on_command, index),
                partial(self._on_grip_command, index),
            )
            for index, (name, arm) in enumerate(self._params.items())
        )  # fmt: skip
        self._send_object = create_sender(self, "object_state", to_msgs.ODOMETRY)
        self._send_clock = create_sender(self, "/clock", to_msgs.CLOCK)
        self._send_tick = create_sender(self, "lockstep_tick", to_msgs.WHOLE_NUMBERS) if self._lockstep else None
        self._pub_object = create_publisher(self, "object_description")
        self._pub_object.publish(to_msgs.string(object_urdf(common)))
        self._commands: list[JointCommand | None] = [None] * len(self._arms)
        self._answers, self._grips = [0] * len(self._arms), [0] * len(self._arms)
        create_subscription(self, "controller/ready", self._on_ready, depth=1, reliable=True)
        self.create_service(Trigger, "~/reset", self._on_reset)

    def on_failure(self, what: str, error: Exception) -> None:
        """Say once of each kind what failed, and continue; where commands stay away for that, the arm is held."""
        self.report_failure(what, error)
        self._failure = self._failure or error

    # -- callbacks ---------------------------------------------------------------------------------

    def _on_ready(self, _message: Any) -> None:
        self._controller_ready = True

    def _on_command(self, arm: int, command: JointCommand) -> None:
        self._commands[arm] = command
        if command.stamp_ns != self._stamp_ns:
            return
        self._answers[arm] += 1
        if self._lockstep:
            self._finish_if_answered()
        elif self._pacer is not None and len(command.numbers) and self._answered():
            self._pacer.answered(time.monotonic())

    def _on_grip_command(self, arm: int, message: Any) -> None:
        try:
            self.session.simulation.set_grip_force(arm, float(message.data))
        except InputError as error:
            self._refusals.add("grip_command", error)
        self._grips[arm] += 1
        if self._lockstep:
            self._finish_if_answered()

    def _answered(self) -> bool:
        """Whether the command of every arm is there."""
        return all(each is not None and each.stamp_ns == self._stamp_ns for each in self._commands)

    def _finish_if_answered(self) -> None:
        """Finish a lockstep tick when all its commands are there; a grip has no stamp: one belongs to each effort."""
        each = zip(self._arms, self._answers, self._grips, strict=True)
        if self._answered() and all(answers == grips for arm, answers, grips in each if arm.follows):
            self._finish_lockstep_tick()

    def _on_reset(self, _request: Any, response: Any) -> Any:
        self.session.request_reset()
        response.success, response.message = True, "reset before the next tick; time, pushes and sensor faults stay"
        return response

    # -- running -----------------------------------------------------------------------------------

    def destroy_node(self) -> None:
        """Release everything; what the executor waits for it holds, and with it the participant."""
        self._executor.shutdown()
        super().destroy_node()

    def run(self, should_stop: Callable[[], bool]) -> None:
        """Run until the duration is over or the process is asked to stop."""
        if not self._wait_for_peers(should_stop):
            return
        set_up_process()
        self.get_logger().info("matched: time runs")
        self._started_wall = time.monotonic()
        self._progress_wall = 0.0
        if self._lockstep:
            self._run_lockstep(should_stop)
        else:
            self._run_realtime(should_stop)
        if self._failure is not None and not should_stop():
            raise self._failure
        why = "stopped" if should_stop() else "duration_s is over"
        self.get_logger().info(f"ends after {self.session.elapsed_s:.3f} s: {why}")
        wall = time.monotonic() - self._started_wall
        results = {"ticks": self.session.tick, "sim_time_s": self.session.elapsed_s, "wall_time_s": wall}
        emit("done", **results, **self._timing())

    def _timing(self) -> dict[str, object]:
        """Return how a real-time run went, for the launcher."""
        if self._pacer is None:
            return {}
        measured = [latency for latency in self._latencies if math.isfinite(latency)] or [math.nan]
        p50, p99, p999, most = np.percentile(measured, (50.0, 99.0, 99.9, 100.0)).tolist()
        return {
            "fresh_share": self._pacer.fresh_share,
            "overruns": self._pacer.overruns,
            "latency_p50_s": p50,
            "latency_p99_s": p99,
            "latency_p999_s": p999,
            "latency_max_s": most,
        }

    def _wait_for_peers(self, should_stop: Callable[[], bool]) -> bool:
        subscribers, recorders = self._common.expected_subscribers, self._common.expected_subscribers - 1
        publishers = [
            *((publisher, max(1, subscribers)) for arm in self._arms for publisher in arm.state_publishers),
            *((sender.publisher, recorders) for sender in (self._send_object, self._send_clock)),
        ]
        missing = partial(missing_endpoints, self, publishers, [arm.sub_command for arm in self._arms])
        self.get_logger().info(f"started in {self._common.mode}" + ", waits for the controller" * bool(subscribers))
        if not self._lockstep and not subscribers:
            return True
        timeout_s = self._common.peer_timeout_s
        deadline = time.monotonic() + timeout_s
        while lacking := [*["controller is not ready"] * (subscribers and not self._controller_ready), *missing()]:
            if should_stop():
                return False
            self.get_logger().info(f"waits: {'; '.join(lacking)}", throttle_duration_sec=SAID_AGAIN_S)
            if time.monotonic() > deadline:
                raise ProtocolError(f"waited {timeout_s:g} s: {'; '.join(lacking)}")
            self._executor.spin_once(0.01)
        return True

    def _run_lockstep(self, should_stop: Callable[[], bool]) -> None:
        """Publish the first state; from then on every command brings the next one, in its callback."""
        if self.session.finished:
            return
        self._begin_lockstep_tick()

        def too_late() -> bool:
            return not self._over and time.monotonic() - self._began_wall > self._common.lockstep_timeout_s

        self._spinner.spin_while(self, lambda: not should_stop() and not self._over and not too_late(), STOP_CHECK_S)
        if too_late() and not should_stop():
            raise self._failure or ProtocolError(self._missing_command())

    def _begin_lockstep_tick(self) -> None:
        outputs = self.session.observe()
        self._publish(outputs)
        self._publish_truth(outputs)
        self._began_wall = time.monotonic()

    def _finish_lockstep_tick(self) -> None:
        try:
            self.session.advance(self._commands)
            if self.session.finished:
                self._over = True
            else:
                self._begin_lockstep_tick()
        except Exception as error:
            self._failure, self._over = error, True
        self._report_progress()
        if self._over:
            self._stamp_ns = -1
            self._spinner.enough()

    def _missing_command(self) -> str:
        late = next(
            index for index, each in enumerate(self._commands) if each is None or each.stamp_ns != self._stamp_ns
        )
        command, topic = self._commands[late], self._arms[late].command_topic
        last = "none" if command is None else f"stamp {command.stamp_ns} ns"
        refused = self._refusals.last(topic.rpartition("/")[2])
        return (
            f"lockstep: no {topic} for tick {self.session.tick} (stamp {self._stamp_ns} ns) within "
            f"{self._common.lockstep_timeout_s:g} s; last command: {last}" + (f"; {refused}" if refused else "")
        )

    def _run_realtime(self, should_stop: Callable[[], bool]) -> None:
        if not self._first_tick(should_stop):
            return
        pacer, clock = self._pacer, time.monotonic
        while pacer is not None:
            truth_is_due = True  # in the time that is left once the command is there
            while (left := pacer.left(clock())) > 0.0 and not should_stop():
                if truth_is_due and pacer.is_answered:
                    truth_is_due = False
                    self._publish_truth(self._outputs)
                else:
                    self._spinner.turn(left)
            if should_stop():
                return
            if truth_is_due:
                self._publish_truth(self._outputs)
            self._latencies.append(pacer.end(clock()))
            self.session.advance(self._commands)
            if self.session.finished:
                return
            self._outputs = self.session.observe()
            pacer.published(clock())
            self._publish(self._outputs)
            self._report_progress()

    def _first_tick(self, should_stop: Callable[[], bool]) -> bool:
        """Publish tick 0 with the present time until its command arrives: then all nodes are compiled and connected.

        Return whether the run is to continue.
        """
        deadline = time.monotonic() + self._common.peer_timeout_s
        while not should_stop():
            self.session.start_at(time.time_ns())
            self._outputs = self.session.observe()
            self._pacer = Pacer(self._common.control_period_s, time.monotonic())
            self._pacer.published(time.monotonic())
            self._publish(self._outputs)
            if not self._common.expected_subscribers:
                return True
            attempt = time.monotonic() + FIRST_TICK_S
            while not self._pacer.is_answered and (left := attempt - time.monotonic()) > 0.0:
                self._spinner.turn(left)
            if self._pacer.is_answered:
                self._started_wall = time.monotonic()
                return True
            if time.monotonic() > deadline:
                raise ProtocolError(f"no effort_command for the first state within {self._common.peer_timeout_s:g} s")
        return False

    def _publish(self, outputs: TickOutputs) -> None:
        """Send what the controller waits for; in lockstep the list of a tick's samples comes after them."""
        self._stamp_ns = outputs.stamp_ns
        self._tell_loss()
        for arm, measured in zip(self._arms, outputs.arms, strict=True):
            arm.publish(measured)
        if self._send_tick is not None:
            self._send_tick.send(outputs.stamp_ns, (outputs.tick, *split_ns(outputs.stamp_ns), *outputs.counts))

    def _tell_loss(self) -> None:
        """Say once that the object is lost; after a reset it can be lost again."""
        lost, before = self.session.lost, self._lost
        self._lost = lost
        if lost is not None and before is None:
            emit("incident", **asdict(lost))
            self.get_logger().warning(str(lost))

    def _publish_truth(self, outputs: TickOutputs) -> None:
        """Send what the controller does not wait for."""
        stamp_ns, truth = outputs.stamp_ns, outputs.truth
        self._send_clock.send(stamp_ns)
        self._send_object.send(
            stamp_ns, *to_msgs.odometry_numbers(truth.object_position, truth.object_rotation, truth.object_twist)
        )
        radius, several = self._common.friction.torsional_radius, len(self._arms) > 1
        internal = outputs.internal_wrenches(radius) if several else [None]
        for arm, measured, part in zip(self._arms, outputs.arms, internal, strict=True):
            arm.publish_truth(stamp_ns, measured, part)

    def _report_progress(self) -> None:
        now = time.monotonic()
        if now - self._progress_wall > PROGRESS_EVERY_S:
            self._progress_wall = now
            emit("progress", sim_time_s=self.session.elapsed_s, ticks=self.session.tick)
