"""The walk of a bring-up on bridge and controller in this process, without DDS."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from slip_vic.setup.bringup.heard import Track
from slip_vic.setup.bringup.walk import stream
from test.support.bringup_arm import DRIVES, ERRORS, SCENARIOS, SENSORS, Error, Loop, bring_up


@pytest.mark.parametrize("name", ERRORS)
def test_scripted_error_is_found(name: str) -> None:
    error, step, words = ERRORS[name]
    found, _ = bring_up(Loop(error=error))
    assert [verdict.step for verdict in found if not verdict.holds] == [step]
    assert words in str(found[-1])
    assert "\n" not in str(found[-1])


@pytest.mark.parametrize("answers_s", [0.3, 1.0])
def test_slow_services_are_no_mistake_of_the_sensor(answers_s: float) -> None:
    found, _ = bring_up(Loop(sensor="optical_flow_120", answers_s=answers_s))
    assert found[-1].holds, str(found[-1])
    assert found[-1].step == "friction"


def test_measured_sensor() -> None:
    _, walk = bring_up(Loop(sensor="optical_flow_120", error=ERRORS["wrench: sign"][0]))
    assert walk.measured["slip_sensor.latency_s"] == pytest.approx(0.01, abs=1e-3)
    assert walk.measured["slip_sensor.rate_hz"] == pytest.approx(120.0, rel=0.02)
    _, walk = bring_up(Loop(error=Error(("bridge.sensors.wrench.noise_force=0.02", "controller.wrench.sign=-1"))))
    assert walk.measured["wrench_sensor.noise_force"] == pytest.approx(0.02, rel=0.1)


def track(hz: float = 100.0, count: int = 200, late: float = 0.0) -> Track:
    stamp = 10.0 + np.arange(count) / hz
    return Track(stamp + late, stamp, np.zeros((count, 6)))


@pytest.mark.parametrize(
    ("samples", "word"),
    [
        (track(count=2), "start the driver"),
        (track(hz=20.0), "rate"),
        (track(hz=300.0), "control_period_s"),
        (track(late=0.3), "clocks"),
        (track(late=-0.3), "ahead"),
        (track()._replace(stamp=np.zeros(200)), "stamp"),
        (track()._replace(stamp=np.roll(track().stamp, 1)), "a second driver"),
    ],
)
def test_slow_late_and_disordered_streams(samples: Track, word: str) -> None:
    assert stream("wrench", track(), 80.0, 120.0, 0.05, 0.05).holds
    assert word in stream("wrench", samples, 80.0, 120.0, 0.05, 0.05).fix


def test_rate_ignores_gaps() -> None:
    every, stamps = track(120.0, 600), track(120.0, 600).stamp
    heard = Track(*(np.concatenate((part[:100], part[300:350], part[580:])) for part in every))
    assert heard.rate == pytest.approx(120.0, rel=1e-6)
    rounded = np.ceil(stamps * 1000.0) / 1000.0
    assert Track(rounded, rounded, every.values).rate == pytest.approx(120.0, rel=1e-2)
    assert np.isnan(track(count=1).rate)


def test_arm_without_wrench_sensor() -> None:
    found, walk = bring_up(Loop(sensor="optical_flow_120", error=Error(("controller.wrench.source=none",))))
    assert found[-1].holds, str(found[-1])
    assert found[-1].step == "friction"
    assert not {"wrench", "weight"} & {verdict.step for verdict in found}
    assert "no wrench sensor" in next(verdict.measured for verdict in found if verdict.step == "rest")
    assert not [name for name in walk.measured if name.startswith("wrench")]


def test_hold_without_stiffness() -> None:
    system = Loop()
    system.listen(0.05)
    stiff = _effort_of_a_posture_beside(system)
    system.tune({"safety.hold_stiffness": 0.0})
    loose = _effort_of_a_posture_beside(system)
    system.tune({"safety.hold_stiffness": 225.0})
    assert abs(loose[1]) < 0.01 * abs(stiff[1])
    assert _effort_of_a_posture_beside(system)[1] == pytest.approx(stiff[1], rel=0.1)


def _effort_of_a_posture_beside(system: Loop) -> np.ndarray:
    """Return by how much the effort changes in the next cycles with a posture that is 1 mrad off at joint 2."""
    loop, posture = system.loop, system.loop.session.arms[0].state.hold.posture
    before = loop.answer(loop.bridge.observe())[0].command
    loop.bridge.advance([before])
    posture[1] += 1e-3
    for _ in range(3):  # the rate limit
        after = loop.answer(loop.bridge.observe())[0].command
        loop.bridge.advance([after])
    posture[1] -= 1e-3
    system.listen(0.05)
    return after.numbers - before.numbers


@pytest.mark.long
@pytest.mark.timeout(1800)
@pytest.mark.parametrize(
    ("scenario", "sensor", "drive"),
    [*itertools.product(SCENARIOS, SENSORS, [""]), *(("paper_planar", "vision_60", drive) for drive in DRIVES)],
)
def test_no_error_is_found(scenario: str, sensor: str, drive: str) -> None:
    found, _ = bring_up(Loop(scenario, sensor, seed=1, drive=drive))
    assert found[-1].holds, str(found[-1])
    assert found[-1].step == "friction"
