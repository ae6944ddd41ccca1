"""Options of the model, and one clear line for every URDF or parameter that cannot be simulated."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from slip_description import urdf_text
from slip_sim_bridge.params import BridgeParams
from slip_sim_bridge.plant.rigid import build_model


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


def test_a_urdf_without_the_mujoco_extension_keeps_fixed_links():
    plain = urdf_text().replace('<compiler fusestatic="false" discardvisual="false"/>', "")
    ours, theirs = (build_model(BridgeParams(), text) for text in (urdf_text(), plain))
    assert theirs.nbody == ours.nbody
    assert theirs.body_mass.sum() == pytest.approx(ours.body_mass.sum())
