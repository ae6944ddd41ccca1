"""The attack suite: controller and bridge as processes over DDS, one attack on fresh nodes at a time, one row each."""

from __future__ import annotations

import contextlib
import dataclasses
import json
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import psutil
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from slip_core.errors import ProtocolError
from slip_core.stamps import stamp_to_ns
from slip_msgs_py.environment import choose_transport
from slip_msgs_py.qos import create_subscription
from slip_vic.run.commands import native_command, node_command
from slip_vic.run.domain import domain_id
from slip_vic.run.prepare import prepare
from slip_vic.run.processes import Child, ProcessGroup, child_environment
from slip_vic.scenarios.scenario import Scenario
from slip_vic.setup.export import write_node
from slip_vic_controller.robot import Robot
from slip_vic_controller.safety.limits import LONGEST_STEP_S
from test.campaigns.attacks.attacks import ATTACKS, TWO_SOURCES
from test.campaigns.attacks.flood import FOREIGN
from test.campaigns.attacks.operator import Operator
from test.campaigns.faults.monitors import CommandMonitor, Promise
from test.campaigns.faults.plan import BRIDGE, CONTROLLER, EFFORT, PERIOD_S, Plan, endless_scenario
from test.campaigns.faults.wire import Wire

START_S = 60.0
SETTLED_S = 0.5
ALONE_S = 2.0  # without help after an attack
BACK_S = 30.0  # with an operator's help
MIB = 1 << 20
USUAL: Final = Plan(0, 0, "paper_planar", True, "vic", ())
FOLLOWS: Final = ("ACTIVE", "DEGRADED")


@dataclasses.dataclass(frozen=True, slots=True)
class Row:
    """Result of one attack.

    Attributes:
        attack: its name.
        violations: commands that break the promise.
        alive: whether controller and bridge still run.
        worst_mode: the mode furthest from ACTIVE.
        lines_per_s: log lines of both nodes.
        grown_mib: memory that both nodes gained [MiB].
        recovery_s: from the end of the attack until the law is active again [s]; None: it did not return.
        helped: whether an operator had to reset a fault or to enable the law.
        note: what the attack reports.
    """

    attack: str
    violations: tuple[str, ...]
    alive: bool
    worst_mode: str
    lines_per_s: float
    grown_mib: float
    recovery_s: float | None
    helped: bool
    note: str

    @property
    def kept(self) -> bool:
        """Whether every command was good, both nodes live, and the law returned."""
        return not self.violations and self.alive and self.recovery_s is not None


class CommandWatch:
    """Judges the controller's commands: finite, inside the limits, no step above the slope of a longest cycle.

    Args:
        scenario: of the nodes.
        effort_rate: allowed slope [N m/s]; None takes the controller's own limit.
    """

    def __init__(self, scenario: Scenario, effort_rate: float | None) -> None:
        params = scenario.controller
        rate = params.safety.limits.effort_rate if effort_rate is None else effort_rate
        most = Robot(scenario.urdf, params.ee_frame, params.joint_names, params.gravity).effort_limit
        # By the stamps of the states that they answer, between which a cycle may take the longest step, whoever sent
        # the second one, and however soon after the first.
        slope, pause_s = rate * LONGEST_STEP_S / PERIOD_S, params.safety.inputs.age_s
        self._wire = Wire(EFFORT, params.joint_names, params.ee_frame)
        self.monitor = CommandMonitor(Promise(most, slope, pause_s, pause_s, PERIOD_S))
        self.judges_steps, self._paused, self._stamp_ns, self._sent_ns, self._now_ns = True, False, 0, 0, 0
        self._pause_ns = 0.8e9 * pause_s

    def take(self, data: bytes, info: Any) -> None:
        """Judge a command, unless an attacker sent it; info: of the middleware."""
        if FOREIGN.encode() in data:
            return
        message = self._wire.typed(data)
        effort, stamp_ns = np.array(message.effort), stamp_to_ns(message.header.stamp)
        # What stood still between a cycle's beginning and its command, or before it, counts as a pause in one of two.
        paused, self._paused = self._paused, info["source_timestamp"] - self._sent_ns > self._pause_ns
        if not self.judges_steps or stamp_ns <= self._stamp_ns or paused or self._paused:
            self.monitor.restarted()
        self._now_ns += max(stamp_ns - self._stamp_ns, round(1e9 * PERIOD_S))
        self._stamp_ns, self._sent_ns = stamp_ns, info["source_timestamp"]
        self.monitor.take(self._now_ns, effort, lambda: [effort], stamp_ns)


class Stage:
    """Controller and bridge of one attack, with an operator and a node of ours on the same domain.

    Args:
        node: rclpy node of the default context.
        executor: runs its callbacks.
        group: owner of the processes.
        environment: of the processes.
        folder: for parameter files.
        effort_rate: as for `CommandWatch`.
        native: a built export whose node is the controller; None: the Python node.
    """

    def __init__(
        self, node: Node, executor: Any, group: ProcessGroup, environment: dict[str, str], folder: Path,
        effort_rate: float | None = None, native: Path | None = None,
    ) -> None:  # fmt: skip
        self.node, self.folder, self.scenario = node, folder, endless_scenario(USUAL)
        self._group, self._environment = group, environment
        self._native = native and with_numbers(native, self.scenario, folder / "native")
        self.watch = CommandWatch(self.scenario, effort_rate)
        self.operator = Operator(node, executor)
        create_subscription(node, EFFORT, self.watch.take, depth=1000, reliable=True, raw=True)
        self._nodes = {
            CONTROLLER: self.start_controller(CONTROLLER),
            BRIDGE: self.start(BRIDGE, node_command(BRIDGE, self.scenario.bridge, folder)),
        }

    def wait(self, seconds: float, until: Callable[[], bool] = lambda: False) -> bool:
        """Process messages for this long or until a condition holds; return whether it held."""
        return self.operator.attend(seconds, until)

    def pid(self, name: str) -> int:
        """Return the process id of controller or bridge."""
        return self._nodes[name].pid

    def start_controller(self, name: str) -> Child:
        """Start a controller."""
        params, folder = self.scenario.controller, self.folder / name
        folder.mkdir(exist_ok=True)
        native = self._native and native_command(self._native, params)
        return self.start(name, native or node_command(CONTROLLER, params, folder))

    def start(self, name: str, argv: Sequence[str]) -> Child:
        """Start a process on the same domain."""
        return self._group.add(Child(name, argv, self._environment, lambda *_: None))

    def attack(self, name: str) -> Row:
        """Wait for the law, run one attack, and observe what follows.

        Raises:
            ProtocolError: the law did not become active before the attack.
        """
        operator = self.operator
        if not self.wait(START_S, lambda: operator.mode in FOLLOWS):
            tails = "\n".join(f"{child.name}:\n{child.tail()}" for child in self._nodes.values())
            raise ProtocolError(f"the law is not active within {START_S:g} s\n{tails}")
        self.wait(SETTLED_S)
        operator.helps, operator.modes = False, {operator.mode}
        self.watch.judges_steps = name not in TWO_SOURCES
        memory, lines, began = self._memory(), self._lines(), time.monotonic()
        note = ATTACKS[name](self)
        for guest in self._group.children:
            if guest not in self._nodes.values():
                guest.kill()
                guest.has_ended(5.0)
        ended = time.monotonic()
        helped = not self._returns(ALONE_S)
        if helped:
            operator.helps = True
            operator.restart()
        recovery_s = time.monotonic() - ended if not helped or self._returns(BACK_S) else None
        rate = (self._lines() - lines) / (time.monotonic() - began)
        deaths = [
            f"{child.name} ended with exit code {child.poll()}:\n{child.tail()}"
            for child in self._nodes.values()
            if child.poll() is not None
        ]
        return Row(
            attack=name, violations=(*self.watch.monitor.violations, *deaths), alive=not deaths,
            worst_mode=max(operator.modes, key=("", "ACTIVE", "DEGRADED", "HOLD", "WAITING_INPUT", "FAULT").index),
            lines_per_s=rate, grown_mib=float("nan") if deaths else self._memory() - memory,
            recovery_s=recovery_s, helped=helped, note=note,
        )  # fmt: skip

    def _returns(self, seconds: float) -> bool:
        """Return whether the law is active and gives commands after a settling time, within so many seconds."""
        self.wait(SETTLED_S)
        before = self.watch.monitor.commands
        return self.wait(seconds, lambda: self.operator.mode in FOLLOWS and self.watch.monitor.commands > before)

    def _memory(self) -> float:
        return sum(psutil.Process(child.pid).memory_info().rss for child in self._nodes.values()) / MIB

    def _lines(self) -> int:
        return sum(child.line_count for child in self._nodes.values())


@contextlib.contextmanager
def stage(effort_rate: float | None = None, native: Path | None = None) -> Iterator[Stage]:
    """Give fresh nodes in a domain of their own; arguments as for `Stage`."""
    prepare()  # otherwise both nodes compile at the same time
    choose_transport()
    with domain_id() as domain, tempfile.TemporaryDirectory(prefix="slip_vic_attacks_") as folder:
        rclpy.init(args=[], domain_id=domain, signal_handler_options=SignalHandlerOptions.NO)
        node = Node("attacks", start_parameter_services=False, enable_rosout=False)
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        try:
            with ProcessGroup() as group:
                yield Stage(node, executor, group, child_environment(domain), Path(folder), effort_rate, native)
        finally:
            executor.shutdown()
            node.destroy_node()
            rclpy.try_shutdown()


def with_numbers(native: Path, scenario: Scenario, folder: Path) -> Path:
    """Return a folder with the node of a built export and the numbers of a scenario."""
    folder.mkdir()
    (folder / "build").symlink_to((native / "build").resolve())
    write_node(scenario, folder)
    return folder


def run_attacks(
    names: Iterable[str], out: Path, on_done: Callable[[Row], None], native: Path | None = None
) -> list[Row]:
    """Run attacks one after the other, each on fresh nodes; write attacks.json. native: as for `Stage`."""
    rows = []
    for name in names:
        with stage(native=native) as attacked:
            rows.append(attacked.attack(name))
        out.mkdir(parents=True, exist_ok=True)
        text = json.dumps([dataclasses.asdict(row) | {"kept": row.kept} for row in rows], indent=1)
        (out / "attacks.json").write_text(text + "\n", encoding="utf-8")
        on_done(rows[-1])
    return rows
