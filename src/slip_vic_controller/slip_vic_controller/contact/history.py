"""The history: rows in a ring, oldest first, in the order in which they count."""

from __future__ import annotations

from slip_core.arrays import Array
from slip_core.compiled import part
from slip_core.records import Records
from slip_vic_controller.contact.layouts import (
    AXES,
    ROW,
    SAMPLE_ROW,
    TICK_ROW,
    Observer,
    ObserverConfig,
    Row,
)
from slip_vic_controller.law.contact import StampedSlip

_HEAD = ROW.fields["axes"][1] // 8  # type: ignore[index]
"""Numbers of a row before its estimate."""


@part
def slot(state: Observer, capacity: int, i: int) -> int:
    """Return where row number i, from the oldest, lies in the ring."""
    j = state.first + i
    return j if j < capacity else j - capacity


@part
def row_at(state: Observer, rows: Records[Row], i: int) -> Row:
    """Return row number i, from the oldest."""
    return rows[slot(state, len(rows), i)]


@part
def drop_oldest(state: Observer, rows: Records[Row]) -> None:
    """Forget the oldest row."""
    state.first = slot(state, len(rows), 1)
    state.rows -= 1


@part
def clear(state: Observer, history: Array, i: int) -> None:
    """Forget what was in the place of row number i before, so that equal states have equal bytes."""
    place = slot(state, history.shape[0], i)
    for j in range(history.shape[1]):
        history[place, j] = 0.0


@part
def append(state: Observer, history: Array, rows: Records[Row]) -> Row:
    """Return a new last row; where there is no room the oldest one goes."""
    if state.rows == len(rows):
        drop_oldest(state, rows)
    state.rows += 1
    clear(state, history, state.rows - 1)
    return row_at(state, rows, state.rows - 1)


@part
def newest_tick(state: Observer, rows: Records[Row]) -> int:
    """Return the number of the last row that is a tick."""
    i = state.rows - 1
    while row_at(state, rows, i).kind != TICK_ROW:
        i -= 1
    return i


@part
def before(config: ObserverConfig, a: StampedSlip, b: StampedSlip) -> bool:
    """Return whether sample a counts before sample b: by stamp, then by value, whatever the order of arrival."""
    if a.stamp_ns != b.stamp_ns:
        return a.stamp_ns < b.stamp_ns
    for i in range(AXES):
        if config.axes[i] and a.twist[i] != b.twist[i]:
            return bool(a.twist[i] < b.twist[i])
    return False


@part
def next_sample(config: ObserverConfig, samples: Records[StampedSlip], count: int, last: int) -> int:
    """Return the number of the sample that counts next after number `last`, or first of all where that is -1."""
    found = -1
    for i in range(count):
        later = (
            last < 0
            or before(config, samples[last], samples[i])
            or (i > last and not before(config, samples[i], samples[last]))
        )
        if later and (found < 0 or before(config, samples[i], samples[found])):
            found = i
    return found


@part
def insert(config: ObserverConfig, state: Observer, history: Array, rows: Records[Row], sample: StampedSlip) -> int:
    """Put a sample behind the first tick not before its stamp, else the last one; return the number of its row.

    There is room for it, and the oldest row is of a tick before its stamp. The estimates of the rows behind it are
    void.
    """
    capacity, count = len(rows), state.rows
    tick = count
    while tick > 0 and row_at(state, rows, tick - 1).stamp_ns >= sample.stamp_ns:
        tick -= 1
    if tick == count:
        tick = newest_tick(state, rows)
    p = tick + 1
    while p < count:
        row = row_at(state, rows, p)
        if row.kind == TICK_ROW or before(config, sample, row.sample):
            break
        p += 1
    state.rows += 1
    clear(state, history, count)
    for i in range(count, p, -1):
        to, source = slot(state, capacity, i), slot(state, capacity, i - 1)
        for j in range(_HEAD):
            history[to, j] = history[source, j]
    for j in range(_HEAD):
        history[slot(state, capacity, p), j] = 0.0
    row = row_at(state, rows, p)
    row.stamp_ns = row_at(state, rows, tick).stamp_ns
    row.kind = SAMPLE_ROW
    row.sample.stamp_ns = sample.stamp_ns
    for i in range(AXES):
        row.sample.twist[i] = sample.twist[i] if config.axes[i] else 0.0
    return p
