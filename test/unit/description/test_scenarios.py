"""Scenarios: complete, accepted by both nodes' parameters, held at rest, and far from what the arm cannot do."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from slip_core.errors import InputError
from slip_description import urdf_text
from slip_vic.presets import preset_text
from slip_vic.scenarios import scenario_names
from slip_vic.scenarios.scenario import load
from test.unit.bridge.one_arm import OneArm

NAMES = ["glass_transport", "paper_planar", "vertical_plane"]
# What the files say of their paths: distance to joint limits [rad], smallest singular value of J.
ROUNDING = 1e-7  # initial positions are written with 9 decimals
HOLDS_AT_REST = 0.9  # of the break-away force


def test_names_and_unknown_name():
    assert scenario_names(1) == NAMES
    with pytest.raises(InputError, match="did you mean paper_planar"):
        preset_text("scenarios", "paper_planer")
    with pytest.raises(InputError, match="unknown scenario"):
        preset_text("scenarios", "../urdf/arm")


@pytest.mark.parametrize(("name", "normal_world"), [(n, (1, 0, 0) if "vert" in n else (0, 0, 1)) for n in NAMES])
def test_object_starts_on_world_axes_with_the_pads_normal_as_described(name, normal_world):
    params = load(name, law="vic").first
    truth = OneArm(params, urdf_text()).observe().truth
    np.testing.assert_allclose(truth.object_rotation, np.eye(3), rtol=0, atol=ROUNDING)
    o_R_p = Rotation.from_quat(params.contacts.orientation_xyzw[:4]).as_matrix()
    np.testing.assert_allclose(truth.object_rotation @ o_R_p[:, 2], normal_world, rtol=0, atol=ROUNDING)


@pytest.mark.parametrize("name", NAMES)
def test_grip_holds_at_rest(name):
    simulation = OneArm(load(name, law="vic").first, urdf_text())
    friction, grip = simulation.params.friction, simulation.params.grip.force
    h = simulation.observe().wrench.wrench[[0, 1, 5]] / [1.0, 1.0, friction.torsional_radius]
    share = np.linalg.norm(h) / (friction.mu_s * grip)
    assert share < HOLDS_AT_REST
    if name == "vertical_plane":
        assert share == pytest.approx(0.85, abs=0.01)
        assert np.linalg.norm(h) < friction.mu_k * grip


def test_governed_arms_that_share_an_object_are_stiff_enough() -> None:
    of_laws = (load("pane_two_arms_flat", law=law).controllers for law in ("vic", "governed"))
    soft, stiff = (controllers["left"].gains for controllers in of_laws)
    assert soft.stiffness == (5.0, 5.0, 400.0, 450.0, 450.0, 4.5)
    assert stiff.stiffness == (20.0, 20.0, 400.0, 450.0, 450.0, 18.0)
    ratios = [np.divide(gains.damping, np.sqrt(gains.stiffness)) for gains in (soft, stiff)]
    np.testing.assert_allclose(*ratios, rtol=1e-12)
    assert load("paper_planar", law="governed").controller.gains.stiffness[0] == 5.0
