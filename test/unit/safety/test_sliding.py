"""The law does not begin onto an object that slides fast; and real time does not follow its spin."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from slip_vic.scenarios.scenario import Law, load_scenario
from slip_vic_controller.params.safety_params import SafetyParams
from slip_vic_controller.safety.faults import Fault, Input, describe_fault
from slip_vic_controller.safety.modes import Request
from test.campaigns.faults.trial import PERIOD_S, STEADY_NS
from test.support.delivery import answered_outputs, begun_bridge, realtime

SAFETY = SafetyParams()
RESUME_TICKS = round(SAFETY.resume_after_s / PERIOD_S)
SLIDES = "the object slides: waiting until it rests"


class Loop:
    """Bridge and controller without topics, with whatever slip velocity a sensor may say."""

    def __init__(self, kind: Law = "vic") -> None:
        changes = [f"{node}.control_period_s={PERIOD_S}" for node in ("bridge", "controller")]
        scenario = load_scenario(
            "paper_planar", law=kind, mode="realtime", assignments=(*changes, "controller.gains.k_s=100.0")
        )
        self.bridge, self.controller, self.now_ns = begun_bridge(scenario), realtime(scenario), STEADY_NS

    def run(self, ticks: int, linear: float = 0.0, angular: float = 0.0, *, valid: bool = True) -> str:
        """Run with this slip velocity measured; return mode and reason."""
        for tick in range(ticks):
            outputs = self.bridge.observe()
            # No sensor says the same to the last bit, but where there is no slip.
            twist = np.array([0.0, -linear, 0.0, 0.0, 0.0, angular]) * (1.0 + 1e-6 * tick)
            slips = [dataclasses.replace(slip, twist=twist, valid=valid) for slip in outputs.arms[0].slips]
            result = answered_outputs(
                self.controller, outputs._replace(arms=(outputs.arms[0]._replace(slips=tuple(slips)),)), self.now_ns
            )
            self.bridge.advance([result.command])
            self.now_ns += round(1e9 * PERIOD_S)
        return f"{result.mode.name} {result.reason}".strip()


@pytest.mark.parametrize(("linear", "angular"), [(1.01, 0.0), (0.0, 1.01)])
def test_law_waits_for_rest(linear: float, angular: float) -> None:
    fast = linear * SAFETY.resume_slip_linear, angular * SAFETY.resume_slip_angular
    loop = Loop()
    assert loop.run(3 * RESUME_TICKS, *fast) == f"HOLD {SLIDES}"
    assert loop.run(RESUME_TICKS) == f"HOLD resumes after: {SLIDES}"
    assert loop.run(1).startswith(("ACTIVE", "DEGRADED the path waits"))
    # A user does not enable it earlier; and while it works, slip is its business.
    loop.controller.request(Request.HOLD)
    loop.run(round(3 * SAFETY.fallback.slow_down_s / PERIOD_S))
    loop.run(1, *fast)
    loop.controller.request(Request.ENABLE)
    assert loop.run(5, *fast) == f"HOLD {SLIDES}"
    loop.controller.request(Request.ENABLE)
    assert loop.run(1).startswith(("ACTIVE", "DEGRADED"))
    loop.run(1, *fast)
    assert loop.controller.mode.follows


def test_law_waits_for_a_slip_sensor() -> None:
    """The levels are for a law that is at work."""
    loop = Loop()
    assert loop.run(1) == "ACTIVE"
    loop.controller.set_publishers({"wrench": 2}, 1)
    loop.run(RESUME_TICKS)
    loop.controller.set_publishers({}, 1)
    words = describe_fault(Input.SLIP, Fault.INVALID)
    assert loop.run(3 * RESUME_TICKS, valid=False) == f"HOLD {words}"
    assert loop.run(RESUME_TICKS) == f"HOLD resumes after: {words}"
    assert loop.run(1).startswith(("ACTIVE", "DEGRADED"))
    assert loop.run(1, valid=False).startswith(f"DEGRADED {words}")


def test_slow_slip_delays_nothing() -> None:
    assert Loop().run(1, 0.9 * SAFETY.resume_slip_linear, 0.9 * SAFETY.resume_slip_angular) == "ACTIVE"
    assert Loop("classical").run(1, 10 * SAFETY.resume_slip_linear) == "ACTIVE"


def test_realtime_bounds_spin_by_default() -> None:
    assert load_scenario("paper_planar").controller.gains.spin == "follow"
    assert load_scenario("paper_planar", mode="realtime").controller.gains.spin == "bounded"
    printed = load_scenario("paper_planar", mode="realtime", assignments=("controller.gains.spin=follow",))
    assert printed.controller.gains.spin == "follow"
