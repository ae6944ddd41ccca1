"""Cross-check backend: the same grasp by MuJoCo's own contacts instead of our projection on the limit surface.

Per pad the elliptic cone of condim 4, (fx/mu)^2 + (fy/mu)^2 + (tau_z/(mu rho))^2 <= n^2, is the same ellipsoid.
MuJoCo's coefficient is constant within a step; here it follows F(s)/N at the slip speed of the sub-step before.
Slower than the default and only as exact as soft contacts are: a referee, not a simulator for long runs.
"""

from __future__ import annotations

import math

import mujoco
import numpy as np

from slip_core.arrays import Array, matrix_from_quat_xyzw
from slip_core.errors import InputError
from slip_sim_bridge.sim.laws import friction_law
from slip_sim_bridge.sim.model import FORCE_SENSOR, OBJECT, PAD, TORQUE_SENSOR
from slip_sim_bridge.sim.native_model import FRICTION_PAIRS, OBJECT_JOINTS, PAD_JOINTS, build_native_model
from slip_sim_bridge.sim.params import BridgeParams
from slip_sim_bridge.sim.plant import DivergenceError, gather

_FATAL_WARNINGS = (mujoco.mjtWarning.mjWARN_BADQPOS, mujoco.mjtWarning.mjWARN_BADQVEL, mujoco.mjtWarning.mjWARN_BADQACC)
_LONGEST_STEP_S = 0.00025
_SETTLING_S = 0.05
_LEAST_FRICTION = 1e-5  # MuJoCo's own lower bound
_LEAST_FORCE = 1e-3  # N
_PRESSING = 5000.0  # m/s2: grip force times the pads' compliance scale; makes them sink in by 0.4 mm


class NativePlant:
    """Arm and grasp with MuJoCo's contacts; see `Plant` for the meaning of the methods.

    Raises:
        InputError: for LuGre friction, whose bristles native contacts do not have.
    """

    def __init__(self, params: BridgeParams, urdf_text: str) -> None:
        if params.friction.model == "lugre":
            raise InputError(
                "parameter friction.model", got="lugre", expected="stribeck or coulomb with backend native"
            )
        self.model = model = build_native_model(params, urdf_text)
        self.data = mujoco.MjData(model)
        self._law = friction_law(params.friction)
        self._rho = params.friction.torsional_radius
        self._substeps = params.substeps or math.ceil(params.control_period_s / _LONGEST_STEP_S - 1e-9)
        model.opt.timestep = params.control_period_s / self._substeps
        self._gravity = np.array(params.gravity)
        self._initial = np.array(params.initial_position)
        self._p_R_o = matrix_from_quat_xyzw(params.contacts.orientation_xyzw[:4]).T

        joints = [model.joint(name) for name in params.joint_names]
        self._arm_q = np.array([joint.qposadr[0] for joint in joints])
        self._arm = np.array([joint.dofadr[0] for joint in joints])
        self._jaws = np.array([model.joint(name).dofadr[0] for name in PAD_JOINTS])
        self._pads = np.array([model.body(name).id for name in PAD_JOINTS])
        self._pairs = np.array([model.pair(name).id for name in FRICTION_PAIRS])
        x, y, _, ball = (model.joint(name).dofadr[0] for name in OBJECT_JOINTS)
        self._slip = np.array([x, y, ball + 2])
        limited = np.array([model.jnt_actfrclimited[joint.id] for joint in joints], dtype=bool)
        self._effort_limit = np.where(limited, [model.jnt_actfrcrange[joint.id, 1] for joint in joints], math.inf)
        self._body, self._pad = model.body(OBJECT).id, model.body(PAD).id
        force, torque = model.sensor(FORCE_SENSOR).adr[0], model.sensor(TORQUE_SENSOR).adr[0]
        self._sensor_index = np.r_[force : force + 3, torque : torque + 3]
        self.reset(params.grip.force)

    @property
    def effort_limit(self) -> Array:
        """Joint effort limits; (n,) [N m].

        Implements: ours: `effort` of the URDF's joint limits.
        """
        return self._effort_limit.copy()

    def reset(self, normal_force: float) -> None:
        """Put everything back to the initial posture, let pads and rollers settle, and start at rest; [N].

        Implements: ours: settling under the weight across the plane only, with arm and slip held.
        """
        model, data = self.model, self.data
        mujoco.mj_resetData(model, data)
        data.qpos[self._arm_q] = self._initial
        mujoco.mj_kinematics(model, data)
        normal = data.xmat[self._pad].reshape(3, 3)[:, 2]
        model.opt.gravity = normal * (normal @ self._gravity)
        self._prepare_contacts(normal_force, 0.0)
        mujoco.mj_step1(model, data)
        for _ in range(round(_SETTLING_S / model.opt.timestep)):
            data.qfrc_applied[self._arm] = self.holding_effort(self._initial, 0.0, 0.0)
            self._step(normal_force)
            data.qpos[self._arm_q] = self._initial
            data.qvel[self._arm] = 0.0
            data.qvel[self._slip] = 0.0
            mujoco.mj_step1(model, data)
        model.opt.gravity = self._gravity
        data.qvel[:] = 0.0
        data.time = 0.0
        mujoco.mj_forward(model, data)
        data.qfrc_applied[self._arm] = self.holding_effort(self._initial, 0.0, 0.0)
        mujoco.mj_forward(model, data)

    def advance(self, effort: Array, normal_force: float) -> None:
        """Advance one control period; (n,) [N m], [N].

        Implements: ours: mj_step1 of the next step runs at the end, so that all state belongs to the new stamp.
        """
        self.data.qfrc_applied[self._arm] = effort
        for _ in range(self._substeps):
            self._step(normal_force)
            mujoco.mj_step1(self.model, self.data)
        if any(self.data.warning[kind].number for kind in _FATAL_WARNINGS):
            raise DivergenceError(
                f"simulation diverged at {self.data.time:.4f} s; reset it, and lower gains or step size"
            )

    def holding_effort(self, target: Array, stiffness: float, damping: float) -> Array:
        """Return bias + M (stiffness (target - q) - damping qd) of the loaded arm; (n,) -> (n,) [N m].

        Implements: ours: computed-torque posture hold.
        """
        model, data = self.model, self.data
        full = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, full)
        pull = stiffness * (target - data.qpos[self._arm_q]) - damping * data.qvel[self._arm]
        return np.array(data.qfrc_bias[self._arm] + full[np.ix_(self._arm, self._arm)] @ pull)

    def read(self) -> Array:
        """Return everything that can be read, laid out by `Record`; (2 n + 36,).

        Implements: ours: all read-out methods in turn.
        """
        return gather(self)

    def joint_position(self) -> Array:
        """Joint positions; (n,) [rad].

        Implements: ours: state read-out.
        """
        return np.array(self.data.qpos[self._arm_q])

    def joint_velocity(self) -> Array:
        """Joint velocities; (n,) [rad/s].

        Implements: ours: state read-out.
        """
        return np.array(self.data.qvel[self._arm])

    def wrench(self) -> Array:
        """Wrench h_ee of the object on the robot in the step that just ended; (6,) [N, N m] {ee} axes.

        Implements: h_ee of Eq. (1), minus what the sensors of the pad body read; 0.2 g of pads count as object.
        """
        return -np.array(self.data.sensordata[self._sensor_index])

    def slip_displacement(self) -> Array:
        """Pose of {ee} in {p}; (6,) [m, rad] {p} axes.

        Implements: ours: relative pose of two free bodies, turned into a rotation vector.
        """
        data = self.data
        R_p, R_ee = data.xmat[self._body].reshape(3, 3), data.xmat[self._pad].reshape(3, 3)
        relative, rotation = np.zeros(4), np.zeros(3)
        mujoco.mju_mat2Quat(relative, (R_p.T @ R_ee).ravel())
        mujoco.mju_quat2Vel(rotation, relative, 1.0)
        return np.concatenate((R_p.T @ (data.xpos[self._pad] - data.xpos[self._body]), rotation))

    def slip_velocity(self) -> Array:
        """Return v_s = v_ee - G^T v_o; (6,) [m/s, rad/s] {ee} axes.

        Implements: Eq. (14), from the twists of both bodies at the pad centre.
        """
        pad, material = self._twist(self._pad), self._twist(self._body)
        arm = self.data.xpos[self._pad] - self.data.xpos[self._body]
        material[:3] += np.cross(material[3:], arm)
        R = self.data.xmat[self._pad].reshape(3, 3)
        return np.concatenate((R.T @ (pad[:3] - material[:3]), R.T @ (pad[3:] - material[3:])))

    def object_pose(self) -> tuple[Array, Array]:
        """Centre of mass (3,) [m] {w} and rotation (3, 3) {o} to {w}.

        Implements: ours: state read-out.
        """
        return self.data.xipos[self._body].copy(), self.data.xmat[self._body].reshape(3, 3) @ self._p_R_o

    def object_twist(self) -> Array:
        """Twist of the object at its centre of mass; (6,) [m/s, rad/s] {w}.

        Implements: v_o of Eq. (10).
        """
        twist = self._twist(self._body)
        twist[:3] += np.cross(twist[3:], self.data.xipos[self._body] - self.data.xpos[self._body])
        return twist

    def _twist(self, body: int) -> Array:
        """Twist of a body at its frame's origin; (6,) linear first, {w}."""
        spatial = np.zeros(6)
        mujoco.mj_objectVelocity(self.model, self.data, mujoco.mjtObj.mjOBJ_XBODY, body, spatial, 0)
        return np.concatenate((spatial[3:], spatial[:3]))

    def _step(self, normal_force: float) -> None:
        """Press the pads, finish this step, and prepare the contacts of the next."""
        self.data.qfrc_applied[self._jaws] = 0.5 * normal_force
        mujoco.mj_step2(self.model, self.data)
        vx, vy, _, _, _, wz = self.slip_velocity().tolist()
        self._prepare_contacts(normal_force, math.sqrt(vx * vx + vy * vy + (self._rho * wz) ** 2))

    def _prepare_contacts(self, normal_force: float, speed: float) -> None:
        """Choose coefficient and compliance of the contacts that the next `mj_step1` makes.

        A sliding contact of MuJoCo lifts off where it is pressed in by less than about 2 mu (time constant) (speed),
        so the pads are made as soft as the grip is weak: they sink in by the same depth under any grip.
        """
        pressed = max(normal_force, _LEAST_FORCE)
        mu = max(self._law.limit(speed, normal_force)[0] / pressed, _LEAST_FRICTION)
        self.model.pair_friction[self._pairs, :3] = (mu, mu, mu * self._rho)
        self.model.body_invweight0[self._pads, 0] = _PRESSING / pressed
