"""One trial in process: bridge, controller and the topics between them in virtual real time."""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from functools import cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slip_core.arrays import matrix_from_quat_xyzw
from slip_core.errors import InputError
from slip_core.params import build, flatten
from slip_core.types import CartesianReference, JointCommand, JointSample, PoseGoal
from slip_sim_bridge.params import BridgeParams
from slip_sim_bridge.plant import DivergenceError
from slip_sim_bridge.session import BridgeSession
from slip_vic.scenarios.scenario import Law, Scenario
from slip_vic_controller.config.controller import ArmController, Controller
from slip_vic_controller.node.arm_topics import STATE_DEPTH
from slip_vic_controller.params.controller_params import ControllerParams
from slip_vic_controller.safety.conditions import Mode, Request
from slip_vic_controller.safety.limits import HELD, LONGEST_STEP_S
from slip_vic_controller.safety.validation import ACCEPT_AFTER
from slip_vic_controller.session.cycle_result import CycleResult
from slip_vic_controller.session.session import RETUNABLE
from slip_vic_controller.sizes import MAX_JOINTS
from test.campaigns.faults.channel import DAMAGED, Channel, Delivery
from test.campaigns.faults.monitors import (
    LOST_M,
    NS,
    REST_AFTER_S,
    AnswerMonitor,
    CommandMonitor,
    JointMonitor,
    Promise,
    SafeStateMonitor,
    promised_ages,
)
from test.campaigns.faults.plan import (
    BRIDGE,
    CONTROLLER,
    EFFORT,
    IDEAL,
    JOINT,
    PERIOD_S,
    SLIP,
    TOPICS,
    WRENCH,
    Fault,
    Plan,
    Verdict,
    change_factor,
    realtime_scenario,
    retuned,
)
from test.campaigns.faults.wire import Wire
from test.support.one_arm import OneArm, one_arm

DURATION_S = 1.8
START_NS = 1_000_000_000_000  # of the wall clock
STEADY_NS = 5_000_000_000
RESTART_S = 0.2  # time from the start of a node to its first message
NewSession = Callable[[Controller, Scenario], OneArm]
GOAL_TICKS, GOAL_STEP, AMPLITUDE = 100, np.array((0.0, 0.06, 0.02)), 0.02  # of goals [m] and references [m]


@cache
def prepared(
    name: str, observer: bool, kind: Law, sensor: str = IDEAL, drive: str = IDEAL, task: str = "path",
    wrench: str = "sensor",
) -> tuple[Scenario, Controller]:  # fmt: skip
    """Return a scenario as the campaign runs it, and its law; the ideal sensor leaves the gains what they are."""
    assignments = [f"controller.trajectory.duration_s={0.75 * DURATION_S}", f"controller.wrench.source={wrench}"]
    if name == "vertical_plane":
        # What friction cannot carry is to be met: more than just enough grip at the start.
        assignments += ["controller.trajectory.displacement=[0.0, 0.1, 0.05]"]
    if task != "path":
        assignments.append(f"controller.trajectory.kind={task}")
    scenario = realtime_scenario(name, observer, kind, sensor, assignments, drive)
    return scenario, one_arm(scenario.controller, scenario.urdf, lockstep=False)


def with_joints(params: BridgeParams, joints: tuple[float, float, float], seed: int) -> BridgeParams:
    """Return the bridge's parameters with a seed; joints: noise, friction and offset beyond those of the drive."""
    noise, friction, offset = joints
    drive, sensors, n = params.drive, params.sensors, len(params.joint_names)
    signs = np.random.default_rng(seed).choice((-1.0, 1.0), n)
    update = {"coulomb": tuple((friction + np.array(drive.of_joints("coulomb", n))).tolist())}
    if drive.interface == "effort":
        update["offset"] = tuple((offset * signs + np.array(drive.of_joints("offset", n))).tolist())
    joint = sensors.joint.model_copy(update={"noise_velocity": sensors.joint.noise_velocity + noise})
    changed: dict[str, Any] = {"seed": seed}
    if any(joints):
        changed["drive"] = drive.model_copy(update=update)
        changed["sensors"] = sensors.model_copy(update={"joint": joint})
    return params.model_copy(update=changed)


class User:
    """Sends goals or references, good ones and wild ones.

    Args:
        task: "path", "goal" or "topic".
        rng: of the wild ones.
    """

    def __init__(self, task: str, rng: np.random.Generator) -> None:
        self._task, self._rng = task, rng
        self._start: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None

    def act(self, controller: OneArm, t: float, pad: Any, wild: Fault | None) -> None:
        """Send what is due at time t [s]; pad: position [m] and attitude of the pad {w}."""
        if self._task == "path":
            return
        self._start = self._start or (pad[0].copy(), pad[1].copy())
        with suppress(InputError):  # refused is right, too
            if wild is not None:
                self._send_wild(controller)
            elif self._task == "topic":
                controller.set_reference(self._reference(t))
            elif round(t / PERIOD_S) % GOAL_TICKS == GOAL_TICKS // 2:
                there = self._start[0] + (round(t / PERIOD_S) // GOAL_TICKS % 2) * GOAL_STEP
                controller.set_goal(PoseGoal(there, self._start[1], 0.5))

    def _reference(self, t: float) -> CartesianReference:
        """Return a slow oscillation about where the pad began."""
        assert self._start is not None
        twist, acceleration, w = np.zeros(6), np.zeros(6), 4.0
        twist[1], acceleration[1] = AMPLITUDE * w * np.sin(w * t), AMPLITUDE * w * w * np.cos(w * t)
        position = self._start[0] + np.array((0.0, AMPLITUDE * (1.0 - np.cos(w * t)), 0.0))
        return CartesianReference(position, self._start[1], twist, acceleration)

    def _send_wild(self, controller: OneArm) -> None:
        """Send a goal or reference that nobody should: near to far, at once to never, still to absurdly fast."""
        assert self._start is not None
        rng = self._rng
        there = self._start[0] + rng.normal(size=3) * 10.0 ** rng.uniform(-4.0, 1.5)
        turn = matrix_from_quat_xyzw(rng.normal(size=4))
        if self._task == "goal":
            controller.set_goal(PoseGoal(there, turn, float(10.0 ** rng.uniform(-9.0, 9.0))))
            return
        twist, acceleration = (rng.normal(size=6) * 10.0 ** rng.uniform(-3.0, 4.0) for _ in range(2))
        if rng.uniform() < 0.1:
            twist[int(rng.integers(6))] = rng.choice((np.nan, np.inf, 1e308))
        controller.set_reference(CartesianReference(there, turn, twist, acceleration))


class Trial:
    """Runs one plan.

    Args:
        plan: what happens.
        new: makes the session that controls.
    """

    def __init__(self, plan: Plan, new: NewSession | None = None) -> None:
        self._plan = plan
        self._new: NewSession = new or (lambda law, _: OneArm(law))
        self.scenario, self._law = prepared(
            plan.scenario, plan.observer, plan.controller, plan.sensor, plan.drive, plan.task, plan.wrench
        )  # fmt: skip
        noise = np.random.default_rng(np.random.SeedSequence(plan.seed, spawn_key=(plan.trial, 1)))
        self._bridge_params = with_joints(self.scenario.bridge, plan.joints, int(noise.integers(2**31)))
        controller, safety = self.scenario.controller, self.scenario.controller.safety
        self._channels = {
            name: Channel(
                Wire(name, controller.joint_names, controller.ee_frame, plan.interface),
                tuple(fault for fault in plan.faults if fault.target == name),
                np.random.default_rng(np.random.SeedSequence(plan.seed, spawn_key=(plan.trial, 2 + i))),
            )
            for i, name in enumerate(TOPICS)
        }
        self._commands = CommandMonitor(promise_of(self._law.first, PERIOD_S))
        slope = self.scenario.bridge.effort_rate if plan.interface == "effort" else np.inf  # a drive's own loop steps
        self._joints = JointMonitor(slope * PERIOD_S, REST_AFTER_S)
        # The same for every sensor: a slow one must be fast enough for it, its latency included.
        ages = promised_ages(
            safety,
            observer=plan.observer,
            needs_slip=plan.controller != "classical",
            has_wrench=plan.wrench == "sensor",
            joints_spoilt=any(fault.target == JOINT and fault.kind in DAMAGED for fault in plan.faults),
        )
        limits, unheeded = ({name: age_s + PERIOD_S for name, age_s in of.items()} for of in ages)
        self._work = AnswerMonitor(ACCEPT_AFTER + 1)
        self._user = User(
            plan.task, np.random.default_rng(np.random.SeedSequence(plan.seed, spawn_key=(plan.trial, 10)))
        )
        self._safe = SafeStateMonitor(limits, self.scenario.controller.safety.inputs.age_s, unheeded)
        self._stops = [fault for fault in plan.faults if fault.kind == "stop"]
        self._clock_stops = [fault for fault in plan.faults if fault.kind == "clock_stop"]
        self._modes: Counter[str] = Counter()
        self._done: set[Fault] = set()
        self._controller_back = self._bridge_back = 0.0
        self._held = True  # by the bridge
        self._clock_offset_ns = 0
        self._newest_command: JointCommand | None = None
        self._recovered: float | None = None
        self._stand_still_ns: int | None = None
        self._newest_stamp_ns = self._lost = 0

    def run(self) -> Verdict:
        """Run to the end; what the code raises is a violation too."""
        try:
            self._run()
        except DivergenceError as error:
            self._commands.violations.append(f"the arm's state is not physical any more: {error}")
        except Exception as error:  # whatever it is, it must not happen
            self._commands.violations.append(f"{type(error).__name__}: {error}")
        violations = self._commands.violations + self._joints.violations + self._safe.violations + self._work.violations
        return Verdict(
            self._plan.trial, tuple(fault.name for fault in self._plan.faults), tuple(violations), self._recovered,
            self._commands.commands, self._modes, self._lost, self._plan.setting,
        )  # fmt: skip

    def _run(self) -> None:
        self._bridge = self._new_bridge(self._bridge_params, START_NS)
        self._controller: OneArm | None = self._new(self._law, self.scenario)
        last_end = max(fault.end_s for fault in self._plan.faults)
        for tick in range(round(DURATION_S / PERIOD_S)):
            t = tick * PERIOD_S
            self._t, self._now_ns = t, STEADY_NS + round(t * 1e9)
            self._nodes(t)
            if self._stopped(BRIDGE, t):
                self._safe.stood_still(PERIOD_S, (WRENCH, SLIP))
            if self._bridge_runs(t):
                self._observe(t)
            if self._controller is None:
                for name in (JOINT, WRENCH, SLIP):  # what is sent while nobody is there is gone
                    self._channels[name].arrivals(self._now_ns)
            elif not self._stopped(CONTROLLER, t):
                self._control(t)
            for delivery in self._channels[EFFORT].arrivals(self._now_ns):
                self._newest_command = delivery.sample
            if self._bridge_runs(t):
                self._bridge.advance([self._shifted(self._newest_command)])
                held = self._bridge.simulation.arms[0].posture is not None
                if held != self._held:
                    self._held = held
                    self._joints.begin_again()  # another one holds the arm from now on, and begins from its motion
                if np.abs(self._bridge.simulation.observe(0).truth.slip_displacement[:3]).max() > LOST_M:
                    self._lost += 1
                    self._restart_bridge(t + PERIOD_S + RESTART_S)
            follows = self._controller is not None and self._controller.mode.follows
            if t >= last_end and follows and self._recovered is None:
                self._recovered = t - last_end
            if not follows:
                self._recovered = None if t < last_end else self._recovered

    # -- nodes -------------------------------------------------------------------------------------

    def _stopped(self, node: str, t: float) -> bool:
        return bool(self._stops) and any(fault.target == node and fault.at(t) for fault in self._stops)

    def _bridge_runs(self, t: float) -> bool:
        return t >= self._bridge_back and not self._stopped(BRIDGE, t)

    def _nodes(self, t: float) -> None:
        for fault in self._plan.faults:
            if fault in self._done or t < fault.start_s:
                continue
            if fault.kind == "kill" and fault.target == CONTROLLER:
                self._done.add(fault)
                self._controller, self._controller_back = None, t + fault.duration_s + RESTART_S
                self._commands.restarted()
                self._work.begin_again()
            elif fault.kind == "kill":
                self._done.add(fault)
                self._restart_bridge(t + fault.duration_s + RESTART_S)
            elif fault.kind in ("reset", "clock_jump", "gains", "parameter", "request", "grip"):
                self._happen(fault)
        if self._controller is None and t >= self._controller_back:
            self._controller = self._new(self._law, self.scenario)

    def _happen(self, fault: Fault) -> None:
        """What happens at one moment, or begins at it."""
        self._done.add(fault)
        if fault.kind == "reset":
            self._bridge.request_reset()
            self._joints.restarted()
        elif fault.kind == "clock_jump":
            self._work.begin_again()
            sign = 1 if fault.size > 0.5 else -1
            self._clock_offset_ns += sign * round(1e9 * 10.0 ** (4.0 * abs(2.0 * fault.size - 1.0) - 2.0))
        elif fault.kind == "grip":
            self._bridge.simulation.set_grip_force(0, self.scenario.bridge.grip.force * 2.0 * fault.size**3)
        elif fault.kind == "request" and self._controller is not None:
            self._controller.request(Request(1 + int(3 * fault.size)))
        elif fault.kind in ("gains", "parameter") and self._controller is not None:
            self._retune(self._controller, fault)

    def _retune(self, controller: OneArm, fault: Fault) -> None:
        values = flatten(self.scenario.controller)
        if fault.kind == "gains":
            values |= retuned(values, fault.size)
        else:
            names = [name for name, value in values.items() if name.startswith(RETUNABLE) and np.all(np.isreal(value))]
            name = names[int(1e6 * fault.size) % len(names)]
            values[name] = (change_factor(fault.size) * np.array(values[name], float)).tolist()
        with suppress(InputError):  # gains may be refused; that is no violation
            controller.retune(build(ControllerParams, values, "trial"))
            # HOLD carries what it is told that the arm carries; softer with the same damping, it returns as much later.
            self._joints.begin_again()
            usual, now = (params.safety.hold_stiffness for params in (self.scenario.controller, controller.tuned))
            self._joints.rest_after_s = REST_AFTER_S * max(1.0, usual / now)

    def _restart_bridge(self, back: float) -> None:
        """Let the bridge be away until `back` [s] and then begin where the arm is, with the object in the grasp."""
        self._bridge_back = back
        posture = self._bridge.simulation.observe(0).joint.position
        params = self._bridge_params.model_copy(update={"initial_position": tuple(posture.tolist())})
        self._bridge = self._new_bridge(params, START_NS + round(back * 1e9))
        self._newest_command = None
        self._joints.restarted()

    def _new_bridge(self, params: BridgeParams, stamp_ns: int) -> BridgeSession:
        bridge = BridgeSession({"": params}, {"": self.scenario.urdf})
        bridge.start_at(stamp_ns)
        return bridge

    # -- messages ----------------------------------------------------------------------------------

    def _stamp(self, stamp_ns: int) -> int:
        """Return what the bridge's clock showed where its simulation was at `stamp_ns`."""
        for fault in self._clock_stops:
            if fault.at(self._t):
                if self._stand_still_ns is None:
                    self._stand_still_ns = stamp_ns
                # What was measured before keeps its own.
                return min(stamp_ns, self._stand_still_ns) + self._clock_offset_ns
        self._stand_still_ns = None
        return stamp_ns + self._clock_offset_ns

    def _observe(self, t: float) -> None:
        outputs = self._bridge.observe()
        sent: list[tuple[str, Any]] = [(JOINT, outputs.arms[0].joint)]
        sent += [(WRENCH, sample) for sample in outputs.arms[0].wrenches] + [
            (SLIP, sample) for sample in outputs.arms[0].slips
        ]
        for name, sample in sent:
            stamp_ns = self._stamp(sample.stamp_ns)
            shown = sample if stamp_ns == sample.stamp_ns else dataclasses.replace(sample, stamp_ns=stamp_ns)
            self._channels[name].send(shown, t, self._now_ns, self._now_ns - (outputs.stamp_ns - sample.stamp_ns))
        controller = self._controller
        follows = controller is not None and controller.mode.follows and not self._stopped(CONTROLLER, t)
        true = self._bridge.simulation.observe(0).joint
        self._joints.take(t, true.effort, true.velocity, follows)

    def _shifted(self, command: JointCommand | None) -> JointCommand | None:
        """Return a command with its stamp on the simulation's clock."""
        if command is None or self._clock_offset_ns == 0:
            return command
        return dataclasses.replace(command, stamp_ns=command.stamp_ns - self._clock_offset_ns)

    def _control(self, t: float) -> None:
        """Let everything arrive, and answer."""
        assert self._controller is not None
        controller, now_ns = self._controller, self._now_ns
        for name, add in ((WRENCH, controller.add_wrench), (SLIP, controller.add_slip)):
            for delivery in self._arrived(name):
                add(0, delivery.sample, now_ns)
                self._note(name, delivery)
        wild = next((f for f in self._plan.faults if f.kind.startswith("wild") and f.at(t)), None)
        truth = self._bridge.simulation.observe(0).truth
        self._user.act(controller, t, (truth.pad_position, truth.pad_rotation), wild)
        commands = self._commands.commands
        damaged = any(f.kind in DAMAGED and f.target == JOINT and f.at(t) for f in self._plan.faults)
        for delivery in self._arrived(JOINT):
            if damaged:  # what looks good may contradict all others
                self._work.begin_again()
            controller.add_joint(delivery.sample, now_ns)
            self._note(JOINT, delivery)
            result = self._controller.cycle(now_ns)
            good = delivery.clean and delivery.sample.stamp_ns > self._newest_stamp_ns
            if good:
                self._newest_stamp_ns = delivery.sample.stamp_ns
            self._work.take(t, result is not None, good)
            self._answer(result, t)
        self._answer(self._controller.watchdog(now_ns), t)
        mode, answered = controller.mode, self._commands.commands > commands
        self._safe.check(t, mode.follows, answered, degraded=mode is not Mode.ACTIVE)

    def _arrived(self, name: str) -> list[Delivery]:
        """Return what reaches the controller: of what came while it was stopped, what the node's readers keep."""
        depth = STATE_DEPTH[name == SLIP]
        arrivals = self._channels[name].arrivals(self._now_ns)
        return arrivals[-depth:] if self._stopped(CONTROLLER, self._t - PERIOD_S) else arrivals

    def _note(self, name: str, delivery: Delivery) -> None:
        if delivery.clean:
            self._safe.good(name, NS * (delivery.measured_ns - STEADY_NS), self._t)

    def _answer(self, result: CycleResult | None, t: float) -> None:
        if result is None or self._controller is None:
            return
        self._modes[result.mode.name] += 1
        starts = partial(starts_of, self._controller, result.joint)
        self._commands.take(self._now_ns, result.command.numbers, starts, result.joint.stamp_ns)
        self._channels[EFFORT].send(result.command, t, self._now_ns)


def promise_of(arm: ArmController, period_s: float) -> Promise:
    """Return what the commands of an arm keep to."""
    command, limits = arm.params.command, arm.params.safety.limits
    most: NDArray[np.float64] = arm.robot.effort_limit
    least: NDArray[np.float64] | None = None
    rate: NDArray[np.float64] | float = limits.effort_rate
    speed = arm.robot.velocity_limit
    if command.interface == "velocity":
        most, rate = speed, command.acceleration_limit
    elif command.interface == "position":
        most, least, rate = arm.robot.position_upper, arm.robot.position_lower, speed
    return Promise(most, rate, LONGEST_STEP_S, arm.params.safety.inputs.age_s, period_s, least)


def starts_of(session: OneArm, joint: JointSample) -> list[NDArray[np.float64]]:
    """Return from where the first command may begin that answers this joint state.

    An effort: what is felt, no farther from gravity compensation than HELD, or gravity compensation itself [N m].
    A velocity or position: what is measured or estimated, rest.
    """
    interface = session.controller.params.command.interface
    if interface != "effort":
        n, rest = len(joint.position), session.state.law.position if interface == "position" else np.zeros(MAX_JOINTS)
        estimate = session.state.estimate
        known = estimate.position if interface == "position" else estimate.velocity
        found = [getattr(joint, interface), known[:n].copy(), rest[:n].copy()]
        return [start for start in found if np.isfinite(start).all()]
    felt = [joint.effort] if np.isfinite(joint.effort).all() else []
    if not session.begun:
        return felt
    gravity, held = (
        session.state.law.gravity[: len(joint.position)].copy(),
        HELD * session.controller.robot.effort_limit,
    )
    return [*(np.clip(one, gravity - held, gravity + held) for one in felt), gravity]


def run_trial(plan: Plan, new: NewSession | None = None) -> Verdict:
    """Run one plan in process; arguments as for `Trial`."""
    return Trial(plan, new).run()
