"""The observer that runs against its referee on sequences of every kind."""

from __future__ import annotations

import pytest

from test.unit.contact.bench import Bench
from test.unit.contact.ride import EAGER, SENSOR, Ride

WALL_CLOCK_NS = 1_763_700_000_123_456_789
AXES = {
    "plane": (True, True, False, False, False, True),
    "all": (True,) * 6,
    "one": (False, False, True, False, False, False),
    "turning": (False, False, False, True, True, False),
    "five": (True, True, True, False, True, True),
    "none": (False,) * 6,
}
SENSORS = {
    "on time": {},
    "late": {"lateness": 30},
    "very late": {"lateness": 120},
    "many": {"rate": 3.0, "lateness": 10},
    "rare": {"rate": 0.04, "lateness": 80},
    "none": {"rate": 0.0},
}


@pytest.mark.parametrize("axes", AXES)
def test_observer_equals_the_referee(axes: str) -> None:
    which = list(AXES).index(axes)
    sensors = list(enumerate(list(SENSORS)[which % 2 :: 2]))
    del sensors[which // 2]
    for seed, sensor in sensors:
        bench = Bench(
            start_ns=WALL_CLOCK_NS if seed % 2 else 0,
            rows=1000,
            **SENSOR,
            **EAGER,
            contacts__slip_axes=AXES[axes],
            slip_sensor__dead_band_linear=2e-3 if seed % 2 else 0.0,
            observer__memory_s=0.1,
        )
        ride = Ride(bench.move, bench.start_ns, seed, axes=AXES[axes], **SENSORS[sensor])
        ride.stick_slip_stick()
        if axes != "none":
            assert True in ride.seen, "nothing slipped"
            assert False in ride.seen[ride.seen.index(True) :], "no slip ended"
        if (axes, sensor) == ("plane", "very late"):
            assert bench.state.late > 5, "no sample came too late"


def test_observer_equals_the_referee_with_short_memories() -> None:
    for window_s, memory_s in ((0.001, 0.3), (0.005, 1e-4), (0.001, 0.004)):
        short = {"observer__window_s": window_s, "observer__memory_s": memory_s}
        bench = Bench(**SENSOR, **short, observer__false_alarm_rate=0.01)
        ride = Ride(bench.move, 0, 3, lateness=6)
        ride.stick_slip_stick()
        assert {True, False} <= set(ride.seen)


def test_the_comparison_sees_a_wrong_referee() -> None:
    bench = Bench(**SENSOR)
    bench.referee.drift_variance = bench.referee.drift_variance * 1.001
    ride = Ride(bench.move, 0, 3)
    with pytest.raises(AssertionError):
        ride.stick_slip_stick()
