"""Every number a parameter may have leaves the loop finite; what it may not have is refused in one line."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from slip_core.errors import InputError
from slip_core.params import ParameterInfo, build, flatten, parameter_infos, range_of
from slip_sim_bridge.session import BridgeSession
from slip_vic.scenarios.scenario import load
from slip_vic_controller.config.controller import Controller
from slip_vic_controller.params.controller_params import ControllerParams
from slip_vic_controller.session.session import Manifest
from test.support.one_arm import OneArm, one_arm

CYCLES = 25
HOSTILE = (5e-324, 1e-300, 1e300, -1e300)
NUMBERS = [info for info in parameter_infos(ControllerParams) if "float" in str(info.kind)]
SET_UPS = {
    "observer, circle": {"slip_estimator": "observer", "trajectory.kind": "circle"},
    "measured, quintic": {
        "attitude": "rpy",
        "trajectory.kind": "quintic",
        "trajectory.displacement": [0.05, 0.0, 0.02],
    },
}
OWN = {"observer, circle": "", "measured, quintic": ("trajectory.", "measured.", "gains.", "slip_sensor.")}
"""Beginnings of the names that are tried in a set-up: those that act as in the first one are not tried twice."""


def corners(info: ParameterInfo) -> Iterator[float]:
    """Yield the ends of a parameter's range, and what is far out of it."""
    bounds, (smallest, largest) = info.bounds, range_of(info.unit)
    yield bounds["ge"] if "ge" in bounds else math.nextafter(bounds["gt"], math.inf) if "gt" in bounds else smallest
    yield bounds["le"] if "le" in bounds else math.nextafter(bounds["lt"], -math.inf) if "lt" in bounds else largest
    yield 0.0
    yield from HOSTILE


def with_value(info: ParameterInfo, value: float) -> Any:
    """Return the parameter with every number of it replaced."""
    if info.kind is float:
        return value
    return [value] * (len(info.default) or 7)


@pytest.fixture(scope="module")
def bridge() -> tuple[Any, BridgeSession]:
    scenario = load("paper_planar", law="vic")
    return scenario, BridgeSession(scenario.bridges, scenario.urdfs)


def run_loop(bridge: BridgeSession, controller: Controller) -> None:
    """Close the loop from the start on, and look at every effort."""
    session = OneArm(controller)
    bridge.request_reset()
    counts = np.zeros(2, np.int64)
    for _ in range(CYCLES):
        tick = bridge.observe()
        for wrench in tick.arms[0].wrenches:
            session.add_wrench(0, wrench)
        for slip in tick.arms[0].slips:
            session.add_slip(0, slip)
        session.add_joint(tick.arms[0].joint)
        counts += len(tick.arms[0].wrenches), len(tick.arms[0].slips)
        session.add_manifest(Manifest(tick.tick, tick.stamp_ns, (int(counts[0]),), (int(counts[1]),)))
        result = session.cycle()
        assert result is not None
        effort = result.command.numbers
        assert np.isfinite(effort).all()
        assert (np.abs(effort) <= controller.first.robot.effort_limit[: len(effort)]).all()
        bridge.advance([result.command])


def outcome(values: dict[str, Any], scenario: Any, bridge: BridgeSession) -> str:
    """Return "refused", "ran", or what went wrong."""
    try:
        controller = one_arm(build(ControllerParams, values, "test"), scenario.urdf, lockstep=True)
    except InputError as error:  # not always of the parameter itself: some must fit to others
        return "refused" if "\n" not in str(error) and ", expected " in str(error) else f"unclear: {error}"
    except Exception as error:
        return repr(error)
    try:
        run_loop(bridge, controller)
    except Exception as error:
        return repr(error)
    return "ran"


@pytest.mark.parametrize("name", SET_UPS)
def test_parameter_corners_stay_finite(name: str, bridge: tuple[Any, BridgeSession]) -> None:
    scenario, session = bridge
    base = {**flatten(scenario.controller), **SET_UPS[name]}
    tried = [info for info in NUMBERS if info.name.startswith(OWN[name])]
    outcomes = {
        (info.name, value): outcome({**base, info.name: with_value(info, value)}, scenario, session)
        for info in tried
        for value in corners(info)
    }
    assert not {key: text for key, text in outcomes.items() if text not in ("ran", "refused")}
    counts = Counter(outcomes.values())
    assert counts["ran"] > len(tried)
    assert counts["refused"] > 2 * len(tried)
