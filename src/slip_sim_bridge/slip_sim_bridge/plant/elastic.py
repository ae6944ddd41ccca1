"""N arms and one free object in one MuJoCo model; `elastic_step` closes the loops through elastic pads.

The object has a free joint of its own. Nothing welds it to a gripper: the wrenches of the pads act on it and, opposite
and at the same points, on the grippers, so momentum is exchanged and never made. Each grasp is made where its pad
stands at the start; the pads begin with the deflection under which they carry the object's weight at rest.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import mujoco
import numpy as np

from slip_core.arrays import Array, matrix_from_quat_xyzw
from slip_core.compiled import interpreted
from slip_core.errors import InputError
from slip_core.records import POSE, Pose, Records, record, records
from slip_sim_bridge.friction import friction_law
from slip_sim_bridge.friction.limit_surface import ROOT_MARGIN
from slip_sim_bridge.params import BridgeParams
from slip_sim_bridge.plant import DivergenceError
from slip_sim_bridge.plant.elastic_step import ELASTIC_CONTACT, ElasticContact, elastic_after, elastic_step
from slip_sim_bridge.plant.joint_step import AGREEMENT, DRIVE_PASSES, TORQUE, joint_step
from slip_sim_bridge.plant.loose import LoosePlant
from slip_sim_bridge.plant.model import check_divergence

LONGEST_STEP = 0.3
"""Largest step as a share of 1 / omega of the stiffest motion of object and pads; the spring is stable below 2."""


class ElasticPlant(LoosePlant):
    """All arms, all grasps and the object.

    Raises:
        InputError: friction models that differ, pads that are damped less than friction falls with speed, a URDF that
            does not fit.
    """

    def __init__(self, arms: Mapping[str, BridgeParams], urdfs: Mapping[str, str]) -> None:
        super().__init__(arms, urdfs)
        self._params = each = tuple(arms.values())
        model, data = self.model, self.data
        self._initial = np.concatenate([arm.initial_position for arm in each])

        law, _ = friction_law(each[0].friction)
        if {arm.friction.model for arm in each} != {each[0].friction.model}:
            raise InputError(
                "parameter friction.model", got=[arm.friction.model for arm in each],
                expected="one model for all pads; its numbers may differ",
            )  # fmt: skip
        self._laws = np.array([friction_law(arm.friction)[1] for arm in each])
        self._step = elastic_step(law)
        count, nv = len(each), model.nv
        self._state, self._frames = (
            np.zeros((count, ELASTIC_CONTACT.itemsize // 8)),
            np.zeros((count + 1, POSE.itemsize // 8)),
        )
        self._rows, self._jacobians = np.zeros((6 * count, nv)), np.zeros((6 * count, nv))
        self._contacts: Records[ElasticContact] = records(self._state, ELASTIC_CONTACT)
        self._frame: Records[Pose] = records(self._frames, POSE)
        for contact, arm in zip(self._contacts, each, strict=True):
            contact.stiffness, contact.damping = np.array(arm.pad.stiffness), np.array(arm.pad.damping)
            contact.radius = arm.friction.torsional_radius
            fall = interpreted(law.steepest_fall)(record(friction_law(arm.friction)[1], law.LAYOUT), arm.grip.force)
            least = fall / ROOT_MARGIN
            if min(contact.damping[0], contact.damping[1], contact.damping[5] / contact.radius**2) < least:
                raise InputError(
                    "parameter pad.damping",
                    got=contact.damping.tolist(),
                    expected=f"at least {least:.3g} N s/m along x and y and {least * contact.radius**2:.3g} N m s/rad "
                    "about z: friction that falls faster with speed makes slip jump",
                )
        self._levers: list[Array] = []
        self._qpos: Array = data.qpos
        self._qvel: Array = data.qvel
        self._object_pose: Array = data.qpos[self._n :]
        self._effort = np.zeros(nv)
        self._pushes: Array | None = None
        self._period = each[0].control_period_s
        self.reset(np.array([arm.grip.force for arm in each]))
        self._substeps = each[0].substeps or max(
            1, math.ceil(self._period * self._stiffest_motion() / LONGEST_STEP - 1e-9)
        )
        model.opt.timestep = self._period / self._substeps

    def reset(self, _normal_forces: Array) -> None:
        """Put all arms back to their initial postures, at rest, the object hanging in all grasps."""
        model, data = self.model, self.data
        mujoco.mj_resetData(model, data)
        self._qpos[: self._n] = self._initial
        mujoco.mj_kinematics(model, data)
        contacts, first = self._contacts, self._params[0]
        for contact in contacts:
            for part in (contact.law_state, contact.deflection, contact.slip, contact.force, contact.slip_rate):
                part[:] = 0.0
            contact.rubbed = contact.damped = 0.0
        R_pad = [data.site_xmat[site].reshape(3, 3).copy() for site in self._sites]
        x_pad = [data.site_xpos[site].copy() for site in self._sites]
        R_o = R_pad[0] @ matrix_from_quat_xyzw(first.contacts.orientation_xyzw[:4]).T
        x_o = x_pad[0] - R_o @ np.array(first.contacts.position[:3])
        self._levers = [R_o.T @ (x - x_o) for x in x_pad]
        # Static balance: the object moves by d until the pads carry its weight.
        K = np.zeros((6, 6))
        maps = [_as_seen_at(R, x - x_o) for R, x in zip(R_pad, x_pad, strict=True)]
        for contact, seen in zip(contacts, maps, strict=True):
            K += seen.T @ np.diag(contact.stiffness) @ seen
        weight = np.concatenate((first.object.mass * np.array(first.gravity), np.zeros(3)))
        d = np.linalg.solve(K, weight)
        for contact, seen in zip(contacts, maps, strict=True):
            contact.deflection[:] = seen @ d
            contact.deflection_before[:] = contact.deflection
            contact.force[:] = -contact.stiffness * contact.deflection
        quaternion = np.zeros(4)
        mujoco.mju_mat2Quat(quaternion, R_o.ravel())
        mujoco.mju_quatIntegrate(quaternion, R_o.T @ d[3:], 1.0)
        self._object_pose[:3], self._object_pose[3:7] = x_o + d[:3], quaternion
        mujoco.mj_step1(model, data)
        self._look()
        body = self._frame[len(contacts)]
        for i in range(len(contacts)):
            at, R = 6 * i, self._frame[i].rotation
            self._rows[at : at + 3], self._rows[at + 3 : at + 6] = (
                -R.T @ self._jacobians[first : first + 3] for first in (at, at + 3)
            )
            seen = _as_seen_at(R, self._frame[i].position - body.position)
            seen[:, 3:] = seen[:, 3:] @ body.rotation
            self._rows[at : at + 6, self._n :] = seen

    def advance(self, efforts: Array, normal_forces: Array, drives: Array | None = None) -> None:
        """Advance one control period as `RigidPlant` does; (sum of n,) [N m], (N,) [N]."""
        model, data, dt = self.model, self.data, self.model.opt.timestep
        self._effort[: self._n] = efforts
        for contact in self._contacts:
            contact.deflection_before[:] = contact.deflection
        for _ in range(self._substeps):
            self._look()
            if self._pushes is not None:
                self._lean(self._pushes)
            if drives is None:
                self._grip(normal_forces)
            else:
                self._agree_with_drives(efforts, normal_forces, drives)
            mujoco.mj_step2(model, data)
            elastic_after(self._qvel, self._rows, normal_forces, dt, self._state)
            mujoco.mj_step1(model, data)
        check_divergence(self.data)

    def _grip(self, normal_forces: Array) -> None:
        """Write the joint forces of the coming step under the present efforts."""
        data = self.data
        if not self._step(
            data.qLD, data.qLDiagInv, self._tree, self._qvel, data.qfrc_bias, self._effort, self._frames,
            self._jacobians, self._laws, normal_forces, self.model.opt.timestep, self._state, self._rows,
            data.qfrc_applied,
        ):  # fmt: skip
            raise DivergenceError("simulation diverged: the forces of the pads are not finite; reset it")

    def _agree_with_drives(self, efforts: Array, normal_forces: Array, drives: Array) -> None:
        """Repeat the forces of the pads and the torques of the drives in turn until both fit."""
        data, dt, n, before = self.data, self.model.opt.timestep, self._n, self._state.copy()
        torque = np.zeros(n)
        for _ in range(DRIVE_PASSES):
            self._state[:] = before  # bristles advance once
            self._effort[:n] = efforts + torque
            self._grip(normal_forces)
            force = data.qfrc_applied - data.qfrc_bias
            force[:n] -= torque
            if not joint_step(data.qLD, data.qLDiagInv, self._tree, self._qpos, self._qvel, force, dt, drives):
                raise DivergenceError("simulation diverged: the torques of the drives are not finite; reset it")
            change = drives[:, TORQUE] - torque
            torque = drives[:, TORQUE].copy()
            data.qfrc_applied[:n] += change
            if np.abs(change).max() < AGREEMENT:
                break

    def push(self, wrenches: Array) -> None:
        """Let hands push the object where each arm grips it from now on; (N, 6) [N, N m] {w}."""
        self._pushes = wrenches.copy() if wrenches.any() else None
        self._effort[self._n :] = 0.0

    def gripped_at(self, arm: int) -> tuple[float, float]:
        """Return where the point of the object that was gripped is on the pad, along x and y of {ee} [m]."""
        x, y, angle = self._contacts[arm].slip.tolist()
        c, s = math.cos(angle), math.sin(angle)
        return -c * x - s * y, s * x - c * y

    def _load(self, arm: int) -> Array:
        return np.array(self._rows[6 * arm : 6 * arm + 6, self._joints[arm]].T @ self._contacts[arm].force)

    def read(self, arm: int) -> Array:
        """Return everything that can be read of one arm, laid out by `read_out`.

        Implements: h_ee of Eq. (1), v_s of Eq. (14).
        """
        out, contact = super().read(arm), self._contacts[arm]
        read = record(out, self._layouts[arm])
        (x, y, angle), (moves_x, moves_y, turns) = contact.slip, contact.slip_rate
        read.wrench = -contact.force
        read.slip_displacement, read.slip_velocity = (x, y, 0, 0, 0, angle), (-moves_x, -moves_y, 0, 0, 0, -turns)
        read.pad_yield = (contact.deflection_before - contact.deflection) / self._period
        return out

    def _look(self) -> None:
        """Take the poses of pads and object, and the pads' Jacobians, from MuJoCo."""
        data, frames = self.data, self._frames
        for i, site in enumerate(self._sites):
            frames[i, :3], frames[i, 3:] = data.site_xpos[site], data.site_xmat[site]
            moving, turning = self._jacobians[6 * i : 6 * i + 3], self._jacobians[6 * i + 3 : 6 * i + 6]
            mujoco.mj_jacSite(self.model, data, moving, turning, site)
        frames[-1, :3], frames[-1, 3:] = data.xipos[self._body], data.xmat[self._body]

    def _lean(self, pushes: Array) -> None:
        """Put what pushes the object on its free joint: force {w}, torque on its own axes."""
        R_o, force, torque = self._frame[len(self._contacts)].rotation, np.zeros(3), np.zeros(3)
        for push, lever in zip(pushes, self._levers, strict=True):
            force += push[:3]
            torque += push[3:] + np.cross(R_o @ lever, push[:3])
        self._effort[self._n : self._n + 3] = force
        self._effort[self._n + 3 :] = R_o.T @ torque

    def _stiffest_motion(self) -> float:
        """Return the largest natural frequency of arms and object on the springs of the pads, at the start [rad/s]."""
        mujoco.mj_fullM(self.model, self.data, self._mass_matrix)
        A = self._rows @ np.linalg.solve(self._mass_matrix, self._rows.T)
        K = np.concatenate([contact.stiffness for contact in self._contacts])
        root = np.sqrt(K)
        return math.sqrt(float(np.linalg.eigvalsh(root[:, None] * A * root).max()))


def _as_seen_at(R: Array, r: Array) -> Array:
    """Return R^T G^T: a small motion of the object as seen at a pad, on the pad's axes; (6, 6)."""
    S = np.array([[0.0, -r[2], r[1]], [r[2], 0.0, -r[0]], [-r[1], r[0], 0.0]])
    seen = np.zeros((6, 6))
    seen[:3, :3] = seen[3:, 3:] = R.T
    seen[:3, 3:] = -R.T @ S
    return seen
