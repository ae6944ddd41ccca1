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
from slip_msgs_py.errors import InputError
from slip_sim_bridge.sim.friction import NO_STATE, solve_contact, substeps_needed
from slip_sim_bridge.sim.laws import friction_law
from slip_sim_bridge.sim.model import FORCE_SENSOR, OBJECT, SLIP_JOINTS, TORQUE_SENSOR, build_model
from slip_sim_bridge.sim.params import BridgeParams
from slip_sim_bridge.sim.plant import DivergenceError

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
        self._law = friction_law(params.friction)
        self._rho = params.friction.torsional_radius
        self._initial = np.array(params.initial_position)
        self._p_R_o = matrix_from_quat_xyzw(params.contacts.orientation_xyzw[:4]).T

        n = self._n = len(params.joint_names)
        first = model.joint(SLIP_JOINTS[0]).dofadr[0]
        if first != n:  # the object is added last, so its joints follow the arm's
            raise InputError("robot_description", got="movable joints after the frame ee", expected="ee at the tip")
        limited = model.jnt_actfrclimited[:n].astype(bool)
        self._effort_limit = np.where(limited, model.jnt_actfrcrange[:n, 1], math.inf)
        self._body = model.body(OBJECT).id
        force, torque = model.sensor(FORCE_SENSOR).adr[0], model.sensor(TORQUE_SENSOR).adr[0]
        self._sensor_index = np.r_[force : force + 3, torque : torque + 3]

        # Views into MuJoCo's memory: valid as long as `data` lives, always the current numbers.
        self._arm_q: Array = data.qpos[:n]
        self._slip_q: Array = data.qpos[n:]
        self._arm_qd: Array = data.qvel[:n]
        self._slip_qd: Array = data.qvel[n:]
        self._arm_tau: Array = data.qfrc_applied[:n]
        self._slip_tau: Array = data.qfrc_applied[n:]
        self._arm_bias: Array = data.qfrc_bias[:n]
        self._readings: Array = data.sensordata
        self._object_position: Array = data.xipos[self._body]
        self._object_rotation: Array = data.xmat[self._body].reshape(3, 3)
        self._warnings = [data.warning[kind] for kind in _FATAL_WARNINGS]

        # Right-hand sides of one solve with M: three unit forces on the relative joints, then the smooth forces.
        self._rhs = np.zeros((4, model.nv))
        self._rhs[:3, n:] = np.eye(3)
        self._solved = np.zeros((4, model.nv))
        self._solved_slip = self._solved[:, n:]
        self._state = self._next_state = NO_STATE
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
        self._friction_step(self._free_motion(), normal_force, self._period)
        mujoco.mj_forward(self.model, self.data)
        self._state = NO_STATE

    def advance(self, effort: Array, normal_force: float) -> None:
        """Advance one control period; (n,) [N m], [N].

        Implements: ours: mj_step1 of the next step runs at the end, so that all state belongs to the new stamp.
        """
        model, data = self.model, self.data
        self._arm_tau[:] = effort
        motion = self._free_motion()
        substeps = self._fixed_substeps or substeps_needed(self._period * motion[0], normal_force, self._law, self._rho)
        model.opt.timestep = dt = self._period / substeps
        for index in range(substeps):
            if index:
                motion = self._free_motion()
            self._friction_step(motion, normal_force, dt)
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
        return self._arm_bias + self._mass_matrix[:n, :n] @ pull

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
        return -self._readings[self._sensor_index]

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
        return self._object_position.copy(), self._object_rotation @ self._p_R_o

    def object_twist(self) -> Array:
        """Twist of the object at its centre of mass; (6,) [m/s, rad/s] {w}.

        Implements: v_o of Eq. (10).
        """
        mujoco.mj_objectVelocity(self.model, self.data, mujoco.mjtObj.mjOBJ_BODY, self._body, self._spatial, 0)
        return np.concatenate((self._spatial[3:], self._spatial[:3]))

    def _free_motion(self) -> tuple[Array, Array]:
        """Return J M^-1 J^T (3, 3) and J times the relative acceleration (3,), without friction and joint stops."""
        self._slip_tau[:] = 0.0
        return self._contact_motion(self.data.qfrc_applied - self.data.qfrc_bias)

    def _contact_motion(self, force: Array) -> tuple[Array, Array]:
        """Return J M^-1 J^T (3, 3) and J times the relative part of M^-1 force (3,); (nv,) [N, N m].

        Written out for J = [[1, 0, y], [0, 1, -x], [0, 0, 1]]: five times faster than matrix products of order 3.
        """
        self._rhs[3] = force
        mujoco.mj_solveM(self.model, self.data, self._solved, self._rhs)
        (xx, xy, xz), (_, yy, yz), (_, _, zz), (ax, ay, az) = self._solved_slip.tolist()
        x, y, _ = self._slip_q.tolist()
        ux, uy = xz + y * zz, yz - x * zz
        vxx, vxy, vyy = xx + y * (xz + ux), xy - x * xz + y * uy, yy - x * (yz + uy)
        mobility = np.array(((vxx, vxy, ux), (vxy, vyy, uy), (ux, uy, zz)))
        return mobility, np.array((ax + y * az, ay - x * az, az))

    def _apply_friction(self, mobility: Array, acceleration: Array, normal_force: float, dt: float) -> None:
        """Solve the friction law for the coming step and put J^T f on the relative joints."""
        x, y, _ = self._slip_q.tolist()
        vx, vy, wz = self._slip_qd.tolist()
        v_free = np.array((vx + y * wz, vy - x * wz, wz))
        v_free += dt * acceleration
        contact = solve_contact(v_free, dt * mobility, normal_force, dt, self._law, self._state, self._rho)
        fx, fy, tau = contact.force.tolist()
        self._slip_tau[:] = fx, fy, tau + y * fx - x * fy
        self._next_state = contact.state

    def _friction_step(self, motion: tuple[Array, Array], normal_force: float, dt: float) -> None:
        """Put the friction of the coming step on the relative joints, given the motion without friction."""
        data = self.data
        self._apply_friction(*motion, normal_force, dt)
        if data.nefc:
            self._agree_with_joint_stops(normal_force, dt)
        self._state = self._next_state

    def _agree_with_joint_stops(self, normal_force: float, dt: float) -> None:
        """Repeat friction and the forces of active joint stops in turn until both fit; a pass gains a factor of 40."""
        data = self.data
        for _ in range(_STOP_PASSES):
            before = self._slip_tau.tolist()
            mujoco.mj_fwdActuation(self.model, data)
            mujoco.mj_fwdAcceleration(self.model, data)
            mujoco.mj_fwdConstraint(self.model, data)
            self._slip_tau[:] = 0.0
            motion = self._contact_motion(data.qfrc_applied - data.qfrc_bias + data.qfrc_constraint)
            self._apply_friction(*motion, normal_force, dt)
            if max(abs(x - y) for x, y in zip(before, self._slip_tau.tolist(), strict=True)) < _STOP_AGREEMENT:
                break
