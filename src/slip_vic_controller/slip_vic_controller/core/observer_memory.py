"""The slip observer at run time: its memory as packed arrays, and what leads from one tick to the next."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from slip_core.arrays import Array, readonly
from slip_core.types import SlipSample
from slip_vic_controller.core.observer_run_kernel import (
    ERROR,
    LAST_TWIST,
    LATE,
    MEAN,
    SIGNIFICANCE,
    SLIDING,
    STAMP,
    STEP,
    VARIANCE,
)
from slip_vic_controller.core.observer_slip_kernel import observe_slip
from slip_vic_controller.core.observer_stick_kernel import begin_slip, observe_stick
from slip_vic_controller.core.observer_types import Motion, ObserverConfig, SlipEstimate
from slip_vic_controller.core.slip_filter_kernel import AxisFilter

BLOCK = 16
"""Rows of a slip that a sample may be late by without touching older blocks, which memories share; each tick copies
less than twice as many."""


class ObserverMemory(NamedTuple):
    """What the observer remembers; read-only arrays, see `observer_run_kernel`.

    stamp_ns: of the last tick; origin_ns: from which the stamps in the arrays count; now: the estimate, first the slip
    twist that the law is given; rows: of the ticks, in stick one array, in slip blocks of them.
    """

    stamp_ns: int
    origin_ns: int
    now: Array
    rows: tuple[Array, ...]

    @property
    def sliding(self) -> bool:
        """Which hypothesis holds."""
        return bool(self.now[SLIDING] == 1.0)

    @property
    def late(self) -> int:
        """Number of samples that came too late to be used."""
        return int(self.now[LATE])

    @property
    def axes(self) -> tuple[AxisFilter, ...]:
        """The filters of the filtered axes."""
        n = (len(self.now) - MEAN) // 10
        return tuple(AxisFilter(*row) for row in self.now[MEAN + n :].reshape(n, 9).tolist())

    @property
    def estimate(self) -> SlipEstimate:
        """What the law is given of it."""
        now = self.now
        parts = now[:ERROR], now[ERROR:VARIANCE], now[VARIANCE:SIGNIFICANCE]
        return SlipEstimate(*parts, float(now[SIGNIFICANCE]), self.sliding)


def pack_motion(motion: Motion) -> Array:
    """Return what a tick tells the observer; (33,).

    Implements: ours: one array, which `predict_motion` writes at run time.
    """
    parts = (motion.R_ee.ravel(), motion.v_ee, motion.follow, motion.force, motion.drag, motion.w_o)
    return readonly(np.concatenate(parts))


class SlipObserver:
    """The observer with its tuning; what changes is in `ObserverMemory`.

    Args:
        config: tuning.
    """

    def __init__(self, config: ObserverConfig) -> None:
        self.config = config
        self._count = n = len(config.axes)
        self._window, self._memory_ns = config.window, config.memory_ns
        ones = (
            n, sum(i < 3 for i in config.axes), config.chi_on, config.chi_off, config.dwell, config.memory_ns,
            config.smoothing, config.outlier, config.drag_spread, config.drag_memory, *config.dead_band,
        )  # fmt: skip
        per_axis = (
            config.axes, config.noise, config.force_noise, config.floor, config.rest, config.prior_b, config.prior_c,
            config.drift_b, config.onset_b, config.calm,
        )  # fmt: skip
        self._tuning = readonly(np.concatenate((ones, *per_axis)))
        self._stick_row, self._slip_row = STEP + 4 * n + 1, STEP + 11 * n
        self._no_tick = readonly(np.empty((0, self._stick_row)))
        self._no_sample = readonly(np.empty((0, 7)))

    def initial(self, stamp_ns: int, v_ee: Array) -> ObserverMemory:
        """Return the memory before the first tick; v_ee (6,) {w}; as `initial_observer`."""
        n = self._count
        now = np.zeros(MEAN + 10 * n)
        now[LAST_TWIST : LAST_TWIST + 6] = v_ee
        filters = now[MEAN + n :].reshape(n, 9)
        filters[:, 6], filters[:, 8] = self.config.prior_b, self.config.prior_c
        return ObserverMemory(stamp_ns, stamp_ns, readonly(now), (self._no_tick,))

    def observe(
        self, memory: ObserverMemory, stamp_ns: int, motion: Array, samples: Sequence[SlipSample]
    ) -> ObserverMemory | None:
        """Take in one tick and the samples that came with it, in any order; as `observer.observe`.

        Args:
            memory: of the tick before.
            stamp_ns: of this tick.
            motion: packed.
            samples: of the own contact.

        Returns:
            The next memory, or None where a number is not finite.
        """
        origin = memory.origin_ns
        fresh = self._packed(samples, origin) if samples else self._no_sample
        stamp, dt, now = stamp_ns - origin, (stamp_ns - memory.stamp_ns) * 1e-9, np.empty(memory.now.shape)
        if memory.now[SLIDING] != 0.0:
            rows = self._slip(memory, motion, fresh, stamp, dt, now)
        else:
            rows = self._stick(memory, motion, fresh, stamp, dt, now)
        now.setflags(write=False)
        return ObserverMemory(stamp_ns, origin, now, rows) if rows else None

    def _packed(self, samples: Sequence[SlipSample], origin_ns: int) -> Array:
        if len(samples) == 1 and samples[0].valid:  # nearly always
            row = np.empty(7)
            row[0], row[1:] = samples[0].stamp_ns - origin_ns, samples[0].twist
            return row.reshape(1, 7)
        valid = [sample for sample in samples if sample.valid]
        fresh = np.empty((len(valid), 7))
        for row, sample in zip(fresh, valid, strict=True):
            row[0], row[1:] = sample.stamp_ns - origin_ns, sample.twist
        return fresh

    def _stick(
        self, memory: ObserverMemory, motion: Array, fresh: Array, stamp: int, dt: float, now: Array
    ) -> tuple[Array, ...]:
        before = memory.rows[0]
        window = np.empty((min(len(before) + 1, self._window), self._stick_row))
        cause = observe_stick(self._tuning, motion, memory.now, before, fresh, stamp, dt, now, window)
        if cause < 0:
            return ()
        if cause > 0:
            rows = np.empty((len(window) if cause == 1 else 1, self._slip_row))
            begin_slip(self._tuning, window, cause, now, rows)
            return _blocks(rows)
        window.setflags(write=False)
        return (window,)

    def _slip(
        self, memory: ObserverMemory, motion: Array, fresh: Array, stamp: int, dt: float, now: Array
    ) -> tuple[Array, ...]:
        earlier, rows = memory.rows[:-1], memory.rows[-1]
        if len(fresh) and earlier:
            earliest = float(fresh[0, 0] if len(fresh) == 1 else fresh[:, 0].min())
            if rows[0, STAMP] >= earliest:
                earlier, rows = _reaching_back(earlier, rows, earliest)
        after = np.empty((len(rows) + 1 + len(fresh), self._slip_row))
        count = observe_slip(self._tuning, motion, memory.now, rows, fresh, stamp, dt, now, after)
        if count < 0:
            return ()
        if count == 0:
            return (self._no_tick,)
        blocks = _blocks(after[:count])
        if len(blocks) > 1:
            while earlier and earlier[0][-1, STAMP] < stamp - self._memory_ns:
                earlier = earlier[1:]
        return (*earlier, *blocks)


def _reaching_back(earlier: tuple[Array, ...], rows: Array, stamp: float) -> tuple[tuple[Array, ...], Array]:
    """Join so many blocks that the first row is of a tick before `stamp`, or all."""
    keep, joined = len(earlier), [rows]
    while keep and joined[0][0, STAMP] >= stamp:
        keep -= 1
        joined.insert(0, earlier[keep])
    return earlier[:keep], np.concatenate(joined)


def _blocks(rows: Array) -> tuple[Array, ...]:
    """Return rows in read-only blocks, at least BLOCK rows in the last one where there are so many."""
    rows.setflags(write=False)
    if len(rows) < 2 * BLOCK:
        return (rows,)
    last = (len(rows) // BLOCK - 1) * BLOCK
    return (*(rows[i : i + BLOCK] for i in range(0, last, BLOCK)), rows[last:])
