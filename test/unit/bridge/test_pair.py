"""Two arms, one object, two elastic contacts: balances of the closed chain, friction at its limit, and refusals."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from slip_core.arrays import Array
from slip_core.errors import InputError
from slip_core.records import new, record
from slip_description import urdf_text
from slip_sim_bridge.pair.params import PairParams
from slip_sim_bridge.pair.simulation import PairSimulation
from slip_sim_bridge.plant import DivergenceError
from slip_sim_bridge.plant.pair_step import PAIR, pair_after

POSTURE = (-0.040646922, 0.138380669, -0.173567454, -2.241908013, -1.709427011, 1.734215231, 0.821351893)
GRAVITY = np.array((0.0, 0.0, -9.81))
HALF = 0.7071067811865476
PUSH = np.array((2.0, -3.0, 1.0, 2.0, 0.5, 0.3, 0.2))


def params(period_s: float = 1e-3, grip: float = 12.0, damping: float = 30.0, **pad: Any) -> PairParams:
    side = {
        "initial_position": POSTURE, "control_period_s": period_s, "substeps": 1, "effort_rate": 1e6,
        "object": {"mass": 1.0, "inertia": (0.0133, 0.0052, 0.0185, 0.0, 0.0, 0.0)},
        "contacts": {"position": (0.0, 0.18, 0.0), "orientation_xyzw": (0.0, 0.0, -HALF, HALF)},
        "grip": {"force": grip}, "friction": {"mu_s": 0.5, "mu_k": 0.45, "torsional_radius": 0.015},
    }  # fmt: skip
    pad = {"damping": (damping, damping, damping, 0.05, 0.05, 0.02)} | pad
    return PairParams.model_validate(
        {"left": side, "right": side, "right_base": {"position": (0.0, -0.36, 0.0)}, "pad": pad}
    )


def pair(**changes: Any) -> PairSimulation:
    return PairSimulation(params(**changes), (urdf_text(), urdf_text()))


def holding(simulation: PairSimulation) -> list[Array]:
    return [simulation.truth(side).joint.effort for side in range(2)]


def push(simulation: PairSimulation, efforts: Sequence[Array], share: float) -> list[Array]:
    wave = np.sin(2.0 * np.pi * share)
    return [efforts[0] + wave * PUSH, efforts[1] + 0.7 * wave * PUSH]


def pads(simulation: PairSimulation) -> list[tuple[Array, Array]]:
    """Return pose of each pad by MuJoCo's own kinematics."""
    data = simulation.plant.data
    sites = [simulation.plant.model.site(f"{side}_pair_pad").id for side in ("left", "right")]
    return [(data.site_xpos[site].copy(), data.site_xmat[site].reshape(3, 3).copy()) for site in sites]


def balances(period_s: float) -> tuple[float, float, float, float]:
    """Return the worst residual of Newton's and Euler's equations over the largest force, that of energy, and
    the energy that friction and dampers have taken [J]."""
    simulation = pair(period_s=period_s)
    J = np.diag(simulation.params.left.object.inertia[:3])
    efforts, steps = holding(simulation), round(0.3 / period_s)
    start, _ = simulation.plant.energy()
    newton = euler = largest = work = 0.0
    for k in range(steps):
        before = simulation.truth(0).truth
        simulation.step(push(simulation, efforts, k / steps))
        sides = [simulation.truth(side) for side in range(2)]
        after = sides[0].truth
        work += sum(float(side.joint.effort @ side.joint.velocity) * period_s for side in sides)
        force, moment = np.zeros(3), np.zeros(3)
        for side, (x, R) in zip(sides, pads(simulation), strict=True):
            f, tau = R @ side.wrench.wrench[:3], R @ side.wrench.wrench[3:]
            force, moment = force + f, moment + tau + np.cross(x - after.position, f)
        spin = [t.rotation @ J @ t.rotation.T @ t.twist[3:] for t in (before, after)]
        newton = max(newton, np.abs((after.twist[:3] - before.twist[:3]) / period_s - GRAVITY + force).max())
        euler = max(euler, np.abs((spin[1] - spin[0]) / period_s + moment).max())
        largest = max(largest, np.abs(force).max())
    end, taken = simulation.plant.energy()
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


def test_at_rest_the_pads_carry_the_weight_and_nothing_moves() -> None:
    simulation = pair()
    for _ in range(50):
        simulation.step([None, None])
    for side in range(2):
        truth = simulation.truth(side)
        np.testing.assert_allclose(truth.wrench.wrench[:3], (0.0, 0.0, -4.905), atol=1e-6)
        assert not truth.truth.slip_displacement.any()
        assert np.abs(truth.truth.twist).max() < 1e-9


def test_sticking_is_exact_below_the_limit_and_friction_is_at_it_while_slipping() -> None:
    simulation = pair(grip=6.0)
    efforts, limits = holding(simulation), []
    for k in range(300):
        simulation.step(push(simulation, efforts, k / 300))
        for side in range(2):
            truth = simulation.truth(side)
            f, slip = truth.wrench.wrench, truth.slip.twist
            load = float(np.linalg.norm((f[0], f[1], f[5] / 0.015)))
            speed = float(np.linalg.norm((slip[0], slip[1], 0.015 * slip[5])))
            friction = simulation.params.left.friction
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
    truth = simulation.truth(0).truth
    for x, R in pads(simulation):
        x_0.append(truth.rotation.T @ (x - truth.position))
        R_0.append(truth.rotation.T @ R)
    start = simulation.plant.deflections
    efforts = holding(simulation)
    for k in range(300):
        simulation.step(push(simulation, efforts, k / 300))
    truth = simulation.truth(0).truth
    for side, (x, _R) in enumerate(pads(simulation)):
        moved = R_0[side].T @ (truth.rotation.T @ (x - truth.position) - x_0[side])
        slip = simulation.truth(side).truth.slip_displacement
        bent = start[side] - simulation.plant.deflections[side]
        now = simulation.plant.deflections[side]
        # Turning of the bent pad is left out: of second order in the deflection.
        second = 2.0 * np.linalg.norm(now[:3]) * np.linalg.norm(now[3:])
        assert second < 0.5 * np.linalg.norm(moved)
        np.testing.assert_allclose(moved, slip[:3] + bent[:3], atol=second)


def test_a_grip_of_zero_lets_the_object_fall() -> None:
    simulation = pair()
    for side in range(2):
        simulation.set_grip_force(side, 0.0)
    for _ in range(100):
        simulation.step([None, None])
        assert not simulation.plant.deflections.any()  # a pad that presses nothing is not bent, and takes no energy
    assert simulation.plant.energy()[1] == 0.0
    assert simulation.truth(0).truth.twist[2] == pytest.approx(-0.981, rel=1e-3)
    assert not simulation.truth(0).wrench.wrench.any()


def test_what_cannot_be_simulated_is_refused() -> None:
    with pytest.raises(InputError, match=r"pad\.damping"):
        pair(damping=1.0)
    with pytest.raises(InputError, match="grip force"):
        pair().set_grip_force(0, -1.0)
    with pytest.raises(ValueError, match="one object"):
        PairParams.model_validate({"left": {"object": {"mass": 2.0}}})
    simulation = pair()
    with pytest.raises(InputError, match="effort"):
        simulation.step([np.zeros(3), None])
    with pytest.raises(DivergenceError):
        simulation.step([None, None])


def test_forces_that_are_not_finite_end_the_simulation_before_they_act() -> None:
    simulation = pair()
    simulation.plant.data.qvel[0] = np.nan
    before = simulation.plant.data.qpos.copy()
    with pytest.raises(DivergenceError, match="the forces of the pads are not finite"):
        simulation.plant.advance([np.zeros(7), np.zeros(7)])
    assert np.array_equal(simulation.plant.data.qpos, before)


@pytest.mark.parametrize("grip", [0.5, 0.0])
def test_deflection_slip_and_energies_move_on_as_their_rates_say(grip: float) -> None:
    """Against the same in matrices: a pad is bent by what does not slip, and without pressure is not bent at all."""
    rng, dt = np.random.default_rng(5), 1e-3
    state, rows, qvel = new(PAIR), rng.normal(size=(12, 9)), rng.normal(size=9)
    state[:] = rng.normal(size=state.shape)
    before, after = record(state.copy(), PAIR), record(state, PAIR)
    pair_after(qvel, rows, np.array((20.0, grip)), dt, state)
    slipping = np.eye(6)[:, (0, 1, 5)]
    for i, pressed in enumerate((True, grip > 0.0)):
        old, moved, w = before.contact[i], after.contact[i], rows[6 * i : 6 * i + 6] @ qvel
        v = old.slip_rate if pressed else slipping.T @ w
        bent = w - slipping @ v if pressed else np.zeros(6)
        np.testing.assert_allclose(moved.slip_rate, v, atol=1e-15)
        np.testing.assert_allclose(moved.deflection, (old.deflection if pressed else 0.0) + dt * bent, atol=1e-15)
        assert moved.damped - old.damped == pytest.approx(dt * bent @ np.diag(old.damping) @ bent, abs=1e-14)
        assert moved.rubbed - old.rubbed == pytest.approx(-dt * old.force @ slipping @ v, abs=1e-14)
        half = old.slip[2] - 0.5 * dt * v[2]
        turn = np.array(((np.cos(half), -np.sin(half)), (np.sin(half), np.cos(half))))
        np.testing.assert_allclose(moved.slip[:2], old.slip[:2] - dt * turn @ v[:2], atol=1e-15)
        assert moved.slip[2] == pytest.approx(old.slip[2] - dt * v[2], abs=1e-15)
