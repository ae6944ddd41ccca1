"""The arms when the object has left all pads: nothing acts on them or it but their own weight; no floor, no second
catch.

What is read of a grasp is what an empty gripper has: no wrench, no slip, and the slip displacement at which the contact
ended. The object is a free rigid body.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import mujoco
import numpy as np

from slip_core.arrays import Array
from slip_core.records import new, record
from slip_sim_bridge.params import BridgeParams
from slip_sim_bridge.plant import DivergenceError, read_out
from slip_sim_bridge.plant.joint_step import TORQUE, joint_step
from slip_sim_bridge.plant.model import OBJECT, PAD, check_divergence, free_object_model, name_of, tree_of


class LoosePlant:
    """Arms and object without contact."""

    def __init__(self, arms: Mapping[str, BridgeParams], urdfs: Mapping[str, str]) -> None:
        self.model = free_object_model(arms, urdfs)
        self.data = mujoco.MjData(self.model)
        self._tree = tree_of(self.model)
        ends = np.cumsum([len(arm.joint_names) for arm in arms.values()]).tolist()
        self._joints = [slice(begin, end) for begin, end in zip([0, *ends], ends, strict=False)]
        self._n, self._body = ends[-1], self.model.body(OBJECT).id
        self._mass_matrix = np.zeros((self.model.nv, self.model.nv))
        self._sites = [self.model.site(name_of(name, PAD)).id for name in arms]
        self._layouts = [read_out(len(arm.joint_names)) for arm in arms.values()]
        self._slip_displacements = [np.zeros(6) for _ in arms]

    def take_over(self, numbers: Sequence[Array]) -> None:
        """Continue from what was read of each arm while the object was held; laid out by `read_out`."""
        n, data = self._n, self.data
        held = [record(each, layout) for each, layout in zip(numbers, self._layouts, strict=True)]
        mujoco.mj_resetData(self.model, data)
        for joints, arm in zip(self._joints, held, strict=True):
            data.qpos[joints], data.qvel[joints] = arm.position, arm.velocity
        R_o, twist = held[0].object_rotation, held[0].object_twist
        data.qpos[n : n + 3] = held[0].object_position
        mujoco.mju_mat2Quat(data.qpos[n + 3 :], R_o.ravel())
        data.qvel[n : n + 3] = twist[:3]
        data.qvel[n + 3 :] = R_o.T @ twist[3:]  # MuJoCo has it on the body's axes
        self._slip_displacements = [arm.slip_displacement.copy() for arm in held]
        mujoco.mj_step1(self.model, data)

    def advance(self, efforts: Array, _normal_forces: Array, drives: Array | None = None) -> None:
        """Advance one control period; (sum of n,) [N m]; no force of the pads reaches the object any more."""
        data, n = self.data, self._n
        data.qfrc_applied[:n] = efforts
        if drives is not None:
            force, dt = data.qfrc_applied - data.qfrc_bias, self.model.opt.timestep
            if not joint_step(data.qLD, data.qLDiagInv, self._tree, data.qpos, data.qvel, force, dt, drives):
                raise DivergenceError("simulation diverged: the torques of the drives are not finite; reset it")
            data.qfrc_applied[:n] += drives[:, TORQUE]
        mujoco.mj_step2(self.model, self.data)
        mujoco.mj_step1(self.model, self.data)
        check_divergence(self.data)

    def holding_effort(self, arm: int, target: Array, stiffness: float, damping: float) -> Array:
        """Return gravity, Coriolis and load compensation plus M (stiffness (target - q) - damping qd); (n,) [N m]."""
        joints, data = self._joints[arm], self.data
        mujoco.mj_fullM(self.model, data, self._mass_matrix)
        pull = stiffness * (target - data.qpos[joints]) - damping * data.qvel[joints]
        return np.array(data.qfrc_bias[joints] - self._load(arm) + self._mass_matrix[joints, joints] @ pull)

    def _load(self, arm: int) -> Array:
        """Return the joint efforts with which the object loads an arm; (n,) [N m]."""
        joints = self._joints[arm]
        return np.zeros(joints.stop - joints.start)

    def read(self, arm: int) -> Array:
        """Return everything that can be read of one arm, laid out by `read_out`."""
        data, joints, n, site = self.data, self._joints[arm], self._n, self._sites[arm]
        out, R_o = new(self._layouts[arm]), data.xmat[self._body].reshape(3, 3)
        read = record(out, self._layouts[arm])
        read.position, read.velocity = data.qpos[joints], data.qvel[joints]
        read.slip_displacement = self._slip_displacements[arm]
        read.object_position, read.object_rotation = data.xipos[self._body], R_o
        read.object_twist = (*data.qvel[n : n + 3], *(R_o @ data.qvel[n + 3 :]))
        read.pad_position, read.pad_rotation = data.site_xpos[site], data.site_xmat[site].reshape(3, 3)
        return out
