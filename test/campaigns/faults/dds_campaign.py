"""Trials over DDS: nodes as processes that go on from one trial to the next, one fault plan after the other."""

from __future__ import annotations

import contextlib
import dataclasses
import itertools
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import rclpy
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.serialization import deserialize_message
from rclpy.signals import SignalHandlerOptions

from slip_core.arms import prefix_of
from slip_core.topics import topic
from slip_msgs_py.environment import choose_transport
from slip_msgs_py.executor import Spinner
from slip_msgs_py.qos import create_subscription, message_class
from slip_vic.run.domain import domain_id
from slip_vic.run.prepare import prepare
from slip_vic.run.processes import ProcessGroup, child_environment
from slip_vic.scenarios.scenario import Scenario, load_scenario
from slip_vic_controller.arm.robot import Robot
from slip_vic_controller.safety.modes import Mode
from test.campaigns.faults import network
from test.campaigns.faults.campaign import Tally, Verdict, write_results
from test.campaigns.faults.dds_faults import FaultActions, remote
from test.campaigns.faults.dds_session import START_S, Nodes, StartUp
from test.campaigns.faults.dds_watch import Watch, Watches
from test.campaigns.faults.evidence import notes_of, write_bag
from test.campaigns.faults.monitors import LOST_M
from test.campaigns.faults.pair import CASES_OVER_DDS, SCENARIOS
from test.campaigns.faults.plan import (
    BRIDGE,
    CONTROLLER,
    JOINT,
    PERIOD_S,
    RECORDER,
    TOPICS,
    Fault,
    Plan,
    all_faults_over_dds,
    make_plan,
    realtime_scenario,
)
from test.campaigns.faults.proxy import Proxy
from test.campaigns.faults.wire import Wire

LATEST_START_S, LONGEST_S = 0.3, 0.5
SETTLED_S = 0.1
Campaign = TypeVar("Campaign", bound="DdsCampaign")
RECOVERY_S = 10.0  # a killed node needs seconds to start on a busy machine
STAYS_S = 2.0  # a mode without the law that lasts so long, with all processes alive, ends by an operator only
BACK_S = 60.0  # for which an operator tries, counted from when all nodes have started
GIVE_UP_S = 2.5 * START_S
ASK_EVERY_S = 0.5
GRIP_AGAIN_S = 10.0  # after so much HOLD the operator grips the object anew: it may hang badly after it slid
DISK_FULL_S = 60.0  # as long as a bridge that has to start anew may need
SPIN_S = 0.002
TRUTH_EVERY = 3
TRIALS_PER_SETTING = 20  # new nodes take as long as some four trials
USUAL = Plan(0, 0, "paper_planar", True, "vic", ())
GRIP_N = {
    "paper_planar": 2.0, "vertical_plane": 8.0, "glass_transport": 3.0,
    "pane_two_arms_flat": 1.5, "pane_two_arms_upright": 17.0,
}  # fmt: skip
PATH = ("controller.trajectory.radius=0.06",)
PATH_OF_TWO = ("controller.trajectory.radius=0.04", "controller.trajectory.period_s=8.0", "controller.gains.kappa=0.4")
STALL_S = 0.05
"""A turn of the campaign's own loop that takes longer: the machine did not run."""


def plan_over_dds(seed: int, trial: int, two_arms: bool = False) -> Plan:
    """Return the plan of a trial over DDS: TRIALS_PER_SETTING in a row run what the first of them has drawn."""
    cases = CASES_OVER_DDS if two_arms else all_faults_over_dds()
    number = trial // TRIALS_PER_SETTING
    first, plan = (
        make_plan(seed, each, cases, LATEST_START_S, LONGEST_S, "effort")
        for each in (number * TRIALS_PER_SETTING, trial)
    )
    setting = {name: getattr(first, name) for name in ("scenario", "observer", "controller", "sensor")}
    setting |= {"scenario": SCENARIOS[number % len(SCENARIOS)]} if two_arms else {}
    return dataclasses.replace(plan, **setting)


def campaign_scenario(plan: Plan = USUAL) -> Scenario:
    """Return what the nodes run: an endless lemniscate, on a grip that survives faults mostly, told to the governor."""
    usual, grip_n = load_scenario(plan.scenario), GRIP_N[plan.scenario]
    friction_n = next(iter(usual.controllers.values())).governor.friction_limit * grip_n / usual.first.grip.force
    assignments = (
        f"bridge.grip.force={grip_n}", f"controller.governor.friction_limit={friction_n}",
        "controller.trajectory.kind=lemniscate", "controller.trajectory.duration_s=1e6", "bridge.wait_for=[]",
        *(PATH_OF_TWO if usual.several else PATH),
    )  # fmt: skip
    return realtime_scenario(plan.scenario, plan.observer, plan.controller, plan.sensor, assignments)


def run_over_dds(
    tally: Tally,
    trials: Iterable[int],
    out: Path,
    on_done: Callable[[Verdict], None],
    *,
    effort_rate: float | None = None,
) -> None:
    """Run trials one after the other in a domain of their own, into a tally; a violation leaves a bag in `out`.

    effort_rate: what the monitor allows [N m/s]; None takes the controller's own limit.
    """
    for _, numbers in itertools.groupby(trials, lambda trial: trial // TRIALS_PER_SETTING):
        plans, before = [plan_over_dds(tally.seed, trial, tally.two_arms) for trial in numbers], tally.notes
        with campaign_of(DdsCampaign, out, effort_rate, plans[0]) as campaign:
            for plan in plans:
                verdict = campaign.run(plan)
                tally.verdicts.append(verdict)
                tally.notes = _added(before, campaign.notes())
                write_results(out, tally)  # an hour of trials is not lost with the last one
                on_done(verdict)


def _added(notes: Mapping[str, Any], more: Mapping[str, Any]) -> dict[str, Any]:
    """Return notes of two campaigns as one: numbers are counts."""
    return {name: notes.get(name, 0) + value if isinstance(value, int) else value for name, value in more.items()}


@contextmanager
def campaign_of(kind: type[Campaign], out: Path, effort_rate: float | None, plan: Plan = USUAL) -> Iterator[Campaign]:
    """Give a campaign of a kind that runs the setting of a plan, in a domain of its own; see `DdsCampaign`."""
    prepare()  # or the nodes would compile first, at the same time
    with contextlib.ExitStack() as stack:
        domain = stack.enter_context(domain_id())
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="slip_vic_faults_")))
        cable = stack.enter_context(network.Cable()) if network.is_own() else None
        group = stack.enter_context(ProcessGroup())
        if cable is not None:
            network.allow_other_machines()
        choose_transport()
        environment = child_environment(domain)
        rclpy.init(args=[], domain_id=domain, signal_handler_options=SignalHandlerOptions.NO)
        node = Node("faults", start_parameter_services=False, enable_rosout=False)
        try:
            nodes = Nodes(node, group, environment, campaign_scenario(plan), folder, cable)
            yield kind(node, nodes, out, effort_rate)
        finally:
            node.destroy_node()
            rclpy.try_shutdown()


class DdsCampaign:
    """Nodes, proxy and monitors.

    Args:
        node: ours.
        nodes: of the system, with their scenario.
        out: where bags of violations go.
        effort_rate: as for `run_over_dds`.
    """

    def __init__(self, node: Any, nodes: Nodes, out: Path, effort_rate: float | None) -> None:
        self.nodes, self.scenario, self._out = nodes, nodes.scenario, out
        wires, watches = {}, {}
        self._lost_m: dict[str, float] = {}
        for arm, params in self.scenario.controllers.items():
            prefix = prefix_of(arm)
            robot = Robot(self.scenario.placed[arm], params.ee_frame, params.joint_names, params.gravity)
            own = {name: Wire(name, params.joint_names, params.ee_frame) for name in TOPICS}
            wires |= {f"{prefix}{name}": wire for name, wire in own.items()}
            bridge = self.scenario.bridges[arm]
            self._lost_m[prefix] = min(LOST_M, 0.25 * min(bridge.grip.pad_size))  # half the way to the edge
            watches[prefix] = Watch(
                own, params, robot, PERIOD_S, bridge.effort_rate, bridge.command_timeout_s, effort_rate
            )
        self.watch = Watches(watches, PERIOD_S)
        self._actions = FaultActions(node, nodes, self.watch)
        self.proxy = Proxy(node, wires, self.watch.forwarded, self._on_state)
        self._lost = False
        self.lost = self.deaf = self.gripped_again = self.stalls = 0
        self._gripped_s = 0.0
        self._startup = StartUp()
        self._truths: Counter[str] = Counter()
        self._last_ask = 0.0
        for prefix, watch in watches.items():
            takers: tuple[tuple[str, Callable[[bytes], None], bool], ...] = (
                ("effort_command", partial(self.on_command, prefix), True),
                ("controller/ledger", watch.ledger, True),
                ("slip_truth", partial(self._on_truth, prefix), False),
            )
            for name, take, reliable in takers:
                actual = f"{prefix}{name}"
                create_subscription(node, name, take, depth=1000, reliable=reliable, actual_name=actual, raw=True)
        self._truth = message_class(topic("slip_truth").type)
        executor = EventsExecutor()
        executor.add_node(node)
        self._spinner = Spinner(executor)

    def notes(self) -> dict[str, Any]:
        """Return what is worth knowing of the whole campaign."""
        return {
            "process_starts": self.nodes.starts,
            "deaf_nodes": self.deaf,
            "gripped_again": self.gripped_again,
            "stalls": self.stalls,
            "commands_without_predecessor": self.watch.not_judged,
            "network_cut": "namespaces"
            if self.nodes.cable
            else "not permitted here: the proxy drops everything instead",
        }

    def run(self, plan: Plan) -> Verdict:
        """Run one trial."""
        violations: list[str] = []
        modes: Counter[str] = Counter()
        self.proxy.set_plan(None, 0)
        self.nodes.place_bridge(self.nodes.cable is not None and remote(plan.faults))
        if any(fault.target == RECORDER for fault in plan.faults) and not self._start_recorder():
            violations.append(f"two recorders have recorded nothing within {BACK_S:g} s each")
        self._actions.restore()
        if not self.help_until(self.works):
            violations.append(f"the law is not at work within {BACK_S:g} s; mode {self.watch.mode.name}")
        violations += self.deaths()
        commands, lost = self.watch.commands, self.lost
        recovery = None if violations else self._suffer(plan, modes)
        violations += self.deaths() + self._recorder(plan) + self.watch.violations() + self.deaths()
        if violations:
            folder = self._out / f"trial_dds_{plan.seed}_{plan.trial}"
            write_bag(folder, self.proxy.kept, notes_of(plan, violations), tuple(self.watch.arms))
        return Verdict(
            plan.trial,
            tuple(fault.name for fault in plan.faults),
            tuple(violations),
            recovery,
            self.watch.commands - commands,
            dict(modes),
            self.lost - lost,
            plan.setting,
        )

    # -- a trial -----------------------------------------------------------------------------------

    def _start_recorder(self) -> bool:
        """Start a recorder; return whether it hears the nodes. One may be deaf, as any node (see `StartUp`)."""
        self.nodes.start_recorder()
        if self.spin_until(self.nodes.records, BACK_S, self.operate):
            return True
        self.deaf += 1
        self.nodes.end(RECORDER)
        self.nodes.start_recorder()
        return self.spin_until(self.nodes.records, BACK_S, self.operate)

    def works(self) -> bool:
        """Return whether the law is at work and has been for a moment."""
        watch, now = self.watch, time.monotonic()
        alive = now - watch.alive_s < SETTLED_S
        return alive and watch.mode.follows and now - watch.mode_since_s > SETTLED_S and not self._lost

    def help_until(self, condition: Callable[[], bool]) -> bool:
        """Do what an operator would until a condition holds; return whether it did, within BACK_S of nodes that are up.

        How long a process takes to start is the machine's affair.
        """
        began, holds = time.monotonic(), False

        def over() -> bool:
            nonlocal holds
            holds = condition()
            return holds or time.monotonic() - max(began, self._startup.last_s) > BACK_S

        self.spin_until(over, GIVE_UP_S, self.operate)
        return holds

    def operate(self) -> None:
        """Do what an operator would do until the law is at work."""
        now = time.monotonic()
        self._lost = False
        for name in (CONTROLLER, BRIDGE):
            if not self.nodes.runs(name):
                self.nodes.start(name)
                self._startup.begin(now)
        if self._startup.deaf(now, self.nodes.up(), self.watch.alive_s):
            self.deaf += 1
            self.nodes.end(CONTROLLER)
        if now - self._last_ask < ASK_EVERY_S:
            return
        self._last_ask = now
        if self.watch.mode == Mode.FAULT:
            self.nodes.trigger("reset_fault")
        elif self.watch.mode == Mode.HOLD:
            self.nodes.trigger("enable")
            self._grip_again(now)

    def _grip_again(self, now: float) -> None:
        """Grip the object anew where HOLD does not end."""
        if now - max(self.watch.mode_since_s, self._gripped_s) > GRIP_AGAIN_S:
            self._gripped_s = now
            self.gripped_again += 1
            self.watch.teleport(now)
            self.nodes.trigger("reset")

    def _suffer(self, plan: Plan, modes: Counter[str]) -> float | None:
        """Let the faults happen; return the time from the last one's end until the law works again."""
        start_ns = time.monotonic_ns()
        self.proxy.set_plan(plan, start_ns, cut_here=self.nodes.cable is None)
        start = start_ns * 1e-9
        begun: set[Fault] = set()
        over: set[Fault] = set()
        last_end = start

        def turn() -> None:
            nonlocal last_end
            now = time.monotonic()
            modes[self.watch.mode.name] += 1
            for fault in plan.faults:
                if fault not in begun and now >= start + fault.start_s:
                    begun.add(fault)
                    self._actions.begin(fault)
                if fault in begun and fault not in over and now >= start + fault.end_s:
                    over.add(fault)
                    self._actions.end(fault)
                    last_end = time.monotonic()  # on a busy machine later than planned

        self.spin_until(lambda: len(over) == len(plan.faults), BACK_S, turn)
        watch = self.watch

        def decided() -> bool:
            now = time.monotonic()
            works = watch.mode.follows and watch.alive_s > last_end
            stays = now - watch.alive_s < SETTLED_S and now - max(watch.mode_since_s, last_end) > STAYS_S
            return works or stays or self._lost

        self.spin_until(decided, RECOVERY_S, turn)
        works = watch.mode.follows and watch.alive_s > last_end
        return max(watch.alive_s - last_end, 0.0) if works else None

    def _recorder(self, plan: Plan) -> list[str]:
        """End the recorder; one whose disk was full must have said so, and left a bag that can be read."""
        found: list[str] = []

        def turn() -> None:
            found.extend(self.deaths())
            self.operate()  # a bridge that was ended comes back: without messages no disk is too small

        faults = [fault for fault in plan.faults if fault.target == RECORDER]
        if any(fault.kind == "disk_full" for fault in faults) and all(fault.kind != "kill" for fault in faults):
            self.spin_until(lambda: not self.nodes.runs(RECORDER), DISK_FULL_S, turn)
            found += filter(None, [self.nodes.judge_full_disk()])
        self.nodes.end(RECORDER)
        return found

    def deaths(self) -> list[str]:
        """Return how controller and bridge ended, where they did."""
        return [text for text in (self.nodes.ended(name) for name in (CONTROLLER, BRIDGE)) if text]

    # -- messages ----------------------------------------------------------------------------------

    def on_command(self, arm: str, data: bytes) -> None:
        """Judge a command; arm: the prefix of its topics."""
        self.watch.arms[arm].command(data)

    def spin_until(self, condition: Callable[[], bool], timeout_s: float, on_turn: Callable[[], None]) -> bool:
        """Let messages come and go until a condition holds; return whether it did in time."""
        turned = time.monotonic()
        end = turned + timeout_s
        while not condition():
            if time.monotonic() > end:
                return False
            self._spinner.spin(SPIN_S)
            self.proxy.flush()
            on_turn()
            last, turned = turned, time.monotonic()
            if turned - last > STALL_S:
                self.stalls += 1
                self.watch.stood_still(turned - last)
        return True

    def _on_state(self, name: str, data: bytes) -> None:
        self.watch.arms[name.removesuffix(JOINT)].bridge_state(data, time.monotonic())

    def _on_truth(self, arm: str, data: bytes) -> None:
        self._truths[arm] += 1
        if self._truths[arm] % TRUTH_EVERY == 0:
            message = deserialize_message(data, self._truth)
            if max(map(abs, message.position[:3]), default=0.0) > self._lost_m[arm] and self.nodes.runs(BRIDGE):
                # It acts on with ever longer levers and soon falls. Its simulation ends here; the operator starts
                # another one.
                self._lost = True
                self.lost += 1
                self.watch.begin_again()
                self.nodes.let_go(BRIDGE)
