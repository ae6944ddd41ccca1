"""The table of conditions: its order by the pairs that matter, how long each must last, and its words."""

from __future__ import annotations

import itertools

import pytest

from slip_core.records import new, record
from slip_vic_controller.safety.conditions import (
    NOTHING,
    SAMPLE_FAULTS,
    Missing,
    Mode,
    Reason,
    Why,
    because,
    first,
    see,
)
from slip_vic_controller.session.words import describe, reason_fields
from slip_vic_controller.sizes import NEVER
from slip_vic_controller.state import ARM_STATE, CONFIG
from test.support.call import call

ROWS = [reason for reason in Reason if reason >= SAMPLE_FAULTS]
NOW_NS = 10**12


class Table:
    """A table in which nothing is so."""

    def __init__(self) -> None:
        self.config = record(new(CONFIG), CONFIG).conditions
        self.rows = record(new(ARM_STATE), ARM_STATE).conditions
        self.rows["since_ns"] = NEVER

    def see(self, why: Why, so: bool, now_ns: int) -> None:
        call(see, self.rows, why, so, now_ns)

    def first(self, now_ns: int) -> Why:
        return Why(*call(first, self.config, self.rows, now_ns))


@pytest.mark.parametrize(
    ("wins", "over"),
    [
        (Reason.TOO_FAST, Reason.FALLS),  # an arm that runs away drops its object
        (Reason.VELOCITY, Reason.FALLS),  # and a sensor that lies shows a fall
        (Reason.FALLS, Reason.EFFORT_COMMAND),
        (Reason.INTERNAL, Reason.TOO_FAST),
        (Reason.INPUTS, Reason.JOINT_STATE),  # a second publisher makes jumps
        (Reason.WRENCH, Reason.JOINT_STATE),  # what is ahead shows joint states that are late
        (Reason.JOINT_STATE, Reason.SLIP),
        (Reason.SLIP, Reason.TARE),  # no tare without samples
        (Reason.BIASED, Reason.PATH_TOO_HEAVY),  # a load that is none
        (Reason.WRENCH_SLOWS, Reason.SLIP_PREDICTED),  # it is predicted from the wrench
        (Reason.SLIP_SLOWS, Reason.SLIP_PREDICTED),  # the same, and for longer
        (Reason.STOPPING, Reason.SATURATED),
        (Reason.SLIP_SENSOR, Reason.OVERRUNS),
        (Reason.OVERRUNS, Reason.PATH_WAITS),
    ],
)
def test_order_by_pairs(wins: Reason, over: Reason) -> None:
    """Whichever is seen first."""
    for order in itertools.permutations((wins, over)):
        table = Table()
        for reason in order:
            table.see(because(reason, 0), True, NOW_NS)
        assert table.first(NOW_NS).reason == wins


def test_modes_are_in_order() -> None:
    """So the first row that has lasted leads to the gravest mode, and one loop decides."""
    gravest_first = [Mode.FAULT, Mode.WAITING_INPUT, Mode.HOLD, Mode.DEGRADED]
    assert [mode for mode, _ in itertools.groupby(reason.mode for reason in ROWS)] == gravest_first
    assert {reason.mode for reason in Reason if reason < SAMPLE_FAULTS} == {Mode.ACTIVE}
    free = {7, 16, 20, 24, 25, 35, 37, 45, 46, 50, 51, *range(63, 68)}
    assert set(range(max(Reason) + 1)) - set(Reason) == free, "bags and programs know reasons by their numbers"


def test_condition_must_last() -> None:
    assert {row.name: row.lasts_s for row in Reason if row.lasts_s} == {
        "TOO_FAST": 0.005,
        "SATURATED": 0.1,
        "HAND": 0.2,
    }
    table, why = Table(), Why(Reason.SATURATED, 0, 0, 3, 0.5, 0.25)
    table.config.lasts_ns[Reason.SATURATED] = 100
    for passed, found in ((0, NOTHING), (99, NOTHING), (100, why), (500, why)):
        table.see(why, True, NOW_NS + passed)
        assert table.first(NOW_NS + passed) == found
    table.see(why, False, NOW_NS + 501)  # and anew
    table.see(why, True, NOW_NS + 502)
    assert table.first(NOW_NS + 503) == NOTHING


@pytest.mark.parametrize("reason", ROWS, ids=lambda reason: reason.name)
def test_every_reason_has_words(reason: Reason) -> None:
    why = Why(reason, Reason.SILENT, 0, 1, 1.0, 1.0)
    assert describe(why, ("a", "b"))
    assert ("b" in describe(why, ("a", "b"))) >= ("{joint}" in reason.words)
    fields = reason_fields(why, ("a", "b"))
    assert (fields["reason"], fields["reason_number"]) == (reason.name, reason.value)
    assert fields["which"] == ("b" if "{joint}" in reason.words else 1)


def test_words_of_missing_inputs() -> None:
    contacts = [f"{name} of contact {k}" for name in ("wrench", "slip") for k in range(4)]
    everything = ", ".join(["activation", "a good joint state", "joint_states", *contacts])
    assert describe(Why(Reason.WAITS, 0, 0, 2**11 - 1, 0.0, 0.0), ()) == f"waits for {everything}"
    absurd = Why(Reason.WAITS, Reason.ABSURD, 0, Missing.GOOD_JOINT_STATE, 0.0, 0.0)
    assert describe(absurd, ()) == "waits for a good joint state (it is absurdly large: wrong unit?)"
    assert describe(NOTHING, ()) == ""
    for which, name in ((-1, "the pad"), (0, "a"), (1, "b")):
        assert describe(Why(Reason.TOO_FAST, 0, 0, which, 1.0, 0.5), ("a", "b")).startswith(f"{name} moves")
    assert because(Reason.TARE, Reason.ABSURD) == Why(Reason.TARE, Reason.ABSURD, 0, 0, 0.0, 0.0)
