"""Run the controller again on what the ledger says it used, and compare every command bit by bit."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from slip_core.arms import prefix_of
from slip_core.errors import InputError
from slip_core.types import PoseGoal, SlipSample
from slip_vic.replay.run_data import LedgerEntry, RecordedRun
from slip_vic_controller.safety.conditions import Missing, Reason
from slip_vic_controller.safety.modes import Request
from slip_vic_controller.session.arm_session import ArmSession
from slip_vic_controller.session.controller import Controller
from slip_vic_controller.session.cycle_result import CycleResult, Health
from slip_vic_controller.session.session import ControllerSession

Sample = TypeVar("Sample")


@dataclass(frozen=True, slots=True)
class Divergence:
    """The first number that is not the recorded one in a cycle."""

    cycle: int
    stamp_ns: int
    topic: str
    field: str
    recorded: float
    replayed: float


def replay(runs: Mapping[str, RecordedRun]) -> Iterator[Divergence | None]:
    """Yield per cycle of each arm None where command and mode are as recorded to the last bit, else what differs first.

    Args:
        runs: of each arm, in one controller.

    Raises:
        InputError: the run cannot be replayed from this bag.

    The ledger gives the inputs, clock, verdicts and requests of every cycle; the rest is code.
    """
    for run in runs.values():
        if run.ledger[0].cycle != 0:
            raise InputError("the ledger", got=f"a beginning at cycle {run.ledger[0].cycle}", expected="the whole run")
    params, urdfs = ({name: getattr(run, of) for name, run in runs.items()} for of in ("params", "urdf"))
    lockstep = next(iter(params.values())).mode == "lockstep"
    session = ControllerSession(Controller(params, urdfs, lockstep=lockstep))
    arms = [_Arm(session, *each) for each in zip(session.arms, runs.values(), strict=True)]
    while any(arm.entry is not None for arm in arms):
        turn = [arms[k] for k in _turn([arm.entry for arm in arms])]
        for arm, entry, result in zip(turn, *_cycle(session, turn), strict=True):
            found = _compare(arm.run, entry, arm.run.commands[arm.at - 1], result)
            yield None if found is None else replace(found, topic=f"{prefix_of(arm.name)}{found.topic}")


def _cycle(session: ControllerSession, turn: Sequence[_Arm]) -> tuple[list[LedgerEntry], list[CycleResult]]:
    """Run the next cycle of some arms; return what was recorded of it, and the results."""
    entries = [arm.begin() for arm in turn]
    if len(turn) == 1:
        silent = turn[0].watchdog(entries[0])
        if silent is not None:
            return entries, [silent]
    together = len(turn) == len(session.arms)
    for arm, entry in zip(turn, entries, strict=True):
        arm.give(entry, together=together)
    results = [result for result in session.answer(entries[0].now_ns) if result is not None]
    if any(entry.waits for entry in entries):
        session.set_active(session.active)  # what comes next begins again, as the run did
    return entries, results


def _turn(entries: Sequence[LedgerEntry | None]) -> tuple[int, ...]:
    """Return whose cycle is next: of those with the earliest clock, one of the watchdog, or all others together."""
    earliest = min(entry.now_ns for entry in entries if entry is not None)
    now = {k: entry for k, entry in enumerate(entries) if entry is not None and entry.now_ns == earliest}
    silent = [k for k, entry in now.items() if Health.from_code(entry.health).joint == Reason.SILENT]
    return tuple(silent[:1] or now)


class _Arm:
    """One arm on its way through its ledger.

    Args:
        session: of all arms.
        arm: of the session.
        run: what was recorded.
    """

    def __init__(self, session: ControllerSession, arm: ArmSession, run: RecordedRun) -> None:
        self._session, self._arm, self.run, self.at = session, arm, run, 0
        self.name, self._slips_to_ns = arm.name, -1
        self._slip_stamps = np.array(sorted(run.slips[0]), dtype=np.int64)

    @property
    def entry(self) -> LedgerEntry | None:
        """What was recorded of the next cycle; None at the end."""
        return self.run.ledger[self.at] if self.at < len(self.run.ledger) else None

    def begin(self) -> LedgerEntry:
        """Take what had come since the cycle before, and return the entry of this one."""
        entry = self.run.ledger[self.at]
        if self.at in self.run.changes:
            params = [arm.tuned for arm in self._session.arms]
            params[self._arm.index] = self.run.changes[self.at]
            self._session.retune(params)
        self.at += 1
        _take(self._session, self.run, entry)
        self._arm.request(Request(entry.request))
        return entry

    def give(self, entry: LedgerEntry, *, together: bool) -> None:
        """Put the samples of a cycle in place.

        together: a cycle of all arms, which finds again whether one holds because of another.
        """
        arm, run, health = self._arm, self.run, Health.from_code(entry.health)
        if together and health.outside == Reason.OTHER_ARM:
            health = health._replace(outside=Reason.NONE)
        joint = _find(entry, run.joints, entry.joint_ns, "joint_states")
        arm.add_joint(joint, entry.now_ns)
        used = arm.validated(joint)
        if entry.waits:
            arm.give(used, (), (), ())
            arm.waiting = joint, int(health.joint), Missing.JOINT_STATES, health
            return
        wrenches, slips = [], []
        if run.params.wrench.source != "none":
            pairs = zip(run.wrenches, entry.wrench_ns, strict=True)
            wrenches = [_find(entry, samples, stamp, "wrench") for samples, stamp in pairs]
        for samples, stamp in zip(run.slips, entry.slip_ns, strict=True):
            absent = run.params.controller != "vic" and stamp == 0 and stamp not in samples
            slips.append(None if absent else _find(entry, samples, stamp, "slip_velocity"))
        arm.give(used, wrenches, slips, self._new_slips(entry.slip_ns[0]))
        arm.waiting = joint, int(health.joint), 0, health

    def _new_slips(self, newest_ns: int) -> list[SlipSample]:
        """Return the slip samples of the own contact since the cycle before."""
        first, last = np.searchsorted(self._slip_stamps, (self._slips_to_ns, newest_ns), side="right")
        self._slips_to_ns = max(self._slips_to_ns, newest_ns)
        found = (self.run.slips[0][int(at)] for at in self._slip_stamps[first:last])
        return [sample for sample in found if sample.valid]

    def watchdog(self, entry: LedgerEntry) -> CycleResult | None:
        """Run the cycle of the watchdog where the entry is of one: no joint state, so no input takes part."""
        if Health.from_code(entry.health).joint != Reason.SILENT or not self._arm.begun:
            return None
        return self._arm.without_joint_state(entry.now_ns)[0]


def _find(entry: LedgerEntry, samples: Mapping[int, Sample], stamp_ns: int, topic: str) -> Sample:
    """Return the sample that a ledger entry names."""
    if stamp_ns not in samples:
        got = f"no message with stamp {stamp_ns} ns"
        raise InputError(f"cycle {entry.cycle}: {topic}", got=got, expected="every sample the ledger names")
    return samples[stamp_ns]


def _take(session: ControllerSession, run: RecordedRun, entry: LedgerEntry) -> None:
    """Hand over the references or goals that had come since the cycle before.

    Raises:
        InputError: the bag has fewer than the controller took.
    """
    if entry.taken > len(run.given):
        got, expected = f"{len(run.given)} messages", f"the {entry.taken} of cycle {entry.cycle}"
        raise InputError("controller/reference_used", got=got, expected=expected)
    for item in run.given[int(session.task.taken) : entry.taken]:
        if isinstance(item, PoseGoal):
            session.set_goal(item)
        else:
            session.set_reference(item)


def _compare(
    run: RecordedRun, entry: LedgerEntry, recorded: NDArray[np.float64], result: CycleResult
) -> Divergence | None:
    topic, replayed = f"{run.params.command.interface}_command", result.numbers
    if recorded.shape != replayed.shape:
        return Divergence(entry.cycle, entry.joint_ns, topic, "numbers", len(recorded), len(replayed))
    differs = np.flatnonzero(recorded.view(np.int64) != replayed.view(np.int64))  # the bits: NaN, -0.0
    if len(differs):
        name, pair = run.params.joint_names[differs[0]], (float(recorded[differs[0]]), float(replayed[differs[0]]))
        return Divergence(entry.cycle, entry.joint_ns, topic, name, *pair)
    if entry.mode != result.mode:
        return Divergence(entry.cycle, entry.joint_ns, "controller/ledger", "mode", entry.mode, int(result.mode))
    return None
