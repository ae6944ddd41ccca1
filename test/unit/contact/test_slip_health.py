"""Health of the slip sensor: mistakes of mounting, unit, clock and driver by their numbers; noise is none."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pytest

from slip_core.records import new, record
from slip_core.vectors import NOTHING, spatial
from slip_vic.setup.slip_sensor import against_motion
from slip_vic_controller.arm.estimator import SIGNIFICANT
from slip_vic_controller.contact.estimate import SensorHealth
from slip_vic_controller.contact.friction_estimate import GIVES_M
from slip_vic_controller.contact.slip_health import (
    DIFFERS,
    SLIP_EVIDENCE,
    SlipEvidence,
    add_reading,
    judge_health,
    mounting,
    start_health,
)
from slip_vic_controller.sizes import NEVER
from test.support.call import call, left

DT = 2e-3
AXES = np.array([1.0, 1.0, 0.0, 0.0, 0.0, 1.0])
TEN_DEGREES = 1.0 - np.cos(np.radians(10.0))
SENSORS = {"event": (500.0, 1e-3), "flow": (125.0, 1e-3), "camera": (62.5, 3e-3)}
"""Rate [Hz], noise [m/s]."""


class Readings(NamedTuple):
    """A motion, and what a sensor reads of it where the object is held fast."""

    times: np.ndarray
    motion: np.ndarray
    stamps: np.ndarray
    readings: np.ndarray
    least: float


def turned(degrees: float) -> np.ndarray:
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def evidence() -> Any:
    state = record(new(SLIP_EVIDENCE), SLIP_EVIDENCE)
    start_health(state)
    return state


def slides(way: float) -> np.ndarray:
    """Velocities of a pad that goes out and back along x, along y and about z, each like a spring that is let go."""
    v, x, k = np.zeros((1200, 6)), np.zeros(3), np.arange(1200)
    for i in k[1:]:
        there = way * np.eye(3)[i // 200 % 3] * (i % 200 < 100)
        speed = v[i - 1, [0, 1, 5]]
        v[i, [0, 1, 5]] = speed + DT * (400.0 * (there - x) - 40.0 * speed)
        x += DT * v[i, [0, 1, 5]]
    return v


def read(
    sensor: str, T: np.ndarray, units: tuple[float, float] = (1.0, 1.0), stamps_s: float = 0.0, held_hz: float = 0.0,
    way: float = 0.015, seed: int = 0,
) -> Readings:  # fmt: skip
    """Return readings of that motion: mounted as T, in other units, with wrong stamps, or held."""
    (hz, noise), rng, v = SENSORS[sensor], np.random.default_rng(seed), slides(way)
    times = 10.0 + DT * np.arange(len(v))
    at = np.arange(0, len(v), round(1.0 / hz / DT))
    true = v[at] + noise * AXES * rng.standard_normal((len(at), 6))
    readings = np.hstack((units[0] * true[:, :3] @ T.T, units[1] * true[:, 3:] @ T.T))
    if held_hz:
        readings = readings[np.searchsorted(at, (at * DT * held_hz).astype(int) / held_hz / DT)]
    return Readings(times, v, times[at] + stamps_s, readings, 6.0 * noise)


def found_in(given: Readings, differs: float, quantum: float = 0.0, bias: float = 0.0, sure: float = 0.0) -> Any:
    """Return the evidence of readings, where the motion drags the object."""
    state = evidence()
    for stamp, z in zip(given.stamps, given.readings, strict=True):
        drags = given.motion[np.clip(np.searchsorted(given.times, stamp), 0, len(given.times) - 1)]
        add_reading(state, round(1e9 * stamp), spatial(z), spatial(drags), bool(np.linalg.norm(z) > given.least))
    judge_health(state, differs, sure, bias, quantum)
    return state


MISTAKES = {
    "none": (SensorHealth.OK, {}, 0.0),
    "x": (SensorHealth.X_INVERTED, {"T": np.diag((-1.0, 1.0, 1.0))}, None),
    "y": (SensorHealth.Y_INVERTED, {"T": np.diag((1.0, -1.0, 1.0))}, None),
    "all": (SensorHealth.INVERTED, {"T": -np.eye(3)}, None),
    "turning": (SensorHealth.TURNS_INVERTED, {"T": np.diag((1.0, 1.0, -1.0))}, None),
    "swapped": (SensorHealth.XY_SWAPPED, {"T": np.eye(3)[[1, 0, 2]]}, None),
    "15 degrees": (SensorHealth.TURNED, {"T": turned(15.0)}, 15.0),
    "-90 degrees": (SensorHealth.TURNED, {"T": turned(-90.0)}, -90.0),
    "mm/s": (SensorHealth.LINEAR_UNIT, {"units": (1000.0, 1.0)}, 1000.0),
    "deg/s": (SensorHealth.ANGULAR_UNIT, {"units": (1.0, 57.3)}, 57.3),
    "old": (SensorHealth.STAMPS, {"stamps_s": -0.03}, -30.0),
    "ahead": (SensorHealth.STAMPS, {"stamps_s": 0.03}, 30.0),
}


@pytest.mark.parametrize("sensor", SENSORS)
@pytest.mark.parametrize("name", MISTAKES)
def test_mistake_is_named(name: str, sensor: str) -> None:
    health, changes, value = MISTAKES[name]
    given = read(sensor, **{"T": np.eye(3), **changes})
    wrong, by = against_motion(given.times, given.motion, given.stamps, given.readings, 1.4, 0.02)
    if wrong == SensorHealth.OK:
        state = found_in(given, TEN_DEGREES)
        wrong, by = SensorHealth(int(state.found)), state.value
    assert wrong == health
    if name in ("x", "y", "all", "turning", "swapped"):
        assert found_in(given, DIFFERS, sure=SIGNIFICANT).found == health
    assert value is None or by == pytest.approx(value, rel=0.1)
    assert health.to_do or health == SensorHealth.OK


@pytest.mark.parametrize(("axes", "health"), [([1, 0, 2], "XY"), ([0, 2, 1], "YZ"), ([2, 1, 0], "ZX")])
def test_any_two_axes_may_be_swapped(axes: list[int], health: str) -> None:
    state = evidence()
    state.way[:], state.length = np.eye(3)[axes], 1.0
    assert call(mounting, state, DIFFERS, SIGNIFICANT, 0.0) == SensorHealth[f"{health}_SWAPPED"]


@pytest.mark.parametrize(("quantum", "health"), [(0.0, SensorHealth.HELD), (1e-3, SensorHealth.OK)])
def test_held_values_are_counted(quantum: float, health: SensorHealth) -> None:
    """Values of a sensor that reads in steps come again."""
    state = found_in(read("event", np.eye(3), held_hz=30.0), DIFFERS, quantum)
    assert state.found == health
    assert (state.value, state.limit) == pytest.approx((30.0, 500.0) if quantum == 0.0 else (0.0, 0.0), rel=0.1)


@pytest.mark.parametrize("sensor", SENSORS)
def test_little_is_no_evidence_nor_is_an_outlier(sensor: str) -> None:
    """Pads give way so far, to and fro; one outlier is longer."""
    assert found_in(read(sensor, -np.eye(3), way=0.1 * GIVES_M), DIFFERS).found == SensorHealth.OK
    state = evidence()
    for k, speed in enumerate((0.01, -0.5)):
        add_reading(state, k * 4 * 10**6, spatial(speed * AXES), spatial(AXES), True)
    for sure, found in ((0.0, SensorHealth.INVERTED), (SIGNIFICANT, SensorHealth.OK)):
        judge_health(state, DIFFERS, sure, 0.0, 0.0)
        assert state.found == found


def test_a_bias_explains_as_much_of_the_way_as_it_may_have_moved() -> None:
    readings = read("event", -np.eye(3))
    speed = float(np.abs(readings.readings[:, :3]).sum(axis=1).max())
    assert found_in(readings, DIFFERS).found == SensorHealth.INVERTED
    assert found_in(readings, DIFFERS, bias=speed).found == SensorHealth.OK


def test_no_force_no_direction() -> None:
    state = evidence()
    for k in range(100):
        add_reading(state, k * 10**6, spatial(np.array([-1.0, 0.0, 0.0, 0.0, 0.0, -1.0])), NOTHING, True)
    assert (state.length, state.turned) == (0.0, 0.0)


def test_nothing_of_before_remains() -> None:
    assert left(start_health, SlipEvidence) == {"read_ns": NEVER}
