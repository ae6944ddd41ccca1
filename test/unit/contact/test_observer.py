"""The slip observer: prediction, late samples and their order, onset and end of slip, false alarms, and its history."""

from __future__ import annotations

import random

import numpy as np
import pytest

from slip_vic_controller.config.observer import capacity
from slip_vic_controller.contact.observer import ROW, ObserverConfig, Row, append, begin_stick, is_confirmed, reset
from slip_vic_controller.contact.observer import Observer as State
from slip_vic_controller.law.contact import SLIP_SAMPLE
from test.support.call import blank, call, left
from test.unit.contact.rig import MS, SENSOR, Bench, Observer, given, make_motion, make_params, six

SHAKY = {"slip_sensor__noise_linear": 2e-3, "slip_sensor__noise_angular": 0.05, "observer__drag_spread": 0.0}


def sliding_bench(**values) -> Bench:
    """A bench in slip at 20 mm/s, its model errors known well enough for samples to matter little but visibly."""
    bench = Bench(**SHAKY, **values)
    for _ in range(100):
        bench.step(np.zeros(6))
    for _ in range(20):
        bench.step(six(x=1.0))
    assert bench.state.sliding
    return bench


def test_model_alone_gives_slip_velocity() -> None:
    bench = Bench(observer__drag_spread=0.0)
    for _ in range(100):
        bench.step(six(x=0.3, turn=0.5), follow=six(x=0.3, turn=0.5))  # stick: the object goes along
    slip = np.zeros(6)
    for _ in range(200):
        slip = slip + 1e-3 * six(x=0.4, y=-0.2, turn=1.0)
        estimate = bench.step(six(x=0.7, y=-0.2, turn=1.5), follow=six(x=0.3, turn=0.5))
    # Turning pads and Coriolis couple the axes; at 0.2 s and 0.5 rad/s that is the part left.
    np.testing.assert_allclose(estimate.twist[[0, 1]], slip[[0, 1]], atol=0.02)
    assert estimate.sliding
    assert abs(estimate.twist[5] - slip[5]) < 0.02


@pytest.mark.parametrize("seed", range(2))
def test_late_samples_equal_timely_ones(seed: int) -> None:
    rng = np.random.default_rng(seed)
    accelerations = [six(*rng.normal(scale=0.3, size=3)) for _ in range(80)]
    measured = {k: ((120 + k) * MS, six(*rng.normal([0.02, 0.0, 0.0], [2e-3, 2e-3, 0.05]))) for k in range(1, 60, 3)}
    arrivals = {
        "timely": {k: k for k in measured},
        "late": {k: k + 10 for k in measured},
        "reordered": {k: k + random.Random(seed * 100 + k).randint(0, 20) for k in measured},
        "none": {},
    }
    ends = {}
    for name, arrival in arrivals.items():
        bench = sliding_bench()
        for k, acceleration in enumerate(accelerations):
            coming = [measured[i] for i, when in arrival.items() if when == k]
            random.Random(k).shuffle(coming)
            bench.step(acceleration, samples=coming)
        ends[name] = bench.observer.buffer.tobytes()
    assert ends["late"] == ends["reordered"] == ends["timely"] != ends["none"]


def test_samples_beyond_memory_are_dropped() -> None:
    benches = sliding_bench(observer__memory_s=0.05), sliding_bench(observer__memory_s=0.05)
    for _ in range(100):
        for bench in benches:
            bench.step(np.zeros(6))
    benches[0].step(np.zeros(6), samples=[(130 * MS, six(x=0.5))])
    benches[1].step(np.zeros(6))
    assert benches[0].state.axes.tobytes() == benches[1].state.axes.tobytes()


def test_model_errors_are_learnt_in_stick() -> None:
    bench = Bench(observer__drag_spread=0.0)
    bias, share = 0.2, 0.25
    for k in range(300):
        true = six(x=2.0 * (k / 300) ** 2)
        bench.step(true, follow=(1.0 + share) * true + six(x=bias))  # the wrench reports too much
    reported = (1.0 + share) * 0.5 + bias
    slip = 0.0
    for _ in range(200):
        slip += 1e-3 * 0.3
        estimate = bench.step(six(x=0.8), follow=six(x=reported))
    assert estimate.sliding
    assert abs(estimate.twist[0] - slip) < 0.05 * slip
    assert abs(estimate.error[0] - (0.5 - reported)) < 0.01


def test_insignificant_slip_ends() -> None:
    bench = sliding_bench()
    for _ in range(20):
        bench.step(six(x=-1.0))
    for _ in range(30):
        estimate = bench.step(np.zeros(6))
    assert not estimate.sliding
    assert not estimate.twist.any()


def test_doubt_is_not_rest() -> None:
    """After 0.1 s of a noisy wrench 2 mm/s could be none, but taken for rest the object would slide unseen."""
    doubtful = {"wrench_sensor__noise_force": 0.1, "observer__drag_spread": 0.0}
    eager = {"observer__stick_acceleration": (10.0, 1e3)}  # the model itself counts as known
    ends = {}
    for calm in (6e-4, 1.0):
        bench = Bench(**doubtful, **eager, observer__stick_speed=(calm, 100.0))
        for _ in range(200):
            bench.step(np.zeros(6))
        for k in range(140):
            estimate = bench.step(six(x=1.0 if k < 20 else -0.9 if k < 40 else 0.0))
        ends[calm] = estimate
    assert ends[6e-4].sliding
    assert abs(ends[6e-4].twist[0] - 2e-3) < 1e-4
    assert ends[6e-4].significance < bench.config.nis_stick, "a speed that is significant proves nothing here"
    assert not ends[1.0].sliding, "without a bound on the doubt it is taken for rest, which is what this test is about"


def test_noise_of_the_joints_leaves_doubt() -> None:
    """As much as of two velocities, at begin and end of the window."""
    config, state, row = map(blank, (ObserverConfig, State, Row))
    config.axes[0], config.window_ticks, row.dt, row.velocity_variance[0] = 1.0, 10, 0.1, 1e-4
    for P_bb, confirmed in ((1.9e-4, True), (2.1e-4, False)):
        state.axes[0].P_bb = P_bb
        assert bool(call(is_confirmed, config, state, row)) is confirmed


def test_three_samples_start_a_slip() -> None:
    bench = Bench(**SENSOR)
    for reads, slides in ((0.0, False), (0.0, False), (0.3, False), (0.3, False), (0.3, True)):
        bench.step(np.zeros(6), samples=[((bench.tick + 1) * MS, six(x=reads, turn=reads))])
        assert bool(bench.state.sliding) == slides
    assert abs(bench.state.twist[0] - 0.3) < 1e-3, "the estimate begins with what they read"


def test_lasting_contradiction_overrides_the_model() -> None:
    """A filter that is certain of a wrong model would take every sample for an outlier."""
    for reads, band in ((0.0, 0.0), (2e-3, 0.0), (0.02, 0.0), (0.0, 0.03)):
        bench = sliding_bench(slip_sensor__dead_band_linear=band)
        for _ in range(200):  # the wrench misses 1 m/s^2 that the object has
            estimate = bench.step(six(x=1.0))
        assert estimate.twist[0] > 0.2
        seen = []
        for _ in range(3):
            seen.append(bench.step(six(x=1.0), samples=[((bench.tick + 1) * MS, six(x=reads))]).twist[0])
        assert min(seen[:2]) > 0.1, "one or two may be outliers"
        assert abs(seen[2] - reads) < 4e-3
        assert bench.state.axes[0].P_vv == pytest.approx(2e-3**2 + reads**2 + band**2, rel=1e-3)
        assert bench.state.against == 0


def test_outliers_are_rejected() -> None:
    bench = sliding_bench()
    true = bench.state.twist[0]
    for k in range(60):
        sample = (bench.tick + 1) * MS, six(x=true if k % 3 else 0.5)
        estimate = bench.step(np.zeros(6), samples=[sample])
    assert abs(estimate.twist[0] - true) < 5e-3


@pytest.mark.parametrize(("band", "contradicts"), [(0.03, 0), (0.003, 1)])
def test_zeros_contradict_a_slip_beyond_the_dead_band(band: float, contradicts: int) -> None:
    bench = sliding_bench(slip_sensor__dead_band_linear=band)
    bench.step(np.zeros(6), samples=[((bench.tick + 1) * MS, np.zeros(6))])
    assert ordered_rows(bench.observer)[-1]["contradicts"] == contradicts


def test_friction_direction_corrects_estimate() -> None:
    """Friction drags the object across while the estimate says that the pad slides along an axis."""
    ends = {}
    for axis, spread in ((0, 0.0), (0, 0.3), (1, 0.3)):
        bench, along = Bench(wrench_sensor__noise_force=0.1, observer__drag_spread=spread), np.eye(6)[axis]
        for _ in range(100):
            bench.step(np.zeros(6))
        for _ in range(20):
            bench.step(along, drag=0.5 * along[:3])
        assert bench.state.sliding
        for _ in range(200):
            estimate = bench.step(np.zeros(6), drag=0.5 * np.eye(3)[1 - axis])
        ends[axis, spread] = estimate.twist[axis]
    assert abs(ends[0, 0.0] - 0.02) < 1e-3
    assert ends[0, 0.3] < 0.5 * ends[0, 0.0]
    assert ends[1, 0.3] == pytest.approx(ends[0, 0.3], rel=1e-9)


def test_million_samples_raise_no_alarm() -> None:
    """At 1e-8 per tick a false alarm in this test has a probability of 1e-2; the seed decides it once for all."""
    rng = np.random.default_rng(3)
    noise = {"slip_sensor__noise_linear": 3e-3, "slip_sensor__noise_angular": 0.06}
    wrench = {"wrench_sensor__noise_force": 0.05, "wrench_sensor__noise_torque": 1e-3}
    observer = Observer(make_params(**noise, **wrench))
    deviation = six(3e-3, 3e-3, 0.06)
    block, per_tick, stamp_ns = 500, 50, 0
    for _ in range(1_000_000 // per_tick // block):
        readings = deviation * rng.standard_normal((block, per_tick, 6))
        # 0.05 N over 0.5 kg; the torque and the force at its lever over 2e-3 kg m2.
        follows = six(0.1, 0.1, 0.7) * rng.standard_normal((block, 6))
        fresh = np.zeros((block, per_tick, 7))
        fresh[:, :, 1:] = readings
        for rows, follow in zip(fresh, follows, strict=True):
            stamp_ns += MS
            rows.view(SLIP_SAMPLE)["stamp_ns"][:, 0] = np.arange(stamp_ns - per_tick, stamp_ns)
            assert observer.observe_packed(make_motion(np.zeros(6), follow), stamp_ns, rows)
            assert not observer.state.sliding
    assert observer.state.significance > 0.0


# -- history: what it keeps and forgets, floods of samples, and numbers that are not finite ------------


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


@pytest.mark.parametrize(("late_ns", "ticks"), [(0, 0), (MS - 1, 0), (MS, 1), (2 * MS - 1, 1), (3 * MS, 3)])
def test_a_sample_counts_at_the_first_tick_not_before_its_stamp(late_ns: int, ticks: int) -> None:
    observer, stamp_ns = sliding_observer()
    assert observer.observe(make_motion(six(x=0.02)), stamp_ns + MS, [(stamp_ns + MS - late_ns, six(x=0.021))])
    assert np.flatnonzero(ordered_rows(observer)["samples"]).tolist() == [observer.state.rows - 1 - ticks]


@pytest.mark.parametrize("above", [-0.5, 0.5])
def test_the_sample_mean_has_a_limit(above: float) -> None:
    observer = Observer(make_params(**SENSOR))
    c = observer.config
    variance = c.smoothing / (2.0 - c.smoothing) * c.measurement_variance[0]
    x = np.sqrt((c.nis_slip + above) * variance)
    observer.state.sample_mean[0] = x
    observer.observe(make_motion(np.zeros(6)), 5 * MS, [(3 * MS, six(x=x))])
    assert bool(observer.state.sliding) is (above > 0.0)


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
    assert capacity(*given()) == 302
    assert capacity(*given(observer__memory_s=0.001, observer__window_s=0.5)) == 502


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


def test_nothing_of_before_remains() -> None:
    of = Observer(make_params()).config
    found = left(reset, of, State, 5, np.full(6, 2.0))
    axes = found.pop("axes")
    assert {name: np.max(value) for name, value in found.items()} == {"stamp_ns": 5, "since_ns": 5, "v_ee": 2.0}
    assert not any(axes[name].any() for name in ("v", "b", "c", "P_vv", "P_vb", "P_vc", "P_bc"))
    assert not {"sliding", "quiet", "against", "first", "rows"} & set(left(begin_stick, of, State))
