"""Life of a simulation: holding, limits, refusals, grip, reset, determinism, divergence, sub-steps, joint stops."""

from __future__ import annotations

import numpy as np
import pytest

from slip_core.errors import InputError, SlipVicError
from slip_sim_bridge.plant import DivergenceError

from .scenes import Shaker, driven_into_the_stop, scene

STILL = 1e-9  # rad, m: rounding of 2 s of holding
LIMIT = np.array([87.0] * 4 + [12.0] * 3)


def state_of(simulation):
    """Everything a simulation publishes, as one array."""
    readings = simulation.observe()
    return np.concatenate((np.frombuffer(readings.truth.tobytes()), readings.joint.effort))


def test_holds_until_the_first_command():
    simulation = scene()
    start = simulation.observe().joint
    for _ in range(2000):
        simulation.step(None)
        assert simulation.holding
    end = simulation.observe().joint
    np.testing.assert_allclose(end.position, start.position, rtol=0, atol=STILL)
    assert np.abs(simulation.observe().truth.slip_displacement).max() < STILL


def test_what_is_read_is_nobody_s_to_change():
    """All samples of an instant share one array."""
    readings = scene().observe()
    for values in (readings.joint.position, readings.wrench.wrench, readings.slip.twist, readings.truth.object_twist):
        with pytest.raises(ValueError, match="read-only"):
            values[0] = 1.0


def test_first_samples_are_those_of_the_held_arm():
    simulation = scene()
    before = state_of(simulation)
    simulation.step(None)
    np.testing.assert_allclose(state_of(simulation), before, rtol=0, atol=STILL)
    weight = simulation.params.object.mass * 9.81
    wrench = simulation.observe().wrench.wrench  # object on robot: down, and 20 mm in front of the pads
    np.testing.assert_allclose(wrench, [0, 0, -weight, 0, 0.02 * weight, 0], rtol=0, atol=1e-7)


def test_holds_where_it_stands_when_commands_stop():
    simulation = scene(grip__force=50.0)
    for _ in Shaker(simulation, 1).run(200):
        assert not simulation.holding
    left = simulation.observe().joint
    assert np.abs(left.velocity).max() > 0.05, "the arm must be moving"
    for _ in range(2000):
        simulation.step(None)
    rest = simulation.observe().joint
    assert simulation.holding
    np.testing.assert_allclose(rest.position, left.position, rtol=0, atol=1e-4)
    np.testing.assert_allclose(rest.velocity, 0.0, atol=1e-4)


def test_effort_is_clipped_to_the_urdf_limits():
    simulation = scene()
    simulation.step(np.full(7, 1e6) * [1, -1, 1, -1, 1, -1, 1])
    np.testing.assert_array_equal(simulation.observe().joint.effort, LIMIT * [1, -1, 1, -1, 1, -1, 1])
    simulation.reset()
    within = simulation.observe().joint.effort + 0.1
    simulation.step(within)
    np.testing.assert_array_equal(simulation.observe().joint.effort, within)


def test_applied_effort_accelerates_the_arm_as_the_mass_matrix_says():
    simulation = scene(grip__force=50.0)
    hold, extra = simulation.observe().joint.effort, np.array([1.0, -2.0, 0.5, 1.0, -0.3, 0.2, 0.1])
    simulation.step(hold + extra)
    unit = simulation.holding_effort(simulation.observe().joint.position, 0.0, -1.0)  # bias + M qd
    idle = simulation.holding_effort(simulation.observe().joint.position, 0.0, 0.0)
    np.testing.assert_allclose(unit - idle, 1e-3 * extra, rtol=0, atol=1e-5)  # M qd = dt extra


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("joint", [0, 6])
def test_effort_that_is_not_finite_is_refused_and_the_arm_holds(bad, joint):
    simulation = scene()
    start = simulation.observe().joint.position
    effort = simulation.observe().joint.effort.copy()
    effort[joint] = bad
    for _ in range(20):
        simulation.step(effort)
        assert simulation.holding
    assert np.isfinite(state_of(simulation)).all()
    np.testing.assert_allclose(simulation.observe().joint.position, start, rtol=0, atol=STILL)
    simulation.step(np.zeros(7))
    assert not simulation.holding


@pytest.mark.parametrize("size", [0, 6, 8])
def test_effort_of_the_wrong_size_is_an_error_and_nothing_moves(size):
    simulation = scene()
    before, stamp = state_of(simulation), simulation.stamp_ns
    with pytest.raises(InputError, match="one per joint"):
        simulation.step(np.zeros(size))
    assert simulation.stamp_ns == stamp
    assert np.array_equal(state_of(simulation), before)


def test_clock_counts_whole_nanoseconds():
    simulation = scene(control_period_s=0.0007)
    for k in range(1, 4):
        simulation.step(None)
        assert simulation.stamp_ns == k * 700_000
        assert simulation.observe().joint.stamp_ns == simulation.observe().slip.stamp_ns == simulation.stamp_ns
        assert simulation.observe().wrench.stamp_ns == simulation.observe().slip.stamp_ns == simulation.stamp_ns


@pytest.mark.parametrize("model", ["stribeck", "coulomb", "lugre"])
def test_reset_brings_everything_back_but_time(model):
    simulation = scene(friction__model=model)
    start = state_of(simulation)
    first = [state_of(simulation) for _ in Shaker(simulation, 2).run(300)]
    assert np.abs(simulation.observe().truth.slip_displacement).max() > 1e-3
    simulation.set_grip_force(3.0)
    simulation.step(np.full(7, np.nan))
    stamp = simulation.stamp_ns
    simulation.reset()
    assert simulation.stamp_ns > stamp
    assert simulation.grip_force == simulation.params.grip.force
    assert simulation.holding
    assert np.array_equal(state_of(simulation), start)
    again = [state_of(simulation) for _ in Shaker(simulation, 2).run(300)]
    # The shaker's time starts from another stamp, so its efforts differ in the last bits.
    np.testing.assert_allclose(np.array(again), np.array(first), rtol=1e-6, atol=1e-6)


def test_grip_force_is_an_input():
    simulation = scene(grip__force=50.0)
    shaker = Shaker(simulation, 4)
    list(shaker.run(200))
    assert np.abs(simulation.observe().truth.slip_displacement).max() < STILL
    simulation.set_grip_force(0.05)
    list(shaker.run(100))
    assert np.abs(simulation.observe().truth.slip_displacement).max() > 1e-3


def test_divergence_is_an_error_until_reset():
    simulation = scene()
    good = simulation.stamp_ns
    simulation.plant.data.qvel[0] = np.nan
    with pytest.raises(DivergenceError, match="diverged") as caught:
        simulation.step(None)
    assert isinstance(caught.value, SlipVicError)
    with pytest.raises(DivergenceError):
        simulation.step(None)
    assert simulation.stamp_ns == good
    simulation.reset()
    simulation.step(None)
    assert np.isfinite(state_of(simulation)).all()


def test_divergence_writes_nothing_into_the_working_folder(tmp_path, monkeypatch, capfd):
    """MuJoCo's default would be MUJOCO_LOG.TXT and lines on stderr."""
    monkeypatch.chdir(tmp_path)
    simulation = scene()
    simulation.plant.data.qvel[0] = np.nan
    with pytest.raises(DivergenceError):
        simulation.step(None)
    assert list(tmp_path.iterdir()) == []
    assert capfd.readouterr() == ("", "")


def test_stick_is_exact_at_a_joint_stop():
    """Without regard to the stop's force the object would slip 2 mm, although the grip could hold it three times."""
    used, touched = 0.0, 0
    for simulation in driven_into_the_stop(200.0):
        used = max(used, np.linalg.norm(simulation.observe().wrench.wrench[[0, 1, 5]] / [1.0, 1.0, 0.03]))
        touched += 1
    assert touched > 100
    assert 20.0 < used < 0.5 * 200.0
    assert np.abs(simulation.observe().truth.slip_displacement).max() < STILL
