"""Two arms and one free object in one MuJoCo model; `pair_step` closes the loop through two elastic pads.

The object has a free joint of its own. Nothing welds it to a gripper: the wrenches of both pads act on it and, opposite
and at the same points, on the grippers, so momentum is exchanged and never made. Each grasp is made where its pad
stands at the start; the pads begin with the deflection under which they carry the object's weight at rest.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import mujoco
import numpy as np

from slip_core.arrays import Array, inertia_from_six, matrix_from_quat_xyzw, readonly
from slip_core.errors import InputError
from slip_core.grasp_params import BaseParams
from slip_core.records import new, record
from slip_sim_bridge.friction import friction_law
from slip_sim_bridge.friction.limit_surface import ROOT_MARGIN
from slip_sim_bridge.pair.params import SIDES, PairParams
from slip_sim_bridge.plant import DivergenceError, ReadOut
from slip_sim_bridge.plant.model import OBJECT, Divergence, arm_spec, compile_spec, effort_limits
from slip_sim_bridge.plant.pair_step import FRAMES, PAIR, ROWS, pair_after, pair_step, read_pair

PAD_SITE = "pair_pad"
LONGEST_STEP = 0.3
"""Largest step as a share of 1 / omega of the stiffest motion of object and pads; the spring is stable below 2."""


def build_model(params: PairParams, urdf_texts: Sequence[str]) -> mujoco.MjModel:
    """Compile both arms, each on its base, and the free object.

    Raises:
        InputError: a URDF that does not parse or lacks the frame or a joint.
    """
    whole = mujoco.MjSpec()
    for side, arm, base, text in zip(SIDES, params.arms, params.bases, urdf_texts, strict=True):
        spec = arm_spec(arm, text)
        spec.body(arm.ee_frame).add_site(name=PAD_SITE)
        whole.option, whole.compiler = spec.option, spec.compiler
        position, quaternion = _base_pose(base)
        whole.attach(spec, prefix=f"{side}_", frame=whole.worldbody.add_frame(pos=position, quat=quaternion))
    whole.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    grasped, J = whole.worldbody.add_body(name=OBJECT), inertia_from_six(params.left.object.inertia)
    grasped.mass, grasped.ipos, grasped.explicitinertial = params.left.object.mass, np.zeros(3), True
    grasped.fullinertia = [J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2]]
    grasped.add_freejoint()
    return compile_spec(whole)


def _base_pose(base: BaseParams) -> tuple[Array, Array]:
    turn, quaternion = np.array(base.rotation), np.zeros(4)
    angle = float(np.linalg.norm(turn))
    mujoco.mju_axisAngle2Quat(quaternion, turn / angle if angle > 0.0 else np.array((1.0, 0.0, 0.0)), angle)
    return np.array(base.position), quaternion


class PairPlant:
    """Both arms, both grasps and the object; everything is in the order left, right."""

    def __init__(self, params: PairParams, urdf_texts: Sequence[str]) -> None:
        self.params = params
        self.model = model = build_model(params, urdf_texts)
        self.data = data = mujoco.MjData(model)
        self._divergence = Divergence(data)
        names = [[f"{side}_{name}" for name in arm.joint_names] for side, arm in zip(SIDES, params.arms, strict=True)]
        counts = [len(each) for each in names]
        self.joints = slice(0, counts[0]), slice(counts[0], sum(counts))
        self._arms = sum(counts)
        self.effort_limits = tuple(effort_limits(model, each) for each in names)
        self._initial = np.concatenate([arm.initial_position for arm in params.arms])

        law, _ = friction_law(params.left.friction)
        self._laws = np.array([friction_law(arm.friction)[1] for arm in params.arms])
        self._step = pair_step(law)
        self._pair, self._frames, self._rows = new(PAIR), new(FRAMES), np.zeros((ROWS, model.nv))
        self._contacts = record(self._pair, PAIR).contact
        for contact, arm in zip(self._contacts, params.arms, strict=True):
            contact.stiffness, contact.damping = params.pad.stiffness, params.pad.damping
            contact.radius = arm.friction.torsional_radius
            fall = law.steepest_fall(record(friction_law(arm.friction)[1], law.LAYOUT), arm.grip.force)
            least = fall / ROOT_MARGIN
            if min(contact.damping[0], contact.damping[1], contact.damping[5] / contact.radius**2) < least:
                raise InputError(
                    "parameter pad.damping",
                    got=contact.damping.tolist(),
                    expected=f"at least {least:.3g} N s/m along x and y and {least * contact.radius**2:.3g} N m s/rad "
                    "about z: friction that falls faster with speed makes slip jump",
                )
        self._sites = [model.site(f"{side}_{PAD_SITE}").id for side in SIDES]
        self._jacobians = [np.zeros((3, model.nv)) for _ in range(4)]
        self._tree = np.concatenate((model.M_rowadr, model.M_rownnz, model.M_colind)).astype(np.int64)
        self._sizes = [ReadOut(count).size for count in counts]
        self._qpos: Array = data.qpos
        self._qvel: Array = data.qvel
        self._object_pose: Array = data.qpos[self._arms :]
        self._mass_matrix = np.zeros((model.nv, model.nv))
        self.grip = np.array([arm.grip.force for arm in params.arms])
        self._period = params.left.control_period_s
        self.reset()
        self._substeps = params.left.substeps or max(
            1, math.ceil(self._period * self._stiffest_motion() / LONGEST_STEP - 1e-9)
        )
        model.opt.timestep = self._period / self._substeps

    def reset(self) -> None:
        """Put both arms back to their initial postures, at rest, the object hanging in both grasps."""
        model, data = self.model, self.data
        mujoco.mj_resetData(model, data)
        self._qpos[: self._arms] = self._initial
        mujoco.mj_kinematics(model, data)
        contacts, grasped = self._contacts, self.params.left.contacts
        for contact in contacts:
            contact.law_state = contact.deflection = contact.slip = contact.force = contact.slip_rate = 0.0
            contact.rubbed = contact.damped = 0.0
        R_pad = [data.site_xmat[site].reshape(3, 3).copy() for site in self._sites]
        x_pad = [data.site_xpos[site].copy() for site in self._sites]
        R_o = R_pad[0] @ matrix_from_quat_xyzw(grasped.orientation_xyzw[:4]).T
        x_o = x_pad[0] - R_o @ np.array(grasped.position[:3])

        # Static balance: the object moves by d until the pads carry its weight.
        K = np.zeros((6, 6))
        maps = [_as_seen_at(R, x - x_o) for R, x in zip(R_pad, x_pad, strict=True)]
        for contact, seen in zip(contacts, maps, strict=True):
            K += seen.T @ np.diag(contact.stiffness) @ seen
        weight = np.concatenate((self.params.left.object.mass * np.array(self.params.left.gravity), np.zeros(3)))
        d = np.linalg.solve(K, weight)
        for contact, seen in zip(contacts, maps, strict=True):
            contact.deflection = seen @ d
            contact.force = -contact.stiffness * contact.deflection
        turn, quaternion = np.zeros(4), np.zeros(4)
        mujoco.mju_mat2Quat(quaternion, R_o.ravel())
        angle = float(np.linalg.norm(d[3:]))
        mujoco.mju_axisAngle2Quat(turn, d[3:] / angle if angle > 0.0 else np.array((1.0, 0.0, 0.0)), angle)
        self._object_pose[:3] = x_o + d[:3]
        mujoco.mju_mulQuat(self._object_pose[3:7], turn, quaternion)
        mujoco.mj_step1(model, data)
        self._rows[:] = 0.0
        self._look()
        for i in range(2):
            R = R_pad[i]
            self._rows[6 * i : 6 * i + 3] = -R.T @ self._jacobians[2 * i]
            self._rows[6 * i + 3 : 6 * i + 6] = -R.T @ self._jacobians[2 * i + 1]

    def advance(self, efforts: Sequence[Array]) -> None:
        """Advance one control period; (n,) [N m] of each arm.

        Raises:
            DivergenceError: where the state stopped being physical.
        """
        model, data, effort = self.model, self.data, np.concatenate(efforts)
        dt = model.opt.timestep
        for _ in range(self._substeps):
            self._look()
            if not self._step(
                data.qLD, data.qLDiagInv, self._tree, self._qvel, data.qfrc_bias, effort, self._frames,
                *self._jacobians, self._laws, self.grip, dt, self._pair, self._rows, data.qfrc_applied,
            ):  # fmt: skip
                raise DivergenceError("simulation diverged: the forces of the pads are not finite; reset it")
            mujoco.mj_step2(model, data)
            pair_after(self._qvel, self._rows, self.grip, dt, self._pair)
            mujoco.mj_step1(model, data)
        self._divergence.check()

    def holding_effort(self, side: int, target: Array, stiffness: float, damping: float) -> Array:
        """Return gravity, Coriolis and load compensation plus M (stiffness (target - q) - damping qd); (n,) [N m]."""
        at, data = self.joints[side], self.data
        mujoco.mj_fullM(self.model, data, self._mass_matrix)
        pull = stiffness * (target - self._qpos[at]) - damping * self._qvel[at]
        load = self._rows[6 * side : 6 * side + 6, at].T @ self._contacts[side].force
        return data.qfrc_bias[at] - load + self._mass_matrix[at, at] @ pull

    def read(self, side: int) -> Array:
        """Return everything that can be read of one side, laid out by `ReadOut`; (2 n + 36,)."""
        self._look()
        out, at = np.empty(self._sizes[side]), self.joints[side]
        read_pair(self._pair, side, self._qpos[at], self._qvel[at], self._qvel[self._arms :], self._frames, out)
        return out

    def energy(self) -> tuple[float, float]:
        """Return the mechanical energy (motion, height, pads) and what friction and dampers have taken [J]."""
        data = self.data
        mujoco.mj_energyPos(self.model, data)
        mujoco.mj_energyVel(self.model, data)
        stored = sum(0.5 * float(c.deflection @ (c.stiffness * c.deflection)) for c in self._contacts)
        taken = sum(float(c.rubbed + c.damped) for c in self._contacts)
        return float(data.energy[0] + data.energy[1]) + stored, taken

    @property
    def deflections(self) -> Array:
        """Deflection of both pads; (2, 6) [m, rad] pad axes."""
        return readonly(np.array([contact.deflection for contact in self._contacts]))

    @property
    def pads(self) -> tuple[tuple[Array, ...], tuple[Array, ...]]:
        """True positions [m] and attitudes of both pads {w}."""
        data = self.data
        return (
            tuple(data.site_xpos[site].copy() for site in self._sites),
            tuple(data.site_xmat[site].reshape(3, 3).copy() for site in self._sites),
        )

    def _look(self) -> None:
        """Take the poses of pads and object, and the pads' Jacobians, from MuJoCo."""
        data, frames = self.data, record(self._frames, FRAMES)
        for i, site in enumerate(self._sites):
            frames.pad[i].position, frames.pad[i].rotation = data.site_xpos[site], data.site_xmat[site].reshape(3, 3)
            mujoco.mj_jacSite(self.model, data, self._jacobians[2 * i], self._jacobians[2 * i + 1], site)
        body = self.model.nbody - 1
        frames.body.position, frames.body.rotation = data.xipos[body], data.xmat[body].reshape(3, 3)

    def _stiffest_motion(self) -> float:
        """Return the largest natural frequency of arms and object on the springs of the pads, at the start [rad/s]."""
        model, rows = self.model, np.zeros((ROWS, self.model.nv))
        frames = record(self._frames, FRAMES)
        mujoco.mj_fullM(model, self.data, self._mass_matrix)
        for i in range(2):
            R, r = frames.pad[i].rotation, frames.pad[i].position - frames.body.position
            seen = _as_seen_at(R, r)
            seen[:, 3:] = seen[:, 3:] @ frames.body.rotation
            rows[6 * i : 6 * i + 3] = -R.T @ self._jacobians[2 * i]
            rows[6 * i + 3 : 6 * i + 6] = -R.T @ self._jacobians[2 * i + 1]
            rows[6 * i : 6 * i + 6, self._arms :] = seen
        A = rows @ np.linalg.solve(self._mass_matrix, rows.T)
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
