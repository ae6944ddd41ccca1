"""Watches over single inputs: what is wrong with a sample when it arrives, and with an input before it is used.

The clock is an argument: steady time in real time, the joint state's stamp in lockstep. Stamps are compared with
stamps only, arrival times with arrival times only.
"""

from __future__ import annotations

import math
from collections import Counter

import numpy as np

from slip_msgs_py.arrays import Array
from slip_msgs_py.types import JointSample
from slip_vic_controller.core.arm import ArmModel
from slip_vic_controller.core.safety_params import InputParams, WatchParams
from slip_vic_controller.core.trouble import Trouble

_TINY = float(np.finfo(np.float64).tiny)
_ARM_MOVES = 0.02  # [rad/s]
_LONGEST_COAST_S = 0.1  # for which a velocity explains a change of position
_WEIGHT = 0.02  # of a new period in the mean


def has_denormal(values: Array) -> bool:
    """Return whether a number is neither zero nor normal; (k,), finite.

    Implements: ours: what a broken driver leaves, and what makes arithmetic slow.
    """
    return any(0.0 < x < _TINY for x in map(abs, values.tolist()))


def finite(values: Array) -> bool:
    """Return whether no element is NaN or infinite; (k,).

    Implements: ours: without numpy's warnings, which a user may have turned into exceptions.
    """
    return all(map(math.isfinite, values.tolist()))


def same(a: Array, b: Array) -> bool:
    """Return whether two arrays are equal to the last bit; (k,), (k,), contiguous.

    Implements: ours: frozen values; a tenth of what numpy's own comparison costs.
    """
    return a.tobytes() == b.tobytes()


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
            if math.isnan(self.period_s):
                self.period_s = period
            self.jitter_s += _WEIGHT * (abs(period - self.period_s) - self.jitter_s)
            self.period_s += _WEIGHT * (period - self.period_s)
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

    def judge(self, stamp_ns: int, values: Array, valid: bool, now_ns: int, joint_stamp_ns: int | None) -> Trouble:
        """Return what is wrong with a sample (6,); only NONE and DENORMAL are to be used."""
        trouble = self._judge(stamp_ns, values, valid, joint_stamp_ns)
        self._invalid = trouble == Trouble.INVALID or (self._invalid and trouble != Trouble.NONE)
        if trouble in (Trouble.NONE, Trouble.DENORMAL):
            if self._values is None or not same(values, self._values):
                self._equal_since_ns = stamp_ns
            self._stamp_ns, self._values, self._arrival_ns = stamp_ns, values, now_ns
            self.rhythm.beat(now_ns)
        if trouble != Trouble.NONE:
            self.counts[trouble] += 1
        return trouble

    def _judge(self, stamp_ns: int, values: Array, valid: bool, joint_stamp_ns: int | None) -> Trouble:
        if values.shape != (6,):
            return Trouble.REFUSED
        if self._stamp_ns is not None and stamp_ns <= self._stamp_ns:
            return Trouble.DUPLICATE if stamp_ns == self._stamp_ns else Trouble.OUT_OF_ORDER
        if joint_stamp_ns is not None and stamp_ns > joint_stamp_ns + self._future_ns:
            return Trouble.FUTURE
        if not valid:
            return Trouble.INVALID
        if not finite(values):
            return Trouble.NOT_FINITE
        numbers = values.tolist()
        if math.hypot(*numbers[:3]) > self._largest[0] or math.hypot(*numbers[3:]) > self._largest[1]:
            return Trouble.ABSURD
        return Trouble.DENORMAL if has_denormal(values) else Trouble.NONE

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
        if now_ns - self._arrival_ns > self._age_ns:
            return Trouble.SILENT
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
        lower, upper = (arm.position_lower - slack).tolist(), (arm.position_upper + slack).tolist()
        # Plain floats: seven of them are looked at sooner than numpy is called.
        self._limits = list(zip(lower, upper, (arm.velocity_limit * joint.velocity_factor).tolist(), strict=True))
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

    @property
    def newest(self) -> JointSample | None:
        """The last good joint state."""
        return None if self._last is None else self._last[0]

    def judge(self, sample: JointSample, now_ns: int) -> Trouble:
        """Return what is wrong with a joint state; RESTARTED is good, and everything before it is void."""
        trouble = self._judge(sample, now_ns)
        if trouble in (Trouble.CLOCK_JUMP, Trouble.JUMP):
            before = self._candidate
            agrees = before is not None and self._compare(sample, now_ns, before) == Trouble.NONE
            self._agreeing = self._agreeing + 1 if agrees else 1
            self._candidate = sample, now_ns
            if self._agreeing >= self._accept_after:
                trouble = Trouble.RESTARTED
        if trouble != Trouble.NONE:
            self.counts[trouble] += 1
        if trouble in (Trouble.NONE, Trouble.RESTARTED, Trouble.DENORMAL):
            last = self.newest
            if last is None or not (same(last.position, sample.position) and same(last.velocity, sample.velocity)):
                self._equal_since_ns = now_ns
            self._last, self._candidate, self._agreeing = (sample, now_ns), None, 0
            self.rhythm.beat(now_ns)
        return trouble

    def _judge(self, sample: JointSample, now_ns: int) -> Trouble:
        q, qd = sample.position, sample.velocity
        if q.shape != self._size or qd.shape != self._size:
            return Trouble.REFUSED
        if not (finite(q) and finite(qd)):
            return Trouble.NOT_FINITE
        for x, v, (lower, upper, fastest) in zip(q.tolist(), qd.tolist(), self._limits, strict=True):
            if not (lower <= x <= upper and abs(v) <= fastest):
                return Trouble.ABSURD
        if self._last is not None:
            trouble = self._compare(sample, now_ns, self._last)
            if trouble != Trouble.NONE:
                return trouble
        return Trouble.DENORMAL if has_denormal(q) or has_denormal(qd) else Trouble.NONE

    def _compare(self, sample: JointSample, now_ns: int, before: tuple[JointSample, int]) -> Trouble:
        """Return how a sample does not follow another one."""
        last, last_now_ns = before
        passed = sample.stamp_ns - last.stamp_ns
        if passed <= 0:
            if passed <= -self._clock_jump_ns:
                return Trouble.CLOCK_JUMP
            return Trouble.OUT_OF_ORDER if passed < 0 else Trouble.DUPLICATE
        if passed - (now_ns - last_now_ns) > self._clock_jump_ns:
            return Trouble.CLOCK_JUMP
        coast_s = 2.0 * min(passed * 1e-9, _LONGEST_COAST_S)
        arrays = (sample.position, sample.velocity, last.position, last.velocity)
        for x, v, last_x, last_v in zip(*(array.tolist() for array in arrays), strict=True):
            if abs(x - last_x) > self._jump + coast_s * max(abs(v), abs(last_v)):
                return Trouble.JUMP
        return Trouble.NONE

    def silent(self, now_ns: int) -> bool:
        """Return whether no good joint state has come for the age limit."""
        return self._last is not None and now_ns - self._last[1] > self._age_ns

    def frozen(self, now_ns: int) -> bool:
        """Return whether the values have been equal to the last bit for longer than measured ones can while moving."""
        return self._last is not None and now_ns - self._equal_since_ns > self._frozen_ns

    def arm_moves(self) -> bool:
        """Return whether the last good joint state says so."""
        last = self.newest
        return last is not None and bool(np.count_nonzero(np.abs(last.velocity) > _ARM_MOVES))
