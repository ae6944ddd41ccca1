"""All inputs of one controller under watch: which samples are used, and what the inputs are worth in a cycle."""

from __future__ import annotations

from collections import Counter
from typing import NamedTuple

from slip_core.types import JointSample, SlipSample, WrenchSample
from slip_vic_controller.core.arm import ArmModel
from slip_vic_controller.core.safety_params import InputParams
from slip_vic_controller.core.trouble import Trouble
from slip_vic_controller.core.watches import JointWatch, VectorWatch

USABLE = frozenset((Trouble.NONE, Trouble.DENORMAL, Trouble.RESTARTED))
UNANSWERED = frozenset((Trouble.OUT_OF_ORDER, Trouble.DUPLICATE, Trouble.CLOCK_JUMP))


class Health(NamedTuple):
    """What the inputs are worth in one cycle; NONE = good. `slip` and `wrench` are the worst of all contacts."""

    joint: Trouble = Trouble.NONE
    wrench: Trouble = Trouble.NONE
    slip: Trouble = Trouble.NONE
    outside: Trouble = Trouble.NONE

    def code(self) -> int:
        """Return all four in one number, for the ledger."""
        return self.joint | self.wrench << 8 | self.slip << 16 | self.outside << 24

    @staticmethod
    def from_code(code: int) -> Health:
        """Read `code`.

        Implements: ours: replay uses the verdicts of the run, whose arrival times no bag has.
        """
        return Health(*(Trouble(code >> shift & 0xFF) for shift in (0, 8, 16, 24)))


GOOD = Health()


class InputMonitor:
    """Watches joint state, and wrench and slip velocity of every contact.

    Args:
        arm: its limits tell what joint states are absurd.
        params: limits.
        contacts: number of contacts n_C.
        lockstep: the clock is the joint state's stamp.
    """

    def __init__(self, arm: ArmModel, params: InputParams, contacts: int, *, lockstep: bool) -> None:
        self._lockstep = lockstep
        wrench, slip = params.wrench, params.slip
        self.joint = JointWatch(arm, params, lockstep=lockstep)
        self.wrenches = [
            VectorWatch(wrench, (wrench.force, wrench.torque), params.future_s, zero_is_normal=False)
            for _ in range(contacts)
        ]
        self.slips = [
            VectorWatch(slip, (slip.linear, slip.angular), params.future_s, zero_is_normal=True)
            for _ in range(contacts)
        ]
        self.outside = Trouble.NONE
        self._outside_counts: Counter[str] = Counter()

    def joint_state(self, sample: JointSample, now_ns: int) -> Trouble:
        """Judge a joint state."""
        trouble = self.joint.judge(sample, now_ns)
        if trouble == Trouble.RESTARTED:
            for watch in (*self.wrenches, *self.slips):
                watch.rebase(sample.stamp_ns)
        return trouble

    def wrench(self, contact: int, sample: WrenchSample, now_ns: int) -> Trouble:
        """Judge a wrench."""
        return self.wrenches[contact].judge(sample.stamp_ns, sample.wrench, True, now_ns, self._joint_stamp_ns())

    def slip(self, contact: int, sample: SlipSample, now_ns: int) -> Trouble:
        """Judge a slip velocity."""
        return self.slips[contact].judge(sample.stamp_ns, sample.twist, sample.valid, now_ns, self._joint_stamp_ns())

    def health(self, joint_trouble: Trouble, joint_stamp_ns: int, now_ns: int) -> Health:
        """Return what the inputs are worth in a cycle that answers a joint state with this trouble."""
        moves = self.joint.arm_moves()
        wrench = slip = Trouble.NONE
        for wrenches, slips in zip(self.wrenches, self.slips, strict=True):
            wrench = max(wrench, wrenches.worth(now_ns, joint_stamp_ns, moves))
            slip = max(slip, slips.worth(now_ns, joint_stamp_ns, moves))
        return Health(joint_trouble, wrench, slip, self.outside)

    def set_publishers(self, counts: dict[str, int], own_topic_publishers: int) -> None:
        """Take how many publishers each input topic has, and how many our command topic has."""
        before = self.outside
        twice = [name for name, count in counts.items() if count > 1]
        self.outside = Trouble.SECOND_PUBLISHER if twice else Trouble.NONE
        if own_topic_publishers > 1:
            self.outside = Trouble.FOREIGN_COMMAND
        if self.outside not in (before, Trouble.NONE):
            self._outside_counts[f"{', '.join(twice) or 'effort command'} {self.outside.name.lower()}"] += 1

    def counts(self) -> dict[str, int]:
        """Return every trouble that was seen, as "input trouble", with how often."""
        named = {"joint state": self.joint.counts}
        for kind, watches in (("wrench", self.wrenches), ("slip", self.slips)):
            for i, watch in enumerate(watches):
                named[kind if i == 0 else f"{kind} of contact {i}"] = watch.counts
        return {
            f"{name} {trouble.name.lower()}": count
            for name, counts in named.items()
            for trouble, count in counts.items()
        } | dict(self._outside_counts)

    def _joint_stamp_ns(self) -> int | None:
        newest = self.joint.newest
        return None if newest is None else newest.stamp_ns
