"""Native contacts as a referee of the rigid plant, and what they can be trusted with themselves."""

from __future__ import annotations

import math

import numpy as np
import pytest

from slip_core.errors import InputError
from slip_vic.scenarios.scenario import load_scenario
from test.referees.native_plant import NativePlant

from .grasp_cases import G0, MU_S, POSTURE, RHO, friction_used, grasp, planar, shaken_hold, slip, slip_speed

SAME_DISTANCE = 0.10  # required; measured 0.01
SAME_WRENCH = 0.005  # of the wrench's size: soft contacts and 0.2 g of pads; measured 0.0005
BREAK_AWAY = 0.005  # the grip falls by 0.05 % a tick; measured 0.003
CREEP_M_S = 2e-5  # noslip solver at 90 % load with vibration, measured 6e-6; without it 2e-3
SLIPPING_M_S = 1e-4  # above creep and settling, below any real slip
SETTLED_M = 1e-7  # measured 3e-8
PLANTS = ("rigid", "native")


def loosened(plant):
    """The grip loosens for 0.1 s under the object's weight and closes again: slip (3,) [m] by then."""
    simulation = grasp(gravity_on_pad=(1.0, 0.5, 0.0), offset=(0.02, 0.01, 0.0), grip=40.0, plant=plant)
    for k in range(200):
        simulation.set_grip_force(7.0 if 20 <= k < 120 else 40.0)
        simulation.step(None)
    assert slip_speed(simulation) < SLIPPING_M_S
    return slip(simulation)


def test_both_plants_slip_as_far_under_weight():
    rigid, native = (loosened(plant) for plant in PLANTS)
    assert np.linalg.norm(rigid) > 0.02
    assert np.linalg.norm(native - rigid) < SAME_DISTANCE * np.linalg.norm(rigid)


def accelerated(plant, efforts):
    """The arm throws the object about in the horizontal plane under given efforts: wrenches and slip (3,) [m]."""
    simulation = grasp(offset=(0.02, 0.01, 0.0), grip=0.5, plant=plant)
    recorded, wrenches = [], []
    for k in range(300):
        if efforts is None:
            effort = simulation.holding_effort(simulation.observe().joint.position, 0.0, 0.0)
            effort[0] += 4.0 if k < 100 else -4.0 if k < 200 else 0.0
        else:
            effort = efforts[k]
        recorded.append(effort)
        simulation.step(effort)
        wrenches.append(simulation.observe().wrench.wrench)
    return recorded, np.array(wrenches), slip(simulation)


def test_both_plants_slip_as_far_and_feel_the_same_in_an_accelerated_hand():
    efforts, rigid_wrench, rigid = accelerated("rigid", None)
    _, native_wrench, native = accelerated("native", efforts)
    assert np.linalg.norm(rigid) > 0.003
    assert np.linalg.norm(native - rigid) < SAME_DISTANCE * np.linalg.norm(rigid)
    early = slice(20, 90)  # still stuck: later the two slips, and with them the poses, are no longer the same
    gap = np.linalg.norm(native_wrench[early] - rigid_wrench[early], axis=1)
    assert gap.max() < SAME_WRENCH * np.linalg.norm(rigid_wrench[early], axis=1).min()


@pytest.mark.parametrize("offset", [(0.0, 0.0, 0.0), (0.02, 0.01, 0.0)])
@pytest.mark.parametrize("direction", [(1.0, 0.0, 0.0), (1.0, -1.0, 0.0)])
def test_native_contacts_break_away_at_mu_n(direction, offset):
    force = 0.5 * G0 * np.array(direction) / np.linalg.norm(direction)
    torque = np.cross(-np.array(offset), force)[2]
    needed = math.sqrt(force @ force + (torque / RHO) ** 2) / MU_S
    grip = 1.05 * needed
    simulation = grasp(gravity_on_pad=direction, offset=offset, grip=grip, plant="native")
    while slip_speed(simulation) < SLIPPING_M_S:
        grip -= 0.0005 * needed
        assert grip > 0.9 * needed
        simulation.set_grip_force(grip)
        simulation.step(None)
    assert grip == pytest.approx(needed, rel=BREAK_AWAY)


def test_native_contacts_creep_little_at_90_percent_load_with_vibration():
    weight = np.array([1.0, 0.5, 0.0]) * 0.5 * G0 / math.hypot(1.0, 0.5)
    torque = np.cross([-0.02, -0.01, 0.0], weight)[2]
    grip = math.sqrt(weight @ weight + (torque / RHO) ** 2) / (0.85 * MU_S)
    simulation = grasp(gravity_on_pad=weight, offset=(0.02, 0.01, 0.0), grip=grip, plant="native")
    start, peak = slip(simulation), 0.0
    for k in range(500):
        simulation.step(shaken_hold(simulation, k, 3.0))
        peak = max(peak, friction_used(simulation) / (MU_S * grip))
    assert peak == pytest.approx(0.9, abs=0.03)
    assert np.linalg.norm(slip(simulation) - start) < 0.5 * CREEP_M_S


def test_native_contacts_stick_in_a_fast_swing():
    """Both bodies turn round the arm's base together; contacts that forget Jdot qdot would creep by 2 mm/s."""
    simulation = grasp(offset=(0.02, 0.01, 0.0), grip=20.0, plant="native")
    for k in range(300):
        effort = simulation.holding_effort(simulation.observe().joint.position, 0.0, 0.0)
        effort[0] += 5.0 if k < 150 else 0.0
        simulation.step(effort)
    assert abs(simulation.observe().joint.velocity[0]) > 1.0
    assert slip_speed(simulation) < CREEP_M_S


def test_the_object_s_twist_is_that_of_its_centre_of_mass():
    """Which moves; in a swing the point where it is gripped has another velocity, by 1 rad/s over 22 mm."""
    for plant in PLANTS:
        simulation = grasp(offset=(0.02, 0.01, 0.0), grip=20.0, plant=plant)
        moved, speeds = [], []
        for _ in range(150):
            effort = simulation.holding_effort(simulation.observe().joint.position, 0.0, 0.0)
            effort[0] += 5.0
            simulation.step(effort)
            truth = simulation.observe().truth
            moved.append(truth.position)
            speeds.append(truth.twist[:3])
        central = (moved[-1] - moved[-3]) / 2e-3
        np.testing.assert_allclose(speeds[-2], central, atol=0.002)


def test_without_grip_the_object_falls_freely_between_the_rollers():
    simulation = grasp(gravity_on_pad=(1.0, 1.0, 0.0), grip=0.0, plant="native")
    ticks, start = 100, simulation.observe().truth.position
    for _ in range(ticks):
        simulation.step(None)
    distance = (simulation.observe().truth.position - start) @ np.array(simulation.params.gravity) / G0
    assert distance == pytest.approx(0.5 * G0 * (1e-3 * ticks) ** 2, rel=0.01)  # semi-rigid Euler: 1 / (4 ticks)


def test_the_slip_is_the_pad_relative_to_the_object_in_both_plants():
    """Displacement is the integral of the slip velocity, and the object falls along +x of the pad."""
    for plant in PLANTS:
        simulation = grasp(gravity_on_pad=(1.0, 0.0, 0.0), offset=(0.02, 0.01, 0.0), grip=6.0, plant=plant)
        integral = np.zeros(3)
        for _ in range(100):
            simulation.step(None)
            integral += 1e-3 * planar(simulation.observe().slip.twist)
        displacement = planar(simulation.observe().truth.slip_displacement)
        assert displacement[0] < -1e-3
        # Axes of {ee} and {p} part by the angle slipped, and the rectangle rule is of first order.
        np.testing.assert_allclose(integral, displacement, atol=0.03 * np.abs(displacement).max())


def test_reset_puts_everything_back_and_equal_inputs_give_equal_bits():
    simulation = grasp(gravity_on_pad=(1.0, 0.5, 0.0), offset=(0.02, 0.01, 0.0), grip=8.0, plant="native")

    def run():
        for _ in range(30):
            simulation.step(None)
        truth = simulation.observe().truth
        return np.concatenate(
            (truth.position, truth.twist, truth.slip_displacement, simulation.observe().wrench.wrench)
        )

    first = run()
    simulation.reset()
    np.testing.assert_allclose(simulation.observe().joint.position, POSTURE, atol=1e-12)
    assert np.abs(slip(simulation)).max() < 1e-6
    assert (run() == first).all()


def test_at_the_start_the_robot_feels_the_whole_weight():
    for plant in PLANTS:
        wrench = grasp(offset=(0.02, 0.01, 0.0), grip=0.5, plant=plant).observe().wrench.wrench
        weight, com = np.array([0.0, 0.0, -0.5 * G0]), np.array([-0.02, -0.01, 0.0])  # seen from the pad
        expected = np.concatenate((weight, np.cross(com, weight)))
        np.testing.assert_allclose(wrench, expected, atol=SAME_WRENCH * 0.5 * G0)


def test_nothing_slides_while_the_contacts_settle():
    scenario = load_scenario("paper_planar")
    plant = NativePlant({"": scenario.bridge}, {"": scenario.urdf})
    plant.reset(np.array([scenario.bridge.grip.force]))
    assert np.abs(plant.data.qpos[plant._slip[:2]]).max() < SETTLED_M


def test_bristles_are_refused():
    with pytest.raises(InputError, match=r"friction\.model"):
        grasp(model="lugre", plant="native")
