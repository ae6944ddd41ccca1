"""Default backend: the object on relative joints in the grasp, friction by implicit projection on the limit surface.

Between the two halves of a MuJoCo step the friction law is solved on the contact twist v of the object relative to the
pad, and its force is applied on the relative joints; `grasp_motion` has the formulas, `grasp_kernel` their compiled
form. The slip of the law is the opposite: v_s = -v, pad relative to object.
"""

from __future__ import annotations

import math

import mujoco
import numpy as np

from slip_core.arrays import Array, matrix_from_quat_xyzw
from slip_core.errors import InputError
from slip_sim_bridge.sim.grasp_kernel import friction_step, read_out
from slip_sim_bridge.sim.laws import friction_law, packed_law
from slip_sim_bridge.sim.model import FORCE_SENSOR, OBJECT, SLIP_JOINTS, TORQUE_SENSOR, build_model
from slip_sim_bridge.sim.params import BridgeParams
from slip_sim_bridge.sim.plant import DivergenceError, Record

_FATAL_WARNINGS = (mujoco.mjtWarning.mjWARN_BADQPOS, mujoco.mjtWarning.mjWARN_BADQVEL, mujoco.mjtWarning.mjWARN_BADQACC)

_STOP_PASSES = 20
_STOP_AGREEMENT = 1e-10  # N, N m


class ImplicitPlant:
    """Arm and grasp with limit-surface friction; see `Plant` for the meaning of the methods."""

    def __init__(self, params: BridgeParams, urdf_text: str) -> None:
        self.model = model = build_model(params, urdf_text)
        self.data = data = mujoco.MjData(model)
        self._period = params.control_period_s
        self._fixed_substeps = params.substeps
        self._packed_law = packed_law(friction_law(params.friction), params.friction.torsional_radius)
        self._initial = np.array(params.initial_position)
        self._p_R_o = np.ascontiguousarray(matrix_from_quat_xyzw(params.contacts.orientation_xyzw[:4]).T)

        n = self._n = len(params.joint_names)
        first = model.joint(SLIP_JOINTS[0]).dofadr[0]
        if first != n:  # the object is added last, so its joints follow the arm's
            raise InputError("robot_description", got="movable joints after the frame ee", expected="ee at the tip")
        limited = model.jnt_actfrclimited[:n].astype(bool)
        self._effort_limit = np.where(limited, model.jnt_actfrcrange[:n, 1], math.inf)
        self._body = model.body(OBJECT).id
        force, torque = model.sensor(FORCE_SENSOR).adr[0], model.sensor(TORQUE_SENSOR).adr[0]
        if torque != force + 3:
            raise InputError("robot_description", got="sensors between force and torque", expected="an arm")

        # Views into MuJoCo's memory: valid as long as `data` lives, always the current numbers.
        self._qpos: Array = data.qpos
        self._qvel: Array = data.qvel
        self._applied: Array = data.qfrc_applied
        self._bias: Array = data.qfrc_bias
        self._factor: Array = data.qLD
        self._inverse_diagonal: Array = data.qLDiagInv
        self._arm_q: Array = data.qpos[:n]
        self._slip_q: Array = data.qpos[n:]
        self._arm_qd: Array = data.qvel[:n]
        self._slip_qd: Array = data.qvel[n:]
        self._slip_tau: Array = data.qfrc_applied[n:]
        self._readings: Array = data.sensordata[force : force + 6]
        self._object_position: Array = data.xipos[self._body]
        self._object_rotation: Array = data.xmat[self._body]
        self._object_spatial: Array = data.cvel[self._body]
        self._root: Array = data.subtree_com[model.body_rootid[self._body]]
        self._bad_position, self._bad_velocity, self._bad_acceleration = (data.warning[k] for k in _FATAL_WARNINGS)
        self._option = model.opt

        self._tree = np.concatenate((model.M_rowadr, model.M_rownnz, model.M_colind)).astype(np.int64)
        self._record_size = Record(n).size
        self._no_stops = np.zeros(model.nv)
        self._state = np.zeros(6)  # of the friction law: now, and after the coming step
        self._substeps = 1
        self._mass_matrix = np.zeros((model.nv, model.nv))
        self._spatial = np.zeros(6)
        self.reset(params.grip.force)

    @property
    def effort_limit(self) -> Array:
        """Joint effort limits; (n,) [N m].

        Implements: ours: `effort` of the URDF's joint limits.
        """
        return self._effort_limit.copy()

    def reset(self, normal_force: float) -> None:
        """Put everything back to the initial posture, held and at rest; [N].

        Implements: ours: the first wrench is that of the held arm.
        """
        model, data = self.model, self.data
        mujoco.mj_resetData(model, data)
        self._arm_q[:] = self._initial
        self._state[:] = 0.0
        self._split(1)
        mujoco.mj_step1(model, data)
        self._friction_step(self.holding_effort(self._initial, 0.0, 0.0), normal_force, 1)
        mujoco.mj_forward(model, data)
        self._state[:] = 0.0

    def advance(self, effort: Array, normal_force: float) -> None:
        """Advance one control period; (n,) [N m], [N].

        Implements: ours: mj_step1 of the next step runs at the end, so that all state belongs to the new stamp.
        """
        model, data = self.model, self.data
        substeps = self._friction_step(effort, normal_force, self._fixed_substeps)
        if substeps != self._substeps:
            self._split(substeps)
        mujoco.mj_step2(model, data)
        mujoco.mj_step1(model, data)
        for _ in range(1, substeps):
            self._friction_step(effort, normal_force, substeps)
            mujoco.mj_step2(model, data)
            mujoco.mj_step1(model, data)
        if self._bad_position.number or self._bad_velocity.number or self._bad_acceleration.number:
            raise DivergenceError(f"simulation diverged at {data.time:.4f} s; reset it, and lower gains or step size")

    def _split(self, substeps: int) -> None:
        """Make MuJoCo's step the period divided by this number."""
        self._substeps = substeps
        self._option.timestep = self._period / substeps

    def read(self) -> Array:
        """Return everything that can be read, laid out by `Record`; (2 n + 36,).

        Implements: ours: the read-out methods below in one call.
        """
        out = np.empty(self._record_size)
        read_out(
            self._qpos, self._qvel, self._readings, self._object_position, self._object_rotation,
            self._object_spatial, self._root, self._p_R_o, out,
        )  # fmt: skip
        return out

    def holding_effort(self, target: Array, stiffness: float, damping: float) -> Array:
        """Return bias + M (stiffness (target - q) - damping qd) of the loaded arm; (n,) -> (n,) [N m].

        Implements: ours: computed-torque posture hold.
        """
        n = self._n
        mujoco.mj_fullM(self.model, self.data, self._mass_matrix)
        pull = stiffness * (target - self._arm_q) - damping * self._arm_qd
        return self._bias[:n] + self._mass_matrix[:n, :n] @ pull

    def joint_position(self) -> Array:
        """Joint positions; (n,) [rad].

        Implements: ours: state read-out.
        """
        return self._arm_q.copy()

    def joint_velocity(self) -> Array:
        """Joint velocities; (n,) [rad/s].

        Implements: ours: state read-out.
        """
        return self._arm_qd.copy()

    def wrench(self) -> Array:
        """Wrench h_ee of the object on the robot in the step that just ended; (6,) [N, N m] {ee} axes.

        Implements: h_ee of Eq. (1), minus what the sensors of the massless pad body read.
        """
        return -self._readings

    def slip_displacement(self) -> Array:
        """Pose of {ee} in {p}: -R(theta)^T (x, y) and -theta; (6,) [m, rad] {p} axes.

        Implements: ours: inverse of the relative joints' pose.
        """
        x, y, theta = self._slip_q.tolist()
        c, s = math.cos(theta), math.sin(theta)
        return np.array((-c * x - s * y, s * x - c * y, 0.0, 0.0, 0.0, -theta))

    def slip_velocity(self) -> Array:
        """Return v_s = -J [sx', sy', rz']; (6,) [m/s, rad/s] {ee} axes.

        Implements: Eq. (14), v_s = v_ee - G^T v_o, in relative coordinates.
        """
        x, y, _ = self._slip_q.tolist()
        vx, vy, wz = self._slip_qd.tolist()
        return np.array((-vx - y * wz, -vy + x * wz, 0.0, 0.0, 0.0, -wz))

    def object_pose(self) -> tuple[Array, Array]:
        """Centre of mass (3,) [m] {w} and rotation (3, 3) {o} to {w}.

        Implements: ours: state read-out.
        """
        return self._object_position.copy(), self._object_rotation.reshape(3, 3) @ self._p_R_o

    def object_twist(self) -> Array:
        """Twist of the object at its centre of mass; (6,) [m/s, rad/s] {w}.

        Implements: v_o of Eq. (10).
        """
        mujoco.mj_objectVelocity(self.model, self.data, mujoco.mjtObj.mjOBJ_BODY, self._body, self._spatial, 0)
        return np.concatenate((self._spatial[3:], self._spatial[:3]))

    def _friction_step(self, effort: Array, normal_force: float, substeps: int) -> int:
        """Put effort and the friction of the coming step on the joints; return into how many the period is split."""
        data = self.data
        if not data.nefc:
            return self._solve(effort, normal_force, substeps, self._no_stops, 1)
        substeps = self._solve(effort, normal_force, substeps, self._no_stops, 0)
        self._agree_with_joint_stops(effort, normal_force, substeps)
        self._state[:3] = self._state[3:]
        return substeps

    def _solve(self, effort: Array, normal_force: float, substeps: int, stops: Array, keep: int) -> int:
        return friction_step(
            self._factor, self._inverse_diagonal, self._tree, self._qpos, self._qvel, self._bias, stops,
            effort, self._packed_law, normal_force, self._period, substeps, keep, self._state, self._applied,
        )  # fmt: skip

    def _agree_with_joint_stops(self, effort: Array, normal_force: float, substeps: int) -> None:
        """Repeat friction and the forces of active joint stops in turn until both fit; a pass gains a factor of 40."""
        data = self.data
        for _ in range(_STOP_PASSES):
            before = self._slip_tau.tolist()
            mujoco.mj_fwdActuation(self.model, data)
            mujoco.mj_fwdAcceleration(self.model, data)
            mujoco.mj_fwdConstraint(self.model, data)
            self._solve(effort, normal_force, substeps, data.qfrc_constraint, 0)
            if max(abs(x - y) for x, y in zip(before, self._slip_tau.tolist(), strict=True)) < _STOP_AGREEMENT:
                break
