"""The walk of a bring-up on bridge and controller in this process, without DDS."""

from __future__ import annotations

import numpy as np
import pytest

from test.support.bringup_arm import DRIVES, ERRORS, SCENARIOS, SENSORS, Error, Loop, bring_up


def test_a_wrong_sign_ends_the_walk_where_the_weight_shows_it() -> None:
    found, walk = bring_up(Loop(sensor="optical_flow_120", error=ERRORS["wrench: sign"]))
    assert [verdict.step for verdict in found if not verdict.holds] == ["weight"]
    assert "wrench.sign" in found[-1].fix
    assert walk.measured["slip_sensor.latency_s"] == pytest.approx(0.01, abs=1e-3)
    assert walk.measured["slip_sensor.rate_hz"] == pytest.approx(120.0, rel=0.02)


def test_an_arm_without_a_wrench_sensor_is_led_to_its_first_motion() -> None:
    found, walk = bring_up(Loop(sensor="optical_flow_120", error=Error(("controller.wrench.source=none",))))
    assert found[-1].holds, str(found[-1])
    assert found[-1].step == "first motion"
    assert not {"wrench", "weight"} & {verdict.step for verdict in found}
    assert "no wrench sensor" in next(verdict.measured for verdict in found if verdict.step == "rest")
    assert not [name for name in walk.measured if name.startswith("wrench")]


def test_hold_without_stiffness_does_not_pull_to_its_posture() -> None:
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
    loop, posture = system.loop, system.loop.controller.state.hold.posture
    before = loop.control(loop.observe()).command
    loop.bridge.advance([before])
    posture[1] += 1e-3
    for _ in range(3):  # the rate limit
        after = loop.control(loop.observe()).command
        loop.bridge.advance([after])
    posture[1] -= 1e-3
    system.listen(0.05)
    return after.effort - before.effort


@pytest.mark.long
@pytest.mark.timeout(1800)
@pytest.mark.parametrize(("scenario", "sensor"), [(scenario, sensor) for scenario in SCENARIOS for sensor in SENSORS])
def test_nothing_is_found_where_nothing_is_wrong(scenario: str, sensor: str) -> None:
    found, _ = bring_up(Loop(scenario, sensor, seed=1))
    assert found[-1].holds, str(found[-1])
    assert found[-1].step == "first motion"


@pytest.mark.long
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("drive", DRIVES[1:])
def test_nothing_is_found_where_drives_are_as_they_are(drive: str) -> None:
    found, _ = bring_up(Loop(sensor="vision_60", seed=1, drive=drive))
    assert found[-1].holds, str(found[-1])
    assert found[-1].step == "first motion"


@pytest.mark.long
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("name", ERRORS)
def test_every_scripted_error_is_found(name: str) -> None:
    assert not bring_up(Loop(error=ERRORS[name]))[0][-1].holds
