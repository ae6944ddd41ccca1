"""The attack suite: nodes of a campaign over DDS, attacked one way after the other; a row of a table for each."""

from __future__ import annotations

import dataclasses
import json
import signal
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import psutil

from slip_vic.run.processes import Child
from slip_vic_controller.safety.modes import Mode
from test.campaigns.faults.attacks import ATTACKS, CHANGES, TWO_SOURCES
from test.campaigns.faults.dds_campaign import DdsCampaign, campaign_of
from test.campaigns.faults.dds_session import Nodes
from test.campaigns.faults.dds_watch import worst
from test.campaigns.faults.flood import FOREIGN
from test.campaigns.faults.plan import BRIDGE, CONTROLLER, Fault, Plan

ALONE_S = 2.0  # for which nobody helps after an attack
MIB = 1 << 20


@dataclasses.dataclass(frozen=True, slots=True)
class Row:
    """How one attack went.

    alive: whether neither controller nor bridge has ended or fallen silent; lines: log lines of both a second; grown:
    memory of both [MiB], NaN where a bridge was restarted because its object was lost; recovery_s: from the attack's
    end until the law is at work, None where that did not happen; helped: whether an operator had to reset a fault or to
    enable.
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
        """Whether the promise was kept: no bad command, nobody died, and the law came back."""
        return not self.violations and self.alive and self.recovery_s is not None


class AttackStage(DdsCampaign):
    """Nodes of a campaign as the `Stage` of attacks."""

    def __init__(self, node: Any, nodes: Nodes, *rest: Any) -> None:
        super().__init__(node, nodes, *rest)
        self.node, self.folder = node, nodes.folder
        self._guests: list[Child] = []

    def on_command(self, arm: str, data: bytes) -> None:
        """Judge a command, unless an attacker sent it."""
        if FOREIGN.encode() not in data:
            super().on_command(arm, data)

    def go_on(self, seconds: float, until: Callable[[], bool] = lambda: False) -> bool:
        """Let time pass."""
        return self.spin_until(until, seconds, lambda: None)

    def pid(self, name: str) -> int:
        """Return the process id of a node."""
        return self.nodes.pid(name)

    def start(self, name: str, argv: Sequence[str]) -> Child:
        """Start a process that ends with the attack."""
        child: Child = self.nodes.group.start(name, argv, self.nodes.environment, lambda *_: None)
        self._guests.append(child)
        return child

    def suffer(self, fault: Fault) -> None:
        """Let a fault happen to what travels, beginning now."""
        plan = Plan(0, 0, self.scenario.name, True, "vic", (fault,))
        self.proxy.set_plan(plan, time.monotonic_ns())

    def load_changes(self) -> None:
        """Let the time to come to rest begin anew."""
        self.watch.begin_again()

    def attack(self, name: str) -> Row:
        """Run one attack, and see what comes after it."""
        self.proxy.set_plan(None, 0)
        self.help_until(self.works)
        self.watch.violations()
        pids = [self.pid(node) for node in (CONTROLLER, BRIDGE)]
        memory, lines, began = self._memory(pids), self._lines(), time.monotonic()
        lost, starts = self.lost, self.nodes.starts
        modes: set[Mode] = set()
        self.watch.observe(modes.add, by_itself=name in TWO_SOURCES)
        note = ATTACKS[name](self)
        for guest in self._guests:
            guest.send(signal.SIGKILL)
            guest.wait(5.0)
        self._guests.clear()
        ended = time.monotonic()
        helped = not self.spin_until(self._law_since(ended), ALONE_S, lambda: None)
        deaths = self.deaths()  # before the operator starts them anew
        if name in CHANGES:
            self._put_back()
        back = not helped or self.help_until(self._law_since(ended))
        recovery = time.monotonic() - ended if back else None
        rate = (self._lines() - lines) / (time.monotonic() - began)
        deaths += self.deaths()
        self.watch.observe(lambda _: None, by_itself=False)
        # A simulation whose object is lost ends with it, and the operator starts another one: that is no death.
        alive = not deaths and self.nodes.starts - starts <= self.lost - lost
        if self.lost > lost:
            note = "; ".join(text for text in (note, "the object was lost") if text)
        same = [self.pid(node) for node in (CONTROLLER, BRIDGE)] == pids
        grown = self._memory(pids) - memory if same else float("nan")
        violations = (*self.watch.violations(), *deaths)
        return Row(name, violations, alive, worst(modes or {self.watch.mode}).name, rate, grown, recovery, helped, note)

    def _put_back(self) -> None:
        """Do what an operator must whose parameters were changed: gains as they were, the object in the grasp again."""
        self._actions.restore()
        self.watch.teleport(time.monotonic())
        self.nodes.trigger("reset")

    def _law_since(self, moment_s: float) -> Callable[[], bool]:
        return lambda: self.watch.mode.follows and self.watch.alive_s > moment_s

    def _memory(self, pids: Iterable[int]) -> float:
        return sum(psutil.Process(pid).memory_info().rss for pid in pids) / MIB

    def _lines(self) -> int:
        return sum(child.line_count for child in self.nodes.group.children if child.name in (CONTROLLER, BRIDGE))


def run_attacks(names: Iterable[str], out: Path, on_done: Callable[[Row], None]) -> list[Row]:
    """Run attacks one after the other in a domain of their own; write attacks.json."""
    rows = []
    with campaign_of(AttackStage, out, None) as stage:
        for name in names:
            rows.append(stage.attack(name))
            out.mkdir(parents=True, exist_ok=True)
            text = json.dumps([dataclasses.asdict(row) | {"kept": row.kept} for row in rows], indent=1)
            (out / "attacks.json").write_text(text + "\n", encoding="utf-8")
            on_done(rows[-1])
    return rows
