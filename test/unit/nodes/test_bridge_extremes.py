"""Whatever the simulation accepts while it runs is harmless, or undone by a reset once inputs are good again."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from slip_core.errors import InputError
from slip_core.params import ParameterInfo, build, flatten, parameter_infos, range_of
from slip_sim_bridge.params import BridgeParams
from slip_sim_bridge.plant import DivergenceError
from slip_vic.scenarios.scenario import load_scenario
from slip_vic_controller.safety.modes import Mode, Request
from slip_vic_controller.session.manifest import Manifest
from test.support.one_arm import OneArm, one_arm

SUFFERS, BACK = 60, 700  # cycles
SMALLEST = 5e-324
LIVE = [info for info in parameter_infos(BridgeParams) if info.runtime]
AFTER_RESET = {"grip.force"}
"""Parameters that need not be set back: a reset does."""


def extremes(info: ParameterInfo) -> Iterator[Any]:
    """Yield the ends of what a parameter accepts, and the smallest number that it may hold."""
    if info.kind is bool:
        yield not info.default
        return
    bounds, largest = info.bounds, range_of(info.unit)[1]
    if info.kind in (int, float):
        yield from (bounds.get("ge", 0), bounds.get("le", largest))
        return
    for value in (largest, -largest, SMALLEST):
        yield [value] * (len(info.default) or 7)


class Loop:
    """Bridge and controller, as in real time: where a tick fails everything is put back and no command counts."""

    def __init__(self) -> None:
        self.scenario = load_scenario("paper_planar", mode="realtime")
        self.bridge = self.scenario.bridge_session()
        self.controller = OneArm(one_arm(self.scenario.controller, self.scenario.urdf, lockstep=True))
        self._counts = np.zeros(2, np.int64)
        self.mode = Mode.WAITING_INPUT

    def set(self, **values: Any) -> bool:
        """Set parameters of the bridge as they would be set on the node; return whether they are accepted."""
        try:
            self.bridge.change((build(BridgeParams, flatten(self.scenario.bridge) | values, "test"),))
        except InputError:
            return False
        return True

    def cycle(self) -> None:
        """Run one tick."""
        tick = self.bridge.observe()
        (arm,), session = tick.arms, self.controller
        for wrench in arm.wrenches:
            session.add_wrench(0, wrench)
        for slip in arm.slips:
            session.add_slip(0, slip)
        session.add_joint(arm.joint)
        self._counts += len(arm.wrenches), len(arm.slips)
        session.add_manifest(Manifest(tick.tick, tick.stamp_ns, (int(self._counts[0]),), (int(self._counts[1]),)))
        result = session.cycle()
        assert result is not None
        assert np.isfinite(result.effort).all()
        self.mode = result.mode
        try:
            self.bridge.advance([result.command])
        except DivergenceError:
            self.bridge.request_reset()

    def suffer(self, each: Callable[[int], Any] = lambda _: None) -> None:
        """Run for a while; `each` is called before every tick."""
        for number in range(SUFFERS):
            each(number)
            self.cycle()

    def comes_back(self) -> bool:
        """Reset and enable as an operator does; return whether the law is at work and stays so."""
        self.bridge.request_reset()
        self.controller.request(Request.RESET_FAULT)
        self.cycle()
        self.controller.request(Request.ENABLE)
        for _ in range(BACK):
            self.cycle()
        return self.mode == Mode.ACTIVE


@pytest.fixture(scope="module")
def loop() -> Loop:
    """One system for all: what an extreme leaves behind would show in the next."""
    made = Loop()
    made.suffer()
    assert made.comes_back()
    return made


def test_live_parameter_extremes_recover(loop: Loop) -> None:
    modes = set()
    for info in LIVE:
        for value in extremes(info):
            if not loop.set(**{info.name: value}):
                continue
            loop.suffer()
            modes.add(loop.mode)
            if info.name not in AFTER_RESET:
                assert loop.set()
            assert loop.comes_back(), (info.name, value, loop.controller.reason)
            loop.set()
    assert modes == {Mode.ACTIVE, Mode.DEGRADED}, "extremes without an effect show nothing"
