"""A pad over an object, for the observer that runs and its referee at once: each tick holds them equal."""

from __future__ import annotations

import numpy as np

from slip_vic_controller.contact.layouts import MOTION, OBSERVER
from test.referees.observer_referee import ObserverReferee
from test.unit.contact.rig import MS, Observer, make_motion, make_params

# Of a standard deviation: both add the same numbers in other orders, and a filter that has learnt a lot amplifies that.
EQUAL = 1e-9


class Bench:
    """A pad that accelerates by given steps over an object whose acceleration the wrench reports.

    Args:
        start_ns: stamp of the tick before the first one.
        refereed: hold every tick against the referee.
        values: parameters, with __ for dots.
    """

    def __init__(self, start_ns: int = 0, refereed: bool = True, rows: int | None = None, **values) -> None:
        self.observer = Observer(make_params(**values), start_ns, rows)
        self.config, self.state = self.observer.config, self.observer.state
        self.referee = ObserverReferee(self.config, start_ns, np.zeros(6)) if refereed else None
        self.twist = np.zeros(6)
        self.tick, self.start_ns = 0, start_ns

    def step(self, acceleration, follow=None, samples=(), drag=(0.0, 0.0, 0.0)):
        """Do a tick of 1 ms; return the state."""
        self.tick += 1
        self.twist = self.twist + 1e-3 * acceleration
        motion = make_motion(self.twist, follow, drag=drag)
        return self.move(motion, self.start_ns + self.tick * MS, samples)

    def move(self, motion: np.ndarray, stamp_ns: int, samples=()):
        """Do a tick of any motion; return the state."""
        assert self.observer.observe(motion, stamp_ns, samples)
        if self.referee is not None:
            self.referee.observe(motion.view(MOTION)[0], stamp_ns, samples)
            self.hold_equal()
        return self.state

    def hold_equal(self) -> None:
        found, expected = self.observer.buffer.view(OBSERVER)[0], self.referee  # a record by name is slower in Python
        names = ("sliding", "late", "quiet", "since_ns")
        assert [found[name] for name in names] == [getattr(expected, name) for name in names]
        axes = found["axes"][expected.axes]
        numbers = np.ascontiguousarray(axes).view(float).reshape(len(axes), 9)
        x, P = numbers[:, :3], numbers[:, [3, 4, 5, 4, 6, 7, 5, 7, 8]].reshape(-1, 3, 3)
        deviation = np.sqrt(np.maximum(np.diagonal(P, axis1=1, axis2=2), 0.0))
        assert np.all(np.abs(x - expected.x) <= EQUAL * (deviation + np.abs(x))), (x, expected.x)
        most = EQUAL * deviation[:, :, None] * deviation[:, None, :]
        assert np.all(np.abs(P - expected.P) <= most), (P, expected.P)
        for name in ("twist", "error", "variance"):
            given = getattr(expected, name)
            assert np.abs(found[name] - given).max() <= EQUAL * np.abs(given).max(), name
        # Of noise alone it is about 1 per axis.
        assert abs(found["significance"] - expected.significance) <= EQUAL * (1.0 + expected.significance)
