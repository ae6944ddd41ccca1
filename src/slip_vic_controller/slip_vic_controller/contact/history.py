"""The history: ticks in a ring, oldest first, each with the samples that count at it."""

from __future__ import annotations

from slip_core.arrays import Array
from slip_core.compiled import part
from slip_core.records import Records
from slip_vic_controller.contact.layouts import Observer, ObserverConfig, Row
from slip_vic_controller.law.contact import StampedSlip


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
def append(state: Observer, history: Array, rows: Records[Row]) -> Row:
    """Return a new last row of zeros; where there is no room the oldest one goes."""
    if state.rows == len(rows):
        drop_oldest(state, rows)
    state.rows += 1
    history[slot(state, len(rows), state.rows - 1), :] = 0.0
    return row_at(state, rows, state.rows - 1)


@part
def place_samples(
    config: ObserverConfig, state: Observer, rows: Records[Row], samples: Records[StampedSlip], count: int
) -> int:
    """Add samples to the ticks at which they count; return the first row that is new or has changed.

    A sample counts at the first tick not before its stamp, else at the last one. One that is not younger than the
    oldest row is too late.
    """
    first = state.rows - 1
    for k in range(count):
        sample, i = samples[k], state.rows - 1
        if sample.stamp_ns <= row_at(state, rows, 0).stamp_ns:
            state.late += 1
            continue
        while row_at(state, rows, i - 1).stamp_ns >= sample.stamp_ns:
            i -= 1
        row, first = row_at(state, rows, i), min(first, i)
        row.samples += 1
        for j in range(6):
            row.reads[j] += sample.twist[j] if config.axes[j] else 0.0
    return first
