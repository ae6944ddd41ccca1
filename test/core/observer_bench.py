"""A pad over an object, for both forms of the slip observer at once: each tick holds them equal."""

from __future__ import annotations

import math

import numpy as np

from slip_core.params import build
from slip_vic_controller.core.observer import initial_observer, observe
from slip_vic_controller.core.observer_config import observer_config
from slip_vic_controller.core.observer_memory import SlipObserver, pack_motion
from slip_vic_controller.core.observer_types import Motion
from slip_vic_controller.params import ControllerParams
from slip_vic_controller.core.slip_filter_kernel import AxisFilter

MS = 1_000_000
PLANE = (True, True, False, False, False, True)
# Relative to the size of what is compared: the kernel adds the same numbers, partly in another order.
EQUAL = 1e-12


def config(**values):
    given = {"contacts.slip_axes": PLANE, **{name.replace("__", "."): value for name, value in values.items()}}
    return observer_config(build(ControllerParams, given, "test"))


def six(x: float = 0.0, y: float = 0.0, turn: float = 0.0) -> np.ndarray:
    return np.array([x, y, 0.0, 0.0, 0.0, turn])


class Bench:
    """A pad that accelerates by given steps over an object whose acceleration the wrench reports.

    state: of the kernels, which run; plain: of the documentation; compared: how often both were held equal.
    """

    def __init__(self, tuning, start_ns: int = 0) -> None:
        self.config, self.observer = tuning, SlipObserver(tuning)
        self.state = self.observer.initial(start_ns, np.zeros(6))
        self.plain = initial_observer(tuning, start_ns, np.zeros(6))
        self.twist = np.zeros(6)
        self.tick, self.start_ns = 0, start_ns

    def step(self, acceleration, follow=None, samples=(), drag=(0.0, 0.0, 0.0)):
        self.tick += 1
        self.twist = self.twist + 1e-3 * acceleration
        follow = np.zeros(6) if follow is None else follow
        stamp_ns = self.start_ns + self.tick * MS
        return self.move(
            Motion(stamp_ns, np.eye(3), self.twist, follow, follow, np.asarray(drag, float), np.zeros(3)), samples
        )

    def move(self, motion: Motion, samples=()):
        """Do a tick of any motion; return the estimate."""
        self.plain, expected = observe(self.config, self.plain, motion, samples)
        self.state = self.observer.observe(self.state, motion.stamp_ns, pack_motion(motion), samples)
        assert self.state is not None
        found = self.state.estimate
        assert (found.sliding, self.state.late) == (expected.sliding, self.plain.late)
        for name in ("twist", "error", "variance"):
            near(getattr(found, name), getattr(expected, name))
        near(found.significance, expected.significance, least=1.0)  # of noise alone it is about 1 per axis
        for a, b in zip(self.state.axes, self.plain.estimate, strict=True):
            same_filter(a, b)
        return found


def near(found, expected, least: float = 0.0) -> None:
    """Hold numbers of one meaning equal."""
    size = max(float(np.max(np.abs(expected))), least)
    assert np.max(np.abs(np.subtract(found, expected))) <= EQUAL * size, (found, expected)


def same_filter(found: AxisFilter, expected: AxisFilter) -> None:
    """Hold filters equal: the estimate relative to its deviation or size, a covariance to the variances."""
    deviation = [math.sqrt(max(P, 0.0)) for P in (expected.P_vv, expected.P_bb, expected.P_cc)]
    for a, b, s in zip(found[:3], expected[:3], deviation, strict=True):
        assert abs(a - b) <= EQUAL * max(s, abs(b)), (found, expected)
    pairs = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
    for a, b, (i, j) in zip(found[3:], expected[3:], pairs, strict=True):
        assert abs(a - b) <= EQUAL * deviation[i] * deviation[j], (found, expected)
