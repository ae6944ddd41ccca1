"""The guard in the cycle: when it holds the control acceleration back, and up to which load."""

from __future__ import annotations

import functools

import numpy as np
import pytest

from slip_core.records import record
from slip_vic.run.in_process import ClosedLoop
from slip_vic.scenarios.scenario import load_scenario
from slip_vic_controller.cycle.governing import guard, held
from slip_vic_controller.governor.guard import missing_load
from slip_vic_controller.state import CONFIG, OUTPUTS
from test.support.call import call

TICKS = 700
"""Tare and the first tenths of a second on the path."""


class OnItsPath:
    """A governed arm with one pad on its path, whose law asks for 20 m/s^2 along the slip plane."""

    def __init__(self, drive: str) -> None:
        self._loop = ClosedLoop(load_scenario("paper_planar", law="governed", drive=drive))  # type: ignore[arg-type]
        for _ in range(TICKS):
            outputs = self._loop.observe()
            self.result = self._loop.control(outputs)
            self._loop.bridge.advance([self.result.command])
        assert self.result.mode.follows
        self.config = record(self._loop.session.controller.config, CONFIG)
        self.state, self.path = self._loop.controller.state, self._loop.session.task.governor
        self.outputs = record(self.result.outputs.copy(), OUTPUTS)
        self.outputs.law.a_C[:] = 20.0, 0.0, 0.0, 0.0, 0.0, 0.0

    def factor(self, *, slips: bool, overrun: bool, off_m: float = 0.0) -> float:
        """Return the guard's factor; off_m: distance from the reference, where nothing is measured of 50 N."""
        self.state.pad.estimate.slipping, self.path.overrun = int(slips), int(overrun)
        self.state.pad.commanded, self.state.pad.measured = 50.0, 0.0
        self.outputs.law.error_linear, self.outputs.law.error_angular = off_m, 0.0
        grasped = call(held, self.config, self.state, self.outputs.gains)
        task = self._loop.session.task
        return float(call(guard, self.config, task, self.state, self.result.arm, self.outputs, grasped))


@functools.cache
def on_its_path(drive: str) -> OnItsPath:
    return OnItsPath(drive)


@pytest.mark.parametrize(("drive", "stays"), [("ideal", False), ("torque_joint", True)])
def test_guard_holds_overrun_slide(drive: str, stays: bool) -> None:
    """Found by the lottery: the impedance dragged at an object that had overrun its path with four times F^."""
    arm = on_its_path(drive)
    holds = arm.factor(slips=False, overrun=False)
    assert 0.0 < holds < 0.5
    assert arm.factor(slips=False, overrun=True) == holds
    assert arm.factor(slips=True, overrun=False) == 1.0
    assert arm.factor(slips=True, overrun=True) == (holds if stays else 1.0)


def test_missing_load_of_slide_is_ignored() -> None:
    arm = on_its_path("torque_joint")
    assert arm.factor(slips=False, overrun=True, off_m=0.03) == 1.0
    assert arm.factor(slips=True, overrun=True, off_m=0.03) == arm.factor(slips=True, overrun=True)
    assert np.isclose(arm.factor(slips=True, overrun=True), arm.factor(slips=False, overrun=False))


def test_missing_load_counts_far_away() -> None:
    cases = (0.0, 0.0, 0.0), (0.01, 0.05, 0.0), (0.015, 0.0, 0.5), (0.0, 0.075, 0.5), (1.0, 0.0, 1.0)
    for linear, angular, share in cases:
        for commanded, measured, F, missing in (
            (2.0, 1.6, 2.0, 0.36), (2.0, 1.97, 2.0, 0.0), (1.6, 2.0, 2.0, 0.0), (2.0, 2.39, 2.0, 0.0),
            (0.5, 3.0, 2.0, 1.2),
        ):  # fmt: skip
            assert call(missing_load, commanded, measured, F, linear, angular) == pytest.approx(missing * share)
