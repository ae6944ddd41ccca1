"""The rigid grasp of one arm: the object on relative joints, friction by implicit projection on the limit surface.

Between the two halves of a MuJoCo step the friction law is solved on the contact twist of the object relative to the
pad, and its force is applied on the relative joints; `rigid_step` has the formulas.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import cast

import mujoco
import numpy as np

from slip_core.arrays import Array, matrix_from_quat_xyzw
from slip_core.errors import InputError
from slip_core.files.urdf import on_base
from slip_core.records import new, record
from slip_sim_bridge.friction import LAWS, friction_law
from slip_sim_bridge.friction.params import FrictionParams
from slip_sim_bridge.params import BridgeParams
from slip_sim_bridge.plant import DivergenceError, read_out
from slip_sim_bridge.plant.joint_step import JOINT_DRIVE_SIZE
from slip_sim_bridge.plant.model import (
    OBJECT,
    PAD,
    add_pad,
    arm_spec,
    check_divergence,
    compile_spec,
    give_inertia,
    sensor_address,
    tree_of,
)
from slip_sim_bridge.plant.rigid_step import RIGID_CONTACT, RigidContact, read_rigid, rigid_step

SLIP_JOINTS = ("grasp_slip_x", "grasp_slip_y", "grasp_slip_rz")
STOP_PASSES = 20
STOP_AGREEMENT = 1e-10  # N, N m
NO_DRIVES = np.zeros((0, JOINT_DRIVE_SIZE))


def build_model(params: BridgeParams, urdf_text: str) -> mujoco.MjModel:
    """Compile arm, object and sensors for the implicit friction law; joint friction of the URDF is left out.

    The object hangs on the pad centre by slide x, slide y, hinge z of the frame `ee`.

    Raises:
        InputError: where the URDF does not parse or lacks the frame or a joint.

    Relative coordinates make stick exact.
    """
    spec = arm_spec(params, on_base(urdf_text, params.base))
    spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    pad = add_pad(spec, params.ee_frame)
    grasped = pad.add_body(name=OBJECT)
    at, turned = params.contacts.position[:3], params.contacts.orientation_xyzw[:4]
    give_inertia(grasped, params.object, matrix_from_quat_xyzw(turned), np.array(at))
    slide, hinge = mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE
    for name, kind, axis in zip(SLIP_JOINTS, (slide, slide, hinge), np.eye(3), strict=True):
        grasped.add_joint(name=name, type=kind, axis=axis)
    return compile_spec(spec)


def compile_laws() -> None:
    """Compile the grasp step of every friction law, so that no run waits for it."""
    for name in sorted({*LAWS.values()}):
        law, _ = friction_law(FrictionParams.model_validate({"model": name}))
        rigid_step(law)


class RigidPlant:
    """One arm and its grasp with limit-surface friction.

    Raises:
        InputError: several arms; parameters and URDF that do not fit.
    """

    def __init__(self, arms: Mapping[str, BridgeParams], urdfs: Mapping[str, str]) -> None:
        if len(arms) != 1:
            raise InputError(
                "parameter plant", got=f"rigid with {len(arms)} arms", expected="elastic: several rigid pads on one "
                "object leave the internal forces undetermined",
            )  # fmt: skip
        (params,), (urdf_text,) = arms.values(), urdfs.values()
        self.model = model = build_model(params, urdf_text)
        self.data = data = mujoco.MjData(model)
        self._initial = np.array(params.initial_position)
        self._p_R_o = np.ascontiguousarray(matrix_from_quat_xyzw(params.contacts.orientation_xyzw[:4]).T)
        law, self._law = friction_law(params.friction)
        self._step = rigid_step(law)
        self._pad = new(RIGID_CONTACT)
        contact: RigidContact = record(self._pad, RIGID_CONTACT)
        contact.period = self._period = params.control_period_s
        contact.torsional_radius = params.friction.torsional_radius
        self._state, self._next_state = contact.state, contact.next_state
        self._fixed_substeps = params.substeps

        n = self._n = len(params.joint_names)
        body, pad, sensors = model.body(OBJECT).id, model.body(PAD).id, sensor_address(model)

        # Views into MuJoCo's memory: valid as long as `data` lives, always the current numbers.
        self._qpos: Array = data.qpos
        self._slid: Array = data.qpos[n : n + 2]
        self._qvel: Array = data.qvel
        self._applied: Array = data.qfrc_applied
        self._bias: Array = data.qfrc_bias
        self._factor: Array = data.qLD
        self._inverse_diagonal: Array = data.qLDiagInv
        self._readings: Array = data.sensordata[sensors]
        self._object_position: Array = data.xipos[body]
        self._object_rotation: Array = data.xmat[body].reshape(3, 3)
        self._object_spatial: Array = data.cvel[body]
        self._pad_position: Array = data.xpos[pad]
        self._pad_rotation: Array = data.xmat[pad].reshape(3, 3)
        self._root: Array = data.subtree_com[model.body_rootid[body]]
        self._option = model.opt

        self._tree = tree_of(model)
        self._size = read_out(n).itemsize // 8
        self._no_stops = np.zeros(model.nv)
        self._body, self._push, self._pushed = body, np.zeros(6), False
        self._outside = self._no_stops
        self._substeps = 1
        self._drives: Array | None = None
        self._mass_matrix = np.zeros((model.nv, model.nv))
        self.reset(np.array([params.grip.force]))

    def gripped_at(self, _arm: int) -> tuple[float, float]:
        """Return where the point of the object that was gripped is on the pad, along x and y of {ee} [m]."""
        return cast(tuple[float, float], self._slid.tolist())

    def reset(self, normal_forces: Array) -> None:
        """Put everything back to the initial posture, held and at rest; (1,) [N].

        The first wrench is that of the held arm.
        """
        model, data = self.model, self.data
        mujoco.mj_resetData(model, data)
        self._qpos[: self._n] = self._initial
        self._state[:] = 0.0
        self._drives = None
        self._split(1)
        mujoco.mj_step1(model, data)
        self._friction_step(self.holding_effort(0, self._initial, 0.0, 0.0), float(normal_forces[0]), 1)
        mujoco.mj_forward(model, data)
        self._state[:] = 0.0

    def advance(self, efforts: Array, normal_forces: Array, drives: Array | None = None) -> None:
        """Advance one control period under constant efforts; (n,) [N m], force of the pads (1,) [N].

        drives: a JOINT_DRIVE per joint, whose torque and effort are written; None: nothing else acts on the joints.

        Raises:
            DivergenceError: where the state stopped being physical.

        mj_step1 of the next step runs at the end, so that all state belongs to the new stamp.
        """
        model, data, normal_force = self.model, self.data, float(normal_forces[0])
        self._drives = drives
        substeps = self._friction_step(efforts, normal_force, self._fixed_substeps)
        if substeps != self._substeps:
            self._split(substeps)
        mujoco.mj_step2(model, data)
        mujoco.mj_step1(model, data)
        for _ in range(1, substeps):
            self._friction_step(efforts, normal_force, substeps)
            mujoco.mj_step2(model, data)
            mujoco.mj_step1(model, data)
        check_divergence(self.data)

    def push(self, wrenches: Array) -> None:
        """Let a hand push the object where it is gripped from now on; (1, 6) [N, N m] {w}."""
        self._push, self._pushed = wrenches[0], bool(wrenches.any())
        self._outside = self._no_stops
        self.data.xfrc_applied[self._body] = 0.0

    def holding_effort(self, _arm: int, target: Array, stiffness: float, damping: float) -> Array:
        """Return bias + M (stiffness (target - q) - damping qd) of the loaded arm; (n,) -> (n,) [N m]."""
        n = self._n
        mujoco.mj_fullM(self.model, self.data, self._mass_matrix)
        pull = stiffness * (target - self._qpos[:n]) - damping * self._qvel[:n]
        return self._bias[:n] + self._mass_matrix[:n, :n] @ pull

    def read(self, _arm: int) -> Array:
        """Return everything that can be read, as a fresh array laid out by `read_out`; (2 n + 54,)."""
        out = np.zeros(self._size)
        read_rigid(
            self._qpos, self._qvel, self._readings, self._object_position, self._object_rotation,
            self._object_spatial, self._root, self._p_R_o, self._pad_position, self._pad_rotation, out,
        )  # fmt: skip
        return out

    def _split(self, substeps: int) -> None:
        """Make MuJoCo's step the period divided by this number."""
        self._substeps = substeps
        self._option.timestep = self._period / substeps

    def _friction_step(self, effort: Array, normal_force: float, substeps: int) -> int:
        """Put effort and the friction of the coming step on the joints; return into how many the period is split."""
        if self._pushed:
            self._lean()
        if self._drives is None and not self.data.nefc:
            return self._solve(effort, normal_force, substeps, self._outside, 1)
        return self._agree(effort, normal_force, substeps)

    def _lean(self) -> None:
        """Put the hand's wrench on the object, and on the joints for the friction law, which looks ahead of MuJoCo."""
        data, body, force, torque = self.data, self._body, self._push[:3], self._push[3:]
        data.xfrc_applied[body, :3] = force  # at the centre of mass; the hand's is at the origin of the body
        data.xfrc_applied[body, 3:] = torque + np.cross(data.xpos[body] - data.xipos[body], force)
        self._outside = np.zeros(self.model.nv)
        mujoco.mj_applyFT(self.model, data, force, torque, data.xpos[body], body, self._outside)

    def _solve(
        self, effort: Array, normal_force: float, substeps: int, stops: Array, keep: int, drives: Array = NO_DRIVES
    ) -> int:
        return self._step(
            self._factor, self._inverse_diagonal, self._tree, self._qpos, self._qvel, self._bias, stops,
            effort, self._law, self._pad, normal_force, substeps, keep, drives, self._applied,
        )  # fmt: skip

    def _agree(self, effort: Array, normal_force: float, substeps: int) -> int:
        """Find friction of the grasp, torques of the drives and forces of joint stops that fit; the grasp is last."""
        data, drives = self.data, NO_DRIVES if self._drives is None else self._drives
        substeps = self._solve(effort, normal_force, substeps, self._outside, 0)
        stops = np.zeros(self.model.nv)
        for _ in range(STOP_PASSES):
            if not self._solve(effort, normal_force, substeps, stops + self._outside, 0, drives):
                raise DivergenceError("simulation diverged: the torques of the drives are not finite; reset it")
            if not data.nefc:
                break
            mujoco.mj_fwdAcceleration(self.model, data)
            mujoco.mj_fwdConstraint(self.model, data)
            change = np.abs(data.qfrc_constraint - stops).max()
            stops = data.qfrc_constraint.copy()
            if change < STOP_AGREEMENT:
                break
        self._state[:] = self._next_state
        return substeps
