"""The laws of other schools against closed forms, an independent solver, and the wrench of the simulation."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.spatial import ConvexHull

import slip_vic
from slip_vic.experiments import proactive_slip_control as proactive
from slip_vic.experiments import toppra_offline
from slip_vic.experiments.driven import driven
from slip_vic.experiments.grip_laws import FixedGrip, GraspCbf, SlipAwareHold, SunSlippingControl
from slip_vic.experiments.law import KNOWN, Setup, find_law
from slip_vic.experiments.schools import measured_load, planned_load, timed

SCHOOLS = [name for name in KNOWN if "ours" not in KNOWN[name]]


class Holding:
    """Remembers what it gets, and holds the arm."""

    needs = frozenset({"wrench"})

    def reset(self, setup: Setup) -> None:
        self.setup, self.seen = setup, []

    def step(self, seen: Any) -> None:
        self.seen.append(seen)


def held(name: str, *settings: str, ticks: int = 1) -> Holding:
    law = Holding()
    assert list(driven(slip_vic.load(name, set=[f"bridge.duration_s={1e-3 * ticks}", *settings]), law))
    return law


@pytest.fixture(scope="module")
def setup() -> Setup:
    return held("paper_planar").setup


def begun(kind: Any, setup: Setup) -> Any:
    law = kind()
    law.reset(setup)
    return law


def seen(load: float = 0.0, grip: float = 0.5, slip: float = 0.0) -> Any:
    return SimpleNamespace(
        wrench=np.array([load, 0.0, 0, 0, 0, 0]), slip=np.array([slip, 0.0, 0, 0, 0, 0]), grip=grip, others=()
    )


@pytest.mark.parametrize("name", SCHOOLS)
def test_every_school_is_found_and_runs(name: str) -> None:
    if name == "toppra_offline":
        pytest.importorskip("toppra", reason="the extra `benchmark`")
    loaded = slip_vic.load("paper_planar", law="classical", set=["bridge.duration_s=0.02"])
    assert len(list(driven(loaded, find_law(name).kind()))) == 20


def test_the_planned_load_is_what_the_simulation_measures_at_rest() -> None:
    law = held("vertical_plane", ticks=300)
    start = law.setup.reference(0.0)
    planned = planned_load(law.setup, start._replace(twist=np.zeros(6), acceleration=np.zeros(6)))
    measured = measured_load(law.setup, law.seen[-1].wrench)
    np.testing.assert_allclose(np.linalg.norm(planned), np.linalg.norm(measured), rtol=0.01)


def test_fixed_grip_of_a_quintic_without_a_turn() -> None:
    """The largest acceleration of a quintic is 10 / sqrt(3) way / T^2."""
    plane = held(
        "paper_planar", "controller.trajectory.rotation=[0.0,0.0,0.0]", "contacts.position=[0.0,0.0,0.0]"
    ).setup
    most = 10.0 / np.sqrt(3.0) * 0.5 / 2.0**2
    assert begun(FixedGrip, plane).force == pytest.approx(2.0 * 0.5 * most / 0.5, rel=1e-3)


def test_slip_aware_hold_rises_at_once_and_decays_by_095_at_500_hz(setup: Setup) -> None:
    law = begun(SlipAwareHold, setup)
    assert law.squeeze(0, seen()) == 4.0
    assert law.squeeze(0, seen(load=3.0)) == pytest.approx(2.0 * 3.0 / 0.5)
    assert law.squeeze(0, seen(slip=0.01)) == pytest.approx(5.0)
    turned = seen()
    turned.wrench[5] = -3.0 * setup.torsional_radius
    assert law.squeeze(0, turned) == pytest.approx(2.0 * 3.0 / 0.5)
    grip = 10.0
    for _ in range(4):
        grip = law.squeeze(0, seen(grip=grip))
    assert grip == pytest.approx(10.0 * 0.95**2)


def test_sun_slipping_control_has_its_static_part_and_its_dc_gain(setup: Setup) -> None:
    """Steady: v = gain (load - limit), so that the slip part is (13 + 35) v."""
    law, load, grip = begun(SunSlippingControl, setup), 0.3, 0.5
    for _ in range(3000):
        squeeze = law.squeeze(0, seen(load, grip))
    assert squeeze == pytest.approx(1.1 * load / 0.5 + 48.0 * (load - 0.5 * grip), rel=1e-6)
    for _ in range(3000):
        squeeze = law.squeeze(0, seen(0.2, grip))
    assert squeeze == pytest.approx(1.1 * 0.2 / 0.5, rel=1e-6)
    assert law.squeeze(0, seen(100.0, grip)) == 10.0


def test_grasp_cbf_solves_its_qp_and_keeps_its_barrier(setup: Setup) -> None:
    law, rng = begun(GraspCbf, setup), np.random.default_rng(3)
    for grip, load, rate in rng.uniform([0.2, 0.0, -2.0], [2.0, 1.0, 2.0], (10, 3)):
        barrier = {
            "type": "ineq",
            "fun": lambda u, g=grip, f=load, d=rate: law.mu * u[0] - d + law.gamma * (law.mu * g - f),
        }
        nominal = law.back * (setup.grip - grip)
        found = minimize(lambda u, n=nominal: (u[0] - n) ** 2, [0.0], constraints=barrier).x[0]
        assert law.filtered(grip, load, rate) == pytest.approx(found, abs=1e-4)
    grip = 0.5
    for load in np.concatenate((np.linspace(0.2, 1.0, 500), np.full(200, 1.0))):
        grip = law.squeeze(0, seen(load, grip))
        assert law.mu * grip >= load
    assert law.mu * grip == pytest.approx(law.margin * 1.0, rel=0.01)


def test_the_load_of_an_acceleration_is_the_difference_of_two_planned_loads(setup: Setup) -> None:
    at, a = setup.reference(0.7), np.array([0.3, -0.8, 0.2])
    more = at._replace(acceleration=at.acceleration + np.concatenate((a, np.zeros(3))))
    difference = planned_load(setup, more) - planned_load(setup, at)
    np.testing.assert_allclose(proactive.load_of_acceleration(setup, at.rotation) @ a, difference, atol=1e-12)


def test_proactive_slip_control_finds_the_least_change_without_slip(setup: Setup) -> None:
    bases = proactive.gaussian_bases()
    change = np.diff(bases, axis=0, prepend=np.zeros((1, 4))) * proactive.RATE
    A = np.broadcast_to(np.diag([0.5, 0.5, 0.0]), (10, 3, 3))
    b = np.column_stack((np.linspace(0.1, 0.3, 10), np.zeros(10), np.zeros(10)))
    assert not proactive.nearest(bases, change, A, b, 0.31).any()
    limit = 0.2
    found = proactive.nearest(bases, change, A, b, limit)
    loads = b + np.einsum("kij,kj->ki", A, np.diff(found, axis=0, prepend=np.zeros((1, 3))) * proactive.RATE)
    assert np.linalg.norm(loads, axis=1).max() <= limit * 1.001
    assert np.linalg.norm(found, axis=1).max() <= proactive.MOST
    rows = {"type": "ineq", "fun": lambda w: limit - b[:, 0] - 0.5 * change @ w}
    least = minimize(lambda w: np.sum((bases @ w) ** 2), np.zeros(4), constraints=rows).fun
    assert np.sum(found**2) == pytest.approx(least, rel=0.02)


def test_proactive_slip_control_plans_the_load_that_friction_admits(setup: Setup) -> None:
    """Where the path would need more, from the end of the first sample on; else it goes back to the path."""
    law = begun(proactive.ProactiveSlipControl, replace(setup, friction_limit=0.4))
    ahead = setup.reference(1.0 / 60.0)
    back = ahead.twist[:3] + 3.0 * (ahead.position - setup.reference(0.0).position)
    np.testing.assert_allclose(law.planned(0.0), back, atol=1e-15)
    for k in range(25):
        wanted = law.wanted(SimpleNamespace(time=k / 60.0 + 1e-9))
        at = setup.reference((k + 1) / 60.0)
        both = np.concatenate((wanted.acceleration[:3], at.acceleration[3:]))
        load = np.linalg.norm(planned_load(setup, at._replace(acceleration=both)))
        assert load < 0.361
    assert load > 0.359


@pytest.mark.parametrize("name", ["proactive_slip_control", "toppra_offline"])
def test_a_changed_motion_is_one_motion_to_the_goal(setup: Setup, name: str) -> None:
    if name == "toppra_offline":
        pytest.importorskip("toppra", reason="the extra `benchmark`")
    law, dt = begun(find_law(name).kind, replace(setup, friction_limit=0.3)), setup.period_s
    rows = [law.wanted(SimpleNamespace(time=dt * k)) for k in range(4000)]
    x, v, a = (np.array([getattr(row, part) for row in rows]) for part in ("position", "twist", "acceleration"))
    np.testing.assert_allclose(np.diff(x, axis=0), (dt * v + 0.5 * dt**2 * a)[:-1, :3], atol=1e-6)
    np.testing.assert_allclose(np.diff(v, axis=0), dt * a[:-1], atol=3e-3)
    np.testing.assert_allclose(x[-1], setup.reference(setup.duration_s).position, atol=1e-3)
    assert np.abs(v[-1]).max() < 1e-3


def test_toppra_is_the_given_timing_where_friction_has_enough_and_else_keeps_the_limit(setup: Setup) -> None:
    pytest.importorskip("toppra", reason="the extra `benchmark`")
    path = np.linspace(0.0, setup.duration_s, 100)
    np.testing.assert_allclose(toppra_offline.timing(setup, path, 10.0), 1.0, atol=1e-3)
    assert ConvexHull(toppra_offline.sphere(200)).equations[:, 3].max() < -0.97, "of a sphere nearly"
    limit = 0.15
    rates = toppra_offline.timing(setup, path, limit)
    assert rates is not None
    slopes = np.diff(rates**2) / (2.0 * np.diff(path))
    loads = [
        np.linalg.norm(planned_load(setup, timed(setup, s, r, u)))
        for s, r, u in zip(path[1:-1], rates[1:-1], slopes[1:], strict=True)
    ]
    assert 0.9 * limit < max(loads) <= limit * 1.001
