"""What must hold on every message, judged without the controller's own bookkeeping."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from slip_vic_controller.arm.estimator import BLIND_S
from slip_vic_controller.params.controller_params import SafetyParams
from test.campaigns.faults.plan import JOINT, SLIP, WRENCH

Numbers = NDArray[np.float64]
NS = 1e-9
ROUNDING = 1e-9  # [N m]: sums of a few numbers of some tens
AT_REST = 0.1  # [rad/s]
REST_AFTER_S = 1.0
LOST_M = 0.05  # slip at which an object has left the pads: half of what the simulation's pads are long
TWICE = 2  # a single stamp that is ahead is the sample's own fault
REACTION_S = 0.02  # beyond the age limit: the watchdog's period and one cycle


@dataclass(frozen=True, slots=True)
class Promise:
    """The limits of a command, (n,) [N m], [rad/s] or [rad], and of its slope, each per second.

    least: lower limits where they are not -most (positions). longest_step_s, restart_after_s, period_s: as in the
    parameters.
    """

    most: Numbers
    rate: Numbers | float
    longest_step_s: float
    restart_after_s: float
    period_s: float
    least: Numbers | None = None

    @property
    def lowest(self) -> Numbers:
        """The lower limits."""
        return -self.most if self.least is None else self.least


@dataclass
class CommandMonitor:
    """Every command: size, finite, effort limit, slope by the controller's clock, and a start without a step."""

    promise: Promise
    violations: list[str] = field(default_factory=list)
    commands: int = 0
    _last: tuple[int, Numbers, int] | None = None

    def restarted(self) -> None:
        """The controller has lost its memory, or the command before the next one was not seen."""
        self._last = None

    def inside(self, now_ns: int, effort: Numbers) -> bool:
        """Judge a command by itself; return whether the slope to it can be judged too."""
        now_s = NS * now_ns
        if effort.shape != self.promise.most.shape:
            self.violations.append(f"{now_s:.3f} s: {len(effort)} numbers")
            return False
        if not np.isfinite(effort).all():
            self.violations.append(f"{now_s:.3f} s: command {effort.tolist()}")
            return False
        if (effort > self.promise.most).any() or (effort < self.promise.lowest).any():
            self.violations.append(f"{now_s:.3f} s: command {effort.tolist()} above the limits")
        return True

    def take(
        self, now_ns: int, effort: Numbers, starts: Callable[[], Sequence[Numbers]], measured_ns: int
    ) -> None:  # fmt: skip
        """Take a command.

        now_ns: when it was given, of a steady clock; starts: gives the commands from which a first one, or the first
        after a pause, may begin: what is measured, gravity compensation or rest; measured_ns: stamp of the joint state
        that it answers.

        After a pause without a new joint state the last command is all that is known of what drives do: the next one
        goes on from there, with the step of a pause. What was measured before the pause is behind.
        """
        if len(effort) == 0:
            self._last = None
            return
        self.commands += 1
        promise = self.promise
        if not self.inside(now_ns, effort):
            return
        known, passed_s = None, np.inf
        if self._last is not None:
            passed_s = NS * (now_ns - self._last[0])
            blind = measured_ns == self._last[2]
            known = self._last[1] if passed_s <= promise.restart_after_s or blind else None
        passed_s = promise.period_s if known is None else passed_s
        allowed = promise.rate * min(passed_s, promise.longest_step_s)
        before = [known] if known is not None else [np.clip(e, promise.lowest, promise.most) for e in starts()]
        beyond = min((float((np.abs(effort - start) - allowed).max()) for start in before), default=0.0)
        if beyond > ROUNDING:
            kind = "from what the joints feel" if known is None else f"in {1e3 * passed_s:.3f} ms"
            self.violations.append(
                f"{NS * now_ns:.3f} s: command steps {kind} by {beyond:.6g} more than allowed: {effort.tolist()}"
                f" after {[start.tolist() for start in before]}"
            )
        self._last = (now_ns, effort, measured_ns)


@dataclass
class AnswerMonitor:
    """Every good joint state is answered.

    patience: joint states in a row that may go without an answer, while the controller decides whether their source
    has restarted.
    """

    patience: int
    violations: list[str] = field(default_factory=list)
    _unanswered: int = 0

    def begin_again(self) -> None:
        """Whether the source has restarted is decided again: a clock has jumped, or a joint state is damaged."""
        self._unanswered = 0

    def take(self, now_s: float, answered: bool, good: bool) -> None:
        """Judge a cycle; good: whether its joint state must be answered."""
        self._unanswered = 0 if answered else self._unanswered + good
        if self._unanswered == self.patience + 1:
            self.violations.append(f"{now_s:.3f} s: {self._unanswered} good joint states without an answer")


@dataclass
class JointMonitor:
    """What the joints feel: no step above the drives' slope, whoever commands; and rest where nobody follows."""

    largest_change: float
    rest_after_s: float = REST_AFTER_S
    violations: list[str] = field(default_factory=list)
    _last: Numbers | None = None
    _resting_since: float | None = None

    def restarted(self) -> None:
        """The simulation has been made anew."""
        self._last, self._resting_since = None, None

    def begin_again(self) -> None:
        """The time to come to rest begins anew: another one holds the arm, or what it carries is no longer the same."""
        self._resting_since = None

    def take(self, now_s: float, applied: Numbers, velocity: Numbers, follows: bool) -> None:
        """Take applied efforts and velocities of a tick; `follows`: whether the law is at work."""
        if self._last is not None:
            step = float(np.abs(applied - self._last).max())
            if step > self.largest_change + ROUNDING:
                self.violations.append(f"{now_s:.3f} s: joint effort steps by {step:.3f} N m")
        self._last = applied
        if follows:
            self._resting_since = None
        elif self._resting_since is None:
            self._resting_since = now_s
        elif now_s - self._resting_since > self.rest_after_s and np.abs(velocity).max() > AT_REST:
            self.violations.append(f"{now_s:.3f} s: not at rest: {np.abs(velocity).max():.2f} rad/s")
            self._resting_since = now_s


def promised_ages(
    safety: SafetyParams, *, observer: bool, needs_slip: bool, has_wrench: bool, joints_spoilt: bool
) -> tuple[dict[str, float], dict[str, float]]:
    """Return `limits` and `unheeded` of a SafeStateMonitor; joints_spoilt: whether joint states may come that are none.

    Without slip velocity or wrench, and where joint states come that show nothing, the path comes to rest first.
    """
    inputs, rest_s = safety.inputs, 2.0 * safety.fallback.slow_down_s
    unheeded = {JOINT: inputs.age_s}
    limits = {JOINT: 0.9 * BLIND_S if joints_spoilt else inputs.age_s}
    if has_wrench:
        unheeded[WRENCH] = inputs.age_s
        limits[WRENCH] = inputs.age_s + rest_s
    if needs_slip:
        unheeded[SLIP] = inputs.slip_age_s
        limits[SLIP] = inputs.slip_age_s + rest_s + (safety.fallback.observer_s if observer else 0.0)
    return limits, unheeded


@dataclass
class SafeStateMonitor:
    """Without an input the law must end within a stated time, by the clock that the joint states show.

    How long the newest joint state was on its way nobody can tell from that one, because clocks need not agree: its age
    counts from its arrival. The stamps of the wrench can tell, where two in a row are ahead of it by `future_s`: then
    every age counts from when the sample was measured.

    limits, unheeded: input -> time [s] after its newest good sample was measured until the law must have ended, and
    until it must at least be degraded.
    """

    limits: dict[str, float]
    future_s: float
    unheeded: dict[str, float] = field(default_factory=dict)
    violations: list[str] = field(default_factory=list)
    _newest: dict[str, float] = field(default_factory=dict)
    _told: dict[tuple[str, str], float | None] = field(default_factory=dict)
    _ahead: int = 0
    _late_s: float = 0.0

    def good(self, name: str, measured_s: float, arrived_s: float) -> None:
        """A sample has arrived as it was sent."""
        newest = self._newest.get(name, -np.inf)
        self._newest[name] = max(measured_s, newest)
        if name == WRENCH:
            self._ahead = self._ahead + 1 if measured_s > self._newest.get(JOINT, np.inf) + self.future_s else 0
        elif name == JOINT and measured_s > newest:
            told = self._ahead >= TWICE and self._newest[WRENCH] > measured_s + self.future_s
            self._late_s = 0.0 if told else arrived_s - measured_s

    def stood_still(self, seconds: float, names: Iterable[str]) -> None:
        """What of these was measured before now is no older for a time in which nothing went on."""
        for name in self._newest.keys() & set(names):
            self._newest[name] += seconds

    def check(self, now_s: float, follows: bool, answered: bool = True, *, degraded: bool = True) -> None:
        """Judge the mode of a moment at which the controller ran; answered: whether it gave a command.

        Where no joint state comes no command is given, whatever else is missing: then the joint state's limit alone
        counts.
        """
        if follows:
            self._judge(now_s, answered, "law", self.limits)
        if follows and not degraded:
            self._judge(now_s, answered, "law with all it needs", self.unheeded)

    def _judge(self, now_s: float, answered: bool, what: str, limits: dict[str, float]) -> None:
        for name, limit in limits.items():
            newest = self._newest.get(name) if answered or name == JOINT else None
            passed_s = 0.0 if newest is None else now_s - self._late_s - newest
            if passed_s > limit + REACTION_S and self._told.get((what, name)) != newest:
                self.violations.append(f"{now_s:.3f} s: {what} at work {passed_s:.3f} s after the last good {name}")
                self._told[what, name] = newest
