"""The arm when the object has left the pads: nothing acts on either but its own weight; no floor, no second catch.

What is read of the grasp is what an empty gripper has: no wrench, no slip, and the slip displacement at which the
contact ended. The object goes on as a free rigid body.
"""

from __future__ import annotations

import mujoco
import numpy as np

from slip_core.arrays import Array
from slip_sim_bridge.params import BridgeParams
from slip_sim_bridge.plant import ReadOut
from slip_sim_bridge.plant.model import OBJECT, Divergence, add_pad, arm_spec, compile_spec


class LoosePlant:
    """Arm and object without contact; the methods mean what they mean in `Plant`."""

    def __init__(self, params: BridgeParams, urdf_text: str) -> None:
        spec = arm_spec(params, urdf_text)
        spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
        add_pad(spec, params.ee_frame)
        free = spec.worldbody.add_body(name=OBJECT)
        free.mass, free.fullinertia, free.explicitinertial = params.object.mass, params.object.inertia, True
        free.ipos = np.zeros(3)  # said, or MuJoCo 4.0 forgets the axes of the inertia
        free.add_freejoint()
        self.model = compile_spec(spec)
        self.data = mujoco.MjData(self.model)
        self._divergence = Divergence(self.data)
        self._n, self._body = len(params.joint_names), self.model.body(OBJECT).id
        self._at, self._slip_displacement = ReadOut(self._n), np.zeros(6)

    def take_over(self, numbers: Array) -> None:
        """Go on from what the plant that held the object has read; laid out by `ReadOut`."""
        at, n, data = self._at, self._n, self.data
        mujoco.mj_resetData(self.model, data)
        R_o, twist = numbers[at.object_rotation], numbers[at.object_twist]
        data.qpos[:n], data.qvel[:n] = numbers[at.position], numbers[at.velocity]
        data.qpos[n : n + 3] = numbers[at.object_position]
        mujoco.mju_mat2Quat(data.qpos[n + 3 :], R_o)
        data.qvel[n : n + 3] = twist[:3]
        data.qvel[n + 3 :] = R_o.reshape(3, 3).T @ twist[3:]  # MuJoCo has it on the body's axes
        self._slip_displacement = numbers[at.slip_displacement].copy()
        mujoco.mj_step1(self.model, data)

    def advance(self, effort: Array, normal_force: float) -> None:
        """Advance one control period; (n,) [N m]; no force of the pads reaches the object any more."""
        self.data.qfrc_applied[: self._n] = effort
        mujoco.mj_step2(self.model, self.data)
        mujoco.mj_step1(self.model, self.data)
        self._divergence.check()

    def holding_effort(self, target: Array, stiffness: float, damping: float) -> Array:
        """Return bias + M (stiffness (target - q) - damping qd) of the empty arm; (n,) -> (n,) [N m]."""
        n, data = self._n, self.data
        full = np.zeros((self.model.nv, self.model.nv))
        mujoco.mj_fullM(self.model, data, full)
        pull = stiffness * (target - data.qpos[:n]) - damping * data.qvel[:n]
        return np.array(data.qfrc_bias[:n] + full[:n, :n] @ pull)

    def read(self) -> Array:
        """Return everything that can be read, laid out by `ReadOut`; (2 n + 36,)."""
        data, at, n, out = self.data, self._at, self._n, np.zeros(self._at.size)
        R_o = data.xmat[self._body]
        out[at.position], out[at.velocity] = data.qpos[:n], data.qvel[:n]
        out[at.slip_displacement] = self._slip_displacement
        out[at.object_position], out[at.object_rotation] = data.xipos[self._body], R_o
        out[at.object_twist] = (*data.qvel[n : n + 3], *(R_o.reshape(3, 3) @ data.qvel[n + 3 :]))
        return out
