"""Cost of the pieces of a tick in this process: control step, simulator step, closed loop; no middleware here."""

from __future__ import annotations

import gc
import random
import statistics
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

from slip_core.arrays import Array
from slip_core.records import new
from slip_core.types import JointSample, SlipSample, WrenchSample
from slip_sim_bridge.session import BridgeSession
from slip_vic.run.in_process import ClosedLoop, run_in_process
from slip_vic.scenarios.scenario import Scenario, load_scenario
from slip_vic_controller.arm.robot import Robot
from slip_vic_controller.law.arm import ARM
from slip_vic_controller.session.cycle_result import CycleResult
from slip_vic_controller.session.session import ControllerSession
from slip_vic_controller.state import ARM_SIZE, TASK_SIZE
from test.campaigns.bench.pingpong import JOINTS, LEDGER_FORM, NEEDED, TRUTH, codec
from test.support.one_arm import one_arm

SCENARIO = "paper_planar"
SETTLE_TICKS = 1200  # of the scenario: the arm moves, and the object has begun to slip
STRETCH = 8  # ticks
SLIDE_TICKS = 500
PERIOD_NS = 1_000_000
STATE_SIZE = TASK_SIZE + ARM_SIZE
Call = Callable[[], object]


class Inputs(NamedTuple):
    """What a control cycle takes in."""

    joint: JointSample
    wrenches: tuple[WrenchSample, ...]
    slips: tuple[SlipSample, ...]


@dataclass(slots=True)
class Stretch:
    """Ticks of a running scenario one after another, again and again: all that their control cycles need.

    state: before the first one; at: the next one.
    """

    scenario: Scenario
    session: ControllerSession
    state: Array
    inputs: tuple[Inputs, ...]
    at: int = 0

    def restore(self) -> None:
        """Go back to the first tick after the last one; the observer's history goes on from the same place."""
        if self.at == len(self.inputs):
            self.session.buffer[:STATE_SIZE], self.at = self.state, 0

    def step(self) -> CycleResult:
        """Do the control cycle of the next tick, with everything in it."""
        session, (joint, wrenches, slips) = self.session, self.inputs[self.at]
        self.at += 1
        (arm,) = session.arms
        for contact, (wrench, slip) in enumerate(zip(wrenches, slips, strict=True)):
            arm.add_wrench(contact, wrench)
            arm.add_slip(contact, slip)
        arm.add_joint(joint)
        (result,) = session.cycle(joint.stamp_ns)
        assert result is not None
        return result


def stretch(scenario: Scenario, ticks: int = SETTLE_TICKS) -> Stretch:
    """Run a scenario in process up to a tick and return what it is from there on."""
    loop, inputs = ClosedLoop(scenario), []
    for _ in range(ticks):
        loop.bridge.advance([loop.control(loop.observe()).command])
    session = ControllerSession(one_arm(scenario.controller, scenario.urdf, lockstep=False))
    session.restore(loop.session.buffer)
    for _ in range(STRETCH):
        outputs = loop.observe()
        (arm,) = outputs.arms
        inputs.append(Inputs(arm.joint, (arm.wrenches[-1],), (arm.slips[-1],)))
        loop.bridge.advance([loop.control(outputs).command])
    return Stretch(scenario, session, session.buffer[:STATE_SIZE].copy(), tuple(inputs))


def interleaved(calls: Mapping[str, Call | Stretch], turns: int) -> dict[str, float]:
    """Time several calls in turn, one call each, in an order that changes, and return the median of each [s].

    So everybody finds the caches as any of the others left them, as in a control loop, where a tick never repeats
    itself; a call that is repeated alone looks two to three times cheaper than it is, and one that always follows
    another that needs the same code looks cheaper too. What slows the machine for longer than a turn slows all alike.

    Of a stretch it is the mean over its ticks, and the way back to its beginning is not timed: a control loop copies no
    100 kB.
    """
    times: dict[str, list[list[float]]] = {
        name: [[] for _ in call.inputs] if isinstance(call, Stretch) else [[]] for name, call in calls.items()
    }
    clock, order, dice = time.perf_counter, list(calls.items()), random.Random(0)
    for turn in range(1 + turns):
        for name, call in order:
            step, of_tick = call, times[name][0]
            if isinstance(call, Stretch):
                call.restore()
                step, of_tick = call.step, times[name][call.at]
            start = clock()
            step()
            passed = clock() - start
            if turn > 0:
                of_tick.append(passed)
        dice.shuffle(order)
    return {name: statistics.fmean(map(statistics.median, filter(None, found))) for name, found in times.items()}


def bare_terms(robot: Robot, joint: JointSample) -> Call:
    """Return the evaluation of the Pinocchio terms that a control cycle needs, as a record, and nothing else."""
    arm = new(ARM)
    return lambda: robot.terms(joint.position, joint.velocity, arm)


def supervised_loop_factor(scenario: Scenario, ticks: int) -> float:
    """Return simulated over wall time of simulator, sensors and the whole control cycle in one process."""
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
    now = stretch(load_scenario(SCENARIO))
    sent = [form for _, form in (*NEEDED.values(), *TRUTH.values())] + [JOINTS, LEDGER_FORM]
    read = [form for _, form in NEEDED.values()] + [JOINTS]
    encoders = [(codec(form).encode, form.zeros()) for form in sent]
    decoders = [(codec(form).decode, codec(form).encode(0, *form.zeros())) for form in read]
    calls: dict[str, Call | Stretch] = {
        "terms": bare_terms(now.session.controller.first.robot, now.inputs[0].joint),
        "step": now,
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
