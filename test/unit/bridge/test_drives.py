"""Simulated drives against closed forms: stick, decay, lag, dead time, loops of their own; and encoders."""

from __future__ import annotations

import math
from typing import Any

import mujoco
import numpy as np
import pytest
from scipy.optimize import lsq_linear

from slip_core.arrays import Array
from slip_core.errors import InputError
from slip_core.files.urdf import parse_urdf
from slip_core.types import JointCommand, JointSample
from slip_description import urdf_text
from slip_sim_bridge.plant.joint_step import JOINT_DRIVE, JOINT_DRIVE_SIZE, TORQUE, VELOCITY, joint_step
from slip_sim_bridge.plant.model import tree_of
from slip_sim_bridge.sensors.params import JointSensorParams
from slip_sim_bridge.sensors.suite import JointSensor
from slip_sim_bridge.session import BridgeSession
from test.unit.bridge.one_arm import OneArm
from test.unit.bridge.scenes import scenario_params, scene

DT = 1e-3
MODE, BANDWIDTH, COULOMB, LIMIT = (
    (JOINT_DRIVE.names or ()).index(name) for name in ("mode", "bandwidth", "coulomb", "limit")
)
LOCKED = (0.0, *(1e3,) * 6)
"""Friction that lets the first joint move alone: its inertia is constant then."""
STEP = 2e-4  # rad: a larger one would ask for more than the drives' effort
PLANTS = ("rigid", "elastic")
FIRST = np.eye(7)[0]


def weightless(plant: str = "rigid", **values: Any) -> OneArm:
    """The arm in free space with an object that sticks in its grasp."""
    return scene(
        plant=plant, gravity=(0.0, 0.0, 0.0), grip__force=1e4, friction__model="coulomb", **values,
    )  # fmt: skip


def inertia(simulation: OneArm) -> float:
    """Return the inertia about the first joint [kg m^2]; of the elastic plant that of arm and object together."""
    plant = simulation.plant
    M = np.zeros((plant.model.nv, plant.model.nv))
    mujoco.mj_fullM(plant.model, plant.data, M)
    return float(M[0, 0])


@pytest.mark.parametrize("plant", PLANTS)
def test_a_joint_below_its_friction_does_not_creep_and_breaks_away_at_the_limit(plant: str) -> None:
    limits = np.array((1.0, 1.0, 0.8, 0.8, 0.4, 0.4, 0.3))
    simulation = weightless(plant, drive__coulomb=tuple(limits.tolist()))
    start = simulation.observe().joint.position.copy()
    for k in range(300):
        simulation.step(limits * (0.95 + 0.049 * math.sin(0.05 * k)))
    assert np.abs(simulation.observe().joint.position - start).max() < 1e-12
    for joint in range(7):
        simulation = weightless(plant, drive__coulomb=tuple(limits.tolist()))
        share = 0.998
        while np.abs(simulation.observe().joint.velocity).max() < 1e-9:
            share += 2e-4
            simulation.step(share * limits * np.eye(7)[joint])
            assert share < 1.1
        assert share == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("braked", [False, True])
def test_the_joints_together_are_the_solution_of_the_convex_problem(braked: bool) -> None:
    """Against scipy's bounded least squares: min |L^T tau + L^-1 v|^2 in the bounds, A = L L^T.

    A drive that brakes its joint has friction on its side.
    """
    simulation, rng = weightless(), np.random.default_rng(3)
    plant = simulation.plant
    M, drives = np.zeros((10, 10)), np.zeros((7, JOINT_DRIVE_SIZE))
    mujoco.mj_fullM(plant.model, plant.data, M)
    data, sliding = plant.data, 0
    for _ in range(200):
        force, v = rng.normal(size=10) * 5.0, rng.normal(size=10) * rng.choice((0.0, 0.01))
        bounds = rng.uniform(0.1, 5.0, 7)
        drives[:] = 0.0
        drives[:, COULOMB] = bounds
        if braked:
            v[:7] = 0.0
            drives[:, (MODE, BANDWIDTH)] = VELOCITY, 1e3
            drives[:, COULOMB] = rng.uniform(0.0, bounds)
            drives[:, LIMIT] = bounds - drives[:, COULOMB]
        assert joint_step(data.qLD, data.qLDiagInv, tree_of(plant.model), data.qpos, v, force, DT, drives)
        A = DT * np.linalg.inv(M)[:7, :7]
        v_free = (v + DT * np.linalg.solve(M, force))[:7]
        L = np.linalg.cholesky(A)
        found = lsq_linear(L.T, -np.linalg.solve(L, v_free), (-bounds, bounds), method="bvls", tol=1e-14)
        np.testing.assert_allclose(drives[:, TORQUE], found.x, rtol=1e-6, atol=1e-7)
        sliding += int((np.abs(drives[:, TORQUE]) > bounds * (1.0 - 1e-9)).sum())
    assert 200 < sliding < 1200


def moving(simulation: OneArm, speed: float) -> OneArm:
    simulation.plant.data.qvel[0] = speed
    mujoco.mj_step1(simulation.plant.model, simulation.plant.data)
    return simulation


def test_a_joint_decays_by_viscous_and_stops_by_coulomb_friction() -> None:
    b = 0.7
    simulation = moving(weightless(drive__coulomb=LOCKED, drive__viscous=(b, *(0.0,) * 6)), 0.3)
    share = 1.0 / (1.0 + b * DT / inertia(simulation))
    for k in range(300):
        assert simulation.observe().joint.velocity[0] == pytest.approx(0.3 * share**k, rel=1e-9)
        simulation.step(np.zeros(7))
    friction = 2.0
    simulation = moving(weightless(drive__coulomb=(friction, *(1e3,) * 6)), 0.3)
    slower = friction * DT / inertia(simulation)
    for k in range(round(0.3 / slower) + 100):
        assert simulation.observe().joint.velocity[0] == pytest.approx(max(0.0, 0.3 - slower * k), abs=1e-9)
        simulation.step(np.zeros(7))


@pytest.mark.parametrize("way", [-1.0, 1.0])
def test_the_effort_of_a_velocity_drive_overcomes_friction_and_accelerates(way: float) -> None:
    simulation = weightless(
        drive__interface="velocity", drive__bandwidth=40.0, drive__coulomb=(3.0,), drive__viscous=(0.5,)
    )
    for k in range(20):
        simulation.step(0.1 * way * FIRST)
        after = 0.1 * (1.0 - math.exp(-40.0 * DT * (k + 1)))
        accelerates = inertia(simulation) * (after - 0.1 * (1.0 - math.exp(-40.0 * DT * k))) / DT
        effort = simulation.observe().joint.effort[0]
        assert effort == pytest.approx(way * (3.0 + 0.5 * after + accelerates), rel=1e-3)


@pytest.mark.parametrize("friction", [0.0, 3.0])
@pytest.mark.parametrize("plant", PLANTS)
def test_a_velocity_drive_follows_with_a_lag_of_first_order_whatever_rubs(plant: str, friction: float) -> None:
    simulation = weightless(
        plant, drive__interface="velocity", drive__bandwidth=40.0, drive__coulomb=(friction,), drive__viscous=(0.5,)
    )
    for k in range(200):
        velocity = simulation.observe().joint.velocity
        assert velocity[0] == pytest.approx(0.1 * (1.0 - math.exp(-40.0 * DT * k)), abs=1e-10)
        assert np.abs(velocity[1:]).max() < 1e-10
        simulation.step(0.1 * FIRST)
    assert not simulation.holding
    effort = simulation.observe().joint.effort
    assert effort[0] > friction, "the drive's effort carries friction and acceleration"
    simulation.step(np.full(7, np.nan))
    assert simulation.holding
    for _ in range(400):
        simulation.step(None)
    assert np.abs(simulation.observe().joint.velocity).max() < 1e-6


def test_a_velocity_drive_accelerates_no_more_than_its_effort_limit_allows() -> None:
    simulation = weightless(drive__interface="velocity", drive__bandwidth=1000.0)
    limits, before = simulation.arm.limits, simulation.observe().joint.velocity[0]
    for _ in range(5):
        simulation.step(2.0 * FIRST)
        velocity = simulation.observe().joint.velocity[0]
        assert (velocity - before) * inertia(simulation) / DT <= 3.0 * limits[0]
        assert np.abs(simulation.observe().joint.effort).max() <= limits.max()
        before = velocity
    assert before < 1.9


def test_a_position_drive_comes_with_a_lag_of_first_order_and_holds_its_posture() -> None:
    simulation = weightless(drive__interface="position", drive__bandwidth=30.0, drive__coulomb=(1.0,))
    start = simulation.observe().joint.position.copy()
    for k in range(300):
        left = STEP * math.exp(-30.0 * DT * k)
        assert simulation.observe().joint.position[0] - start[0] == pytest.approx(STEP - left, abs=1e-12)
        simulation.step(start + STEP * FIRST)
    for _ in range(300):
        simulation.step(None)
    np.testing.assert_allclose(simulation.observe().joint.position, start + STEP * FIRST, atol=1e-7)


@pytest.mark.parametrize("towards", ["lower", "upper"])
@pytest.mark.parametrize("joint", [3])
@pytest.mark.parametrize("interface", ["velocity", "position"])
def test_drives_take_no_command_beyond_the_speed_and_range_of_a_joint(interface: str, joint: int, towards: str) -> None:
    simulation = weightless(drive__interface=interface, drive__bandwidth=40.0, control_period_s=0.004)
    command = np.zeros(7) if interface == "velocity" else simulation.observe().joint.position.copy()
    command[joint] = 1e300 if towards == "upper" else -1e300
    name = scenario_params().joint_names[joint]
    (limit,) = (at.find("limit") for at in parse_urdf(urdf_text()).iter("joint") if at.get("name") == name)
    end, fastest = float(limit.get(towards)), 0.0
    for _ in range(750):
        assert (end - simulation.observe().joint.position[joint]) * np.sign(command[joint]) >= -1e-6
        simulation.step(command)
        fastest = max(fastest, abs(simulation.observe().joint.velocity[joint]))
    assert simulation.observe().joint.position[joint] == pytest.approx(end, abs=1e-3)
    assert fastest == pytest.approx(float(limit.get("velocity")), rel=1e-3)


@pytest.mark.parametrize("interface", ["velocity", "position"])
@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_a_command_with_a_number_that_is_none_is_refused_and_the_arm_rests(interface: str, bad: float) -> None:
    simulation = weightless(drive__interface=interface, drive__bandwidth=40.0)
    start = simulation.observe().joint.position
    for _ in range(100):
        simulation.step(np.array((0.0, bad, 0.0, 0.0, 0.0, 0.0, 0.0)))
        assert simulation.holding
    np.testing.assert_allclose(simulation.observe().joint.position, start, atol=1e-9)


@pytest.mark.parametrize("interface", ["velocity", "position"])
def test_a_command_that_jumps_to_and_fro_throws_no_arm(interface: str) -> None:
    simulation, rng = weightless(drive__interface=interface, drive__bandwidth=300.0), np.random.default_rng(5)
    for _ in range(1000):
        simulation.step(rng.choice((-1.0, 1.0), 7) * 10.0 ** rng.uniform(-3.0, 300.0, 7))
        assert np.isfinite(np.frombuffer(simulation.observe().truth.tobytes())).all()


@pytest.mark.parametrize("delay", [0, 1, 4])
def test_a_command_takes_effect_whole_periods_later(delay: int) -> None:
    prompt, late = scene(), scene(drive__delay_s=delay * DT)
    hold = prompt.observe().joint.effort.copy()
    efforts = [hold + 0.1 * np.sin(0.1 * k) for k in range(30)]
    for k in range(30):
        late.step(efforts[k])
        if k >= delay:
            assert np.array_equal(late.observe().joint.effort, efforts[k - delay])
        else:
            assert late.holding
    late.reset()
    late.step(efforts[0])
    assert late.holding == (delay > 0), "a reset forgets what is under way"


def test_efforts_lag_and_are_scaled_and_offset() -> None:
    simulation = scene(drive__lag_s=0.005)
    hold = simulation.observe().joint.effort.copy()
    for k in range(20):
        np.testing.assert_allclose(
            simulation.observe().joint.effort, hold + 0.2 * (1.0 - math.exp(-DT * k / 0.005)), rtol=0.0, atol=1e-12
        )
        simulation.step(hold + 0.2)
    (arm,) = scene(drive__gain=0.95, drive__offset=(0.1,), drive__ripple=0.02).all.arms
    effort, position = np.linspace(-2.0, 1.0, 7), np.linspace(-0.3, 0.1, 7)
    expected = 0.95 * effort + 0.1 + 0.02 * np.sin(6.0 * position)
    np.testing.assert_allclose(arm.at_joints(effort, position), expected)


def test_ideal_drives_are_not_there_and_friction_outlasts_the_object() -> None:
    assert scene().all._drives is None
    simulation = scene(drive__coulomb=(200.0,))
    simulation.set_grip_force(0.0)
    start = simulation.observe().joint.position.copy()
    for _ in range(100):
        simulation.step(np.zeros(7))
    assert simulation.loss is not None
    assert np.abs(simulation.observe().joint.position - start).max() < 1e-12
    assert simulation.observe().truth.object_twist[2] < -0.9


def test_the_friction_of_the_urdf_is_named() -> None:
    text = urdf_text().replace('<dynamics damping="0" friction="0"/>', '<dynamics damping="0.1" friction="0.5"/>')
    left_out = OneArm(scenario_params(), text)
    assert left_out.all.notes == (
        "friction and damping of the URDF's joints are not simulated: use drive.coulomb, viscous",
    )
    assert left_out.all._drives is None
    assert scene().all.notes == ()


def test_a_command_of_another_interface_is_named() -> None:
    session = BridgeSession({"": scenario_params(drive__interface="velocity")}, {"": urdf_text()})
    session.advance([JointCommand(0, np.zeros(7), "velocity")])
    with pytest.raises(InputError, match=r"drive\.interface"):
        session.advance([JointCommand(0, np.zeros(7))])


@pytest.mark.parametrize(
    "values", [{"coulomb": (1.0, 2.0)}, {"coulomb": (-1.0,)}, {"viscous": (0.1,) * 6}, {"gain": 0.0}]
)
def test_lists_that_do_not_fit_are_refused(values: dict[str, Any]) -> None:
    with pytest.raises(InputError, match="drive"):
        scenario_params(**{f"drive__{name}": value for name, value in values.items()})


def measured(params: JointSensorParams, positions: Array) -> list[JointSample]:
    sensor = JointSensor(params, np.random.default_rng(0))
    zero = np.zeros(1)
    return [sensor.update(JointSample(round(1e6 * k), np.array([q]), zero, zero)) for k, q in enumerate(positions)]


def test_a_driver_that_reads_seldom_repeats_what_it_has_read_noise_and_all() -> None:
    found = measured(JointSensorParams(rate_hz=100.0, noise_position=1e-3, noise_velocity=1e-2), np.zeros(200))
    for name in ("position", "velocity"):
        read = np.array([getattr(sample, name)[0] for sample in found])
        assert len(set(read)) == 20
        assert (np.diff(read) != 0.0).sum() == 19
    assert [sample.stamp_ns for sample in found] == [1_000_000 * k for k in range(200)]
