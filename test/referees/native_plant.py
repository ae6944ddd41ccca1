"""Another plant as a referee: the same grasp by MuJoCo's own contacts instead of our projection on the limit surface.

Per pad the elliptic cone of condim 4, (fx/mu)^2 + (fy/mu)^2 + (tau_z/(mu rho))^2 <= n^2, is the same ellipsoid.
MuJoCo's coefficient is constant within a step; here it follows F(s)/N at the slip speed of the sub-step before.
Slower than the rigid plant and only as exact as soft contacts are: a referee, not a simulator for long runs.

The object is free and pinched by two pads. It carries a flat plate in the slip plane. The light pads on slides press
on it from both sides, each with half of the grip force: contacts with friction (elliptic cone, condim 4) at the pad
centre. What the rigid plant takes for granted, that the object can only slip in the pads' plane, is done by smooth
rollers fixed to the gripper around the pads: contacts without friction, which carry weight and moments across the
plane but nothing within it.

The object has all six degrees of freedom, counted from the gripper (three slides and a ball joint) and not from the
world: MuJoCo's contacts leave out the acceleration that the motion of both bodies itself brings (Jdot qdot), and two
bodies that swing round together, one counted from the world, would creep apart by 2 mm/s in a fast move.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from typing import Any

import mujoco
import numpy as np

from slip_core.arrays import Array, matrix_from_quat_xyzw
from slip_core.compiled import IN1, REAL, kernel
from slip_core.errors import InputError
from slip_core.records import record
from slip_sim_bridge.friction import FrictionLaw, friction_law
from slip_sim_bridge.params import BridgeParams
from slip_sim_bridge.plant import ReadOut
from slip_sim_bridge.plant.model import (
    OBJECT,
    PAD,
    Divergence,
    add_pad,
    add_scenery,
    arm_spec,
    compile_spec,
    effort_limits,
    sensor_address,
    set_object_inertia,
)

PAD_JOINTS = ("native_pad_upper", "native_pad_lower")
OBJECT_JOINTS = ("native_object_x", "native_object_y", "native_object_z", "native_object_ball")

_PLATE_HALF_SIZE = 1.0  # m; where the pads end is `grip.pad_size`
_PLATE_HALF_THICKNESS = 0.005  # m
_TIP_RADIUS = 0.005  # m
_PAD_MASS = 1e-4  # kg each: light, so that the jaw force keeps them down on a sliding plate (they lift off at 1 g)
_ROLLER_CIRCLE = 0.05  # m
_ROLLERS_PER_SIDE = 3
_SOLREF = (0.002, 1.0)  # s, -: contacts as stiff as sub-steps of 0.25 ms allow with a factor of 8
_NOSLIP_ITERATIONS = 30
_LONGEST_STEP_S = 0.00025
_SETTLING_S = 0.05
_LEAST_FRICTION = 1e-5  # MuJoCo's own lower bound
_LEAST_FORCE = 1e-3  # N
_PRESSING = 5000.0  # m/s2: grip force times the pads' compliance scale; makes them sink in by 0.4 mm


@functools.cache
def sliding_friction(law: FrictionLaw) -> Any:
    """Compile F(parameters, speed [m/s], normal force [N]) [N] of steady sliding for a law."""
    layout = law.LAYOUT

    @kernel(REAL(IN1, REAL, REAL))
    def friction(parameters: Array, speed: float, normal_force: float) -> float:
        return law.limit(record(parameters, layout), speed, normal_force)[0]

    return friction


def build_model(params: BridgeParams, urdf_text: str) -> mujoco.MjModel:
    """Compile arm, pads, rollers, free object and sensors; joint friction of the URDF is left out.

    Raises:
        InputError: where the URDF does not parse or lacks the frame or a joint.

    Elliptic cones, condim 4, noslip solver, normal force by slides.
    """
    spec = arm_spec(params, urdf_text)
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.noslip_iterations = _NOSLIP_ITERATIONS
    spec.option.noslip_tolerance = 0.0
    for geom in spec.geoms:
        geom.contype = geom.conaffinity = 0

    pad = add_pad(spec, params.ee_frame)
    grasped = pad.add_body(name=OBJECT)
    set_object_inertia(grasped, params)
    for name, axis in zip(OBJECT_JOINTS[:3], np.eye(3), strict=True):
        grasped.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
    grasped.add_joint(name=OBJECT_JOINTS[3], type=mujoco.mjtJoint.mjJNT_BALL)
    plate = [_PLATE_HALF_SIZE, _PLATE_HALF_SIZE, _PLATE_HALF_THICKNESS]
    _add_geom(grasped, OBJECT, mujoco.mjtGeom.mjGEOM_BOX, plate, [0.0, 0.0, 0.0])

    height = _PLATE_HALF_THICKNESS + _TIP_RADIUS
    for name, side in zip(PAD_JOINTS, (1.0, -1.0), strict=True):
        slider = pad.add_body(name=name)
        slider.mass = _PAD_MASS
        slider.inertia = [0.4 * _PAD_MASS * _TIP_RADIUS**2] * 3
        slider.explicitinertial = True
        slider.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0.0, 0.0, -side])
        _add_geom(slider, name, mujoco.mjtGeom.mjGEOM_SPHERE, [_TIP_RADIUS, 0, 0], [0.0, 0.0, side * height])
        _add_pair(spec, name, condim=4)
        for k in range(_ROLLERS_PER_SIDE):
            angle = 2.0 * math.pi * k / _ROLLERS_PER_SIDE
            x, y = _ROLLER_CIRCLE * math.cos(angle), _ROLLER_CIRCLE * math.sin(angle)
            roller = f"{name}_roller_{k}"
            _add_geom(pad, roller, mujoco.mjtGeom.mjGEOM_SPHERE, [_TIP_RADIUS, 0, 0], [x, y, side * height])
            _add_pair(spec, roller, condim=1)
    add_scenery(spec, params, pad, grasped)
    for name in (OBJECT, *PAD_JOINTS):
        spec.geom(name).group = 3  # what computes is not what is drawn
    return compile_spec(spec)


def _add_geom(body: mujoco.MjsBody, name: str, kind: mujoco.mjtGeom, size: list[float], position: list[float]) -> None:
    body.add_geom(name=name, type=kind, size=size, pos=position, mass=0.0, contype=0, conaffinity=0)


def _add_pair(spec: mujoco.MjSpec, geom: str, *, condim: int) -> None:
    pair = spec.add_pair(name=geom, geomname1=geom, geomname2=OBJECT, condim=condim)
    pair.solref = np.array(_SOLREF)


class NativePlant:
    """Arm and grasp with MuJoCo's contacts; see `Plant` for the meaning of the methods.

    Raises:
        InputError: for a friction law with a state, which native contacts do not have.
    """

    def __init__(self, arms: Mapping[str, BridgeParams], urdfs: Mapping[str, str]) -> None:
        (params,), (urdf_text,) = arms.values(), urdfs.values()
        law, self._law = friction_law(params.friction)
        if law.STATEFUL:
            raise InputError(
                "parameter friction.model",
                got=params.friction.model,
                expected="a law without memory, such as stribeck or coulomb: native contacts have none",
            )
        self._friction = sliding_friction(law)
        self._rho = params.friction.torsional_radius
        self.model = model = build_model(params, urdf_text)
        self.data = data = mujoco.MjData(model)
        self.effort_limits = (effort_limits(model, params.joint_names),)
        self._divergence = Divergence(data)
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
        self._pairs = np.array([model.pair(name).id for name in PAD_JOINTS])
        x, y, _, ball = (model.joint(name).dofadr[0] for name in OBJECT_JOINTS)
        self._slip = np.array([x, y, ball + 2])
        self._body, self._pad = model.body(OBJECT).id, model.body(PAD).id
        self._readings: Array = data.sensordata[sensor_address(model)]
        self._at = ReadOut(len(joints))
        self.reset(np.array([params.grip.force]))

    def gripped_at(self, _arm: int) -> tuple[float, float]:
        """Where the point of the object that was gripped is on the pad, along x and y of {ee} [m]."""
        data = self.data
        x, y, _ = data.xmat[self._pad].reshape(3, 3).T @ (data.xpos[self._body] - data.xpos[self._pad])
        return float(x), float(y)

    def reset(self, normal_forces: Array) -> None:
        """Put everything back to the initial posture, let pads and rollers settle, and start at rest; [N].

        They settle under the weight across the plane only, with arm and slip held.
        """
        model, data, normal_force = self.model, self.data, float(normal_forces[0])
        mujoco.mj_resetData(model, data)
        data.qpos[self._arm_q] = self._initial
        mujoco.mj_kinematics(model, data)
        normal = data.xmat[self._pad].reshape(3, 3)[:, 2]
        model.opt.gravity = normal * (normal @ self._gravity)
        self._prepare_contacts(normal_force, 0.0)
        mujoco.mj_step1(model, data)
        for _ in range(round(_SETTLING_S / model.opt.timestep)):
            data.qfrc_applied[self._arm] = self.holding_effort(0, self._initial, 0.0, 0.0)
            self._step(normal_force)
            data.qpos[self._arm_q] = self._initial
            data.qvel[self._arm] = 0.0
            data.qvel[self._slip] = 0.0
            mujoco.mj_step1(model, data)
        model.opt.gravity = self._gravity
        data.qvel[:] = 0.0
        data.time = 0.0
        mujoco.mj_forward(model, data)
        data.qfrc_applied[self._arm] = self.holding_effort(0, self._initial, 0.0, 0.0)
        mujoco.mj_forward(model, data)

    def advance(self, efforts: Array, normal_forces: Array, drives: Array | None = None) -> None:
        """Advance one control period; (n,) [N m], [N].

        mj_step1 of the next step runs at the end, so that all state belongs to the new stamp.
        """
        assert drives is None, "ideal drives only"
        self.data.qfrc_applied[self._arm] = efforts
        for _ in range(self._substeps):
            self._step(float(normal_forces[0]))
            mujoco.mj_step1(self.model, self.data)
        self._divergence.check()

    def push(self, wrenches: Array) -> None:
        """Refuse a hand: with these contacts what it pushes slides away, however firmly it is gripped.

        Raises:
            InputError: there is a push.
        """
        if wrenches.any():
            raise InputError(
                "parameter push.wrench", got=wrenches.tolist(), expected="zeros with native contacts",
            )  # fmt: skip

    def holding_effort(self, _arm: int, target: Array, stiffness: float, damping: float) -> Array:
        """Return bias + M (stiffness (target - q) - damping qd) of the loaded arm; (n,) -> (n,) [N m]."""
        model, data = self.model, self.data
        full = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, full)
        pull = stiffness * (target - data.qpos[self._arm_q]) - damping * data.qvel[self._arm]
        return np.array(data.qfrc_bias[self._arm] + full[np.ix_(self._arm, self._arm)] @ pull)

    def read(self, _arm: int) -> Array:
        """Return everything that can be read, laid out by `ReadOut`; (2 n + 54,).

        The wrench counts 0.2 g of pads as object.
        """
        data, at, out = self.data, self._at, np.empty(self._at.size)
        out[at.position], out[at.velocity] = data.qpos[self._arm_q], data.qvel[self._arm]
        out[at.wrench] = -self._readings
        R_p, R_ee = data.xmat[self._body].reshape(3, 3), data.xmat[self._pad].reshape(3, 3)
        relative, rotation = np.zeros(4), np.zeros(3)
        mujoco.mju_mat2Quat(relative, (R_p.T @ R_ee).ravel())
        mujoco.mju_quat2Vel(rotation, relative, 1.0)
        between = R_p.T @ (data.xpos[self._pad] - data.xpos[self._body])
        out[at.slip_displacement] = np.concatenate((between, rotation))
        out[at.slip_velocity] = self._slip_velocity()
        out[at.object_position] = data.xipos[self._body]
        out[at.object_rotation] = (R_p @ self._p_R_o).ravel()
        twist = self._twist(self._body)
        twist[:3] += np.cross(twist[3:], data.xipos[self._body] - data.xpos[self._body])
        out[at.object_twist] = twist
        out[at.pad_position], out[at.pad_rotation] = data.xpos[self._pad], data.xmat[self._pad]
        out[at.pad_yield] = 0.0
        return out

    def _slip_velocity(self) -> Array:
        """Return v_s = v_ee - G^T v_o (Eq. 14) from the twists of both bodies at the pad centre; (6,) {ee}."""
        pad, material = self._twist(self._pad), self._twist(self._body)
        arm = self.data.xpos[self._pad] - self.data.xpos[self._body]
        material[:3] += np.cross(material[3:], arm)
        R = self.data.xmat[self._pad].reshape(3, 3)
        return np.concatenate((R.T @ (pad[:3] - material[:3]), R.T @ (pad[3:] - material[3:])))

    def _twist(self, body: int) -> Array:
        """Twist of a body at its frame's origin; (6,) linear first, {w}."""
        spatial = np.zeros(6)
        mujoco.mj_objectVelocity(self.model, self.data, mujoco.mjtObj.mjOBJ_XBODY, body, spatial, 0)
        return np.concatenate((spatial[3:], spatial[:3]))

    def _step(self, normal_force: float) -> None:
        """Press the pads, finish this step, and prepare the contacts of the next."""
        self.data.qfrc_applied[self._jaws] = 0.5 * normal_force
        mujoco.mj_step2(self.model, self.data)
        vx, vy, _, _, _, wz = self._slip_velocity().tolist()
        self._prepare_contacts(normal_force, math.sqrt(vx * vx + vy * vy + (self._rho * wz) ** 2))

    def _prepare_contacts(self, normal_force: float, speed: float) -> None:
        """Choose coefficient and compliance of the contacts that the next `mj_step1` makes.

        A sliding contact of MuJoCo lifts off where it is pressed in by less than about 2 mu (time constant) (speed),
        so the pads are made as soft as the grip is weak: they sink in by the same depth under any grip.
        """
        pressed = max(normal_force, _LEAST_FORCE)
        mu = max(self._friction(self._law, speed, normal_force) / pressed, _LEAST_FRICTION)
        self.model.pair_friction[self._pairs, :3] = (mu, mu, mu * self._rho)
        self.model.body_invweight0[self._pads, 0] = _PRESSING / pressed
