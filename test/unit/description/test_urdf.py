"""The arm's URDF: published kinematics and limits, physical links, frames of the grasp, sources named."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np
import pinocchio as pin
import pytest

from slip_description import urdf_text

EXACT = 1e-12
# Modified Denavit-Hartenberg rows of the arm: a [m], d [m], alpha [rad] before the joint; then the flange.
DH = [
    (0.0, 0.333, 0.0),
    (0.0, 0.0, -np.pi / 2),
    (0.0, 0.316, np.pi / 2),
    (0.0825, 0.0, np.pi / 2),
    (-0.0825, 0.384, -np.pi / 2),
    (0.0, 0.0, np.pi / 2),
    (0.088, 0.0, np.pi / 2),
]
FLANGE, PADS = 0.107, 0.20


def dh_flange(q):
    """Pose (4, 4) of the flange by the modified Denavit-Hartenberg rule Rx(alpha) Tx(a) Rz(q) Tz(d)."""
    T = np.eye(4)
    for (a, d, alpha), angle in zip(DH, q, strict=True):
        ca, sa, c, s = np.cos(alpha), np.sin(alpha), np.cos(angle), np.sin(angle)
        T = T @ np.array([[c, -s, 0, a], [s * ca, c * ca, -sa, -d * sa], [s * sa, c * sa, ca, d * ca], [0, 0, 0, 1]])
    T[:3, 3] += FLANGE * T[:3, 2]
    return T


@pytest.fixture(scope="module")
def model():
    return pin.buildModelFromXML(urdf_text())


@pytest.mark.parametrize("seed", [1])
def test_kinematics_are_the_published_dh_parameters(model, seed):
    data, rng = model.createData(), np.random.default_rng(seed)
    for _ in range(50):
        q = rng.uniform(model.lowerPositionLimit, model.upperPositionLimit)
        pin.framesForwardKinematics(model, data, q)
        flange = dh_flange(q)
        np.testing.assert_allclose(data.oMf[model.getFrameId("flange")].homogeneous, flange, rtol=0, atol=EXACT)
        ee = data.oMf[model.getFrameId("ee")]
        np.testing.assert_allclose(ee.rotation[:, 0], flange[:3, 2], rtol=0, atol=EXACT)  # x approaches
        np.testing.assert_allclose(ee.rotation[:, 2], flange[:3, 1], rtol=0, atol=EXACT)  # z closes
        np.testing.assert_allclose(ee.translation, flange[:3, 3] + PADS * flange[:3, 2], rtol=0, atol=EXACT)


def test_fingers_close_along_z_of_ee_and_hold_its_centre(model):
    data = model.createData()
    pin.framesForwardKinematics(model, data, pin.neutral(model))
    ee, left, right = (data.oMf[model.getFrameId(name)] for name in ("ee", "finger_left", "finger_right"))
    apart = ee.actInv(left).translation - ee.actInv(right).translation
    assert abs(apart[2]) > 0.02
    np.testing.assert_allclose(apart[:2], 0.0, atol=EXACT)
    middle = (ee.actInv(left).translation + ee.actInv(right).translation) / 2
    np.testing.assert_allclose(middle[1:], 0.0, atol=EXACT)


def test_limits_are_the_published_ones(model):
    np.testing.assert_allclose(model.upperEffortLimit, [87.0] * 4 + [12.0] * 3)
    np.testing.assert_allclose(model.upperVelocityLimit, [2.175] * 4 + [2.61] * 3)
    np.testing.assert_allclose(
        model.lowerPositionLimit, [-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973]
    )
    np.testing.assert_allclose(model.upperPositionLimit, [2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973])


def test_every_link_is_a_physical_body():
    checked = 0
    for link in ET.fromstring(urdf_text()).iter("link"):
        inertial = link.find("inertial")
        if inertial is None:
            continue
        assert float(inertial.find("mass").get("value")) > 0.0
        n = {key: float(value) for key, value in inertial.find("inertia").attrib.items()}
        J = np.array([[n["ixx"], n["ixy"], n["ixz"]], [n["ixy"], n["iyy"], n["iyz"]], [n["ixz"], n["iyz"], n["izz"]]])
        principal = np.linalg.eigvalsh(J)
        assert principal[0] > 0.0, link.get("name")
        assert principal[0] + principal[1] >= principal[2], link.get("name")
        assert inertial.find("origin").get("rpy") == "0 0 0"
        checked += 1
    assert checked == 11


def test_joints_have_no_friction_and_names_in_order():
    joints = [j for j in ET.fromstring(urdf_text()).iter("joint") if j.get("type") == "revolute"]
    assert [joint.get("name") for joint in joints] == [f"arm_joint{i}" for i in range(1, 8)]
    for joint in joints:
        assert float(joint.find("dynamics").get("damping")) == 0.0
        assert float(joint.find("dynamics").get("friction")) == 0.0
