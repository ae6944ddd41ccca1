"""Judges every command of the controller process, with the ledger that says when and in which mode it was given."""

from __future__ import annotations

import itertools
import time
from collections import deque
from collections.abc import Callable, Iterable
from functools import partial
from typing import Any

import numpy as np

from slip_core.stamps import NS_PER_S, stamp_of
from slip_core.topics import topic
from slip_msgs_py.fast_io import Receiver
from slip_vic_controller.arm.robot import Robot
from slip_vic_controller.params.controller_params import ControllerParams
from slip_vic_controller.safety.modes import Mode
from test.campaigns.faults.monitors import (
    NS,
    CommandMonitor,
    JointMonitor,
    Promise,
    SafeStateMonitor,
    TogetherMonitor,
    promised_ages,
)
from test.campaigns.faults.plan import EFFORT, JOINT, SLIP, WRENCH
from test.campaigns.faults.wire import Wire

REMEMBERED = 2000  # joint states
TELEPORT_S = 0.3  # after a reset of the simulation, within which its joints may feel anything
HOST_S = 0.1  # what a busy machine may take beyond the stated reaction
LEDGERS_S = 0.5  # how long joint states wait for the ledgers that tell the mode: no queue here holds more
ODD_ONES = 5  # commands that wait for a ledger that never comes


class Watch:
    """All monitors of an arm in a run over DDS.

    Args:
        wires: by topic, without the arm's prefix.
        params: of the controller.
        robot: for limits and gravity compensation.
        period_s: control period.
        effort_rate: of the bridge's drives [N m/s].
        timeout_s: age of the state that the newest command answers, beyond which the bridge holds the arm itself.
        allowed_rate: of commands [N m/s]; None takes the law's limit.
    """

    def __init__(
        self,
        wires: dict[str, Wire],
        params: ControllerParams,
        robot: Robot,
        period_s: float,
        effort_rate: float,
        timeout_s: float,
        allowed_rate: float | None = None,
    ) -> None:
        self._wires, self._robot = wires, robot
        safety = params.safety
        limits, inputs = safety.limits, safety.inputs
        rate = limits.effort_rate if allowed_rate is None else allowed_rate
        promise = Promise(robot.effort_limit, rate, limits.longest_step_s, limits.restart_after_s, period_s)
        ages, _ = promised_ages(
            safety,
            observer=params.slip_estimator == "observer",
            needs_slip=params.controller != "classical",
            has_wrench=True,
            joints_spoilt=True,
        )
        self.commands = CommandMonitor(promise)
        self.joints = JointMonitor(effort_rate * period_s)
        self._for_joints: deque[tuple[float, Callable[[], object]]] = deque()
        self.safe = SafeStateMonitor({name: age + period_s + HOST_S for name, age in ages.items()}, inputs.future_s)
        self._timeout_ns = round(1e9 * timeout_s)
        self.mode = Mode.WAITING_INPUT
        self.mode_since_s = 0.0
        self.alive_s = 0.0
        self._period_ns = round(1e9 * period_s)
        self._efforts: deque[tuple[int, bytes]] = deque()
        self._ledgers: deque[tuple[int, int, int, Mode]] = deque()
        self._states: deque[tuple[int, bytes]] = deque(maxlen=REMEMBERED)
        self._cycle = -1
        self.not_judged = 0  # commands whose slope is unknown, because a message was lost on its way to this monitor
        self._state_stamp_ns: int | None = None
        self._ignore_until_s = 0.0
        self._answered_ns: int | None = None  # stamp of the state that the newest command in the bridge answers
        self._was_obeyed, self._state_s = False, 0.0
        self._last_seen = np.zeros(0)  # positions that the command before answered
        self.by_itself = False  # two sources alternate: no command follows the one before
        self.on_mode: Callable[[Mode], object] = lambda _: None
        self.on_cycle: Callable[[int, Mode], object] = lambda *_: None
        """Called with controller's clock [ns] and mode of every cycle."""
        self._ledger: Receiver[tuple[int, int, int, Mode]] = Receiver(
            topic("controller/ledger").type, ("data",), lambda _: _entry, stamp=""
        )

    def violations(self) -> list[str]:
        """Return what was found since the last call."""
        found = []
        for monitor in (self.commands, self.joints, self.safe):
            found += monitor.violations
            monitor.violations.clear()
        return found

    def forwarded(self, name: str, data: bytes, sent_ns: int, counts: bool) -> None:
        """A message has been handed on to controller or bridge."""
        if name == JOINT:
            self._states.append((stamp_of(data) if len(data) >= 12 else 0, data))
        elif name == EFFORT and (command := self._wires[EFFORT].receive(data)) is not None:
            self._answered_ns = command.stamp_ns if len(command.effort) else None
        if name != EFFORT and counts:
            self.safe.good(name, sent_ns * 1e-9, time.monotonic())

    def command(self, data: bytes) -> None:
        """A command, as the controller sent it."""
        self._efforts.append((stamp_of(data), data))
        self._pair()

    def ledger(self, data: bytes) -> None:
        """The ledger of a cycle."""
        entry = self._ledger(data)
        _, _, clock_ns, mode = entry
        now_s = clock_ns * 1e-9
        self._joints_until(now_s)
        self.safe.check(now_s, mode.follows)
        if mode != self.mode:
            self.mode_since_s = now_s
        self.mode, self.alive_s = mode, now_s
        self.on_mode(mode)
        self.on_cycle(clock_ns, mode)
        self._ledgers.append(entry)
        self._pair()

    def teleport(self, now_s: float) -> None:
        """The simulation is about to be reset."""
        self._ignore_until_s = now_s + TELEPORT_S

    def stood_still(self, seconds: float) -> None:
        """This machine did not run: what was handed on before may have waited as long for the controller."""
        self.safe.stood_still(seconds, (JOINT, WRENCH, SLIP))

    def bridge_state(self, data: bytes, now_s: float) -> None:
        """A joint state as the bridge sent it."""
        sample = self._wires[JOINT].receive(data)
        if sample is None:
            return
        last, self._state_stamp_ns = self._state_stamp_ns, sample.stamp_ns
        steps = 1 if last is None else (sample.stamp_ns - last) / self._period_ns
        if not 0.5 < steps < 1.5 or now_s < self._ignore_until_s:
            self._for_joints.append((now_s, self.joints.restarted))
        # By the bridge's rule: a command that answers an old state does not count, however often one arrives.
        answered_ns = self._answered_ns
        obeyed = answered_ns is not None and 0 <= sample.stamp_ns - answered_ns <= self._timeout_ns
        if obeyed != self._was_obeyed or now_s - self._state_s > 1e-9 * self._timeout_ns:
            self.begin_again(now_s)  # another one holds the arm from now on, and begins from its motion
        self._was_obeyed, self._state_s = obeyed, now_s

        def take() -> None:
            # By the simulation's clock: a bridge that was stopped has not moved meanwhile.
            follows = self.mode.follows and obeyed
            self.joints.take(sample.stamp_ns * 1e-9, sample.effort, sample.velocity, follows)

        self._for_joints.append((now_s, take))
        self._joints_until(now_s - LEDGERS_S)

    def begin_again(self, now_s: float) -> None:
        """The time to come to rest begins anew: another one holds the arm, or what it carries is not the same."""
        self._for_joints.append((now_s, self.joints.begin_again))

    def _joints_until(self, now_s: float) -> None:
        """Judge the joint states that came before. A ledger may come later than what the arm did after it."""
        while self._for_joints and self._for_joints[0][0] <= now_s:
            self._for_joints.popleft()[1]()

    def _pair(self) -> None:
        """Judge commands with their ledgers; one whose ledger is missing is judged by itself.

        Without joint states several commands answer the same one: where one of them was lost nobody can tell which.
        """
        while self._efforts and self._ledgers:
            stamp_ns, state_ns = self._efforts[0][0], self._ledgers[0][1]
            if stamp_ns == state_ns:
                efforts = _how_many(stamp_ns, (each[0] for each in self._efforts))
                ledgers = _how_many(stamp_ns, (each[1] for each in self._ledgers))
                if efforts == len(self._efforts) or ledgers == len(self._ledgers):
                    return  # more of them may come
                commands = [self._efforts.popleft()[1] for _ in range(efforts)]
                entries = [self._ledgers.popleft() for _ in range(ledgers)]
                if efforts != ledgers:
                    for data in commands:
                        self._alone(data)
                    continue
                for data, (cycle, _, clock_ns, _) in zip(commands, entries, strict=True):
                    self._judge(stamp_ns, data, cycle, clock_ns)
            elif stamp_ns < state_ns or len(self._efforts) > ODD_ONES:
                self._alone(self._efforts.popleft()[1])
            else:
                self._ledgers.popleft()

    def _alone(self, data: bytes) -> None:
        effort = np.array(self._wires[EFFORT].typed(data).effort)
        if len(effort):
            self.not_judged += 1
            self.commands.inside(round(1e9 * self.alive_s), effort)

    def _judge(self, stamp_ns: int, data: bytes, cycle: int, clock_ns: int) -> None:
        known = cycle in (0, self._cycle + 1) and not self.by_itself
        if not known or cycle == 0:
            self.commands.restarted()
        self._cycle = cycle
        command = self._wires[EFFORT].typed(data)
        effort = np.array(command.effort)
        if known:
            starts = self._starts(stamp_ns, np.array(command.position))
            self.commands.take(clock_ns, effort, lambda: starts, stamp_ns)
        elif len(effort):
            self.not_judged += 1
            if self.by_itself:
                self.commands.inside(clock_ns, effort)
            else:
                self.commands.take(clock_ns, effort, tuple, stamp_ns)

    def _starts(self, stamp_ns: int, position: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return the efforts from which a first command may begin, as the controller was told them."""
        samples = [self._wires[JOINT].receive(data) for stamp, data in self._states if stamp == stamp_ns]
        starts = [sample.effort for sample in samples if sample is not None]
        shape = self._robot.effort_limit.shape
        for seen in (position, self._last_seen):
            if seen.shape == shape and np.isfinite(seen).all():
                starts.append(self._robot.gravity(seen))
        self._last_seen = position
        return tuple(start for start in starts if start.shape == shape and np.isfinite(start).all())


class Watches:
    """The watch of each arm, and whether the law is at work for all of them or for none.

    Args:
        arms: by the prefix of their topics.
        period_s: control period.
    """

    def __init__(self, arms: dict[str, Watch], period_s: float) -> None:
        self.arms = arms
        self.together = TogetherMonitor(tuple(arms), period_s)
        self._cycle_ns = 0
        self._follows: dict[str, bool] = {}
        for prefix, watch in arms.items():
            watch.on_cycle = partial(self._cycle, prefix)

    @property
    def mode(self) -> Mode:
        """The mode that is furthest from the law at work."""
        return worst(watch.mode for watch in self.arms.values())

    @property
    def mode_since_s(self) -> float:
        """When a mode changed last."""
        return max(watch.mode_since_s for watch in self.arms.values())

    @property
    def alive_s(self) -> float:
        """Until when all arms have had commands."""
        return min(watch.alive_s for watch in self.arms.values())

    @property
    def commands(self) -> int:
        """How many have been judged."""
        return sum(watch.commands.commands for watch in self.arms.values())

    @property
    def not_judged(self) -> int:
        """Commands whose slope is unknown, because a message was lost on its way to the monitor."""
        return sum(watch.not_judged for watch in self.arms.values())

    def violations(self) -> list[str]:
        """Return what was found since the last call."""
        found = [text for watch in self.arms.values() for text in watch.violations()] + self.together.violations
        self.together.violations.clear()
        return found

    def forwarded(self, name: str, data: bytes, sent_ns: int, counts: bool) -> None:
        """A message has been handed on to controller or bridge; name: of its topic, with the arm's prefix."""
        arm, slash, topic_name = name.rpartition("/")
        self.arms[arm + slash].forwarded(topic_name, data, sent_ns, counts)

    def teleport(self, now_s: float) -> None:
        """The simulation is about to be reset."""
        for watch in self.arms.values():
            watch.teleport(now_s)

    def stood_still(self, seconds: float) -> None:
        """This machine did not run."""
        for watch in self.arms.values():
            watch.stood_still(seconds)

    def begin_again(self) -> None:
        """The time to come to rest begins anew: another one holds the arms, or what they carry is not the same."""
        for watch in self.arms.values():
            watch.begin_again(time.monotonic())

    def observe(self, on_mode: Callable[[Mode], object], *, by_itself: bool) -> None:
        """Call with every mode from now on; by_itself: two sources alternate, so no command follows the one before."""
        for watch in self.arms.values():
            watch.on_mode, watch.by_itself = on_mode, by_itself

    def _cycle(self, prefix: str, clock_ns: int, mode: Mode) -> None:
        """Judge the arms together where the newest cycle has told of all of them."""
        if clock_ns != self._cycle_ns:
            self._cycle_ns = clock_ns
            self._follows.clear()
        self._follows[prefix] = mode.follows
        if len(self._follows) == len(self.arms):
            self.together.check(NS * clock_ns, tuple(self._follows[each] for each in self.arms))


def worst(modes: Iterable[Mode]) -> Mode:
    """Return the mode that is furthest from the law at work."""
    order = (Mode.ACTIVE, Mode.DEGRADED, Mode.HOLD, Mode.WAITING_INPUT, Mode.FAULT)
    return max(modes, key=order.index)


def _how_many(stamp_ns: int, stamps: Iterable[int]) -> int:
    """Return how many of these begin the row with this stamp."""
    return sum(1 for _ in itertools.takewhile(lambda each: each == stamp_ns, stamps))


def _entry(_stamp_ns: int, data: Any) -> tuple[int, int, int, Mode]:
    """Return cycle, state's stamp, controller's clock [ns] and mode of a ledger."""
    row = [int(x) for x in data]
    clock_sec, clock_nsec, mode = row[-5:-2]
    return row[0], row[1] * NS_PER_S + row[2], clock_sec * NS_PER_S + clock_nsec, Mode(mode)
