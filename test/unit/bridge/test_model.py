"""Options of the model, and one clear line for every URDF or parameter that cannot be simulated."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from slip_core.errors import InputError
from slip_core.params import build
from slip_description import urdf_text
from slip_sim_bridge.params import BridgeParams
from slip_sim_bridge.plant.rigid import build_model
from test.unit.bridge.one_arm import OneArm

JOINTS = [f"arm_joint{i}" for i in range(1, 8)]


def fails(urdf=None, **values) -> str:
    with pytest.raises(InputError) as caught:
        OneArm(build(BridgeParams, values, "test"), urdf or urdf_text())
    line = str(caught.value)
    assert "\n" not in line
    assert caught.value.exit_code == 2
    return line


def test_model_options_avoid_the_engines_traps():
    model = build_model(BridgeParams(), urdf_text())
    assert model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    assert model.opt.jacobian == mujoco.mjtJacobian.mjJAC_DENSE
    assert model.opt.integrator == mujoco.mjtIntegrator.mjINT_EULER
    assert not np.any(model.dof_damping)
    assert model.body("finger_left").mass[0] > 0.0  # fixed links keep their mass


def test_joint_friction_of_a_urdf_is_left_out():
    rough = urdf_text().replace('damping="0" friction="0"', 'damping="3" friction="2"')
    assert rough != urdf_text()
    model = build_model(BridgeParams(), rough)
    assert not np.any(model.dof_damping)
    assert not np.any(model.dof_frictionloss)


def test_collision_shapes_of_a_urdf_do_not_touch():
    shape = '<collision><geometry><sphere radius="0.5"/></geometry></collision></link>'
    model = build_model(BridgeParams(), urdf_text().replace("</link>", shape))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert np.count_nonzero(model.geom_contype) > 5
    assert data.ncon == 0


def test_a_urdf_without_the_mujoco_extension_keeps_fixed_links():
    plain = urdf_text().replace('<compiler fusestatic="false" discardvisual="false"/>', "")
    ours, theirs = (build_model(BridgeParams(), text) for text in (urdf_text(), plain))
    assert theirs.nbody == ours.nbody
    assert theirs.body_mass.sum() == pytest.approx(ours.body_mass.sum())


@pytest.mark.parametrize(
    ("text", "word"),
    [("", "URDF"), ("not xml", "URDF"), ("<robot name='x'>", "URDF"), ("<robot name='x'/>", "")],
)
def test_no_urdf(text, word):
    with pytest.raises(InputError) as caught:
        build_model(BridgeParams(), text)
    assert "\n" not in str(caught.value)
    assert word in str(caught.value)


def test_unknown_frame_offers_the_nearest():
    assert "flange" in fails(ee_frame="flang")


def test_unknown_joint_offers_the_nearest():
    line = fails(joint_names=[*JOINTS[:-1], "arm_joint77"])
    assert "arm_joint77" in line
    assert "arm_joint7" in line.split("expected")[1]


def test_joints_in_another_order():
    swapped = [JOINTS[1], JOINTS[0], *JOINTS[2:]]
    assert "from base to tip" in fails(joint_names=swapped)


def test_joints_left_out():
    line = fails(joint_names=JOINTS[:6], initial_position=[0.0] * 6)
    assert "arm_joint7" in line


def test_unphysical_link():
    wrong = urdf_text().replace('mass value="4.970684"', 'mass value="-4.970684"')
    assert wrong != urdf_text()
    fails(urdf=wrong)


@pytest.mark.parametrize(
    ("name", "value", "word"),
    [
        ("object.mass", 0.0, "object.mass"),
        ("object.inertia", (1e-3, 1e-3, 1e-2, 0.0, 0.0, 0.0), "inertia"),
        ("object.inertia", (1e-3, 1e-3), "object.inertia"),
        ("contacts.position", (0.0, 0.0), "contacts"),
        ("contacts.orientation_xyzw", (0.0, 0.0, 0.0, 2.0), "orientation_xyzw"),
        ("contacts.slip_axes", (True,) * 5, "slip_axes"),
        ("initial_position", (0.0,) * 6, "initial_position"),
        ("joint_names", ("a",) * 7, "joint_names"),
        ("control_period_s", 0.0, "control_period_s"),
        ("control_period_s", 1.5e-9, "control_period_s"),
        ("friction.mu_s", 0.1, "mu_s"),
        ("grip.force", -1.0, "grip.force"),
        ("grip.force", float("nan"), "grip.force"),
        ("plant", "none", "plant"),
        ("substeps", 1000, "substeps"),
        ("grip.strength", 1.0, "grip.force"),
    ],
)
def test_bad_parameter(name, value, word):
    assert word in fails(**{name: value})
