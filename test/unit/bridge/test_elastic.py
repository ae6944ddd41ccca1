"""Arms on one object in elastic contacts: balances of the closed chain, friction at its limit, loss, and refusals."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
import pytest

from slip_core.arrays import Array, inertia_from_six, matrix_from_quat_xyzw
from slip_core.errors import InputError
from slip_core.grasp_params import BaseParams, ObjectParams
from slip_core.records import POSE, records
from slip_core.types import DisplacementSample, SlipSample
from slip_description import urdf_text
from slip_sim_bridge.params import BridgeParams, PushParams
from slip_sim_bridge.plant import DivergenceError
from slip_sim_bridge.plant.elastic import LONGEST_STEP, ElasticPlant
from slip_sim_bridge.plant.elastic_step import fill_rows
from slip_sim_bridge.plant.model import OBJECT, PAD, name_of
from slip_sim_bridge.session import BridgeSession
from slip_sim_bridge.simulation import Simulation
from test.support.call import call

POSTURE = (-0.040646922, 0.138380669, -0.173567454, -2.241908013, -1.709427011, 1.734215231, 0.821351893)
GRAVITY = np.array((0.0, 0.0, -9.81))
HALF = 0.7071067811865476
PUSH = np.array((2.0, -3.0, 1.0, 2.0, 0.5, 0.3, 0.2))


NAMES = ("left", "right")
COULOMB = {"model": "coulomb", "mu_k": 0.5, "torsional_radius": 0.015}


def params(period_s: float = 1e-3, grip: float = 12.0, damping: float = 30.0, **more: Any) -> dict[str, BridgeParams]:
    arm = {
        "plant": "elastic", "initial_position": POSTURE, "control_period_s": period_s, "substeps": 1,
        "effort_rate": 1e6, "object": {"mass": 1.0, "inertia": (0.0133, 0.0052, 0.0185, 0.0, 0.0, 0.0)},
        "contacts": {"position": (0.0, 0.18, 0.0), "orientation_xyzw": (0.0, 0.0, -HALF, HALF)},
        "grip": {"force": grip}, "friction": {"mu_s": 0.5, "mu_k": 0.45, "torsional_radius": 0.015},
        "pad": {"damping": (damping, damping, damping, 0.05, 0.05, 0.02)},
    }  # fmt: skip
    left = BridgeParams.model_validate(arm | more)
    return {"left": left, "right": left.model_copy(update={"base": BaseParams(position=(0.0, -0.36, 0.0))})}


def pushed(arms: dict[str, BridgeParams], *force: float) -> list[BridgeParams]:
    """Return parameters by which a hand pushes the object where the left arm grips it [N]."""
    push = PushParams.model_validate({"wrench": (*force, 0.0, 0.0, 0.0)})
    return [arms["left"].model_copy(update={"push": push}), arms["right"]]


def test_the_free_object_has_the_mass_and_the_inertia_that_it_was_told_to_have() -> None:
    told = ObjectParams(mass=0.7, inertia=(2.0e-3, 1.5e-3, 1.2e-3, 2e-4, -1e-4, 3e-4))
    body = plant_of(pair(object=told.model_dump())).model.body(OBJECT)
    axes = matrix_from_quat_xyzw(np.roll(body.iquat, -1))
    assert body.mass == told.mass
    np.testing.assert_allclose(axes @ np.diag(body.inertia) @ axes.T, inertia_from_six(told.inertia), atol=1e-12)


def test_a_sensor_that_looks_at_the_object_sees_how_pads_give_way_to_a_load() -> None:
    """While nothing slips its sum is what the load bends the pads by, F / K to each pad; the truth is no slip."""
    told = params(grip=60.0, friction=COULOMB, substeps=4, sensors={"slip": {"sees_pads": True}})
    session, seen = BridgeSession(told, dict.fromkeys(NAMES, urdf_text())), np.zeros((2, 6))
    commands = [None, None]
    for _ in range(300):
        session.advance(commands)
        session.observe()
    before = [session.simulation.observe(k).wrench.wrench for k in range(2)]
    session.change(pushed(told, 1.5, 1.5, -2.0))
    for _ in range(1500):
        session.advance(commands)
        outputs = session.observe()
        for k, arm in enumerate(outputs.arms):
            (sample,) = arm.slips
            assert isinstance(sample, SlipSample)
            assert not arm.readings.truth.slip_velocity.any()
            seen[k] += 1e-3 * sample.twist
    for k in range(2):
        bent = session.simulation.observe(k).wrench.wrench - before[k]
        expected = -bent / np.array(told["left"].pad.stiffness)
        assert np.abs(expected[:2]).max() > 5e-5
        np.testing.assert_allclose(seen[k][[0, 1, 5]], expected[[0, 1, 5]], atol=1e-7)


@pytest.mark.parametrize("words", [{"plant": "rigid"}, {"slip_input": "displacement"}])
def test_a_sensor_cannot_see_pads_that_do_not_give_way(words: dict[str, str]) -> None:
    with pytest.raises(ValueError, match="sees_pads: needs plant elastic, and slip_input twist or flag"):
        params(sensors={"slip": {"sees_pads": True}}, **words)


@pytest.mark.parametrize("turning", [5.0, 4e3])
def test_steps_are_short_enough_for_the_stiffest_motion(turning: float) -> None:
    """Of the arms and the object together: with stiff pads it is one that turns."""
    pad = {"stiffness": (1e4, 1e4, 1e4, turning, turning, turning), "damping": (30.0, 30.0, 30.0, 0.5, 0.5, 0.2)}
    plant = plant_of(pair(period_s=4e-3, substeps=0, pad=pad))
    nv, rows = plant.model.nv, np.zeros((12, plant.model.nv))
    for i in range(2):
        moving, turned = (np.ascontiguousarray(plant._jacobians[6 * i + k : 6 * i + k + 3]) for k in (0, 3))
        call(fill_rows, plant._frame[i], plant._frame[2], moving, turned, rows[6 * i : 6 * i + 6])
    M = np.zeros((nv, nv))
    mujoco.mj_fullM(plant.model, plant.data, M)
    K = np.diag(np.tile(pad["stiffness"], 2))
    fastest = np.sqrt(np.abs(np.linalg.eigvals(np.linalg.solve(M, rows.T @ K @ rows))).max())
    steps = round(4e-3 / plant.model.opt.timestep)
    assert steps == max(1, np.ceil(4e-3 * fastest / LONGEST_STEP))
    assert steps > 1


def test_rows_of_a_contact_are_the_twist_of_the_object_against_the_pad() -> None:
    """Whatever stood in them before; the pad centre moves with the object's velocity and turning."""
    rng, nv = np.random.default_rng(0), 20
    frames, rotations = records(np.zeros((2, POSE.itemsize // 8)), POSE), []
    for frame in frames:
        R = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        R *= np.linalg.det(R)
        frame.rotation, frame.position = R, rng.normal(size=3)
        rotations.append(R)
    (pad, body), (R, R_o) = frames, rotations
    moving, turning = np.ascontiguousarray(rng.normal(size=(2, 3, nv)))
    rows, v = np.full((6, nv), 7.0), rng.normal(size=nv)
    call(fill_rows, pad, body, moving, turning, rows)
    pad_twist = moving[:, : nv - 6] @ v[: nv - 6], turning[:, : nv - 6] @ v[: nv - 6]
    w_o, r = R_o @ v[nv - 3 :], pad.position - body.position
    linear, angular = v[nv - 6 : nv - 3] + np.cross(w_o, r) - pad_twist[0], w_o - pad_twist[1]
    np.testing.assert_allclose(rows @ v, np.concatenate((R.T @ linear, R.T @ angular)), atol=1e-12)
    np.testing.assert_array_equal(rows[3:, nv - 6 : nv - 3], 0.0)


def simulated(arms: dict[str, BridgeParams]) -> Simulation:
    return Simulation(arms, dict.fromkeys(arms, urdf_text()))


def pair(**changes: Any) -> Simulation:
    return simulated(params(**changes))


def plant_of(simulation: Simulation) -> ElasticPlant:
    assert isinstance(simulation.plant, ElasticPlant)
    return simulation.plant


def deflections(simulation: Simulation) -> Array:
    return np.array([contact.deflection for contact in plant_of(simulation)._contacts])


def holding(simulation: Simulation) -> list[Array]:
    return [arm.applied for arm in simulation.arms]


def push(simulation: Simulation, efforts: Sequence[Array], share: float) -> list[Array]:
    wave = np.sin(2.0 * np.pi * share)
    return [efforts[0] + wave * PUSH, efforts[1] + 0.7 * wave * PUSH]


def pads(simulation: Simulation) -> list[tuple[Array, Array]]:
    """Return pose of each pad by MuJoCo's own kinematics."""
    data = plant_of(simulation).data
    sites = [plant_of(simulation).model.site(name_of(side, PAD)).id for side in NAMES]
    return [(data.site_xpos[site].copy(), data.site_xmat[site].reshape(3, 3).copy()) for site in sites]


def energy(plant: ElasticPlant) -> tuple[float, float]:
    """Return the mechanical energy (motion, height, pads) and what friction and dampers have taken [J]."""
    mujoco.mj_energyPos(plant.model, plant.data)
    mujoco.mj_energyVel(plant.model, plant.data)
    stored = sum(0.5 * float(c.deflection @ (c.stiffness * c.deflection)) for c in plant._contacts)
    taken = sum(float(c.rubbed + c.damped) for c in plant._contacts)
    return float(plant.data.energy.sum()) + stored, taken


def balances(period_s: float) -> tuple[float, float, float, float]:
    """Return the worst residual of Newton's and Euler's equations over the largest force, that of energy, and
    the energy that friction and dampers have taken [J]."""
    simulation = pair(period_s=period_s)
    J = np.diag(simulation.arms[0].params.object.inertia[:3])
    efforts, steps = holding(simulation), round(0.3 / period_s)
    start, _ = energy(plant_of(simulation))
    newton = euler = largest = work = 0.0
    for k in range(steps):
        before = simulation.observe(0).truth
        simulation.step(push(simulation, efforts, k / steps))
        sides = [simulation.observe(side) for side in range(2)]
        after = sides[0].truth
        work += sum(float(side.joint.effort @ side.joint.velocity) * period_s for side in sides)
        force, moment = np.zeros(3), np.zeros(3)
        for side, (x, R) in zip(sides, pads(simulation), strict=True):
            f, tau = R @ side.wrench.wrench[:3], R @ side.wrench.wrench[3:]
            force, moment = force + f, moment + tau + np.cross(x - after.object_position, f)
        spin = [t.object_rotation @ J @ t.object_rotation.T @ t.object_twist[3:] for t in (before, after)]
        newton = max(
            newton, np.abs((after.object_twist[:3] - before.object_twist[:3]) / period_s - GRAVITY + force).max()
        )
        euler = max(euler, np.abs((spin[1] - spin[0]) / period_s + moment).max())
        largest = max(largest, np.abs(force).max())
    end, taken = energy(plant_of(simulation))
    return newton / largest, euler / (0.18 * largest), work - taken - (end - start), taken


def test_newton_euler_and_energy_of_the_closed_chain_converge_at_first_order() -> None:
    coarse, middle, fine = balances(1e-3), balances(5e-4), balances(2.5e-4)
    assert max(coarse[:2]) < 2e-3
    assert max(middle[:2]) < 1e-3
    assert max(fine[:2]) < 6e-4
    assert 0.0 < coarse[2] < 1e-2
    # What is left of it as steps vanish: nothing, measured by what the dampers take.
    assert abs(2.0 * fine[2] - middle[2]) < 1e-3 * fine[3]
    for k in range(3):
        assert coarse[k] / fine[k] == pytest.approx(4.0, rel=0.25), k


@pytest.mark.parametrize("released", [False, True])
def test_sticking_is_exact_below_the_limit_and_friction_is_at_it_while_slipping(released: bool) -> None:
    """A pad that presses nothing takes no part in it."""
    simulation = pair(grip=6.0)
    efforts, limits = holding(simulation), []
    if released:
        simulation.set_grip_force(0, 0.0)
    for k in range(300):
        simulation.step(push(simulation, efforts, k / 300))
        for side in range(int(released), 2):
            truth = simulation.observe(side)
            f, slip = truth.wrench.wrench, truth.slip.twist
            load = float(np.linalg.norm((f[0], f[1], f[5] / 0.015)))
            speed = float(np.linalg.norm((slip[0], slip[1], 0.015 * slip[5])))
            friction = simulation.arms[0].params.friction
            if speed == 0.0:
                assert load <= 3.0 * (1.0 + 1e-9)
                continue
            limits.append(speed)
            fading = np.exp(-((speed / friction.stribeck_velocity) ** 2))
            limit = 6.0 * (0.45 + 0.05 * fading) + friction.viscous * speed
            assert load == pytest.approx(limit, rel=1e-6)
    assert len(limits) > 20


def test_slip_and_deflection_together_are_the_motion_of_the_pad_on_the_object() -> None:
    simulation = pair(grip=6.0)
    x_0, R_0 = [], []
    truth = simulation.observe(0).truth
    for x, R in pads(simulation):
        x_0.append(truth.object_rotation.T @ (x - truth.object_position))
        R_0.append(truth.object_rotation.T @ R)
    start = deflections(simulation)
    efforts = holding(simulation)
    for k in range(300):
        simulation.step(push(simulation, efforts, k / 300))
    truth = simulation.observe(0).truth
    for side, (x, _R) in enumerate(pads(simulation)):
        moved = R_0[side].T @ (truth.object_rotation.T @ (x - truth.object_position) - x_0[side])
        slip = simulation.observe(side).truth.slip_displacement
        bent = start[side] - deflections(simulation)[side]
        now = deflections(simulation)[side]
        # Turning of the bent pad is left out: of second order in the deflection.
        second = 2.0 * np.linalg.norm(now[:3]) * np.linalg.norm(now[3:])
        assert second < 0.5 * np.linalg.norm(moved)
        np.testing.assert_allclose(moved, slip[:3] + bent[:3], atol=second)


def test_what_no_pad_holds_falls_and_one_pad_that_holds_carries() -> None:
    simulation = pair(grip=60.0, friction=COULOMB)
    simulation.set_grip_force(0, 0.0)
    for step in range(100):
        simulation.step([None, None])
        assert not simulation.observe(0).wrench.wrench.any(), step
    assert simulation.loss is not None
    assert simulation.loss[1] == "left: the object is lost: the grip is zero"
    assert not simulation.observe(0).wrench.wrench.any()
    assert not simulation.observe(0).slip.twist.any()
    assert not deflections(simulation)[0].any()  # a pad that presses nothing is not bent
    right = simulation.observe(1)
    assert right.truth.object_twist[2] > -0.6, "it hangs and swings on the other pad; in free fall it is -0.981"
    assert (right.truth.pad_rotation @ right.wrench.wrench[:3])[2] < -5.0
    simulation.set_grip_force(0, 60.0)
    simulation.step([None, None])
    assert not simulation.observe(0).wrench.wrench.any(), "a grip that comes back does not catch it"
    simulation.set_grip_force(1, 0.0)
    simulation.step([None, None])
    before = simulation.observe(0).truth.object_twist[2]
    for _ in range(100):
        simulation.step([None, None])
    assert simulation.observe(0).truth.object_twist[2] - before == pytest.approx(-0.981, rel=1e-9)
    assert not simulation.observe(1).wrench.wrench.any()
    simulation.reset()
    assert simulation.loss is None
    np.testing.assert_allclose(simulation.observe(1).wrench.wrench[:3], (0.0, 0.0, -4.905), atol=1e-6)


def test_a_push_acts_where_the_arm_grips() -> None:
    """Two equal pushes at the two grasps are one at the middle; each is carried by both pads, as Newton says."""
    simulation = pair(grip=200.0, friction=COULOMB)
    simulation.push(0, np.array((3.0, 0.0, 0.0, 0.0, 0.0, 0.0)), np.zeros(0))
    simulation.push(1, np.array((3.0, 0.0, 0.0, 0.0, 0.0, 0.0)), np.zeros(0))
    for _ in range(1500):
        simulation.step([None, None])
    readings = [simulation.observe(k) for k in range(2)]
    forces = [reading.truth.pad_rotation @ reading.wrench.wrench[:3] for reading in readings]
    assert np.abs(readings[0].truth.object_twist).max() < 1e-4
    np.testing.assert_allclose(forces[0] + forces[1], (6.0, 0.0, -9.81), atol=1e-3)
    assert forces[0][0] == pytest.approx(forces[1][0], rel=0.02)


def test_several_arms_have_flags_displacements_and_grips_of_their_own() -> None:
    arms = params(grip=9.0, slip_input="displacement")
    arms["right"] = arms["right"].model_copy(update={"slip_input": "flag"})
    session = BridgeSession(arms, dict.fromkeys(arms, urdf_text()))
    session.change(pushed(arms, 15.0, 0.0, 0.0))
    slipping = False
    for _ in range(80):
        outputs = session.observe()
        (pose,), (flag,) = outputs.arms[0].slips, outputs.arms[1].slips
        assert isinstance(pose, DisplacementSample)
        assert isinstance(flag, SlipSample)
        truth = [arm.readings.truth for arm in outputs.arms]
        np.testing.assert_allclose(pose.pose[:3], truth[0].slip_displacement[:3], atol=1e-15)
        v = truth[1].slip_velocity
        fast = np.linalg.norm((*v[:3], *(0.015 * v[3:]))) > 1e-3
        assert flag.twist[0] == float(fast)
        slipping |= bool(fast)
        session.simulation.set_grip_force(0, 9.5)
        session.simulation.set_grip_force(1, 9.0)
        session.advance([None, None])
    assert slipping
    assert [arm.gripper.force for arm in session.simulation.arms] == [9.5, 9.0]
    assert outputs.counts == (80, 80, 80, 80)


def test_what_cannot_be_simulated_is_refused() -> None:
    with pytest.raises(InputError, match=r"pad\.damping"):
        pair(damping=1.0)
    with pytest.raises(InputError, match="grip force"):
        pair().set_grip_force(0, -1.0)
    other = ObjectParams(mass=2.0)
    with pytest.raises(InputError, match="one object"):
        simulated(params() | {"right": params()["right"].model_copy(update={"object": other})})
    with pytest.raises(InputError, match="several rigid pads"):
        simulated({name: arm.model_copy(update={"plant": "rigid"}) for name, arm in params().items()})
    simulation = pair()
    with pytest.raises(InputError, match="effort"):
        simulation.step([np.zeros(3), None])


def test_forces_that_are_not_finite_end_the_simulation_before_they_act() -> None:
    simulation = pair()
    plant_of(simulation).data.qvel[0] = np.nan
    before = plant_of(simulation).data.qpos.copy()
    with pytest.raises(DivergenceError, match="the forces of the pads are not finite"):
        plant_of(simulation).advance(np.zeros(14), np.array((12.0, 12.0)))
    assert np.array_equal(plant_of(simulation).data.qpos, before)
