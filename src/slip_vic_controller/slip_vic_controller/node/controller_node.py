"""The controller node: joint states, wrench and slip velocity in, joint efforts out; a managed (lifecycle) node.

It controls one arm, or several that hold one object (parameter `arms`), whose topics and parameters are below their
names: one process, one cycle, one lifecycle and one request for all.

A thin shell around `ControllerSession`: topics, readiness and publication; no maths here.
"""

from __future__ import annotations

import functools
import time
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from rclpy._rclpy_pybind11 import RCLError
from rclpy.clock import Clock, ClockType
from rclpy.experimental import EventsExecutor
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn

from slip_core.arms import by_arm
from slip_core.errors import SlipVicError
from slip_core.files.urdf import on_base
from slip_core.files.urdf_file import arm_urdf
from slip_msgs_py.environment import emit
from slip_msgs_py.executor import Spinner
from slip_msgs_py.fast_io import Refusals, create_receiver
from slip_msgs_py.messages import to_msgs
from slip_msgs_py.node_shell import GuardedNode, set_up_process
from slip_msgs_py.qos import SAID_AGAIN_S, create_publisher, missing_endpoints
from slip_msgs_py.ros_params import OWN_TIME, allow_changes, declare_arms
from slip_vic_controller.config.controller import Controller
from slip_vic_controller.law.gains import gain_report
from slip_vic_controller.node.arm_topics import LOOK_S, STATE_DEPTH, ArmTopics
from slip_vic_controller.node.task_topics import TaskTopics
from slip_vic_controller.params.controller_params import ControllerParams
from slip_vic_controller.session.session import ControllerSession, Manifest, Results

WATCHDOG_S = 0.01
LINGER_S = 0.2  # for the answer of the transition that ends the process to reach who asked
_Transition = Callable[[Any, LifecycleState], TransitionCallbackReturn]


def _transition(callback: _Transition) -> _Transition:
    """Report a failure in a transition: rclpy only converts it to ERROR, without a message."""

    @functools.wraps(callback)
    def run(self: SlipVicController, state: LifecycleState) -> TransitionCallbackReturn:
        try:
            return callback(self, state)
        except Exception as error:
            self.on_failure("a transition", error)
            return TransitionCallbackReturn.ERROR

    return run


class SlipVicController(GuardedNode, LifecycleNode):
    """Answers every complete set of inputs with one effort command, stamped as the joint state it answers.

    Unconfigured it has no topics; inactive it answers with empty commands, which let the arm hold itself.
    """

    def __init__(self) -> None:
        super().__init__(
            "slip_vic_controller", automatically_declare_parameters_from_overrides=True, parameter_overrides=[*OWN_TIME]
        )
        self.params: Any = declare_arms(self, ControllerParams)
        common = self._common
        self._lockstep = common.mode == "lockstep"
        self._refusals = Refusals(self.get_logger().error)
        self._executor = EventsExecutor()
        self._spinner = Spinner(self._executor)
        self._endpoints: list[tuple[Callable[[Any], Any], Any]] = []
        self._failure: SlipVicError | None = None
        self._peers: Callable[[], list[str]] | None = None
        """Says which of its endpoints are not matched; None while the node has none."""
        self._finished_at: float | None = None
        self._ready = False
        self._service_change_state.callback = self.guarded(
            "service change_state", self._guarded(self._service_change_state)
        )
        self._arms: tuple[ArmTopics, ...] = ()
        self._task: TaskTopics | None = None
        allow_changes(self, self.params, self._on_change)
        if common.auto_activate:
            self.trigger_configure()
            if self._failure is not None:
                raise self._failure
            self.trigger_activate()
        self._executor.add_node(self)

    @property
    def _common(self) -> ControllerParams:
        """The parameters of the first arm, for those that are equal in all."""
        first: ControllerParams = next(iter(by_arm(self.params).values()))
        return first

    def _on_change(self, wanted: Any) -> None:
        """Take changed parameters; before `configure` any, later gains and payload only, which ramp."""
        if hasattr(self, "session"):
            self.session.retune(tuple(by_arm(wanted).values()))
        self.params = wanted

    # -- what must not end the node ----------------------------------------------------------------

    def on_failure(self, what: str, error: Exception) -> None:
        """Go to FAULT, with a command from the last good joint state, and say once of each kind what failed."""
        self.report_failure(what, error)
        if self._peers is None:
            return
        try:
            now_ns = time.monotonic_ns()
            self._publish(self.session.failed(now_ns), now_ns)
        except Exception as again:
            self.report_failure("the last resort", again)

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
        self._destroy_endpoints()
        return TransitionCallbackReturn.SUCCESS

    # -- lifecycle ---------------------------------------------------------------------------------

    @_transition
    def on_configure(self, _state: LifecycleState) -> TransitionCallbackReturn:
        """Read the arms, make the law, and create topics and services."""
        try:
            params: Mapping[str, ControllerParams] = by_arm(self.params)
            urdfs = {name: on_base(arm_urdf(of), of.base) for name, of in params.items()}
            self.session = ControllerSession(Controller(params, urdfs, lockstep=self._lockstep))
        except SlipVicError as error:
            self._failure = error
            if not self._common.auto_activate:
                self.get_logger().error(str(error))
            return TransitionCallbackReturn.FAILURE
        self._failure = None
        self.get_logger().info(f"configured in {self._common.mode}")
        if self._common.wrench.source == "none":
            self.get_logger().warning("no wrench sensor (wrench.source: none): the load is modelled")
        for name, arm in self.session.controller.arms.items():
            of_arm, judged = f"{name}: " if name else "", gain_report(arm.params).conditions
            admitted = ", ".join(f"{one.name} {one.limit:.3g}" for one in judged if one.parameter == "gains.stiffness")
            self.get_logger().info(f"{of_arm}the loop's delays admit at most {admitted} [N/m, N m/rad]")
            if not arm.wrist.holds:
                line = of_arm + arm.wrist.line
                self.get_logger().warning(line)
                emit("warning", text=line)
        self.session.set_active(False)
        before = set(self._entities())
        try:
            self._create_endpoints()
        finally:
            self._endpoints = [entity for entity in self._entities() if entity not in before]
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
        self.get_logger().info("shut down by a transition: the process ends")
        return TransitionCallbackReturn.SUCCESS

    def _destroy_endpoints(self) -> None:
        self._peers, self._ready = None, False
        self._arms, self._task = (), None
        for destroy, item in self._endpoints:
            destroy(item)
        self._endpoints = []

    def _create_endpoints(self) -> None:
        self._pub_ready = create_publisher(self, "controller/ready")
        status = create_publisher(self, "/diagnostics")
        self._arms = tuple(
            ArmTopics(self, params, arm, self._refusals, status, self._cycle)
            for params, arm in zip(by_arm(self.params).values(), self.session.arms, strict=True)
        )
        self._task = TaskTopics(self, self._common, self.session, self._refusals)
        inputs = [item for arm in self._arms for item in arm.inputs]
        if self._lockstep:
            inputs.append(
                create_receiver(
                    self, "lockstep_tick", Manifest.decode, self._on_tick, self._refusals,
                    depth=STATE_DEPTH[True], reliable=True,
                )
            )  # fmt: skip
        else:
            self.create_timer(WATCHDOG_S, self._on_watchdog, clock=Clock(clock_type=ClockType.STEADY_TIME))
        publishers = [*self._task.publishers, *(item for arm in self._arms for item in arm.publishers)]
        self._peers = functools.partial(missing_endpoints, self, publishers, inputs)

    def _say_no_command(self) -> None:
        for arm in self._arms:
            arm.say_no_command()

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

    # -- callbacks ---------------------------------------------------------------------------------

    def _on_tick(self, manifest: Manifest) -> None:
        self.session.add_manifest(manifest)
        self._cycle()

    # -- running -----------------------------------------------------------------------------------

    def _cycle(self) -> None:
        began_ns = time.monotonic_ns()
        self._publish(self.session.cycle(began_ns), began_ns)

    def _on_watchdog(self) -> None:
        now_ns = time.monotonic_ns()
        self._publish(self.session.watchdog(now_ns), now_ns)

    def _publish(self, results: Results, began_ns: int) -> None:
        if self._peers is None:
            return  # answers a message that was on its way to us when the topics were removed
        answered = [(arm, result) for arm, result in zip(self._arms, results, strict=True) if result is not None]
        for arm, result in answered:
            arm.command(result, began_ns)
        for arm, result in answered:
            arm.tell(result)
        if answered and self._task is not None:
            self._task.publish()

    def announce_when_ready(self) -> None:
        """Tell once that every peer is matched."""
        if self._ready or self._peers is None:
            return
        if missing := self._peers():
            self.get_logger().info(f"waits: {'; '.join(missing)}", throttle_duration_sec=SAID_AGAIN_S)
            return
        set_up_process()
        self._ready = True
        self._pub_ready.publish(to_msgs.string("controller"))
        self.get_logger().info("matched: every input has a publisher, and the efforts have a subscriber")

    def destroy_node(self) -> None:
        """Release everything; what the executor waits for it holds, and with it the participant."""
        self._executor.shutdown()
        super().destroy_node()
        self._state_machine.destroy_when_not_in_use()  # rclpy forgets it, and it holds the node

    def run(self, should_stop: Callable[[], bool]) -> None:
        """Run until asked to stop."""

        def goes_on() -> bool:
            self.announce_when_ready()
            over = self._finished_at is not None and time.monotonic() - self._finished_at > LINGER_S
            return not should_stop() and not over

        self._spinner.spin_while(self, goes_on, LOOK_S)
        if self._peers is None:
            return
        if self.session.active:
            self._say_no_command()
        missed = sum(arm.missed for arm in self._arms)
        emit("done", cycles=self.session.arms[0].cycles, missed=missed)
