"""A hand that leans on the simulated arm: felt by the wrench sensor, opposed by friction; zeros change nothing."""

from __future__ import annotations

import numpy as np
import pytest

from slip_sim_bridge.params import HOLD_STIFFNESS, BridgeParams
from test.unit.bridge.scenes import scene

FORCE = np.array([2.0, -1.0, 0.5])
SETTLED = 600
NONE = np.zeros(0)
STILL = np.zeros(6)
TURN = 0.02


def test_a_push_on_a_held_object_is_what_the_wrench_changes_by() -> None:
    simulation = scene("paper_planar", grip__force=40.0)
    before = _wrench_in_world(simulation)
    simulation.push(np.concatenate((FORCE, np.zeros(3))), NONE)
    change = _wrench_in_world(simulation)[:3] - before[:3]
    np.testing.assert_allclose(change, FORCE, atol=0.03 * np.linalg.norm(FORCE))  # the arm gives way, and tilts
    simulation.push(STILL, NONE)
    np.testing.assert_allclose(_wrench_in_world(simulation)[:3], before[:3], atol=0.02)


def test_what_friction_cannot_hold_moves_with_the_push() -> None:
    simulation = scene("paper_planar", grip__force=2.0)
    simulation.push(np.array([1.5, 0.0, 0.0, 0.0, 0.0, 0.0]), NONE)
    start = simulation.observe().truth.object_position
    for _ in range(200):
        simulation.step(None)
    moved = simulation.observe().truth.object_position - start
    # m a = F - mu_k N, with mu_k N between 0.8 and 1 N while it begins to slide
    assert 0.5 * (1.5 - 1.0) / 0.5 * 0.2**2 < moved[0] < 0.5 * (1.5 - 0.8) / 0.5 * 0.2**2 + 0.01
    assert abs(moved[1]) < 1e-3


def test_a_push_on_a_joint_moves_it_as_the_hold_allows() -> None:
    simulation = scene("paper_planar", grip__force=40.0)
    start = simulation.observe().joint.position
    at_rest = simulation.holding_effort(start, 0.0, 0.0)
    target = start.copy()
    target[3] += TURN
    simulation.push(STILL, simulation.holding_effort(target, HOLD_STIFFNESS, 0.0) - at_rest)
    for _ in range(SETTLED):
        simulation.step(None)
    moved = simulation.observe().joint.position - start
    assert int(np.abs(moved).argmax()) == 3
    assert moved[3] == pytest.approx(TURN, rel=0.1)


def test_no_push_changes_no_bit() -> None:
    pushed, plain = scene("vertical_plane"), scene("vertical_plane")
    pushed.push(np.ones(6), np.ones(7))
    pushed.push(STILL, np.zeros(7))
    for _ in range(50):
        pushed.step(None)
        plain.step(None)
    assert pushed.observe().truth.tobytes() == plain.observe().truth.tobytes()


def test_a_push_on_other_joints_is_refused() -> None:
    with pytest.raises(ValueError, match=r"push\.effort: 3 numbers for 7 joints"):
        BridgeParams.model_validate({"push": {"effort": (1.0, 0.0, 0.0)}})


def _wrench_in_world(simulation) -> np.ndarray:
    """Let it come to rest; return force and torque with the pad's attitude, known from the object's, taken out."""
    for _ in range(SETTLED):
        simulation.step(None)
    readings = simulation.observe()
    grasp = readings.truth.object_rotation @ _GRASPED
    wrench = readings.wrench.wrench
    return np.concatenate((grasp @ wrench[:3], grasp @ wrench[3:]))


_GRASPED = np.diag([-1.0, -1.0, 1.0])  # half a turn about the pads' normal, as paper_planar has it
