"""Run the controller again on the inputs of the ledger: identical to the last bit, or where it first differs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple, TypeVar

import numpy as np

from slip_core.arms import prefix_of
from slip_core.errors import InputError
from slip_core.types import PoseGoal, SlipSample
from slip_vic.replay.run_data import LedgerEntry, RecordedRun
from slip_vic.run.versions import git_revision, versions
from slip_vic_controller.config.controller import Controller
from slip_vic_controller.safety.conditions import Missing, Reason, Request
from slip_vic_controller.session.cycle_result import CycleResult, Health
from slip_vic_controller.session.session import ArmSession, ControllerSession

KINDS = {"effort": "efforts", "velocity": "velocities", "position": "positions"}
Sample = TypeVar("Sample")


class Comparison(NamedTuple):
    """How many cycles and commanded numbers were compared, how many cycles differ, and the first difference."""

    cycles: int
    numbers: int
    kind: str  # efforts, velocities or positions, with squeezes where the grip is commanded
    different: int
    first: str

    @property
    def identical(self) -> bool:
        """Whether not one bit differs."""
        return self.different == 0

    def text(self) -> str:
        """Return the verdict in one line."""
        if self.identical:
            return f"identical: {self.cycles} cycles, {self.numbers} {self.kind}, to the last bit"
        return f"differs in {self.different} of {self.cycles} cycles; first in {self.first}"


def verify_run(runs: Mapping[str, RecordedRun]) -> Comparison:
    """Replay the run of each arm, in one controller.

    Raises:
        InputError: the run cannot be replayed from its bag.
    """
    commands = [command for run in runs.values() for command in run.commands]
    kind = KINDS[next(iter(runs.values())).params.command.interface]
    squeezes = sum(len(run.squeezes) for run in runs.values())
    found = list(filter(None, _replay(runs)))
    kind += " and squeezes" if squeezes else ""
    return Comparison(len(commands), sum(map(len, commands)) + squeezes, kind, len(found), next(iter(found), ""))


def other_software(recorded: Mapping[str, str]) -> list[str]:
    """Return a line for each version that differs from the recorded one: only the same software gives the same bits."""
    here = {**versions(), "git_revision": git_revision()}
    return [
        f"recorded with {name} {version}, here it is {here.get(name, 'not installed')}"
        for name, version in recorded.items()
        if here.get(name) != version
    ]


def _replay(runs: Mapping[str, RecordedRun]) -> Iterator[str]:
    """Yield per cycle of each arm what differs first, nothing where commands and mode are as recorded to the last bit.

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
            yield _difference(arm, entry, result)


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
        """Take the parameters, references and goals since the previous cycle; return the entry of this one."""
        entry = self.run.ledger[self.at]
        for changed in self.run.changes.get(self.at, ()):
            params = [arm.tuned for arm in self._session.arms]
            params[self._arm.index] = changed
            self._session.retune(params)
        self.at += 1
        taken = int(self._session.task.taken)
        if entry.taken > len(self.run.given):
            got, expected = f"{len(self.run.given)} messages", f"the {entry.taken} of cycle {entry.cycle}"
            raise InputError("controller/reference_used", got=got, expected=expected)
        for item in self.run.given[taken : entry.taken]:
            if isinstance(item, PoseGoal):
                self._session.set_goal(item)
            else:
                self._session.set_reference(item)
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


def _difference(arm: _Arm, entry: LedgerEntry, result: CycleResult) -> str:
    """Return the first number of the cycle before the arm's next one that is not the recorded one, with its place."""
    recorded, replayed, params = arm.run.commands[arm.at - 1], result.numbers, arm.run.params
    squeeze = arm.run.squeezes[arm.at - 1] if arm.run.squeezes else result.grip
    topic = f"{params.command.interface}_command"
    pair: tuple[float, float]
    if recorded.shape != replayed.shape:
        where, pair = f"{topic}, numbers", (len(recorded), len(replayed))
    elif len(differs := np.flatnonzero(recorded.view(np.int64) != replayed.view(np.int64))):  # the bits: NaN, -0.0
        where, pair = f"{topic}, {params.joint_names[differs[0]]}", (recorded[differs[0]], replayed[differs[0]])
    elif squeeze.hex() != result.grip.hex():  # the bits, too
        where, pair = "grip_command", (squeeze, result.grip)
    elif entry.mode != result.mode:
        where, pair = "controller/ledger, mode", (entry.mode, int(result.mode))
    else:
        return ""
    was, now = map(float, pair)
    at = f"cycle {entry.cycle} (stamp {entry.joint_ns * 1e-9:.9f} s), {prefix_of(arm.name)}{where}"
    return f"{at}: recorded {was!r}, replayed {now!r}"
