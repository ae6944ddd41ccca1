"""The history of the observer: what it keeps, what it forgets, floods of samples, and numbers that are not finite."""

from __future__ import annotations

import numpy as np
import pytest

from slip_vic_controller.config.observer import capacity
from slip_vic_controller.contact.layouts import ROW, WITNESSES
from slip_vic_controller.contact.observer import append, contradicted_since
from test.support.call import call
from test.unit.contact.ride import SENSOR
from test.unit.contact.rig import MS, Bench, Observer, given, make_motion, make_params, six


def sliding_observer(rows: int | None = None, **values) -> tuple[Observer, int]:
    """An observer in slip at 20 mm/s, and the stamp of its last tick."""
    observer = Observer(*given(**SENSOR, observer__drag_spread=0.0, **values), rows=rows)
    twist = np.zeros(6)
    for k in range(1, 121):
        twist = twist + six(x=1e-3 if k > 100 else 0.0)
        assert observer.observe(make_motion(twist), k * MS, [])
    assert observer.state.sliding
    return observer, 120 * MS


def ordered_rows(observer: Observer) -> np.ndarray:
    rows, state = observer.history.view(ROW)[:, 0], observer.state
    return rows[(state.first + np.arange(state.rows)) % len(rows)]


def test_contradiction_needs_a_run_of_samples() -> None:
    observer = Observer(make_params(**SENSOR))
    state, rows = observer.state, observer.history.view(ROW)[:, 0]
    state.first, state.rows = 0, WITNESSES
    rows["samples"][:WITNESSES], rows["contradicts"][:WITNESSES] = 1, 1
    assert contradicted_since(state, rows) == 0  # the oldest row counts too
    rows["contradicts"][0] = 0
    assert contradicted_since(state, rows) == -1
    rows["samples"][WITNESSES : WITNESSES + 2], rows["contradicts"][WITNESSES + 1] = (0, 1), 1
    state.rows = WITNESSES + 2
    assert contradicted_since(state, rows) == 1  # whatever ticks lie between
    state.rows = 0
    assert contradicted_since(state, rows) == -1


def test_unfiltered_axes_stay_zero() -> None:
    rng = np.random.default_rng(0)
    R = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    for axis in range(6):
        axes = np.arange(6) == axis
        observer = Observer(make_params(**SENSOR, contacts__slip_axes=tuple(map(bool, axes))))
        v_ee, follow, force = rng.normal(size=(3, 6))
        drag, w_o = rng.normal(size=(2, 3))
        observer.observe(make_motion(v_ee, follow, force, drag, w_o, R), MS, [])
        row = ordered_rows(observer)[-1]
        for name in ("step", "force", "drag"):
            assert np.array_equal(row[name] != 0.0, axes[: len(row[name])]), (axis, name)


def test_samples_of_a_tick_are_one() -> None:
    """Their mean counts, with the variance of a mean."""
    ends = []
    for spread in (0.0, 1e-3):
        samples = [(121 * MS - k, six(x=0.021 + spread * (k - 1.5))) for k in range(4)]
        observer, stamp_ns = sliding_observer()
        assert observer.observe(make_motion(six(x=0.02)), stamp_ns + MS, samples)
        row = ordered_rows(observer)[-1]
        assert (row["samples"], row["contradicts"]) == (4, 0)
        ends.append(observer.state.axes[0])
    single, _ = sliding_observer()
    assert single.observe(make_motion(six(x=0.02)), 121 * MS, [(121 * MS, six(x=0.021))])
    assert ends[0].v == pytest.approx(ends[1].v, rel=1e-12)
    assert ends[0].P_vv < single.state.axes[0].P_vv


@pytest.mark.parametrize("above", [-0.5, 0.5])
def test_the_sample_mean_has_a_limit(above: float) -> None:
    observer = Observer(make_params(**SENSOR))
    c = observer.config
    variance = c.smoothing / (2.0 - c.smoothing) * c.measurement_variance[0]
    x = np.sqrt((c.nis_slip + above) * variance)
    observer.state.sample_mean[0] = x
    observer.observe(make_motion(np.zeros(6)), 5 * MS, [(3 * MS, six(x=x))])
    assert bool(observer.state.sliding) is (above > 0.0)


def test_stick_keeps_only_the_window() -> None:
    observer = Observer(make_params(**SENSOR))
    for k in range(1, 200):
        assert observer.observe(make_motion(np.zeros(6)), k * MS, [(k * MS, np.zeros(6))])
        assert observer.state.rows == min(k, observer.config.window_ticks)


def test_long_slip_keeps_the_memory() -> None:
    observer, stamp_ns = sliding_observer(observer__memory_s=0.1)
    for k in range(1, 1000):
        now_ns = stamp_ns + k * MS
        assert observer.observe(make_motion(six(x=0.02)), now_ns, [])
        stamps = ordered_rows(observer)["stamp_ns"]
        assert stamps[0] == max(now_ns - 100 * MS, 62 * MS)  # the window of the onset, 40 ticks up to 101 ms
        assert np.all(np.diff(stamps) == MS)
    assert observer.state.sliding


def test_capacity_follows_the_parameters() -> None:
    def rows(**values) -> int:
        return capacity(*given(**values))

    assert rows() == 302
    assert rows(observer__memory_s=0.001, observer__window_s=0.5) == 502


def test_a_flood_drops_the_oldest_rows() -> None:
    observer, start_ns = sliding_observer(rows=64)
    rng = np.random.default_rng(1)
    for k in range(1, 60):
        stamp_ns = start_ns + k * MS
        stamps = stamp_ns - rng.integers(0, 5 * MS, size=20)
        samples = [(int(stamp), six(*(0.02 + 1e-3 * rng.standard_normal(2)))) for stamp in stamps]
        assert observer.observe(make_motion(six(x=0.02)), stamp_ns, samples)
        rows = ordered_rows(observer)
        assert len(rows) <= 64
        assert rows["stamp_ns"][-1] == stamp_ns
        assert np.all(np.diff(rows["stamp_ns"]) > 0)


def test_a_new_row_is_empty() -> None:
    """Equal states have equal bytes: what a row of another kind has left would be part of a snapshot."""
    observer, _ = sliding_observer(rows=64)
    observer.history[:] = 7.0
    for _ in range(70):  # beyond the end of the ring
        call(append, observer.state, observer.history, observer.history)
        assert not ordered_rows(observer)[-1:].view(np.float64).any()
        observer.history[:] = 7.0


def test_infinite_numbers_are_refused() -> None:
    for slipping in (False, True):
        bench = Bench(**SENSOR, observer__drag_spread=0.0)
        for k in range(120):
            bench.step(six(x=1.0 if slipping and k >= 100 else 0.0))
        assert bench.state.sliding == slipping
        stamp_ns = (bench.tick + 1) * MS
        good = make_motion(bench.twist)
        for bad in (np.nan, np.inf, 1e200):
            assert bad == 1e200 or not bench.observer.copy().observe(good, stamp_ns, [(stamp_ns, six(x=bad))])
            motion = make_motion(bench.twist + six(x=bad))
            assert not bench.observer.copy().observe(motion, stamp_ns, [])
        assert bench.observer.copy().observe(good, stamp_ns, [])
