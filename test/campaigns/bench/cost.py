"""Cost of a control cycle and of the whole loop in this process, without middleware."""

from __future__ import annotations

import gc
import random
import statistics
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from slip_core.arrays import Array
from slip_core.records import new
from slip_core.types import JointSample
from slip_sim_bridge.session import ArmOutputs
from slip_vic.run.in_process import ClosedLoop, run_in_process
from slip_vic.scenarios.scenario import Scenario, load
from slip_vic_controller.law.arm import ARM
from slip_vic_controller.robot import Robot
from slip_vic_controller.session.cycle_result import CycleResult
from slip_vic_controller.session.session import ControllerSession
from slip_vic_controller.state import ARM_SIZE, TASK_SIZE
from test.support.one_arm import one_arm

SCENARIO = "paper_planar"
SETTLE_TICKS = 1200  # of the scenario: the arm moves, and the object has begun to slip
STRETCH = 8  # ticks
STATE_SIZE = TASK_SIZE + ARM_SIZE
Call = Callable[[], object]


@dataclass(slots=True)
class Stretch:
    """Consecutive ticks of a running scenario, repeated: all inputs of their control cycles.

    state: before the first one; at: the next one.
    """

    scenario: Scenario
    session: ControllerSession
    state: Array
    inputs: tuple[ArmOutputs, ...]
    at: int = 0

    def restore(self) -> None:
        """Go back to the first tick after the last one, where the observer's history continues."""
        if self.at == len(self.inputs):
            self.session.buffer[:STATE_SIZE], self.at = self.state, 0

    def step(self) -> CycleResult:
        """Do the control cycle of the next tick, with everything in it."""
        session, sent = self.session, self.inputs[self.at]
        self.at += 1
        (arm,) = session.arms
        arm.add_wrench(0, sent.wrenches[-1])
        arm.add_slip(0, sent.slips[-1])
        arm.add_joint(sent.joint)
        (result,) = session.cycle(sent.joint.stamp_ns)
        assert result is not None
        return result


def stretch(scenario: Scenario, ticks: int = SETTLE_TICKS) -> Stretch:
    """Run a scenario in process up to a tick and return the ticks that follow."""
    loop, inputs = ClosedLoop(scenario), []
    for _ in range(ticks):
        loop.bridge.advance([loop.answer(loop.bridge.observe())[0].command])
    session = ControllerSession(one_arm(scenario.controller, scenario.urdf, lockstep=False))
    session.buffer[:] = loop.session.buffer
    for _ in range(STRETCH):
        outputs = loop.bridge.observe()
        inputs.append(outputs.arms[0])
        loop.bridge.advance([loop.answer(outputs)[0].command])
    return Stretch(scenario, session, session.buffer[:STATE_SIZE].copy(), tuple(inputs))


def interleaved(calls: Mapping[str, Call | Stretch], turns: int) -> dict[str, float]:
    """Time several calls in turn, one call each, in an order that changes, and return the median of each [s].

    Each call finds the caches as another one left them, as in a control loop; repeated alone it would look two to three
    times cheaper. Of a stretch it is the mean over its ticks; its restart is not timed.
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
    next(run)
    gc.collect()
    gc.freeze()  # as the nodes do
    start = time.perf_counter()
    for _ in range(ticks):
        next(run)
    factor = ticks * scenario.bridge.control_period_s / (time.perf_counter() - start)
    gc.unfreeze()
    return factor


def observer_scenario() -> Scenario:
    """Return the scenario with the slip observer."""
    return load(SCENARIO, law="vic", set=("controller.slip_estimator=observer",))


def governed_scenario(drive: str = "") -> Scenario:
    """Return the scenario below the reference governor; with drives the joint state estimator is on."""
    return load(SCENARIO, law="governed", drive=drive)
