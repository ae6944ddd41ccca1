"""A stream of references under the governor: it is followed, slowed down, and never overloads friction."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from slip_bags.reader import Bag
from slip_core.records import new, record
from slip_core.types import CartesianReference
from slip_core.vectors import NOTHING, mat, spatial, vec
from slip_vic.replay.run_data import read_run
from slip_vic.replay.verify import verify_run
from slip_vic.run.in_process import ClosedLoop
from slip_vic.scenarios.scenario import load
from slip_vic_controller.governor.layouts import Governor
from slip_vic_controller.governor.load import ALONE, Held
from slip_vic_controller.path.paths import REFERENCE, Reference, put_reference
from slip_vic_controller.path.stream import Stream, at, drop_passed, plan_stream, stream_bound, take_queued
from slip_vic_controller.safety.conditions import Mode
from slip_vic_controller.sizes import NEVER, ROOM
from test.referees.governor_paths import BentPath
from test.support.call import blank
from test.support.run_maker import goal_message, record_run

FIRST = 10
HELD_M = 1e-7
HELD = Held(0.5, mat(np.eye(3)), vec(np.zeros(3)), spatial(np.ones(6)), vec(np.zeros(3)), ALONE)
"""An object without weight."""
LIMITS = (1.0, 1.0, 1.0)
PREVIEW_S, SPACING_S = 0.144, 0.009
TOPIC = "controller.trajectory.kind=topic"


def test_fast_stream_is_slowed() -> None:
    """The path of paper_planar, streamed at 100 Hz; not governed, the object slips 40 mm on it."""
    loop = ClosedLoop(load("paper_planar", law="governed", set=(TOPIC, "bridge.duration_s=3.0")))
    path = BentPath([0.4, 0.3, 0.0, 0.0, 0.0, 0.8], 2.0)
    start, poses, twists, waits, modes, slip_m, most = None, [], [], [], set(), 0.0, 0.0
    for tick in range(3000):
        outputs = loop.bridge.observe()
        if start is not None and tick >= FIRST and (tick - FIRST) % 10 == 0:
            x, R, v, a = path.at((tick - FIRST) * 1e-3)
            stamp_ns = 7 * 10**15 + tick * 10**6  # of another clock
            loop.session.set_reference(CartesianReference(start[0] + x, R @ start[1], v, a, stamp_ns))
        result = loop.answer(outputs)[0]
        reference, governor = result.record.reference, result.record.governor
        start = start or (np.array(reference.position), np.array(reference.rotation))
        poses.append(np.array(reference.position) - start[0])
        twists.append(np.array(reference.twist))
        waits.append(float(governor.stream_waits))
        modes.add(result.mode)
        slip_m = max(slip_m, float(np.linalg.norm(outputs.truth.slip_displacement[:3])))
        most = max(most, float(governor.load_ratio))
        loop.bridge.advance([result.command])
    assert slip_m < HELD_M
    assert most <= 1.0 + 1e-9
    assert modes <= {Mode.ACTIVE, Mode.DEGRADED}
    assert max(waits) > 0.2, "it is slowed down"
    assert np.abs(poses[-1] - path.way[:3]).max() < 1e-9, "it is followed to its end"
    assert np.abs(np.diff(poses, axis=0) / 1e-3 - np.array(twists)[:-1, :3]).max() < 1e-2, "twist is that of the pose"


def test_passed_samples_are_dropped() -> None:
    stream = blank(Stream)
    for time, points in ((0.5, 6), (1.0, 5), (2.5, 4), (9.0, 2)):
        stream.count = 6
        for i in range(6):
            stream.points[i].time = float(i)
            stream.samples[i].position[:] = i
        drop_passed(stream, time)
        kept = range(stream.count)
        assert stream.count == points, time
        assert [stream.points[i].time for i in kept] == list(range(6 - points, 6)), time
        assert [stream.samples[i].position[0] for i in kept] == list(range(6 - points, 6)), time


def new_stream() -> tuple:
    """Return a STREAM that begins with its next sample, and a GOVERNOR."""
    stream = blank(Stream)
    stream.first_ns = NEVER
    return stream, blank(Governor)


def take(stream, path, now_ns: int) -> bool:
    """Take what is queued; samples closer than 9 ms are thinned."""
    return bool(take_queued(stream, path, HELD, LIMITS, PREVIEW_S, now_ns))


def test_close_samples_are_thinned() -> None:
    stream, path = new_stream()
    spacings_ms = (*(3,) * 20, *(10,) * 100)  # more of them than there is room for
    stamps = 5 * 10**15 + np.cumsum((0, *spacings_ms)) * 10**6
    for k, stamp_ns in enumerate(stamps):
        stream.queued, stream.queue[0].stamp_ns = 1, stamp_ns
        stream.queue[0].reference.position[:] = k
        assert take(stream, path, stamp_ns) is (k == 0)
        n = int(stream.count)
        assert stream.queued == 0
        stream.queued, stream.queue[0].stamp_ns = 1, stamp_ns - 10**6
        stream.queue[0].reference.position[:] = -1.0
        assert not take(stream, path, stamp_ns), "what is older than the newest is left out"
        assert stream.count == n
        times = np.array([stream.points[i].time for i in range(n)])
        assert times[-1] == pytest.approx((stamp_ns - stamps[0]) * 1e-9)
        assert stream.samples[n - 1].position[0] == k
        assert n <= ROOM
        assert np.diff(times)[1:-1].min(initial=1.0) >= SPACING_S, "but the last, that the next may replace"
        if n < ROOM:
            assert np.diff(times)[1:].max(initial=0.0) < 2.5 * SPACING_S, "and no more than need be"
    assert n == ROOM
    assert (path.time, path.rate) == (-PREVIEW_S, 0.0)


def test_stream_bound_admits_braking() -> None:
    """A point mass: over the way D, K falls by 2 D F / m."""
    stream, F, mass, spacing_s = blank(Stream), 1.5, 0.5, 0.1
    stream.count, stream.load = 5, -1.0
    for i in range(5):
        point = stream.points[i]
        point.s, point.uu, point.cap = spacing_s * i, mass * mass, 100.0
    stream.points[4].cap = 0.01
    plan_stream(stream, F, 0.0, PREVIEW_S)
    K = [stream.points[i].K for i in range(5)]
    expected = 0.01 + 2.0 * spacing_s * F / mass * np.arange(4, -1, -1)
    np.testing.assert_allclose(K, expected, rtol=1e-6)


def test_stream_bound_is_piecewise_linear() -> None:
    stream = blank(Stream)
    stream.count = 3
    for i, (time, K) in enumerate(((0.0, 4.0), (1.0, 2.0), (3.0, 1.0))):
        stream.points[i].time = stream.points[i].s = time
        stream.points[i].K = K
    expected = (
        (-1.0, 4.0, -2.0),
        (0.5, 3.0, -2.0),
        (1.0, 2.0, -0.5),
        (2.0, 1.5, -0.5),
        (3.0, 0.0, 0.0),
        (9.0, 0.0, 0.0),
    )
    for time, bound, slope in expected:
        assert stream_bound(stream, time) == pytest.approx((bound, slope)), time


def test_unstamped_sample_uses_cycle_stamp() -> None:
    stream, path = new_stream()
    for ms in (0, 20, 50):
        stream.queued, stream.queue[0].stamp_ns = 1, 0
        take(stream, path, (5 + ms) * 10**6)
    assert [stream.points[i].time for i in range(stream.count)] == pytest.approx([-PREVIEW_S, 0.0, 0.02, 0.05])


def test_ended_stream_restarts_where_it_ended() -> None:
    stream, path = new_stream()

    def receive(ms: int) -> bool:
        stream.queued, stream.queue[0].stamp_ns = 1, (7 + ms) * 10**6
        item = Reference(vec([1e-3 * ms, 0.0, 0.0]), mat(np.eye(3)), spatial([1.0, 0.0, 0.0, 0.0, 0.0, 0.0]), NOTHING)
        put_reference(stream.queue[0].reference, item)
        return take(stream, path, 0)

    assert [receive(ms) for ms in (0, 20, 40)] == [True, False, False]
    path.time, path.rate = 0.05, 0.1  # behind the last sample, where it goes straight on
    assert not receive(45)
    path.time, path.rate = 0.03, 0.0
    assert not receive(60), "there is something to follow"
    path.time = 0.07
    assert receive(500)
    assert (stream.count, path.rate) == (2, 0.0)
    assert path.time == stream.points[0].time == pytest.approx(0.5 - PREVIEW_S)
    rests, newest = numbers(at(stream, path.time)), numbers(at(stream, 0.5))
    np.testing.assert_allclose(rests[:3], (0.07, 0.0, 0.0), atol=1e-12)
    np.testing.assert_array_equal(rests[12:], 0.0)
    np.testing.assert_allclose(newest[[0, 12]], (0.5, 1.0))


def numbers(reference: Reference) -> np.ndarray:
    """Position, attitude, twist and acceleration; (24,)."""
    buffer = new(REFERENCE)
    put_reference(record(buffer, REFERENCE), reference)
    found = record(buffer, REFERENCE)
    return np.concatenate([np.ravel(found[name]) for name in ("position", "rotation", "twist", "acceleration")])


def test_stream_interpolation_is_consistent() -> None:
    rng, stream = np.random.default_rng(5), blank(Stream)
    times, R, samples = (0.0, 0.3, 0.5, 1.1), np.eye(3), []
    for i, time in enumerate(times):
        R = Rotation.from_rotvec(rng.normal(size=3) * 0.2).as_matrix() @ R
        x, v, a = rng.normal(size=3), rng.normal(size=6), rng.normal(size=6)
        samples.append(Reference(vec(x), mat(R), spatial(v), spatial(a)))
        stream.points[i].time = stream.points[i].s = time
        put_reference(stream.samples[i], samples[-1])
    stream.count = len(times)
    for time, sample in zip(times, samples, strict=True):
        expected = numbers(sample)
        expected[18:] *= time < times[-1]  # behind the last sample it goes straight on
        np.testing.assert_allclose(numbers(at(stream, time)), expected, atol=1e-9)
        if time > 0.0:
            np.testing.assert_allclose(numbers(at(stream, time - 1e-10)), numbers(sample), atol=1e-5)
    h = 1e-6
    for time in (0.04, 0.2, 0.33, 0.49, 0.6, 1.0, 2.0):
        before, now, after = (numbers(at(stream, time + step)) for step in (-h, 0.0, h))
        turned = Rotation.from_matrix(after[3:12].reshape(3, 3) @ before[3:12].reshape(3, 3).T).as_rotvec()
        rates = np.concatenate((after[:3] - before[:3], turned, after[12:18] - before[12:18])) / (2.0 * h)
        np.testing.assert_allclose(rates, now[12:], rtol=1e-5, atol=1e-4)


def test_stream_runs_replay_identically(tmp_path) -> None:
    for controller in ("governed", "vic"):
        loaded = load("paper_planar", law=controller, set=(TOPIC, "bridge.duration_s=0.2"))
        given = {}
        for tick in (*range(5, 60, 5), 62, *range(120, 180, 20)):
            twist = np.array([0.1, 0.0, 0.0, 0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
            stamp_ns = 0 if tick % 2 else tick * 10**6
            given[tick] = goal_message((0.1 * tick * 1e-3, 0.35, 0.5), (0, 0, 1, 0.01 * tick), 0.0, twist, stamp_ns)
        record_run(tmp_path / controller, loaded, goals=given)
        bag = Bag(tmp_path / controller)
        verdict = verify_run(read_run(bag))
        assert verdict.text() == "identical: 200 cycles, 1400 efforts, to the last bit"
