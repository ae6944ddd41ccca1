"""A governed reference by topic: it is followed with a delay, and more slowly where friction requires it.

The samples received and not yet followed are a path over the stream's own time, C2 between samples (position, velocity
and acceleration of both). Its continuation is unknown, so its end is not planned for. The load of every cycle stays
within the friction limit as long as the pad can brake within what is received `preview_s` ahead. Beyond the last sample
of a stream that ends in motion, the pad brakes along a straight line.
"""

from __future__ import annotations

import math
from typing import Annotated, Final

from slip_core.compiled import part
from slip_core.records import Real, Record, Records, Whole
from slip_core.vectors import NOTHING, Mat, Spatial, Vec
from slip_vic_controller.governor.governor import REPLAN
from slip_vic_controller.governor.layouts import Governor
from slip_vic_controller.governor.load import Held
from slip_vic_controller.governor.plan import (
    GridPoint,
    along_at,
    backward_pass,
    bound,
    cell,
    left_for_motion,
    most,
    take_point,
)
from slip_vic_controller.law.arm import DesiredMotion
from slip_vic_controller.law.rotation import (
    exponential,
    left_jacobian,
    left_jacobian_inverse,
    left_jacobian_rate,
    logarithm,
)
from slip_vic_controller.path.paths import Reference, put_reference, quintic, read_reference, standing
from slip_vic_controller.sizes import NEVER, ROOM

SAMPLES_AHEAD: Final = 16
"""Samples in the time by which a stream is followed later; closer ones are thinned."""


class QueuedReference(Record):
    """A reference as received."""

    stamp_ns: Whole  # 0 where it has none
    reference: DesiredMotion


class Stream(Record):
    """Samples received and not yet followed."""

    queued: Whole
    queue: Annotated[Records[QueuedReference], ROOM]  # since the last cycle
    count: Whole
    first_ns: Whole  # when the stream's time is 0
    load: Real  # N, that the pass was made for; negative where a sample has come since
    rests: DesiredMotion  # the pose while there is nothing to follow
    samples: Annotated[Records[DesiredMotion], ROOM]
    points: Annotated[Records[GridPoint], ROOM]


@part
def rest_stream(stream: Stream, position: Vec, rotation: Mat) -> None:
    """Discard all samples, and rest at a pose [m] {w}."""
    put_reference(stream.rests, Reference(position, rotation, NOTHING, NOTHING))
    stream.count, stream.first_ns = 0, NEVER


@part
def take_queued(
    stream: Stream, state: Governor, held: Held, limits: tuple[float, float, float], preview_s: float, now_ns: int
) -> bool:
    """Add the samples received since the last cycle to the path; return whether a new path begins.

    A sample without a stamp has that of the cycle. Where the pad rests with nothing to follow, it reaches the first
    sample after `preview_s` of the stream's time.

    Args:
        stream: changed.
        state: GOVERNOR; its time is set where the path begins.
        held, limits: as in `take_point`.
        preview_s: how much later the stream is followed [s].
        now_ns: stamp of the cycle.
    """
    begins = False
    for k in range(stream.queued):
        item = stream.queue[k]
        stamp_ns = item.stamp_ns if item.stamp_ns != 0 else now_ns
        if stream.first_ns == NEVER:
            stream.first_ns = stamp_ns
        time = (stamp_ns - stream.first_ns) * 1e-9
        n = stream.count
        waits = n > 0 and state.rate == 0.0 and state.time >= stream.points[n - 1].time
        if n == 0 or waits:
            if waits:
                put_reference(stream.rests, standing(at(stream, state.time)))
            put_sample(stream, 0, time - preview_s, stream.rests, held, limits)
            put_sample(stream, 1, time, item.reference, held, limits)
            state.time = state.s = time - preview_s
            state.rate, begins = 0.0, True
        elif time > stream.points[n - 1].time:
            close = stream.points[n - 1].time - stream.points[n - 2].time < preview_s / SAMPLES_AHEAD
            put_sample(stream, n - 1 if close or n == ROOM else n, time, item.reference, held, limits)
    stream.queued = 0
    return begins


@part
def put_sample(
    stream: Stream, i: int, time: float, sample: DesiredMotion, held: Held, limits: tuple[float, float, float]
) -> None:
    """Write the last sample of the path, which is number i; its s is the time. Arguments as in `take_point`."""
    stream.samples[i] = sample
    take_point(stream.points, i, time, along_at(read_reference(sample), 1.0, 0.0), held, limits)
    stream.points[i].s, stream.count, stream.load = time, i + 1, -1.0


@part
def received(stream: Stream) -> Records[GridPoint]:
    """Return the points of the samples received and not yet followed."""
    return stream.points[: stream.count]


@part
def drop_passed(stream: Stream, time: float) -> None:
    """Drop the samples that have been followed."""
    while stream.count > 2 and stream.points[1].time <= time:
        for i in range(stream.count - 1):
            stream.samples[i] = stream.samples[i + 1]
            stream.points[i] = stream.points[i + 1]
        stream.count -= 1


@part
def plan_stream(stream: Stream, F: float, reserve: float, preview_s: float) -> None:
    """Find how fast each point may be passed, where that has changed.

    As far as a stream is followed later, `preview_s` [s], its path continues after the last sample as fast as its speed
    limits admit. F, reserve: as in `backward_pass`.
    """
    if abs(F - stream.load) <= REPLAN * stream.load:
        return
    stream.load, last = F, stream.points[stream.count - 1]
    last.K = max(most(last, left_for_motion(F, math.sqrt(last.cc), reserve), preview_s, last.cap), 0.0)
    backward_pass(received(stream), F, reserve)


@part
def stream_bound(stream: Stream, time: float) -> tuple[float, float]:
    """Return K and its slope at a time of the stream; beyond its end the pad must stop."""
    if time >= stream.points[stream.count - 1].time:
        return 0.0, 0.0
    return bound(received(stream), time)


@part
def at(stream: Stream, time: float) -> Reference:
    """Return the reference at a time of the stream [s], over that time."""
    n = stream.count
    if n == 0:
        return read_reference(stream.rests)
    last = stream.points[n - 1].time
    if time >= last:
        end = read_reference(stream.samples[n - 1])
        turned = exponential((time - last) * end.twist.angular) @ end.rotation
        return Reference(end.position + (time - last) * end.twist.linear, turned, end.twist, 0.0 * end.twist)
    i = cell(received(stream), time)
    begin, end = read_reference(stream.samples[i]), read_reference(stream.samples[i + 1])
    h, t = stream.points[i + 1].time - stream.points[i].time, time - stream.points[i].time
    phi = logarithm(end.rotation @ begin.rotation.T())
    rate = left_jacobian_inverse(phi, end.twist.angular)
    rate_rate = left_jacobian_inverse(phi, end.acceleration.angular - left_jacobian_rate(phi, rate))
    x, v, a = between(h, t, begin.twist.linear, begin.acceleration.linear, end.position - begin.position,
                      end.twist.linear, end.acceleration.linear)  # fmt: skip
    p, p_dot, p_ddot = between(
        h, t, begin.twist.angular, begin.acceleration.angular, phi, rate, rate_rate
    )  # fmt: skip
    alpha = left_jacobian(p, p_ddot) + left_jacobian_rate(p, p_dot)
    return Reference(
        begin.position + x, exponential(p) @ begin.rotation, Spatial(v, left_jacobian(p, p_dot)), Spatial(a, alpha)
    )


@part
def between(h: float, t: float, v0: Vec, a0: Vec, p1: Vec, v1: Vec, a1: Vec) -> tuple[Vec, Vec, Vec]:
    """Return value and two rates at t of the quintic from 0 to p1 over h [s], with these rates at both ends."""
    c3, c4, c5 = quintic(h, p1, v0, a0, v1, a1)
    return (
        t * v0 + (0.5 * t * t) * a0 + (t * t * t) * (c3 + t * c4 + (t * t) * c5),
        v0 + t * a0 + (t * t) * (3.0 * c3 + (4.0 * t) * c4 + (5.0 * t * t) * c5),
        a0 + t * (6.0 * c3 + (12.0 * t) * c4 + (20.0 * t * t) * c5),
    )


@part
def waiting(stream: Stream, time: float) -> float:
    """Return how much of the stream has been received and not yet followed [s]."""
    return max(stream.points[stream.count - 1].time - time, 0.0) if stream.count > 0 else 0.0
