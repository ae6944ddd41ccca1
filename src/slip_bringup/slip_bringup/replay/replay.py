"""Run the controller again on what the ledger says it used, and compare every effort bit by bit."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from slip_bringup.replay.run_data import LedgerEntry, RecordedRun
from slip_core.errors import InputError
from slip_core.types import JointSample, SlipSample, WrenchSample
from slip_vic_controller.core.controller import VicController
from slip_vic_controller.core.input_monitor import Health
from slip_vic_controller.core.inputs import TickInputs
from slip_vic_controller.core.modes import Mode, Request
from slip_vic_controller.core.session import ControllerSession
from slip_vic_controller.core.snapshot import from_text
from slip_vic_controller.core.trouble import Trouble


@dataclass(frozen=True, slots=True)
class Divergence:
    """The first number that is not the recorded one in a cycle; `ulps` is None where there is no distance."""

    cycle: int
    stamp_ns: int
    topic: str
    field: str
    recorded: float
    replayed: float
    ulps: int | None


Sample = TypeVar("Sample", JointSample, WrenchSample, SlipSample)


class ReplayInputs:
    """Stands in for the session's input buffer: hands over exactly what a ledger entry names."""

    def __init__(self, run: RecordedRun) -> None:
        self._run = run
        self._slip_needed = run.params.controller == "vic"
        self._previous_slip = [-1] * len(run.slips)
        self._slip_stamps = [np.array(sorted(slips), dtype=np.int64) for slips in run.slips]
        self._entry: LedgerEntry | None = None
        self.joint_trouble = Trouble.NONE

    def give(self, entry: LedgerEntry) -> None:
        """Name the cycle that comes next."""
        self._entry = entry
        self.joint_trouble = Health.from_code(entry.health).joint

    def previous(self, entry: LedgerEntry) -> None:
        """Name the cycle before the first one: the slip samples up to it are not new."""
        self._previous_slip = list(entry.slip_ns)

    @property
    def newest_joint(self) -> JointSample:
        """The joint state the cycle answered."""
        return self._find(self._run.joints, self._given.joint_ns, "joint_states")

    def complete(self) -> bool:
        """Always: the entry says that the cycle was answered."""
        return self._entry is not None

    def missing(self) -> list[str]:
        """Whether the cycle had to wait for an input; its entry names no sample then."""
        named = any(self._given.wrench_ns) or any(self._given.slip_ns)
        waits = self._given.mode == Mode.WAITING_INPUT or (self._given.mode == Mode.FAULT and not named)
        return ["an input"] if waits else []

    def take(self) -> TickInputs | None:
        """Return the samples of the cycle, and the slip samples since the one before."""
        entry, run = self._given, self._run
        if self.missing():
            return None
        wrenches = tuple(
            self._find(samples, stamp, "wrench") for samples, stamp in zip(run.wrenches, entry.wrench_ns, strict=True)
        )
        slips = tuple(self._slip(index, stamp) for index, stamp in enumerate(entry.slip_ns))
        new_slips = tuple(self._new_slips(index, stamp) for index, stamp in enumerate(entry.slip_ns))
        return TickInputs(self.newest_joint, wrenches, slips, tuple((sample,) for sample in wrenches), new_slips)

    @property
    def _given(self) -> LedgerEntry:
        assert self._entry is not None
        return self._entry

    def _slip(self, contact: int, stamp_ns: int) -> SlipSample:
        if not self._slip_needed and stamp_ns == 0 and stamp_ns not in self._run.slips[contact]:
            return SlipSample(0, np.full(6, np.nan), valid=False)
        return self._find(self._run.slips[contact], stamp_ns, "slip_velocity")

    def _new_slips(self, contact: int, stamp_ns: int) -> tuple[SlipSample, ...]:
        stamps = self._slip_stamps[contact]
        first = np.searchsorted(stamps, self._previous_slip[contact], side="right")
        last = np.searchsorted(stamps, stamp_ns, side="right")
        self._previous_slip[contact] = max(self._previous_slip[contact], stamp_ns)
        found = (self._run.slips[contact][int(stamp)] for stamp in stamps[first:last])
        return tuple(sample for sample in found if sample.valid)

    def _find(self, samples: dict[int, Sample], stamp_ns: int, topic: str) -> Sample:
        try:
            return samples[stamp_ns]
        except KeyError:
            raise InputError(
                f"cycle {self._given.cycle}: {topic}",
                got=f"no message with stamp {stamp_ns} ns",
                expected="every sample the ledger names",
            ) from None


def first_index(run: RecordedRun, from_s: float = 0.0) -> int:
    """Return where in the ledger a replay begins: at its first cycle, or where the memory of the controller is known.

    Args:
        run: the run.
        from_s: begin no earlier than this many seconds after the first cycle.

    Raises:
        InputError: there is no such place.
    """
    if run.ledger[0].cycle == 0 and from_s <= 0.0:
        return 0
    earliest = run.ledger[0].joint_ns + round(1e9 * from_s)
    # The cycle before is needed too: it says which slip samples are new.
    for index, entry in enumerate(run.ledger[1:], start=1):
        if entry.joint_ns >= earliest and entry.cycle in run.states:
            return index
    raise InputError(
        "the ledger",
        got=f"a beginning at cycle {run.ledger[0].cycle}, and no controller/state at {from_s:g} s or later",
        expected="the run from its first cycle, or a state to begin with (one each second)",
    )


def replay(run: RecordedRun, begin: int = 0) -> Iterator[Divergence | None]:
    """Yield per cycle None where effort and mode are the recorded ones to the last bit, else the first difference.

    Args:
        run: the run.
        begin: index in the ledger, of `first_index`.

    Raises:
        InputError: the run cannot be replayed from this bag.

    Implements: ours: the ledger gives the inputs, clock, verdicts and requests of every cycle; the rest is code.
    """
    session = ControllerSession(VicController(run.params, run.urdf), lockstep=run.params.mode == "lockstep")
    inputs = ReplayInputs(run)
    session.inputs = inputs  # type: ignore[assignment]  # the same five methods
    changes = {change.index: change.params for change in run.changes}
    if begin > 0:
        session.restore(from_text(run.states[run.ledger[begin].cycle]))
        inputs.previous(run.ledger[begin - 1])
        for index in [index for index in changes if index < begin]:
            session.know(changes.pop(index))
    for index in range(begin, len(run.ledger)):
        entry, effort = run.ledger[index], run.efforts[index]
        if index in changes:
            session.retune(changes[index])
        inputs.give(entry)
        mode, replayed = _cycle(session, inputs, entry)
        yield _compare(run, entry, effort, replayed, mode)


def _cycle(session: ControllerSession, inputs: ReplayInputs, entry: LedgerEntry) -> tuple[int, NDArray[np.float64]]:
    health = Health.from_code(entry.health)
    if health.joint == Trouble.SILENT and session.state is not None and session.safety is not None:
        # The watchdog's cycle: no joint state, so nothing of the input side takes part.
        done = session.supervisor.without_joint_state(
            session.safety, session.state, entry.now_ns, Request(entry.request)
        )
        session.state, session.safety = done.control, done.state
        session.cycles += 1
        return int(done.state.mode.mode), done.command.effort
    session.monitor.joint.judge(inputs.newest_joint, entry.now_ns)
    session.request(Request(entry.request))
    result = session.cycle(entry.now_ns, health)
    assert result is not None, "a complete set of inputs is always answered"
    if not len(result.command.effort):
        session.state = None  # the run waited for an input, and began anew after it
    return int(result.mode.mode), result.command.effort


def _compare(
    run: RecordedRun, entry: LedgerEntry, recorded: NDArray[np.float64], replayed: NDArray[np.float64], mode: int
) -> Divergence | None:
    def differs(topic: str, field: str, one: float, other: float, ulps: int | None) -> Divergence:
        return Divergence(entry.cycle, entry.joint_ns, topic, field, one, other, ulps)

    if recorded.shape != replayed.shape:
        return differs("effort_command", "number of efforts", len(recorded), len(replayed), None)
    if recorded.tobytes() != replayed.tobytes():
        index = next(i for i in range(len(recorded)) if _bits(recorded[i]) != _bits(replayed[i]))
        distance = abs(_ordered(recorded[index]) - _ordered(replayed[index]))
        return differs(
            "effort_command", run.params.joint_names[index], float(recorded[index]), float(replayed[index]), distance
        )
    if entry.mode != mode:
        return differs("controller/ledger", "mode", entry.mode, mode, None)
    return None


def _bits(value: float) -> int:
    return int(struct.unpack("<q", struct.pack("<d", value))[0])


def _ordered(value: float) -> int:
    """Number the floats in order, so that neighbours differ by one."""
    bits = _bits(value)
    return bits if bits >= 0 else -(2**63) - bits
