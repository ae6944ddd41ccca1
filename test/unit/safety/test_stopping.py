"""Coming to rest along the path, going on from there, and joint states that stay away."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from slip_core.records import record
from slip_vic_controller.safety.conditions import Mode, Reason, Request
from slip_vic_controller.session.cycle_result import Health
from slip_vic_controller.session.session import Manifest
from slip_vic_controller.state import CONFIG
from test.support.law_cases import reference_of
from test.support.made_up import CALM, MS, MadeUp, N, law_at_work

PATH = {
    "trajectory__kind": "quintic", "trajectory__displacement": (0.1, -0.05, 0.02),
    "trajectory__rotation": (0.0, 0.2, 0.1), "trajectory__duration_s": 2.0, "trajectory__start_s": 0.05,
}  # fmt: skip
STILL = {"joint": {"velocity": np.zeros(N)}, "slip": np.zeros(6)}
CLOSE = 1e-8  # [m]: what is lost of the path is counted in whole nanoseconds
SLOW_DOWN_S = 0.5  # default of `fallback.slow_down_s`


class Path:
    """A controller along a path, and the path itself by the time that has passed on it."""

    def __init__(self, **values) -> None:
        self.made_up = law_at_work(**PATH, **CALM, **values)
        law = self.made_up.state.law
        self.start = np.array(law.start_position), np.array(law.start_rotation)
        self.path_s, self.speeds, self.modes = 0.0, [1.0], []

    def planned(self, t: float):
        path = np.frombuffer(record(self.made_up.controller.config, CONFIG).path.tobytes())
        return reference_of(path, t - 0.05, *self.start)

    def run(self, cycles: int, **given) -> None:
        """Run, and compare every reference with the path at the time that has passed on it, at its speed."""
        for _ in range(cycles):
            result = self.made_up.run(1, **{**STILL, **given})
            self.modes.append(result.mode)
            sigma = float(result.record.path_scale)
            if result.record.ok:
                self.path_s += 0.001 * sigma
                planned, found = self.planned(self.path_s), result.record.reference
                rate = float(self.made_up.session.task.path.rate)
                np.testing.assert_allclose(found.position, planned.position, atol=CLOSE)
                np.testing.assert_allclose(found.rotation, planned.rotation, atol=CLOSE)
                np.testing.assert_allclose(found.twist, sigma * planned.twist, atol=10 * CLOSE)
                expected = sigma**2 * planned.acceleration + rate * planned.twist
                np.testing.assert_allclose(found.acceleration, expected, atol=100 * CLOSE)
                if self.speeds[-1] != sigma:
                    assert rate == pytest.approx((sigma - self.speeds[-1]) / 0.001, abs=1e-6)
            self.speeds.append(sigma)


def test_requested_hold_stops_on_path() -> None:
    path = Path()
    path.run(700)
    assert path.speeds[-1] == 1.0
    path.made_up.session.request(Request.HOLD)
    path.run(1)
    assert path.made_up.session.reason == "hold requested: coming to rest first"
    path.run(round(1e3 * SLOW_DOWN_S) - 9)
    assert 0.0 < path.speeds[-1] < 0.05
    assert path.modes[-1] == Mode.DEGRADED
    path.run(15)
    assert path.speeds[-1] == 0.0
    assert path.modes[-1] == Mode.DEGRADED  # at rest, and a while longer until the arm is, too
    path.run(round(1e3 * SLOW_DOWN_S))
    assert path.modes[-1] == Mode.HOLD
    assert path.made_up.session.reason == "hold requested"
    path.run(150)  # the time in HOLD is not part of the path
    path.made_up.session.request(Request.ENABLE)
    path.run(round(1e3 * SLOW_DOWN_S) + 2)
    assert path.modes[-1].follows
    assert path.speeds[-1] == 1.0
    path.run(300)
    slowest = max(abs(b - a) for a, b in pairwise(path.speeds))
    assert slowest <= 1.001 * 0.001 / SLOW_DOWN_S


def test_lost_slip_stops_on_path() -> None:
    path = Path()
    path.run(700)
    path.run(round(1e3 * SLOW_DOWN_S) - 5, slip=np.full(6, np.nan))
    assert 0.0 < path.speeds[-1] < 0.02
    assert path.made_up.session.reason == "slip velocity is invalid: slowing down"
    path.run(round(1e3 * SLOW_DOWN_S) + 15, slip=np.full(6, np.nan))  # until an arm that friction brakes rests, too
    assert path.modes[-1] == Mode.HOLD
    path.run(110)  # it begins where it has come to rest, from rest
    assert path.modes[-1].follows
    assert path.speeds[-1] < 0.1
    path.run(600)
    assert path.speeds[-1] == 1.0


# -- joint states that stay away ----------------------------------------------------------------------

AGE_NS = 50 * MS  # default of `inputs.age_s`


def wait(made_up: MadeUp, passed_ns: int):
    made_up.now_ns += passed_ns
    return made_up.session.watchdog(made_up.now_ns)


def test_silence_leads_to_gravity_compensation() -> None:
    """Within the rate limit, however old the last command is."""
    for age_ns in (20 * MS, AGE_NS):
        made_up = law_at_work(**CALM, safety__inputs__age_s=1e-9 * age_ns)
        last = made_up.run(50, wrench=np.array([0.0, 0.0, 30.0, 0.0, 0.0, 0.0]), **STILL)
        assert wait(made_up, age_ns) is None  # not longer than the age limit
        first = wait(made_up, 1)
        assert first is not None
        assert (first.mode, first.reason) == (Mode.HOLD, "joint state is silent")
        assert (first.record.ok, first.outputs.flags.writeable) == (False, False)
        gravity = made_up.session.state.law.gravity[:N].copy()
        efforts = [last.command.numbers, first.command.numbers]
        assert np.abs(efforts[0] - gravity).max() > 6.0
        while (result := wait(made_up, 4 * MS)) is not None:
            efforts.append(result.command.numbers)
        steps = [np.abs(after - before).max() for before, after in pairwise(efforts)]
        assert steps[0] == pytest.approx(5.0)  # 1000 N m/s, and a pause counts 5 ms
        assert max(steps[1:]) <= 4.0 + 1e-9
        assert len(efforts) > 3
        np.testing.assert_allclose(efforts[-1], gravity, atol=1e-12)
        # It has nothing more to say, and says nothing of it in the state.
        before = made_up.session.buffer.tobytes()
        assert wait(made_up, 4 * MS) is None
        assert made_up.session.buffer.tobytes() == before
        assert first.ledger[1:3] == divmod(last.joint.stamp_ns, 10**9)
        assert Health.from_code(first.decision[3]).joint == Reason.SILENT
        # A user's wish is not lost on it.
        made_up.session.request(Request.HOLD)
        asked = wait(made_up, 4 * MS)
        assert asked is not None
        assert (asked.reason, asked.mode) == ("joint state is silent", Mode.HOLD)
        assert made_up.session.state.mode.enabled == 0


# -- lockstep -----------------------------------------------------------------------------------------


def test_lockstep_waits_for_manifest() -> None:
    made_up = MadeUp(lockstep=True)
    session, stamp = made_up.session, made_up.stamp_ns
    session.add_joint(made_up.joint(), stamp)
    for manifest in (
        Manifest(0, stamp + 1, (1,), (1,)),
        Manifest(0, stamp, (2,), (1,)),
        Manifest(0, stamp, (1,), (0,)),
    ):
        made = MadeUp(lockstep=True)
        made.session.add_joint(made.joint(), stamp)
        made.deliver()
        made.session.add_manifest(manifest)
        assert made.session.cycle() is None, manifest
    session.add_manifest(Manifest(0, stamp, (1,), (1,)))
    assert session.cycle() is None
    made_up.deliver()
    result = session.cycle()
    assert result is not None
    assert (result.mode, result.outputs.flags.writeable) == (Mode.ACTIVE, False)
    assert result.decision[:2] == divmod(stamp, 10**9)  # its clock is the joint state's
    assert session.watchdog(made_up.now_ns + 10**10) is None  # and it waits for the bridge as long as that takes
