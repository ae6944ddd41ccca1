"""Cost of the pieces of a tick in this process: control step, simulator step, closed loop; no middleware here."""

from __future__ import annotations

import gc
import random
import statistics
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from slip_bringup.inprocess import ClosedLoop, Tick, run_in_process
from slip_bringup.scenario import Scenario, load_scenario
from slip_campaigns.bench.chain import chain_urdf
from slip_campaigns.bench.pingpong import JOINTS, LEDGER_FORM, NEEDED, TRUTH, codec
from slip_core.types import JointSample, SlipSample, WrenchSample
from slip_sim_bridge.session import BridgeSession
from slip_vic_controller.core.arm import ArmModel
from slip_vic_controller.core.controller import TickResult, VicController
from slip_vic_controller.core.params import ContactParams, ControllerParams
from slip_vic_controller.core.state import ControllerState

SCENARIO = "paper_planar"
SETTLE_TICKS = 1200  # of the scenario: the arm moves, and the object has begun to slip
SLIDE_TICKS = 500
Call = Callable[[], object]


@dataclass(frozen=True, slots=True)
class Moment:
    """One tick of a running scenario: all that a control step needs."""

    scenario: Scenario
    controller: VicController
    state: ControllerState
    tick: Tick

    def step(self) -> TickResult:
        """Do the control step of this moment, from the same state each time."""
        outputs = self.tick.outputs
        newest_wrench, newest_slip = outputs.wrenches[0][-1], outputs.slips[0][-1]
        return self.controller.step(self.state, outputs.joint, (newest_wrench,), (newest_slip,), None)


def moment(scenario: Scenario, ticks: int = SETTLE_TICKS) -> Moment:
    """Run a scenario in process up to a tick and return what it is there."""
    controller = VicController(scenario.controller, scenario.urdf)
    state: ControllerState | None = None
    for tick in run_in_process(scenario):
        outputs = tick.outputs
        if state is None:
            state = controller.initial_state(outputs.joint)
        if outputs.tick == ticks:
            return Moment(scenario, controller, state, tick)
        wrenches, slips = (outputs.wrenches[0][-1],), (outputs.slips[0][-1],)
        state = controller.step(state, outputs.joint, wrenches, slips, None).state
    raise ValueError(f"{scenario.name} has fewer than {ticks} ticks")


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


def bare_terms(arm: ArmModel, joint: JointSample) -> Call:
    """Return the evaluation of the Pinocchio terms that a control step needs, as arrays, and nothing else."""
    return lambda: arm.terms(joint.position, joint.velocity)


def closed_loop_factor(scenario: Scenario, ticks: int) -> float:
    """Return simulated over wall time of simulator, sensors and law in one loop, without supervision or middleware."""
    bridge, controller = (
        BridgeSession(scenario.bridge, scenario.urdf),
        VicController(scenario.controller, scenario.urdf),
    )
    outputs = bridge.observe()
    state = controller.initial_state(outputs.joint)

    def tick() -> None:
        nonlocal outputs, state
        wrenches, slips = (outputs.wrenches[0][-1],), (outputs.slips[0][-1],)
        result = controller.step(state, outputs.joint, wrenches, slips, None, slips)
        state = result.state
        bridge.advance(result.command)
        outputs = bridge.observe()

    return _factor(tick, scenario, ticks)


def supervised_loop_factor(scenario: Scenario, ticks: int) -> float:
    """Return the same with all that the controller does in a cycle: input watches, mode machine, walls, gate."""
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
        "terms": bare_terms(now.controller.arm, now.tick.outputs.joint),
        "step": now.step,
        "messages: encode": lambda: [encode(0, *numbers) for encode, numbers in encoders],
        "messages: decode": lambda: [decode(data) for decode, data in decoders],
    }
    times = interleaved(calls, turns)
    loop = _loop_parts(now.scenario, ticks)
    return {
        "controller: Pinocchio terms": times["terms"],
        "controller: law and torque": times["step"] - times["terms"],
        "controller: inputs and supervision": loop["cycle"] - times["step"],
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
        loop.bridge.advance(result.command)
        times["advance"].append(clock() - controlled)
        times["cycle"].append(controlled - observed)
        times["observe"].append(observed - start)
    return {name: statistics.median(found) for name, found in times.items()}


def holding_bridge(scenario: Scenario) -> BridgeSession:
    """Return a bridge whose arm holds itself: the scenario decides whether the object slips."""
    bridge = BridgeSession(scenario.bridge, scenario.urdf)
    bridge.observe()
    return bridge


def sliding_step(bridge: BridgeSession) -> Call:
    """Return the simulator step of a bridge whose object slides, and is put back before it is far away."""

    def step() -> None:
        if bridge.tick % SLIDE_TICKS == 0:
            bridge.request_reset()
            bridge.observe()
        bridge.advance(None)

    return step


def observer_scenario() -> Scenario:
    """Return the scenario with the slip observer."""
    return load_scenario(SCENARIO, assignments=("controller.slip_estimator=observer",))


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
    controller = VicController(params, chain_urdf(joints))
    q = 0.3 + 0.1 * np.arange(joints, dtype=np.float64)
    joint = JointSample(0, q, 0.1 * np.ones(joints), np.zeros(joints))
    state = controller.initial_state(joint)
    later = replace(joint, stamp_ns=1_000_000)
    wrenches = tuple(WrenchSample(0, 0.1 * np.arange(6.0)) for _ in range(contacts))
    slips = tuple(SlipSample(0, 1e-3 * np.arange(6.0)) for _ in range(contacts))
    return lambda: controller.step(state, later, wrenches, slips, None)
