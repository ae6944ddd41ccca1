"""Default backend: the object on relative joints in the grasp, friction by implicit projection on the limit surface.

Between the two halves of a MuJoCo step the friction law is solved on the contact twist v = J [sx', sy', rz'] at the
pad centre (object relative to pad), with J = [[1, 0, y], [0, 1, -x], [0, 0, 1]], and J^T f is applied on the
relative joints. The slip of the law is the opposite: v_s = -v, pad relative to object.
"""

from __future__ import annotations

import math

import mujoco
import numpy as np
from slip_msgs_py.arrays import Array, matrix_from_quat_xyzw
from slip_sim_bridge.sim.friction import NO_STATE, solve_contact, substeps_needed
from slip_sim_bridge.sim.laws import friction_law
from slip_sim_bridge.sim.model import FORCE_SENSOR, OBJECT, SLIP_JOINTS, TORQUE_SENSOR, build_model
from slip_sim_bridge.sim.params import BridgeParams
from slip_sim_bridge.sim.plant import DivergenceError

_FATAL_WARNINGS = (mujoco.mjtWarning.mjWARN_BADQPOS, mujoco.mjtWarning.mjWARN_BADQVEL, mujoco.mjtWarning.mjWARN_BADQACC)


class ImplicitPlant:
    """Arm and grasp with limit-surface friction; see `Plant` for the meaning of the methods."""

    def __init__(self, params: BridgeParams, urdf_text: str) -> None:
        self.model = model = build_model(params, urdf_text)
        self.data = data = mujoco.MjData(model)
        self._period = params.control_period_s
        self._fixed_substeps = params.substeps
        self._law = friction_law(params.friction)
        self._rho = params.friction.torsional_radius
        self._initial = np.array(params.initial_position)
        self._p_R_o = matrix_from_quat_xyzw(params.contacts.orientation_xyzw[:4]).T

        n = self._n = len(params.joint_names)
        first = model.joint(SLIP_JOINTS[0]).dofadr[0]
        assert first == n, "the grasp's joints come after the arm's, because the object is the last body"
        limited = model.jnt_actfrclimited[:n].astype(bool)
        self._effort_limit = np.where(limited, model.jnt_actfrcrange[:n, 1], math.inf)
        self._body = model.body(OBJECT).id
        force, torque = model.sensor(FORCE_SENSOR).adr[0], model.sensor(TORQUE_SENSOR).adr[0]
        self._sensor_index = np.r_[force : force + 3, torque : torque + 3]

        # Views into MuJoCo's memory: valid as long as `data` lives, always the current numbers.
        self._arm_q, self._slip_q = data.qpos[:n], data.qpos[n:]
        self._arm_qd, self._slip_qd = data.qvel[:n], data.qvel[n:]
        self._arm_tau, self._slip_tau = data.qfrc_applied[:n], data.qfrc_applied[n:]
        self._warnings = [data.warning[kind] for kind in _FATAL_WARNINGS]

        # Right-hand sides of one solve with M: three unit forces on the relative joints, then the smooth forces.
        self._rhs = np.zeros((4, model.nv))
        self._rhs[:3, n:] = np.eye(3)
        self._solved = np.zeros((4, model.nv))
        self._J = np.eye(3)
        self._state = NO_STATE
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
        mujoco.mj_resetData(self.model, self.data)
        self._arm_q[:] = self._initial
        self._state = NO_STATE
        mujoco.mj_step1(self.model, self.data)
        self._arm_tau[:] = self.holding_effort(self._initial, 0.0, 0.0)
        self.model.opt.timestep = self._period
        self._apply_friction(normal_force)
        mujoco.mj_forward(self.model, self.data)
        self._state = NO_STATE

    def advance(self, effort: Array, normal_force: float) -> None:
        """Advance one control period; (n,) [N m], [N].

        Implements: ours: mj_step1 of the next step runs at the end, so that all state belongs to the new stamp.
        """
        model, data = self.model, self.data
        substeps = self._fixed_substeps or self._substeps(normal_force)
        model.opt.timestep = self._period / substeps
        self._arm_tau[:] = effort
        for _ in range(substeps):
            self._apply_friction(normal_force)
            mujoco.mj_step2(model, data)
            mujoco.mj_step1(model, data)
        if any(warning.number for warning in self._warnings):
            raise DivergenceError(f"simulation diverged at {data.time:.4f} s; reset it, and lower gains or step size")

    def holding_effort(self, target: Array, stiffness: float, damping: float) -> Array:
        """Return bias + M (stiffness (target - q) - damping qd) of the loaded arm; (n,) -> (n,) [N m].

        Implements: ours: computed-torque posture hold.
        """
        n = self._n
        mujoco.mj_fullM(self.model, self.data, self._mass_matrix)
        pull = stiffness * (target - self._arm_q) - damping * self._arm_qd
        return self.data.qfrc_bias[:n] + self._mass_matrix[:n, :n] @ pull

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
        return -self.data.sensordata[self._sensor_index]

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
        return self.data.xipos[self._body].copy(), self.data.xmat[self._body].reshape(3, 3) @ self._p_R_o

    def object_twist(self) -> Array:
        """Twist of the object at its centre of mass; (6,) [m/s, rad/s] {w}.

        Implements: v_o of Eq. (10).
        """
        mujoco.mj_objectVelocity(self.model, self.data, mujoco.mjtObj.mjOBJ_BODY, self._body, self._spatial, 0)
        return np.concatenate((self._spatial[3:], self._spatial[:3]))

    def _apply_friction(self, normal_force: float) -> None:
        """Solve the friction law for the coming step and put J^T f on the relative joints."""
        self._slip_tau[:] = 0.0
        self._rhs[3] = self.data.qfrc_applied - self.data.qfrc_bias
        self._solve_friction(normal_force)
        if self.data.nefc:  # a joint stop is active: one fixed-point pass with its force
            mujoco.mj_fwdActuation(self.model, self.data)
            mujoco.mj_fwdAcceleration(self.model, self.data)
            mujoco.mj_fwdConstraint(self.model, self.data)
            self._slip_tau[:] = 0.0
            self._rhs[3] = self.data.qfrc_applied - self.data.qfrc_bias + self.data.qfrc_constraint
            self._solve_friction(normal_force)

    def _solve_friction(self, normal_force: float) -> None:
        n, dt, J = self._n, self.model.opt.timestep, self._J
        J[0, 2], J[1, 2] = self._slip_q[1], -self._slip_q[0]
        mujoco.mj_solveM(self.model, self.data, self._solved, self._rhs)
        A = dt * (J @ self._solved[:3, n:] @ J.T)
        v_free = J @ (self._slip_qd + dt * self._solved[3, n:])
        solution = solve_contact(v_free, A, normal_force, dt, self._law, self._state, self._rho)
        self._state = solution.state
        self._slip_tau[:] = J.T @ solution.force

    def _substeps(self, normal_force: float) -> int:
        """How many sub-steps this control period needs, from the contact's inertia in the present posture."""
        n, J = self._n, self._J
        J[0, 2], J[1, 2] = self._slip_q[1], -self._slip_q[0]
        mujoco.mj_solveM(self.model, self.data, self._solved, self._rhs)
        A = self._period * (J @ self._solved[:3, n:] @ J.T)
        return substeps_needed(A, normal_force, self._law, self._rho)
