"""Drives that do not take commands for a while: a protective stop, a driver that is paused or not switched on yet."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from slip_vic.scenarios.scenario import load
from slip_vic_controller.arm.command import CommandLimits, Interface, SentCommand, ignored_joint
from slip_vic_controller.arm.estimator import LASTS_S, MOVES
from slip_vic_controller.safety.conditions import Mode
from test.support.call import blank, call
from test.support.watched_loop import WatchedLoop

T, N = 2e-3, 3


class Paused(WatchedLoop):
    """A closed loop whose drives hold the arm by themselves for a while."""

    def __init__(self, drive: str, law: Any = "governed", name: str = "paper_planar", *assignments: str) -> None:
        super().__init__(load(name, law=law, drive=drive, sensor="event_1000", set=assignments))

    def cycles(self, count: int, *, paused: bool = False) -> Any:
        """Return the last result."""
        for _ in range(count):
            result = self.cycle(sent=lambda command: None if paused else command)
        return result

    def pause(self, count: int) -> Any:
        """Return the last result of a pause that begins when the law does."""
        self.cycles(330)
        return self.cycles(count, paused=True)


@pytest.mark.parametrize(
    ("name", "drive", "law"),
    [
        ("paper_planar", "velocity_500", "governed"), ("glass_transport", "velocity_125", "governed"),
        ("vertical_plane", "position_250", "governed"), ("paper_planar", "position_250", "vic"),
        ("glass_transport", "position_250", "governed"), ("vertical_plane", "velocity_500", "vic"),
    ],
)  # fmt: skip
def test_paused_arm_is_not_thrown(name: str, drive: str, law: str) -> None:
    """It went off at 0.4 to 2.8 rad/s, and position_250 lost the object in all three scenarios."""
    run = Paused(drive, law, name)
    result = run.pause(1500)
    assert result.mode == Mode.FAULT
    assert " ignores commands: " in result.reason
    run.fastest = 0.0
    assert run.cycles(500).mode == Mode.FAULT
    assert run.fastest < 0.02
    assert run.slip < 5e-4


def command(**values: Any) -> tuple[Any, Any]:
    """Return configuration and state of a command of N joints."""
    config, state = blank(CommandLimits), blank(SentCommand)
    config.interface, config.joints = Interface.POSITION, N
    config.velocity[:], config.lower[:], config.upper[:] = 2.0, -1.0, 1.0
    for name, value in values.items():
        state[name][:N] = value
    return config, state


def test_ignored_joint() -> None:
    for commanded, share, ignored in (
        (0.2, 0.0, True), (0.2, 0.45, True), (0.2, 0.55, False), (-0.2, 0.0, True), (0.2, 1.55, True),
        (0.9 * MOVES, 0.0, False), (1.1 * MOVES, 0.0, True),
    ):  # fmt: skip
        config, state = command(velocity=(0.0, commanded, 0.0))
        seen = [call(ignored_joint, config, state, np.array([0.0, share * commanded, 0.0]), T) for _ in range(250)]
        assert (max(seen) == 1) is ignored, (commanded, share)
        if ignored:
            assert LASTS_S <= T * (1 + seen.index(1)) < LASTS_S + 2 * T


def test_what_the_lag_of_a_drive_explains_is_not_ignored() -> None:
    """Servos at 50 Hz follow a command that turns round 0.1 s later: for a third of a second they move against it."""
    lag_s, period_s = 0.1, 0.02
    for share, ignored in ((1.0, False), (0.0, True)):
        config, state = command()
        config.lag_s, found = lag_s, -1
        for k in range(150):
            state.velocity[1], state.acceleration[1] = 0.5 * np.sin(period_s * k), 0.5 * np.cos(period_s * k)
            follows = share * 0.5 * np.sin(period_s * k - lag_s)
            found = max(found, call(ignored_joint, config, state, np.array([0.0, follows, 0.0]), period_s))
        assert (found == 1) is ignored
