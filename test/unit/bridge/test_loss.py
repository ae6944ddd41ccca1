"""What is not held falls: over the pad's edge, or without grip; a free rigid body, and sensors that touch nothing."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from slip_core.errors import InputError
from slip_core.records import record
from slip_description import urdf_text
from slip_sim_bridge.plant import read_out
from slip_sim_bridge.plant.loose import LoosePlant
from slip_sim_bridge.session import BridgeSession
from test.unit.bridge.scenes import Shaker, scenario_params, scene

SCENARIOS = ("paper_planar", "vertical_plane", "glass_transport")
FALL_TICKS = 500
FIRST_ORDER = 2e-3
"""MuJoCo's semi-implicit step of 1 ms: relative error of half a second of free motion."""
ROUNDING = 1e-9


@pytest.mark.parametrize("name", SCENARIOS)
def test_without_grip_the_object_falls_in_every_scenario(name: str) -> None:
    simulation = scene(name)
    before = simulation.observe().truth
    simulation.set_grip_force(0.0)
    for _ in range(FALL_TICKS):
        simulation.step(None)
    readings, fallen_s = simulation.observe(), 1e-3 * FALL_TICKS
    fall = before.object_position - readings.truth.object_position
    np.testing.assert_allclose(fall, [0.0, 0.0, 0.5 * 9.81 * fallen_s**2], rtol=3 * FIRST_ORDER, atol=1e-6)
    assert simulation.loss is not None
    assert simulation.loss == (0, "the object is lost: the grip is zero")
    assert not readings.wrench.wrench.any()
    assert not readings.slip.twist.any()
    assert not readings.truth.slip_displacement.any()


@pytest.mark.parametrize("plant", ["rigid", "elastic"])
def test_over_the_edge_it_is_lost_and_before_it_is_not(plant: str) -> None:
    """A grip that is much too weak; the edge is one of the pad, wherever the object turns."""
    simulation = scene("vertical_plane", grip__force=2.0, grip__pad_size=(0.01, 0.03), plant=plant)
    hold, x, y = Shaker(simulation, 2, 0.0), 0.0, 0.0
    while simulation.loss is None:
        x, y = simulation._held.gripped_at(0)
        simulation.step(hold.effort())
        assert simulation.stamp_ns < 1_000_000_000
    assert abs(x) > 0.005 or abs(y) > 0.015
    assert "over the pad's edge" in simulation.loss[1]
    left = simulation.observe().truth
    for _ in range(100):
        simulation.step(None)
    np.testing.assert_array_equal(simulation.observe().truth.slip_displacement, left.slip_displacement)
    assert np.abs(simulation.observe().joint.velocity).max() < 0.1, "the empty arm is held"


def test_a_lost_object_keeps_its_momentum_and_turns_as_a_free_body_does() -> None:
    simulation = scene(grip__force=50.0, object__inertia=(1e-3, 2e-3, 2.5e-3, 0.0, 0.0, 0.0))
    list(Shaker(simulation, 4).run(300))
    J = np.diag(simulation.params.object.inertia[:3])
    simulation.set_grip_force(0.0)
    simulation.step(None)
    first = simulation.observe().truth
    for _ in range(FALL_TICKS):
        simulation.step(None)
    last, passed_s = simulation.observe().truth, 1e-3 * FALL_TICKS

    def momentum(truth):
        return truth.object_rotation @ J @ truth.object_rotation.T @ truth.object_twist[3:]

    assert np.linalg.norm(first.object_twist[3:]) > 0.1
    np.testing.assert_allclose(last.object_twist[:3], first.object_twist[:3] - [0.0, 0.0, 9.81 * passed_s], atol=1e-6)
    moved = first.object_twist[:3] * passed_s - np.array([0.0, 0.0, 0.5 * 9.81 * passed_s**2])
    np.testing.assert_allclose(last.object_position - first.object_position, moved, atol=5e-3)
    np.testing.assert_allclose(momentum(last), momentum(first), rtol=0, atol=0.02 * np.linalg.norm(momentum(first)))


def test_taking_over_changes_nothing_but_the_contact() -> None:
    simulation = scene("vertical_plane")
    list(Shaker(simulation, 3).run(200))
    numbers, loose = simulation.plant.read(0), LoosePlant({"": simulation.params}, {"": urdf_text()})
    loose.take_over([numbers])
    held, taken = record(numbers, read_out(7)), record(loose.read(0), read_out(7))
    for part in ("position", "velocity", "object_position", "object_rotation", "object_twist"):
        np.testing.assert_allclose(taken[part], held[part], atol=ROUNDING)
    np.testing.assert_array_equal(taken.slip_displacement, held.slip_displacement)
    assert not taken.wrench.any()
    assert not taken.slip_velocity.any()
    model = pin.buildModelFromXML(urdf_text())
    alone = pin.nonLinearEffects(model, model.createData(), held.position, held.velocity)
    np.testing.assert_allclose(loose.holding_effort(0, held.position, 0.0, 0.0), alone, atol=1e-8)


def test_the_session_tells_when_in_the_time_of_the_run() -> None:
    session = BridgeSession({"": scenario_params()}, {"": urdf_text()})
    session.start_at(5_000_000_000)
    session.advance([None])
    assert session.lost is None
    session.simulation.set_grip_force(0, 0.0)
    session.advance([None])
    assert session.lost is not None
    assert str(session.lost) == "LOST at 0.001 s: the object is lost: the grip is zero"


@pytest.mark.parametrize("size", [(), (0.02,), (0.02, -0.02), (0.02, 0.02, 0.02)])
def test_a_pad_without_a_size_is_refused(size: tuple[float, ...]) -> None:
    with pytest.raises(InputError, match="pad_size"):
        scenario_params(grip__pad_size=size)
