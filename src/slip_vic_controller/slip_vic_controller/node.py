"""The controller node: joint states, wrench and slip velocity in, joint efforts out; a managed (lifecycle) node.

A thin shell around `ControllerSession`: topics, readiness and publication; no maths here.
"""

from __future__ import annotations

import functools
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

from rclpy._rclpy_pybind11 import RCLError
from rclpy.clock import Clock, ClockType
from rclpy.experimental import EventsExecutor
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn

from slip_core.errors import InputError, SlipVicError
from slip_core.files.resources import read_text
from slip_core.topics import contact_topic
from slip_core.types import DisplacementSample, JointSample, SlipSample, WrenchSample
from slip_msgs_py.endpoint_matching import EndpointMatching
from slip_msgs_py.events import Done, Ready, emit
from slip_msgs_py.executor import Spinner
from slip_msgs_py.fast_io import Refusals, create_receiver, create_sender
from slip_msgs_py.last_resort import Failures, LastResort, fails_loudly
from slip_msgs_py.messages import forms, from_msgs, to_msgs
from slip_msgs_py.node_main import memory_mib, run_node
from slip_msgs_py.qos import create_publisher, create_subscription
from slip_msgs_py.realtime import set_up_interpreter
from slip_msgs_py.ros_params import OWN_TIME, allow_changes, declare
from slip_vic_controller.config import governed_stream
from slip_vic_controller.goal_interface import GoalInterface
from slip_vic_controller.mode_interface import ModeInterface
from slip_vic_controller.parameters.node_params import ControllerNodeParams
from slip_vic_controller.publishing import DiagnosticsPublisher, StatePublisher, TimingPublisher
from slip_vic_controller.session import NO_EFFORT, Controller, ControllerSession, CycleResult, Manifest

STATE_DEPTH = {True: 100, False: 1}  # lockstep loses nothing; in real time only the newest state matters
SLIP_DEPTH = 100  # every sample counts for the observer
LOOK_S = 0.02
WATCHDOG_S = 0.01
_Transition = Callable[[Any, LifecycleState], TransitionCallbackReturn]
LINGER_S = 0.2  # for the answer of the transition that ends the process to reach who asked


def _transition(callback: _Transition) -> _Transition:
    """Let a failure in a transition be seen: rclpy makes an ERROR of it and says nothing."""

    @functools.wraps(callback)
    def run(self: SlipVicController, state: LifecycleState) -> TransitionCallbackReturn:
        try:
            return callback(self, state)
        except Exception as error:
            self._failed_transition = error
            self.on_failure("a transition", error)
            return TransitionCallbackReturn.ERROR

    return run


class SlipVicController(LastResort, LifecycleNode):
    """Answers every complete set of inputs with one effort command, stamped as the joint state it answers.

    Unconfigured it has no topics; inactive it answers with empty commands, which let the arm hold itself.
    """

    def __init__(self, executor: Any = None) -> None:
        super().__init__(
            "slip_vic_controller", automatically_declare_parameters_from_overrides=True, parameter_overrides=[*OWN_TIME]
        )
        self.params = declare(self, ControllerNodeParams)
        self._lockstep = self.params.mode == "lockstep"
        self._refusals = Refusals(self.get_logger().error)
        self._executor = executor or EventsExecutor()
        self._spinner = Spinner(self._executor)
        self._endpoints: list[tuple[Callable[[Any], Any], Any]] = []
        self._failure: SlipVicError | None = None
        self._peers: EndpointMatching | None = None
        self._finished_at: float | None = None
        self._ready = False
        self._failures = Failures(self.get_logger().error)
        self._failed_transition: Exception | None = None
        self._service_change_state.callback = self.answering("change_state", self._guarded(self._service_change_state))
        allow_changes(self, self.params, self._on_change)
        if self.params.auto_activate:
            self.trigger_configure()
            if self._failure is not None:
                raise self._failure
            self.trigger_activate()
        self._executor.add_node(self)

    def _on_change(self, wanted: ControllerNodeParams) -> None:
        """Take changed parameters; before `configure` any, later gains and payload only, which ramp."""
        if hasattr(self, "session"):
            self.session.retune(wanted)
        self.params = wanted

    # -- what must not end the node ----------------------------------------------------------------

    def on_failure(self, what: str, error: Exception) -> None:
        """Go to FAULT, with a command from the last good joint state, and say once of each kind what failed."""
        self._failures.add(what, error)
        if self._peers is None:
            return
        try:
            now_ns = time.monotonic_ns()
            result = self.session.failed(now_ns)
            if result is not None:
                self._publish(result, now_ns)
        except Exception as again:
            self._failures.add("the last resort", again)

    def _guarded(self, service: Any) -> Callable[[Any, Any], Any]:
        """Return rclpy's callback of `change_state`, answering False to what is no transition of the present state."""
        change = service.callback

        def answer(request: Any, response: Any) -> Any:
            try:
                return change(request, response)
            except RCLError:
                response.success = False
                return response

        return answer

    def on_error(self, _state: LifecycleState) -> TransitionCallbackReturn:
        """Become unconfigured after a transition that failed."""
        if self._peers is not None:
            self._destroy_endpoints()
        return TransitionCallbackReturn.SUCCESS

    # -- lifecycle ---------------------------------------------------------------------------------

    @_transition
    def on_configure(self, _state: LifecycleState) -> TransitionCallbackReturn:
        """Read the arm, make the law, and create topics and services."""
        try:
            urdf = self.params.robot_description or read_text(
                self.params.robot_description_file, "parameter robot_description_file"
            )
            self.session = ControllerSession(Controller(self.params, urdf, lockstep=self._lockstep))
        except SlipVicError as error:
            self._failure = error
            if not self.params.auto_activate:
                self.get_logger().error(str(error))
            return TransitionCallbackReturn.FAILURE
        self._failure = None
        self.session.set_active(False)
        self._create_endpoints()
        return TransitionCallbackReturn.SUCCESS

    @_transition
    def on_activate(self, _state: LifecycleState) -> TransitionCallbackReturn:
        """Give efforts as soon as every input has been seen."""
        self.session.set_active(True)
        return TransitionCallbackReturn.SUCCESS

    @_transition
    def on_deactivate(self, _state: LifecycleState) -> TransitionCallbackReturn:
        """Say once that there is no command any more, and give no effort from now on."""
        self.session.set_active(False)
        self._say_no_command()
        return TransitionCallbackReturn.SUCCESS

    @_transition
    def on_cleanup(self, _state: LifecycleState) -> TransitionCallbackReturn:
        """Remove topics and services, and forget everything."""
        self._destroy_endpoints()
        return TransitionCallbackReturn.SUCCESS

    @_transition
    def on_shutdown(self, _state: LifecycleState) -> TransitionCallbackReturn:
        """End: as `on_deactivate` and `on_cleanup`; then the process ends."""
        if self._peers is not None:
            self.session.set_active(False)
            self._say_no_command()
            self._destroy_endpoints()
        self._finished_at = time.monotonic()
        return TransitionCallbackReturn.SUCCESS

    def _say_no_command(self) -> None:
        newest = self.session.newest_joint
        if newest is not None and not self._lockstep:
            self._send_effort.send(newest.stamp_ns, newest.position, newest.velocity, NO_EFFORT)

    def _destroy_endpoints(self) -> None:
        self._peers, self._ready = None, False
        self._state_publisher.close()
        for destroy, item in self._endpoints:
            destroy(item)
        self._endpoints = []

    def _create_endpoints(self) -> None:
        before = set(self._entities())
        names, contacts = self.params.joint_names, self.session.contacts
        self._send_effort = create_sender(self, "effort_command", forms.joint_state(names))
        self._send_array = (
            create_sender(self, "effort_controller/commands", forms.numbers(len(names)))
            if self.params.publish_effort_array
            else None
        )
        self._send_grip = (
            create_sender(self, "grip_command", forms.number()) if self.params.grip.control == "follow" else None
        )
        numbers = 3 + 4 * contacts + 5 + self.session.controller.external
        self._send_ledger = create_sender(self, "controller/ledger", forms.whole_numbers(numbers))
        self._state_publisher = StatePublisher(self, self.params.control_period_s, in_background=not self._lockstep)
        self._pub_ready = create_publisher(self, "controller/ready")
        self._diagnostics = DiagnosticsPublisher(self, self.params.diagnostics.decimation)
        self._timing = None if self._lockstep else TimingPublisher(self, self.params, self._diagnostics.status)
        inputs = self._create_inputs()
        self._goals: GoalInterface | None = None
        if self.session.controller.external:
            self._used = create_publisher(self, "controller/reference_used")
        if self.session.reference_from_topic:
            create_subscription(self, "reference", self._on_reference, depth=10, reliable=False)
        elif self.session.controller.external:
            duration_s = self.params.trajectory.duration_s
            self._goals = GoalInterface(self, self.session, self._refusals, self._used, duration_s)
        self._mode = ModeInterface(self, self.session, self._refusals, self._diagnostics.status)
        self._mode.watch(self._send_effort.publisher.topic_name, inputs)
        if not self._lockstep:
            self.create_timer(WATCHDOG_S, self._on_watchdog, clock=Clock(clock_type=ClockType.STEADY_TIME))
        published = (*self._diagnostics.publishers, *(self._timing.publishers if self._timing else ()))
        self._peers = EndpointMatching(
            self,
            publishers=[
                (self._send_effort.publisher, self.params.expected_subscribers),
                (self._send_ledger.publisher, self.params.expected_subscribers - 1),
                (self._state_publisher.publisher, self.params.expected_subscribers - 1),
                *([(self._send_grip.publisher, self.params.expected_subscribers)] if self._send_grip else []),
                *([(self._used, self.params.expected_subscribers - 1)] if self.session.controller.external else []),
                *((publisher, self.params.expected_subscribers - 1) for publisher in published),
            ],
            subscriptions=inputs,
        )
        self._endpoints = [entity for entity in self._entities() if entity not in before]

    def _entities(self) -> Iterator[tuple[Callable[[Any], Any], Any]]:
        """Yield everything that this node has, and what destroys it."""
        for kind, destroy in (
            (self.publishers, self.destroy_publisher),
            (self.subscriptions, self.destroy_subscription),
            (self.services, self.destroy_service),
            (self.timers, self.destroy_timer),
        ):
            for item in kind:
                yield destroy, item

    def _create_inputs(self) -> list[Any]:
        depth = STATE_DEPTH[self._lockstep]

        def receive(name: str, fields: tuple[str, ...], learn: Any, deliver: Any, **options: Any) -> Any:
            return create_receiver(
                self, name, fields, learn, deliver, self._refusals, reliable=self._lockstep, **options
            )

        order = from_msgs.JointOrder(self.params.joint_names)
        fields = ("position", "velocity", "effort")
        learn: Any = partial(from_msgs.joint_samples, order=order)
        inputs = [receive("joint_states", fields, learn, self._on_joint_state, depth=depth)]
        for contact in range(self.session.contacts):
            for name, field, learn, deliver, keep in (
                ("wrench", "wrench", self._in_frame(WrenchSample, contact), self._on_wrench, depth),
                (*self._slip_input(contact), SLIP_DEPTH),
            ):
                actual = contact_topic(name, contact)
                inputs.append(receive(name, (field,), learn, partial(deliver, contact), depth=keep, actual_name=actual))
        if self._lockstep:
            inputs.append(
                receive("lockstep_tick", ("data",), lambda _: _manifest, self._on_tick, depth=depth, stamp="")
            )
        return inputs

    def _in_frame(self, make: Any, contact: int = -1) -> Any:
        """Return what checks the frame of a message: the own wrench's, or that of the pad."""
        frame = self.params.wrench.frame if contact == 0 else ""
        return partial(from_msgs.in_frame, frame=frame or self.params.ee_frame, make=make)

    def _slip_input(self, contact: int) -> tuple[str, str, Any, Any]:
        """Return topic, field, reader and callback of what the slip sensor says."""
        if self.params.slip_input == "displacement":
            return "slip_displacement", "pose", lambda _: from_msgs.displacement_sample, self._on_displacement
        if self.params.slip_input == "flag":
            return "slip_flag", "position", from_msgs.flag_samples, self._on_slip
        return "slip_velocity", "twist", self._in_frame(from_msgs.slip_sample), self._on_slip

    # -- callbacks ---------------------------------------------------------------------------------

    def _on_joint_state(self, sample: JointSample) -> None:
        self.session.add_joint(sample, self._now_ns())
        self._cycle()

    def _on_wrench(self, contact: int, sample: WrenchSample) -> None:
        self.session.add_wrench(contact, sample, self._now_ns())
        if self._lockstep:
            self._cycle()

    def _on_slip(self, contact: int, sample: SlipSample) -> None:
        self.session.add_slip(contact, sample, self._now_ns())
        if self._lockstep:
            self._cycle()

    def _on_displacement(self, contact: int, sample: DisplacementSample) -> None:
        self.session.add_displacement(contact, sample, self._now_ns())
        if self._lockstep:
            self._cycle()

    def _on_tick(self, manifest: Manifest) -> None:
        self.session.add_manifest(manifest)
        self._cycle()

    def _on_reference(self, message: Any) -> None:
        try:
            read = from_msgs.streamed_reference if governed_stream(self.params) else from_msgs.cartesian_reference
            reference = read(message)
        except InputError as error:
            self._refusals.add("reference", error)
            return
        self._used.publish(message)
        self.session.set_reference(reference)

    # -- running -----------------------------------------------------------------------------------

    def _now_ns(self) -> int | None:
        """Return the controller's clock: steady time; in lockstep None, there it is the joint state's stamp."""
        return None if self._lockstep else time.monotonic_ns()

    def _cycle(self) -> None:
        began_ns = time.monotonic_ns()
        result = self.session.cycle(began_ns)
        if result is not None:
            self._publish(result, began_ns)

    def _on_watchdog(self) -> None:
        now_ns = time.monotonic_ns()
        result = self.session.watchdog(now_ns)
        if result is not None:
            self._publish(result, now_ns)

    def _publish(self, result: CycleResult, began_ns: int) -> None:
        if self._peers is None:
            return  # answers a message that was on its way to us when the topics were removed
        command, joint = result.command, result.joint
        if self._send_grip is not None:
            self._send_grip.send(command.stamp_ns, (result.grip,))
        # Positions and velocities beside the effort, so that viewers draw the robot where it is.
        self._send_effort.send(command.stamp_ns, joint.position, joint.velocity, command.effort)
        if self._timing is not None:
            self._timing.publish(began_ns, result.ledger)
        if self._send_array is not None and len(command.effort):
            self._send_array.send(command.stamp_ns, command.effort)
        self._send_ledger.send(joint.stamp_ns, (*result.ledger, *result.decision))
        self._state_publisher.publish(self.session)
        self._mode.publish(result)
        if self._goals is not None:
            self._goals.publish()
        if len(command.effort):
            self._diagnostics.publish(result)

    def announce_when_ready(self) -> None:
        """Tell once that every peer is matched."""
        if not self._ready and self._peers is not None and not self._peers.missing():
            set_up_interpreter()
            self._ready = True
            self._pub_ready.publish(to_msgs.string("controller"))
            emit(Ready())

    def run(self, should_stop: Callable[[], bool]) -> None:
        """Run until asked to stop."""

        def goes_on() -> bool:
            if self._failed_transition is not None and fails_loudly():
                raise self._failed_transition
            self.announce_when_ready()
            over = self._finished_at is not None and time.monotonic() - self._finished_at > LINGER_S
            return not should_stop() and not over

        self._spinner.spin_while(self, goes_on, LOOK_S)
        if self._peers is None:
            return
        if self.session.active:
            self._say_no_command()
        missed = self._timing.missed if self._timing is not None else 0
        emit(Done({"cycles": self.session.cycles, "missed": missed, "memory_mib": memory_mib()}))


def _manifest(_stamp_ns: int, numbers: Any) -> Manifest:
    return Manifest.decode(numbers.tolist())


def main() -> int:
    """Entry point of ``slip_vic_controller_node``."""
    return run_node(SlipVicController)


if __name__ == "__main__":
    sys.exit(main())
