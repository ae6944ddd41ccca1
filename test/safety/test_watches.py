"""A watch over one input says what is wrong with it: silent is only who says nothing."""

from __future__ import annotations

import numpy as np
import pytest

from slip_vic_controller.core.trouble import Trouble
from slip_vic_controller.core.watches import VectorWatch
from slip_vic_controller.safety_params import SlipWatchParams

PERIOD_NS = 4_000_000
PARAMS = SlipWatchParams()
AGE_NS = round(PARAMS.age_s * 1e9)
GOOD = np.array([0.01, 0.0, 0.0, 0.0, 0.0, 0.0])


def heard_once() -> VectorWatch:
    """Return a watch over a slip velocity that has been good once, at time 0."""
    watch = VectorWatch(PARAMS, (PARAMS.linear, PARAMS.angular), 0.05, zero_is_normal=True)
    assert watch.judge(0, GOOD, True, 0, 0) == Trouble.NONE
    return watch


def said_while(bad: np.ndarray, heard: bool) -> Trouble:
    """Return what a slip velocity is worth that was good once, and then bad or not heard for longer than its age."""
    watch = heard_once()
    now_ns = 0
    worths = []
    while now_ns <= 2 * AGE_NS:
        now_ns += PERIOD_NS
        if heard:
            watch.judge(now_ns, bad, True, now_ns, now_ns)
        worths.append(watch.worth(now_ns, now_ns, False))
    assert worths[0] == Trouble.NONE  # one bad sample is dropped, and the last good one used
    return worths[-1]


@pytest.mark.parametrize(
    ("bad", "trouble"),
    [(np.full(6, 2.0 * PARAMS.linear), Trouble.ABSURD), (np.full(6, np.inf), Trouble.NOT_FINITE)],
)
def test_an_input_whose_numbers_are_bad_is_not_called_silent(bad: np.ndarray, trouble: Trouble) -> None:
    assert said_while(bad, heard=True) == trouble
    assert said_while(bad, heard=False) == Trouble.SILENT


def test_bad_numbers_of_long_ago_are_no_excuse_for_silence() -> None:
    watch = heard_once()
    watch.judge(PERIOD_NS, np.full(6, np.inf), True, PERIOD_NS, PERIOD_NS)
    assert watch.worth(2 * AGE_NS, 2 * AGE_NS, False) == Trouble.SILENT


def test_good_numbers_after_bad_ones_count_at_once() -> None:
    watch = heard_once()
    late_ns = 2 * AGE_NS
    watch.judge(late_ns, np.full(6, np.inf), True, late_ns, late_ns)
    assert watch.worth(late_ns, late_ns, False) == Trouble.NOT_FINITE
    watch.judge(late_ns + PERIOD_NS, 2.0 * GOOD, True, late_ns + PERIOD_NS, late_ns + PERIOD_NS)
    assert watch.worth(late_ns + PERIOD_NS, late_ns + PERIOD_NS, False) == Trouble.NONE
