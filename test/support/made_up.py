"""A controller of the small test arm with made-up samples: no bridge, no physics, whatever a test wants to say."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from slip_core.params import build
from slip_core.records import record
from slip_core.types import JointSample, SlipSample, WrenchSample
from slip_vic_controller.config.controller import Controller
from slip_vic_controller.params.controller_params import ControllerParams
from slip_vic_controller.safety.conditions import Reason
from slip_vic_controller.session.cycle_result import CycleResult, Health
from slip_vic_controller.state import CONFIG
from test.support.one_arm import OneArm, one_arm
from test.support.small_arm import HOME, small_arm_urdf

MS = 1_000_000
STAMP_NS = 1_000_000_000_000
NOW_NS = 5_000_000_000
POSITION = np.array(HOME)
VELOCITY = np.full(7, 0.05)
LOAD = np.array([0.1, 0.2, -4.9, 0.0, 0.0, 0.01])
SLIP = np.array([0.004, -0.002, 0.0, 0.0, 0.0, 0.03])
NOISE = 1e-7 * np.random.default_rng(0).uniform(-1.0, 1.0, (4096, 10))  # no measured number is equal to the one before
N = len(HOME)
CALM = {
    "safety__load__drop_speed": 1e3, "safety__limits__error_linear": 100.0, "safety__limits__error_angular": 100.0,
}  # fmt: skip
"""For an arm that is held: it does not do what the law wants, and nothing of that is to be a finding."""


def controller_of(lockstep: bool = False, **values: Any) -> Controller:
    """Return a controller of parameters, flat names with `__` for the dot."""
    return _controller(lockstep, tuple((name.replace("__", "."), value) for name, value in values.items()))


@lru_cache
def _controller(lockstep: bool, values: tuple[tuple[str, Any], ...]) -> Controller:
    controller = one_arm(build(ControllerParams, dict(values), "test"), small_arm_urdf(), lockstep=lockstep)
    controller.config = controller.config.copy()
    record(controller.config, CONFIG).estimator.difference = math.inf  # made-up velocities are not those of positions
    return controller


class MadeUp:
    """A session, the two clocks, and ordinary samples where a test says nothing else.

    lockstep, values: as of `controller_of`.
    """

    def __init__(self, lockstep: bool = False, **values: Any) -> None:
        self.controller = controller_of(lockstep, **values)
        self.session = OneArm(self.controller)
        self.stamp_ns, self.now_ns, self.tick = STAMP_NS, STAMP_NS if lockstep else NOW_NS, 0

    @property
    def state(self) -> Any:
        return self.session.state

    def pass_time(self, passed_ns: int = MS) -> None:
        self.stamp_ns, self.now_ns, self.tick = self.stamp_ns + passed_ns, self.now_ns + passed_ns, self.tick + 1

    def noise(self, size: int) -> np.ndarray:
        return NOISE[self.tick % len(NOISE), :size]

    def joint(self, position=POSITION, velocity=VELOCITY, effort=None) -> JointSample:
        """Return a joint state at the present stamp."""
        effort = np.zeros(len(position)) if effort is None else effort
        return JointSample(self.stamp_ns, position + self.noise(len(position)), np.array(velocity), effort)

    def deliver(self, wrench=LOAD, slip=SLIP) -> None:
        """Let wrench and slip velocity arrive; None = none; a slip velocity of NaN is invalid."""
        if wrench is not None:
            noise = self.noise(len(wrench)) if np.isfinite(wrench).all() else 0.0
            self.session.add_wrench(0, WrenchSample(self.stamp_ns, wrench + noise), self.now_ns)
        if slip is not None:
            noise = self.noise(len(slip)) * (slip != 0.0) if np.isfinite(slip).all() else 0.0
            sample = SlipSample(self.stamp_ns, slip + noise, valid=bool(np.isfinite(slip).all()))
            self.session.add_slip(0, sample, self.now_ns)

    def cycle(self, joint: JointSample | None = None, wrench=LOAD, slip=SLIP, passed_ns: int = MS) -> CycleResult:
        """Let time pass, samples arrive, and return the answer. joint: its stamp, as the others, moves with time."""
        joint = self._moved(joint, passed_ns)
        self.deliver(wrench, slip)
        self.session.add_joint(joint, self.now_ns)
        result = self.session.cycle(self.now_ns)
        assert result is not None
        return result

    def _moved(self, joint: JointSample | None, passed_ns: int) -> JointSample:
        self.pass_time(passed_ns)
        return self.joint() if joint is None else replace(joint, stamp_ns=joint.stamp_ns + passed_ns)

    def run(self, cycles: int, **given: Any) -> CycleResult:
        """Run cycles; return the last answer. given: as of `cycle`, joint as of `joint` in a dictionary."""
        joint = given.pop("joint", {})
        for _ in range(cycles):
            result = self.cycle(self.joint(**joint), **given)
        return result

    def past_validation(
        self, joint: JointSample | None = None, wrench=LOAD, slip=SLIP, *, health: Health | None = None,
        passed_ns: int = MS,
    ) -> CycleResult:  # fmt: skip
        """Return the answer to samples that input validation does not look at, as in a replay."""
        joint = self._moved(joint, passed_ns)
        new = SlipSample(self.stamp_ns, slip)
        self.session.add_joint(joint, self.now_ns)
        self.session.give(joint, [WrenchSample(self.stamp_ns, wrench)], [new], [new])
        return self.session.answer(joint, Reason.NONE, self.now_ns, 0, Health() if health is None else health)


def law_at_work(lockstep: bool = False, **values: Any) -> MadeUp:
    """Return a controller whose law has begun, at rest and without slip."""
    made_up = MadeUp(lockstep, **values)
    made_up.cycle(made_up.joint(velocity=np.zeros(N)), slip=np.zeros(6), passed_ns=0)
    assert made_up.session.mode.follows
    return made_up
