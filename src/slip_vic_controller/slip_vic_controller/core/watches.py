"""Watches over single inputs: what is wrong with a sample when it arrives, and with an input before it is used.

The clock is an argument: steady time in real time, the joint state's stamp in lockstep. Stamps are compared with
stamps only, arrival times with arrival times only.
"""

from __future__ import annotations

import math
from collections import Counter
from typing import Any

import numpy as np

from slip_core.arrays import Array, readonly
from slip_core.types import JointSample
from slip_vic_controller.core.arm import ArmModel
from slip_vic_controller.core.safety_params import InputParams, WatchParams
from slip_vic_controller.core.trouble import Trouble
from slip_vic_controller.core.watch_kernel import (
    ABSURD,
    DENORMAL,
    JUMP,
    MOVES,
    NOT_FINITE,
    SAME,
    judge_joints,
    judge_six,
)

_LONGEST_COAST_S = 0.1  # for which a velocity explains a change of position
_WEIGHT = 0.02  # of a new period in the mean
_TWICE = 2  # stamps in a row that are ahead of the joint state's: one alone is the sample's own fault


class Rhythm:
    """Rate and jitter of an input."""

    def __init__(self) -> None:
        self._last_ns: int | None = None
        self.period_s = math.nan
        self.jitter_s = 0.0

    def beat(self, now_ns: int) -> None:
        """Take an arrival."""
        if self._last_ns is not None:
            period = (now_ns - self._last_ns) * 1e-9
            change = period - self.period_s
            if change != change:  # the first period
                self.period_s, change = period, 0.0
            self.jitter_s += _WEIGHT * (abs(change) - self.jitter_s)
            self.period_s += _WEIGHT * change
        self._last_ns = now_ns


class VectorWatch:
    """Watches wrench or slip velocity of one contact.

    Args:
        params: age and freeze limits.
        largest: linear and angular magnitude above which a sample is absurd.
        future_s: how far a stamp may be ahead of the joint state's.
        zero_is_normal: whether a value of zero may stay for ever, as a slip velocity does in stick.
    """

    def __init__(
        self, params: WatchParams, largest: tuple[float, float], future_s: float, *, zero_is_normal: bool
    ) -> None:
        self._age_ns = round(params.age_s * 1e9)
        self._frozen_ns = round(params.frozen_s * 1e9)
        self._largest = largest
        self._future_ns = round(future_s * 1e9)
        self._zero_is_normal = zero_is_normal
        self.counts: Counter[Trouble] = Counter()
        self.rhythm = Rhythm()
        self.reset()

    def reset(self) -> None:
        """Forget all samples, not the counts."""
        self._stamp_ns: int | None = None
        self._arrival_ns = 0
        self._values: Array | None = None
        self._equal_since_ns = 0
        self._invalid = False
        self._ahead = 0
        self._refused = Trouble.SILENT, 0

    def judge(self, stamp_ns: int, values: Array, valid: bool, now_ns: int, joint_stamp_ns: int | None) -> Trouble:
        """Return what is wrong with a sample (6,); only NONE and DENORMAL are to be used."""
        trouble, bits = self._judge(stamp_ns, values, valid, joint_stamp_ns)
        self._ahead = self._ahead + 1 if trouble == Trouble.FUTURE else 0
        if trouble == Trouble.NONE or trouble == Trouble.DENORMAL:
            if not bits & SAME:
                self._equal_since_ns = stamp_ns
            self._stamp_ns, self._values, self._arrival_ns = stamp_ns, values, now_ns
            self.rhythm.beat(now_ns)
        elif trouble in _BAD_VALUES:
            self._refused = trouble, now_ns
        if trouble != Trouble.NONE:
            self._invalid = self._invalid or trouble == Trouble.INVALID
            self.counts[trouble] += 1
        else:
            self._invalid = False
        return trouble

    def _judge(self, stamp_ns: int, values: Array, valid: bool, joint_stamp_ns: int | None) -> tuple[Trouble, int]:
        if values.shape != (6,):
            return Trouble.REFUSED, 0
        if self._stamp_ns is not None and stamp_ns <= self._stamp_ns:
            return (Trouble.DUPLICATE if stamp_ns == self._stamp_ns else Trouble.OUT_OF_ORDER), 0
        if joint_stamp_ns is not None and stamp_ns > joint_stamp_ns + self._future_ns:
            return Trouble.FUTURE, 0
        if not valid:
            return Trouble.INVALID, 0
        bits = judge_six(values, _UNKNOWN_SIX if self._values is None else self._values, *self._largest)
        if bits & _BAD_NUMBERS:
            return (Trouble.NOT_FINITE if bits & NOT_FINITE else Trouble.ABSURD), bits
        return (Trouble.DENORMAL if bits & DENORMAL else Trouble.NONE), bits

    def rebase(self, joint_stamp_ns: int) -> None:
        """Take the joint state's new clock: a sample ahead of it belongs to the old one."""
        if self._stamp_ns is not None and self._stamp_ns > joint_stamp_ns + self._future_ns:
            self.reset()

    def worth(self, now_ns: int, joint_stamp_ns: int, arm_moves: bool) -> Trouble:
        """Return why the newest good sample does not count in a cycle."""
        if self._stamp_ns is None or self._values is None:
            return Trouble.NEVER_SEEN
        if self._invalid:
            return Trouble.INVALID
        if self._ahead >= _TWICE or self._stamp_ns > joint_stamp_ns + self._future_ns:
            # Two clocks that differ, or joint states that were long on their way: not to wait for the age limit.
            return Trouble.FUTURE
        if now_ns - self._arrival_ns > self._age_ns:
            # Silent is only who says nothing: "absurdly large" tells a user of an object that has been lost.
            trouble, refused_ns = self._refused
            return trouble if now_ns - refused_ns <= self._age_ns else Trouble.SILENT
        if joint_stamp_ns - self._stamp_ns > self._age_ns:
            return Trouble.STALE
        frozen = self._stamp_ns - self._equal_since_ns > self._frozen_ns
        if frozen and (self._values.any() if self._zero_is_normal else arm_moves):
            return Trouble.FROZEN
        return Trouble.NONE


class JointWatch:
    """Watches the joint state.

    Args:
        arm: its limits tell what is absurd.
        params: limits.
        lockstep: a clock or position that jumps is taken at once, because the bridge waits for the answer.
    """

    def __init__(self, arm: ArmModel, params: InputParams, *, lockstep: bool) -> None:
        joint = params.joint
        slack = joint.position_slack
        fastest = arm.velocity_limit * joint.velocity_factor
        self._limits = readonly((arm.position_lower - slack, arm.position_upper + slack, fastest))
        self._unknown = readonly(np.full(arm.position_lower.shape, np.nan))
        self._jump = joint.jump
        self._clock_jump_ns = round(params.clock_jump_s * 1e9)
        self._age_ns, self._frozen_ns = round(joint.age_s * 1e9), round(joint.frozen_s * 1e9)
        self._accept_after = 1 if lockstep else params.accept_after
        self._size = arm.position_lower.shape
        self.counts: Counter[Trouble] = Counter()
        self.rhythm = Rhythm()
        self._last: tuple[JointSample, int] | None = None
        self._candidate: tuple[JointSample, int] | None = None
        self._agreeing = 0
        self._equal_since_ns = 0
        self._moves = False

    @property
    def newest(self) -> JointSample | None:
        """The last good joint state."""
        return None if self._last is None else self._last[0]

    def judge(self, sample: JointSample, now_ns: int) -> Trouble:
        """Return what is wrong with a joint state; RESTARTED is good, and everything before it is void."""
        trouble, bits = self._judge(sample, now_ns, self._last)
        if trouble in (Trouble.CLOCK_JUMP, Trouble.JUMP):
            before = self._candidate
            agrees = before is not None and self._judge(sample, now_ns, before)[0] in (Trouble.NONE, Trouble.DENORMAL)
            self._agreeing = self._agreeing + 1 if agrees else 1
            self._candidate = sample, now_ns
            if self._agreeing >= self._accept_after:
                trouble = Trouble.RESTARTED
        if trouble != Trouble.NONE:
            self.counts[trouble] += 1
        if trouble in (Trouble.NONE, Trouble.RESTARTED, Trouble.DENORMAL):
            if not bits & SAME:
                self._equal_since_ns = now_ns
            self._moves = bool(bits & MOVES)
            self._last, self._candidate, self._agreeing = (sample, now_ns), None, 0
            self.rhythm.beat(now_ns)
        return trouble

    def _judge(self, sample: JointSample, now_ns: int, before: tuple[JointSample, int] | None) -> tuple[Trouble, int]:
        """Return what is wrong with a sample in itself, or as one that follows another; and the bits of its numbers."""
        q, qd = sample.position, sample.velocity
        if q.shape != self._size or qd.shape != self._size:
            return Trouble.REFUSED, 0
        if before is None:
            bits = judge_joints(q, qd, self._limits, self._unknown, self._unknown, 0.0, 0.0)
            trouble = Trouble.NONE
        else:
            last, last_now_ns = before
            passed = sample.stamp_ns - last.stamp_ns
            coast_s = 2.0 * min(passed * 1e-9, _LONGEST_COAST_S)
            bits = judge_joints(q, qd, self._limits, last.position, last.velocity, self._jump, coast_s)
            trouble = self._clock_trouble(passed, now_ns - last_now_ns)
        if bits & _BAD_NUMBERS:
            return (Trouble.NOT_FINITE if bits & NOT_FINITE else Trouble.ABSURD), bits
        if trouble == Trouble.NONE and bits & (JUMP | DENORMAL):
            trouble = Trouble.JUMP if bits & JUMP else Trouble.DENORMAL
        return trouble, bits

    def _clock_trouble(self, passed: int, waited: int) -> Trouble:
        """Return how a stamp does not follow another one [ns], while `waited` passed on the steady clock [ns]."""
        if passed <= 0:
            if passed <= -self._clock_jump_ns:
                return Trouble.CLOCK_JUMP
            return Trouble.OUT_OF_ORDER if passed < 0 else Trouble.DUPLICATE
        return Trouble.CLOCK_JUMP if passed - waited > self._clock_jump_ns else Trouble.NONE

    def memory(self) -> tuple[Any, ...]:
        """Return what the watch knows of the last good joint state."""
        if self._last is None:
            return ()
        last, now_ns = self._last
        parts = (last.stamp_ns, last.position, last.velocity, last.effort)
        return (*parts, now_ns, self._equal_since_ns, self._moves)

    def recall(self, memory: tuple[Any, ...]) -> None:
        """Go on from what `memory` gave."""
        self._last = None
        if memory:
            stamp_ns, position, velocity, effort, now_ns, self._equal_since_ns, self._moves = memory
            self._last = JointSample(stamp_ns, position, velocity, effort), now_ns

    def silent(self, now_ns: int) -> bool:
        """Return whether no good joint state has come for the age limit."""
        return self._last is not None and now_ns - self._last[1] > self._age_ns

    def frozen(self, now_ns: int) -> bool:
        """Return whether the values have been equal to the last bit for longer than measured ones can while moving."""
        return self._last is not None and now_ns - self._equal_since_ns > self._frozen_ns

    def arm_moves(self) -> bool:
        """Return whether the last good joint state says so."""
        return self._moves


_UNKNOWN_SIX = readonly(np.full(6, np.nan))
_BAD_NUMBERS = NOT_FINITE | ABSURD
_BAD_VALUES = (Trouble.NOT_FINITE, Trouble.ABSURD)
