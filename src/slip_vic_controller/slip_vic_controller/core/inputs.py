"""Collects samples between ticks and says when a set is complete; the same for lockstep, real time and replay."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, cast

import numpy as np

from slip_core.errors import InputError
from slip_core.types import JointSample, SlipSample, WrenchSample
from slip_vic_controller.core.input_monitor import UNANSWERED, USABLE, InputMonitor
from slip_vic_controller.core.trouble import Trouble


class TickInputs(NamedTuple):
    """What one cycle uses: the joint state, and per contact the samples that came since the last cycle, oldest first.

    `wrenches` and `slips` hold the newest sample of each contact.
    """

    joint: JointSample
    wrenches: tuple[WrenchSample, ...]
    slips: tuple[SlipSample, ...]
    new_wrenches: tuple[tuple[WrenchSample, ...], ...]
    new_slips: tuple[tuple[SlipSample, ...], ...]


class Manifest(NamedTuple):
    """The bridge's list of what belongs to a lockstep tick: samples published so far, per contact."""

    tick: int
    stamp_ns: int
    wrench_counts: tuple[int, ...]
    slip_counts: tuple[int, ...]

    @staticmethod
    def decode(data: Sequence[int]) -> Manifest:
        """Read [tick, sec, nanosec, wrench count, slip count, ... per contact]; [ns] inside.

        Raises:
            InputError: a list of another length.

        Implements: ours: the lockstep protocol of the topic table.
        """
        if len(data) < 5 or len(data) % 2 == 0:
            raise InputError("lockstep tick", got=f"{len(data)} numbers", expected="3, and 2 more per contact")
        return Manifest(data[0], data[1] * 1_000_000_000 + data[2], tuple(data[3::2]), tuple(data[4::2]))


class InputBuffer:
    """Newest sample per input, samples since the last tick, and counts for lockstep.

    Args:
        contacts: number of contacts n_C.
        lockstep: True waits for exactly the samples of a manifest, so that runs are repeatable; False takes
            whatever is newest when a joint state arrives.
        monitor: judges every sample, and keeps bad ones out; None takes all.
        slip_needed: whether a set without a good slip velocity is incomplete.
    """

    def __init__(
        self, contacts: int, *, lockstep: bool, monitor: InputMonitor | None = None, slip_needed: bool = True
    ) -> None:
        self._lockstep = lockstep
        self._monitor = monitor
        self._slip_needed = slip_needed
        self.joint_trouble = Trouble.NONE
        self._joint: JointSample | None = None
        self._manifest: Manifest | None = None
        self._wrenches: list[list[WrenchSample]] = [[] for _ in range(contacts)]
        self._slips: list[list[SlipSample]] = [[] for _ in range(contacts)]
        self._newest_wrench: list[WrenchSample | None] = [None] * contacts
        self._newest_slip: list[SlipSample | None] = [None] * contacts
        self._wrench_counts = [0] * contacts
        self._slip_counts = [0] * contacts
        self.skipped = 0
        self._all_seen = False

    def add_joint(self, sample: JointSample, now_ns: int | None = None) -> None:
        """Take a joint state; one that was never used is skipped, newest wins. `now_ns`: steady time of its arrival."""
        trouble = Trouble.NONE
        if self._monitor is not None:
            trouble = self._monitor.joint_state(sample, sample.stamp_ns if now_ns is None else now_ns)
            if trouble in UNANSWERED and not self._lockstep:
                return
        if self._joint is not None:
            self.skipped += 1
            if self.joint_trouble == Trouble.RESTARTED and trouble in USABLE:
                trouble = Trouble.RESTARTED
        self._joint, self.joint_trouble = sample, trouble

    def add_wrench(self, contact: int, sample: WrenchSample, now_ns: int | None = None) -> None:
        """Take a wrench of one contact; the newest by stamp counts, whatever the order of arrival."""
        self._wrench_counts[contact] += 1
        if self._monitor is not None:
            trouble = self._monitor.wrench(contact, sample, sample.stamp_ns if now_ns is None else now_ns)
            if trouble not in USABLE:
                return
        self._wrenches[contact].append(sample)
        newest = self._newest_wrench[contact]
        if self._monitor is not None or newest is None or sample.stamp_ns >= newest.stamp_ns:
            self._newest_wrench[contact] = sample

    def add_slip(self, contact: int, sample: SlipSample, now_ns: int | None = None) -> None:
        """Take a slip velocity of one contact; the newest by stamp counts, whatever the order of arrival."""
        self._slip_counts[contact] += 1
        if self._monitor is not None:
            trouble = self._monitor.slip(contact, sample, sample.stamp_ns if now_ns is None else now_ns)
            if trouble not in USABLE:
                return
        self._slips[contact].append(sample)
        newest = self._newest_slip[contact]
        if self._monitor is not None or newest is None or sample.stamp_ns >= newest.stamp_ns:
            self._newest_slip[contact] = sample

    def add_manifest(self, manifest: Manifest) -> None:
        """Take the list of what belongs to the current lockstep tick."""
        self._manifest = manifest

    @property
    def newest_joint(self) -> JointSample:
        """The joint state that the next cycle answers; only after `complete`."""
        if self._joint is None:
            raise RuntimeError("newest_joint before complete()")
        return self._joint

    def missing(self) -> list[str]:
        """Return the inputs that have never been seen.

        Implements: ours: no command before every input was seen once.
        """
        if self._all_seen and self._joint is not None:
            return []
        names = ["joint_states"] if self._joint is None else []
        names += [f"wrench of contact {i}" for i, sample in enumerate(self._newest_wrench) if sample is None]
        slips = self._newest_slip if self._slip_needed else ()
        return names + [f"slip of contact {i}" for i, sample in enumerate(slips) if sample is None]

    def complete(self) -> bool:
        """Return whether a cycle can be answered now: a joint state, and in lockstep all that belongs to its stamp.

        Implements: ours: lockstep answers every tick, also one whose other inputs are still missing.
        """
        if self._joint is None:
            return False
        if not self._lockstep:
            return True
        manifest = self._manifest
        return (
            manifest is not None
            and manifest.stamp_ns == self._joint.stamp_ns
            and tuple(self._wrench_counts) == manifest.wrench_counts
            and tuple(self._slip_counts) == manifest.slip_counts
        )

    def take(self) -> TickInputs | None:
        """Hand over the set for this tick and start collecting for the next; None where an input was never seen.

        Implements: ours: no command before every input was seen once.
        """
        joint = self._joint
        if not self._all_seen:
            newest = (*self._newest_wrench, *(self._newest_slip if self._slip_needed else ()))
            self._all_seen = all(sample is not None for sample in newest)
        if joint is None or not self._all_seen:
            self._joint = None
            self._manifest = None
            return None
        inputs = TickInputs(
            joint,
            cast("tuple[WrenchSample, ...]", tuple(self._newest_wrench)),
            tuple([sample or _NO_SLIP for sample in self._newest_slip]),
            tuple([tuple(samples) for samples in self._wrenches]),
            tuple([tuple(samples) for samples in self._slips]),
        )
        self._joint = None
        self._manifest = None
        for wrench_samples in self._wrenches:
            wrench_samples.clear()
        for slip_samples in self._slips:
            slip_samples.clear()
        return inputs


_NO_SLIP = SlipSample(0, np.full(6, np.nan), valid=False)
