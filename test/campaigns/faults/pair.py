"""One trial with two arms in process: faults on the inputs of either arm; both must stop, together."""

from __future__ import annotations

import dataclasses
from collections import Counter
from functools import cache, partial
from typing import Any

import numpy as np

from slip_core.types import JointCommand
from slip_sim_bridge.plant import DivergenceError
from slip_sim_bridge.session import BridgeSession
from slip_vic.scenarios.scenario import Scenario, load_scenario
from slip_vic_controller.safety.modes import Request
from slip_vic_controller.safety.validation import FUTURE_S
from slip_vic_controller.session.controller import Controller
from slip_vic_controller.session.session import ControllerSession, Results
from test.campaigns.faults.channel import DAMAGED, Channel
from test.campaigns.faults.monitors import NS, CommandMonitor, SafeStateMonitor, TogetherMonitor, promised_ages
from test.campaigns.faults.plan import (
    DRIVES,
    EFFORT,
    JOINT,
    ON_TOPICS,
    SLIP,
    TOPICS,
    WRENCH,
    Fault,
    draw_faults,
    in_order,
    one_in_turn,
)
from test.campaigns.faults.trial import promise_of, starts_of
from test.campaigns.faults.wire import Wire

PERIOD_S = 0.004
DURATION_S = 1.2
LATEST_START_S, LONGEST_S = 0.6, 0.3
STEADY_NS = 5_000_000_000
SIDES = ("left", "right")
SCENARIOS = ("pane_two_arms_flat", "pane_two_arms_upright")
CASES = (
    *((kind, f"{side}/{topic}") for kind in ON_TOPICS for side in SIDES for topic in TOPICS),
    *(("wrong_names", f"{side}/{JOINT}") for side in SIDES),
    *(("wrong_frame", f"{side}/{topic}") for side in SIDES for topic in (WRENCH, SLIP)),
    *(("grip", side) for side in SIDES),
    ("request", ""),
)  # fmt: skip
"""Every (kind, target) there is."""


def make_plan(seed: int, trial: int, interface: str = "") -> tuple[str, tuple[Fault, ...], str]:
    """Draw a trial: its scenario, what its arms take where that is not given, and its faults in order."""
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(trial,)))
    faults = draw_faults(rng, one_in_turn(rng, trial, CASES), (LATEST_START_S, LONGEST_S))
    scenario, drawn = SCENARIOS[int(rng.integers(2))], tuple(DRIVES)[int(rng.integers(len(DRIVES)))]
    return scenario, in_order(faults), interface or drawn


@cache
def prepared(name: str, interface: str = "effort") -> tuple[Scenario, Controller]:
    """Return a scenario as the campaign runs it, and its controller."""
    scenario = load_scenario(
        name,
        drive="" if interface == "effort" else DRIVES[interface][0],
        assignments=[
            f"controller.control_period_s={PERIOD_S}", f"bridge.control_period_s={PERIOD_S}",
            "controller.gains.k_s=100.0", "controller.gains.kappa=0.4", "controller.trajectory.start_s=0.0",
            f"controller.trajectory.duration_s={DURATION_S}", "controller.mode=realtime", "bridge.mode=realtime",
        ],
    )  # fmt: skip
    return scenario, Controller(scenario.controllers, scenario.placed, lockstep=False)


class PairTrial:
    """Runs one plan.

    Args:
        scenario: name.
        faults: what happens; targets `left/wrench` and so on.
        seed, trial: of the randomness of the channels.
        interface: what the arms take.
    """

    def __init__(
        self, scenario: str, faults: tuple[Fault, ...], seed: int, trial: int, interface: str = "effort"
    ) -> None:
        self._faults = faults
        self.scenario, self._controller = prepared(scenario, interface)
        self._channels = {}
        for i, name in enumerate(f"{side}/{topic}" for side in SIDES for topic in TOPICS):
            controller = list(self.scenario.controllers.values())[i // len(TOPICS)]
            self._channels[name] = Channel(
                Wire(name.partition("/")[2], controller.joint_names, controller.ee_frame, interface),
                tuple(fault for fault in faults if fault.target == name),
                np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(trial, 2 + i))),
            )
        safety = next(iter(self.scenario.controllers.values())).safety
        self.commands = [CommandMonitor(promise_of(arm, PERIOD_S)) for arm in self._controller.arms.values()]
        spoilt = any(fault.target.endswith(JOINT) and fault.kind in DAMAGED for fault in faults)
        limits, _ = promised_ages(safety, observer=False, needs_slip=True, has_wrench=True, joints_spoilt=spoilt)
        age = {name: age_s + PERIOD_S for name, age_s in limits.items()}
        self.safe = [SafeStateMonitor(dict(age), FUTURE_S) for _ in SIDES]
        self.together = TogetherMonitor(SIDES, PERIOD_S)
        self.modes: Counter[str] = Counter()
        self.violations: list[str] = []
        self.follows: tuple[bool, ...] = ()
        self._happened: set[Fault] = set()

    def run(self) -> list[str]:
        """Run to the end; return the violations. What the code raises is one too."""
        try:
            self._run()
        except DivergenceError as error:
            self.violations.append(f"the state is not physical any more: {error}")
        except Exception as error:  # whatever it is, it must not happen
            self.violations.append(f"{type(error).__name__}: {error}")
        found = self.violations + self.together.violations
        found += [text for monitor in self.safe for text in monitor.violations]
        return found + [text for monitor in self.commands for text in monitor.violations]

    def _run(self) -> None:
        bridge, team = self.scenario.bridge_session(), ControllerSession(self._controller)
        newest: list[JointCommand | None] = [None] * len(SIDES)
        for tick in range(round(DURATION_S / PERIOD_S)):
            t = tick * PERIOD_S
            now_ns = STEADY_NS + round(1e9 * t)
            self._happen(t, bridge, team)
            outputs = bridge.observe()
            for side, name in enumerate(SIDES):
                sent: list[tuple[str, Any]] = [(JOINT, outputs.arms[side].joint)]
                sent += [(WRENCH, sample) for sample in outputs.arms[side].wrenches]
                sent += [(SLIP, sample) for sample in outputs.arms[side].slips]
                for topic, sample in sent:
                    shown = dataclasses.replace(sample, stamp_ns=STEADY_NS + sample.stamp_ns)
                    self._channels[f"{name}/{topic}"].send(shown, t, now_ns)
            self._control(team, t, now_ns)
            for side, name in enumerate(SIDES):
                for delivery in self._channels[f"{name}/{EFFORT}"].arrivals(now_ns):
                    command = delivery.sample
                    newest[side] = dataclasses.replace(command, stamp_ns=command.stamp_ns - STEADY_NS)
            bridge.advance(newest)

    def _happen(self, t: float, bridge: BridgeSession, team: ControllerSession) -> None:
        for fault in self._faults:
            if fault in self._happened or t < fault.start_s:
                continue
            if fault.kind == "grip":
                self._happened.add(fault)
                name = fault.target
                side = SIDES.index(name)
                bridge.set_grip_force(side, self.scenario.bridges[name].grip.force * 2.0 * fault.size**3)
            elif fault.kind == "request":
                self._happened.add(fault)
                team.request(Request(1 + int(3 * fault.size)))

    def _control(self, team: ControllerSession, t: float, now_ns: int) -> None:
        """Let everything arrive, and answer each joint state as it comes, as the node does."""
        answered = False
        for side, name in enumerate(SIDES):
            arm = team.arms[side]
            for topic, add in ((WRENCH, arm.add_wrench), (SLIP, arm.add_slip)):
                for delivery in self._channels[f"{name}/{topic}"].arrivals(now_ns):
                    add(0, delivery.sample, now_ns)
                    self._note(side, topic, delivery, t)
            for delivery in self._channels[f"{name}/{JOINT}"].arrivals(now_ns):
                arm.add_joint(delivery.sample, now_ns)
                self._note(side, JOINT, delivery, t)
                answered |= self._answer(team, team.cycle(now_ns), t, now_ns)
        answered |= self._answer(team, team.watchdog(now_ns), t, now_ns)
        self.follows = tuple(session.mode.follows for session in team.arms)
        for monitor in self.safe:  # each arm's inputs are reasons for both
            monitor.check(t, any(self.follows), answered)
        self.together.check(t, self.follows)

    def _answer(self, team: ControllerSession, results: Results, t: float, now_ns: int) -> bool:
        """Judge and send what a cycle answers; return whether it answers anything."""
        for side, result in enumerate(results):
            if result is None:
                continue
            self.modes[result.mode.name] += 1
            starts = partial(starts_of, team.arms[side], result.joint)
            self.commands[side].take(now_ns, result.command.numbers, starts, result.joint.stamp_ns)
            self._channels[f"{SIDES[side]}/{EFFORT}"].send(result.command, t, now_ns)
        return any(result is not None for result in results)

    def _note(self, side: int, topic: str, delivery: Any, t: float) -> None:
        if delivery.clean:
            self.safe[side].good(topic, NS * (delivery.measured_ns - STEADY_NS), t)
