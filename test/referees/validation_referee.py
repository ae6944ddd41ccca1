"""Input validation in plain form: watches that keep the last good sample as a value, numpy for the numbers."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from typing import Any

import numpy as np

from slip_core.arrays import Array
from slip_core.types import JointSample
from slip_vic_controller.arm.robot import Robot
from slip_vic_controller.params.safety_params import InputParams
from slip_vic_controller.safety.faults import Fault

LONGEST_COAST_S = 0.1
MOVES_RAD_S = 0.02
GOOD = (Fault.NONE, Fault.DENORMAL)


def denormal(values: Array) -> bool:
    return bool(((values != 0.0) & (np.abs(values) < np.finfo(float).tiny)).any())


class VectorReferee:
    """Wrench or slip velocity of one contact; limits: WatchParams with what is absurd in `largest`."""

    def __init__(self, limits: Any, largest: tuple[float, float], future_s: float, *, zero_is_normal: bool) -> None:
        self.age_ns, self.frozen_ns = round(limits.age_s * 1e9), round(limits.frozen_s * 1e9)
        self.largest, self.future_ns, self.zero_is_normal = largest, round(future_s * 1e9), zero_is_normal
        self.counts: Counter[Fault] = Counter()
        self.forget()

    def forget(self) -> None:
        self.last: tuple[int, Array, int] | None = None
        self.equal_since_ns, self.invalid, self.ahead = 0, False, 0
        self.refused: tuple[Fault, int] | None = None

    def receive(self, stamp_ns: int, values: Array, valid: bool, now_ns: int, joint_stamp_ns: int | None) -> Fault:
        fault = self.fault_of(stamp_ns, values, valid, joint_stamp_ns)
        self.ahead = self.ahead + 1 if fault == Fault.FUTURE else 0
        if fault in GOOD:
            if self.last is None or self.last[1].tobytes() != values.tobytes():
                self.equal_since_ns = stamp_ns
            self.last = stamp_ns, values, now_ns
        if fault in (Fault.NOT_FINITE, Fault.ABSURD):
            self.refused = fault, now_ns
        if fault in (Fault.NONE, Fault.INVALID):
            self.invalid = fault == Fault.INVALID
        self.counts[fault] += fault != Fault.NONE
        return fault

    def fault_of(self, stamp_ns: int, values: Array, valid: bool, joint_stamp_ns: int | None) -> Fault:
        if values.shape != (6,):
            return Fault.REFUSED
        if self.last is not None and stamp_ns == self.last[0]:
            return Fault.DUPLICATE
        if self.last is not None and stamp_ns < self.last[0]:
            return Fault.OUT_OF_ORDER
        if joint_stamp_ns is not None and stamp_ns - joint_stamp_ns > self.future_ns:
            return Fault.FUTURE
        if not valid:
            return Fault.INVALID
        if not np.isfinite(values).all():
            return Fault.NOT_FINITE
        with np.errstate(over="ignore"):
            sizes = np.linalg.norm(values[:3]), np.linalg.norm(values[3:])
        if sizes[0] > self.largest[0] or sizes[1] > self.largest[1]:
            return Fault.ABSURD
        return Fault.DENORMAL if denormal(values) else Fault.NONE

    def rebase(self, joint_stamp_ns: int) -> None:
        if self.last is not None and self.last[0] - joint_stamp_ns > self.future_ns:
            self.forget()

    def validity(self, now_ns: int, joint_stamp_ns: int, arm_moves: bool) -> Fault:
        if self.last is None:
            return Fault.NEVER_SEEN
        stamp_ns, values, arrival_ns = self.last
        if self.invalid:
            return Fault.INVALID
        if self.ahead > 1 or stamp_ns - joint_stamp_ns > self.future_ns:
            return Fault.FUTURE
        if now_ns - arrival_ns > self.age_ns:
            lately = self.refused is not None and now_ns - self.refused[1] <= self.age_ns
            return self.refused[0] if lately and self.refused else Fault.SILENT
        if joint_stamp_ns - stamp_ns > self.age_ns:
            return Fault.STALE
        changes = values.any() if self.zero_is_normal else arm_moves
        return Fault.FROZEN if stamp_ns - self.equal_since_ns > self.frozen_ns and changes else Fault.NONE


class JointReferee:
    """The joint state."""

    def __init__(self, robot: Robot, params: InputParams, *, lockstep: bool) -> None:
        joint = params.joint
        self.lower, self.upper = (
            robot.position_lower - joint.position_slack,
            robot.position_upper + joint.position_slack,
        )
        self.fastest, self.jump = robot.velocity_limit * joint.velocity_factor, joint.jump
        self.clock_jump_ns = round(params.clock_jump_s * 1e9)
        self.age_ns, self.frozen_ns = round(joint.age_s * 1e9), round(joint.frozen_s * 1e9)
        self.accept_after = 1 if lockstep else params.accept_after
        self.counts: Counter[Fault] = Counter()
        self.last: tuple[JointSample, int] | None = None
        self.after_jump: list[tuple[JointSample, int]] = []
        self.equal_since_ns, self.moves = 0, False
        self.spiked: Array | bool = False
        self.jumped: Array | bool = False
        self.without, self.stands_since_ns = False, 0

    def receive(self, sample: JointSample, now_ns: int) -> Fault:
        """Return what is wrong; after a jump, `accept_after` samples that follow each other are a new beginning."""
        whole = sample.position.shape == sample.velocity.shape == self.lower.shape
        if whole:
            self.without = bool((self.without or self.last is None) and np.isnan(sample.velocity).all())
        if whole and self.without:
            kept = np.zeros(sample.position.size) if self.last is None else self.last[0].velocity
            sample = replace(sample, velocity=kept)
        fault = self.fault_of(sample, now_ns, self.last)
        if fault == Fault.JUMP and self.silent(now_ns):
            fault = Fault.RESTARTED
        if fault in (Fault.CLOCK_JUMP, Fault.JUMP):
            follows = self.fault_of(sample, now_ns, self.after_jump[-1]) if self.after_jump else fault
            late = follows in (Fault.DUPLICATE, Fault.OUT_OF_ORDER)
            if follows not in GOOD and not late:
                self.after_jump = []
            if not late:
                self.after_jump.append((sample, now_ns))
            if len(self.after_jump) >= self.accept_after:
                fault = Fault.RESTARTED
        self.counts[fault] += fault != Fault.NONE
        if fault in (*GOOD, Fault.RESTARTED):
            before, held_s = (self.last[0] if self.last else None), 0.0
            if before is not None:
                held_s = 1e-9 * (sample.stamp_ns - self.stands_since_ns)
            if before is None or _bits(before) != _bits(sample):
                self.equal_since_ns = now_ns
            self.moves = bool((np.abs(sample.velocity) > MOVES_RAD_S).any())
            used = self.without_spikes(sample, before, fault, held_s)
            if before is None or fault == Fault.RESTARTED or (used.position != before.position).any():
                self.stands_since_ns = sample.stamp_ns
            self.last, self.after_jump = (used, now_ns), []
        return fault

    def without_spikes(
        self, sample: JointSample, before: JointSample | None, fault: Fault, held_s: float
    ) -> JointSample:
        """A velocity that changes by more than 0.3 rad/s and 100 rad/s^2 is the positions', but not twice in a row.

        A position that is more than 5 mrad and 100 rad/s^2 beyond what velocities explain is where the last one leads.
        """
        if before is None or fault == Fault.RESTARTED:
            self.spiked = self.jumped = False
            return replace(sample, velocity=np.zeros(sample.position.size)) if self.without else sample
        passed_s = 1e-9 * (sample.stamp_ns - before.stamp_ns)
        led, way = before.position + passed_s * before.velocity, np.abs(sample.position - before.position)
        explained = min(held_s, 0.1) * np.maximum(np.abs(sample.velocity), np.abs(before.velocity))
        self.jumped = (way - explained > 5e-3 + 100.0 * passed_s**2) & ~np.asarray(self.jumped)
        sample = replace(sample, position=np.where(self.jumped, led, sample.position))
        shown = (sample.position - before.position) / passed_s
        change, of_positions = (np.abs(v - before.velocity) for v in (sample.velocity, shown))
        if self.without and (sample.position != before.position).any():
            velocity = (sample.position - before.position) / held_s
            return replace(sample, velocity=np.clip(velocity, -self.fastest, self.fastest))
        self.spiked = (change > 0.3 + 100.0 * passed_s) & ~np.asarray(self.spiked)
        return replace(sample, velocity=np.where(self.spiked & (of_positions < change), shown, sample.velocity))

    def fault_of(self, sample: JointSample, now_ns: int, before: tuple[JointSample, int] | None) -> Fault:
        q, qd = sample.position, sample.velocity
        if q.shape != self.lower.shape or qd.shape != self.lower.shape:
            return Fault.REFUSED
        if not np.isfinite(np.concatenate((q, qd))).all():
            return Fault.NOT_FINITE
        if (q < self.lower).any() or (q > self.upper).any() or (np.abs(qd) > self.fastest).any():
            return Fault.ABSURD
        if before is not None:
            last, last_ns = before
            passed, waited = sample.stamp_ns - last.stamp_ns, now_ns - last_ns
            if passed <= -self.clock_jump_ns or (passed > 0 and passed - waited > self.clock_jump_ns):
                return Fault.CLOCK_JUMP
            if passed <= 0:
                return Fault.OUT_OF_ORDER if passed < 0 else Fault.DUPLICATE
            coast = 2.0 * min(passed * 1e-9, LONGEST_COAST_S) * np.maximum(np.abs(qd), np.abs(last.velocity))
            if (np.abs(q - last.position) > self.jump + coast).any():
                return Fault.JUMP
        return Fault.DENORMAL if denormal(np.concatenate((q, qd))) else Fault.NONE

    def frozen(self, now_ns: int) -> bool:
        return self.last is not None and now_ns - self.equal_since_ns > self.frozen_ns

    def silent(self, now_ns: int) -> bool:
        return self.last is not None and now_ns - self.last[1] > self.age_ns


def _bits(sample: JointSample) -> bytes:
    return sample.position.tobytes() + sample.velocity.tobytes()
