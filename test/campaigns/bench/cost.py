"""Cost of the pieces of a tick in this process: control step, simulator step, closed loop; no middleware here."""

from __future__ import annotations

import gc
import random
import statistics
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from slip_core.arrays import Array
from slip_core.records import new
from slip_core.types import JointSample, SlipSample, WrenchSample
from slip_sim_bridge.session import BridgeSession
from slip_vic.run.in_process import ClosedLoop, run_in_process
from slip_vic.scenarios.scenario import Scenario, load_scenario
from slip_vic_controller.law.arm import ARM
from slip_vic_controller.params import ContactParams, ControllerParams
from slip_vic_controller.robot import Robot
from slip_vic_controller.session.cycle_result import CycleResult
from slip_vic_controller.session.session import ControllerSession
from slip_vic_controller.state import ARM_SIZE, TASK_SIZE
from test.campaigns.bench.chain import chain_urdf
from test.campaigns.bench.pingpong import JOINTS, LEDGER_FORM, NEEDED, TRUTH, codec
from test.campaigns.bench.whole_pass import whole_pass
from test.support.one_arm import one_arm

SCENARIO = "paper_planar"
SETTLE_TICKS = 1200  # of the scenario: the arm moves, and the object has begun to slip
SLIDE_TICKS = 500
PERIOD_NS = 1_000_000
STATE_SIZE = TASK_SIZE + ARM_SIZE
Call = Callable[[], object]


@dataclass(frozen=True, slots=True)
class Moment:
    """One tick of a running scenario: all that a control cycle needs."""

    scenario: Scenario
    session: ControllerSession
    state: Array
    joint: JointSample
    wrenches: tuple[WrenchSample, ...]
    slips: tuple[SlipSample, ...]

    def step(self) -> CycleResult:
        """Do the control cycle of this moment, with everything in it, from the same state each time."""
        session = self.session
        (arm,) = session.arms
        session.buffer[:STATE_SIZE] = self.state  # the observer's history goes on from the same place
        for contact, (wrench, slip) in enumerate(zip(self.wrenches, self.slips, strict=True)):
            arm.add_wrench(contact, wrench)
            arm.add_slip(contact, slip)
        arm.add_joint(self.joint)
        (result,) = session.cycle(self.joint.stamp_ns)
        assert result is not None
        return result


def moment(scenario: Scenario, ticks: int = SETTLE_TICKS) -> Moment:
    """Run a scenario in process up to a tick and return what it is there."""
    loop = ClosedLoop(scenario)
    for _ in range(ticks):
        loop.bridge.advance([loop.control(loop.observe()).command])
    outputs = loop.observe()
    controller = one_arm(scenario.controller, scenario.urdf, lockstep=False)
    session = ControllerSession(controller)
    session.restore(loop.session.buffer)
    newest = (outputs.arms[0].wrenches[-1],), (outputs.arms[0].slips[-1],)
    return Moment(scenario, session, session.buffer[:STATE_SIZE].copy(), outputs.arms[0].joint, *newest)


def interleaved(calls: Mapping[str, Call], turns: int) -> dict[str, float]:
    """Time several calls in turn, one call each, in an order that changes, and return the median of each [s].

    So everybody finds the caches as any of the others left them, as in a control loop, where a tick never repeats
    itself; a call that is repeated alone looks two to three times cheaper than it is, and one that always follows
    another that needs the same code looks cheaper too. What slows the machine for longer than a turn slows all alike.
    """
    times: dict[str, list[float]] = {name: [] for name in calls}
    for call in calls.values():
        call()
    clock, order, dice = time.perf_counter, list(calls.items()), random.Random(0)
    for _ in range(turns):
        dice.shuffle(order)
        for name, call in order:
            start = clock()
            call()
            times[name].append(clock() - start)
    return {name: statistics.median(found) for name, found in times.items()}


def bare_terms(robot: Robot, joint: JointSample) -> Call:
    """Return the evaluation of the Pinocchio terms that a control cycle needs, as a record, and nothing else."""
    arm = new(ARM)
    return lambda: robot.terms(joint.position, joint.velocity, arm)


def backward_pass(governed: Moment) -> Call:
    """Return the governor's whole backward pass over the path of a governed moment."""
    state, F = governed.session.buffer.copy(), governed.scenario.controller.governor.friction_limit
    return lambda: whole_pass(state, F)


def closed_loop_factor(scenario: Scenario, ticks: int) -> float:
    """Return simulated over wall time of simulator, sensors and law in one loop: the law alone, no middleware."""
    from test.campaigns.bench.bare_law import BareLaw  # half a minute of compilation, for this alone

    bridge = scenario.bridge_session()
    law = BareLaw(one_arm(scenario.controller, scenario.urdf, lockstep=True))
    outputs = bridge.observe()

    def tick() -> None:
        nonlocal outputs
        bridge.advance([law.answer(outputs.arms[0].joint, outputs.arms[0].wrenches[-1], outputs.arms[0].slips)])
        outputs = bridge.observe()

    return _factor(tick, scenario, ticks)


def supervised_loop_factor(scenario: Scenario, ticks: int) -> float:
    """Return the same with all of a cycle: input validation, modes, limit avoidance, effort limiter."""
    run = run_in_process(scenario)
    return _factor(lambda: next(run), scenario, ticks)


def _factor(tick: Call, scenario: Scenario, ticks: int) -> float:
    tick()
    gc.collect()
    gc.freeze()  # as the nodes do
    start = time.perf_counter()
    for _ in range(ticks):
        tick()
    factor = ticks * scenario.bridge.control_period_s / (time.perf_counter() - start)
    gc.unfreeze()
    return factor


def tick_profile(ticks: int, turns: int) -> dict[str, float]:
    """Return what each part of a lockstep tick costs, without middleware [s]."""
    now = moment(load_scenario(SCENARIO))
    sent = [form for _, form in (*NEEDED.values(), *TRUTH.values())] + [JOINTS, LEDGER_FORM]
    read = [form for _, form in NEEDED.values()] + [JOINTS]
    encoders = [(codec(form).encode, form.zeros()) for form in sent]
    decoders = [(codec(form).decode, codec(form).encode(0, *form.zeros())) for form in read]
    calls: dict[str, Call] = {
        "terms": bare_terms(now.session.controller.first.robot, now.joint),
        "step": now.step,
        "messages: encode": lambda: [encode(0, *numbers) for encode, numbers in encoders],
        "messages: decode": lambda: [decode(data) for decode, data in decoders],
    }
    times = interleaved(calls, turns)
    loop = _loop_parts(now.scenario, ticks)
    return {
        "controller: Pinocchio terms": times["terms"],
        "controller: all but the terms": times["step"] - times["terms"],
        "bridge: simulator step": loop["advance"],
        "bridge: sensors and truth": loop["observe"],
        "messages: encode": times["messages: encode"],
        "messages: decode": times["messages: decode"],
    }


def _loop_parts(scenario: Scenario, ticks: int) -> dict[str, float]:
    """Return the median time of each part of the loop of bridge and controller in one process [s]."""
    loop = ClosedLoop(scenario)
    times: dict[str, list[float]] = {"observe": [], "cycle": [], "advance": []}
    clock = time.perf_counter
    for _ in range(ticks):
        start = clock()
        outputs = loop.observe()
        observed = clock()
        result = loop.control(outputs)
        controlled = clock()
        loop.bridge.advance([result.command])
        times["advance"].append(clock() - controlled)
        times["cycle"].append(controlled - observed)
        times["observe"].append(observed - start)
    return {name: statistics.median(found) for name, found in times.items()}


def holding_bridge(scenario: Scenario) -> BridgeSession:
    """Return a bridge whose arm holds itself: the scenario decides whether the object slips."""
    bridge = scenario.bridge_session()
    bridge.observe()
    return bridge


def sliding_step(bridge: BridgeSession) -> Call:
    """Return the simulator step of a bridge whose object slides, and is put back before it is far away."""

    def step() -> None:
        if bridge.tick % SLIDE_TICKS == 0:
            bridge.request_reset()
            bridge.observe()
        bridge.advance([None])

    return step


def observer_scenario() -> Scenario:
    """Return the scenario with the slip observer."""
    return load_scenario(SCENARIO, assignments=("controller.slip_estimator=observer",))


def governed_scenario(drive: str = "") -> Scenario:
    """Return the scenario below the reference governor; with drives the joint state estimator is on."""
    return load_scenario(SCENARIO, law="governed", drive=drive)


def slipping_scenario() -> Scenario:
    """Return a scenario whose object slips all the time: gravity in the plane of the pads and hardly any grip."""
    return load_scenario(SCENARIO, assignments=("gravity=[0.5, 0.0, -9.81]", "bridge.grip.force=0.05"))


def scaled_step(joints: int, contacts: int) -> Call:
    """Return the control step of a chain of `joints` joints with `contacts` contacts on the object."""
    params = ControllerParams(
        joint_names=tuple(f"joint{i}" for i in range(1, joints + 1)),
        contacts=ContactParams(
            position=tuple(np.linspace(-0.05, 0.05, 3 * contacts).tolist()),
            orientation_xyzw=(0.0, 0.0, 0.0, 1.0) * contacts,
            slip_axes=(True,) * (6 * contacts),
        ),
    )
    session = ControllerSession(one_arm(params, chain_urdf(joints), lockstep=False))
    joint = JointSample(0, 0.3 + 0.1 * np.arange(joints, dtype=np.float64), 0.1 * np.ones(joints), np.zeros(joints))
    wrenches = tuple(WrenchSample(0, 0.1 * np.arange(6.0)) for _ in range(contacts))
    slips = tuple(SlipSample(0, 1e-3 * np.arange(6.0)) for _ in range(contacts))
    now = Moment(observer_scenario(), session, session.buffer[:STATE_SIZE].copy(), joint, wrenches, slips)
    now.step()
    begun, at = session.buffer[:STATE_SIZE].copy(), replace(joint, stamp_ns=PERIOD_NS)
    wrenches = tuple(replace(wrench, stamp_ns=PERIOD_NS) for wrench in wrenches)
    slips = tuple(replace(slip, stamp_ns=PERIOD_NS) for slip in slips)
    return Moment(now.scenario, session, begun, at, wrenches, slips).step
