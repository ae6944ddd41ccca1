"""The MuJoCo model of the cross-check: a free object pinched by two pads, all forces by MuJoCo's own contacts.

The object carries a flat plate in the slip plane. Two light pads on slides press on it from both sides, each with
half of the grip force: contacts with friction (elliptic cone, condim 4) at the pad centre. What the default backend
takes for granted, that the object can only slip in the pads' plane, is done by smooth rollers fixed to the gripper
around the pads: contacts without friction, which carry weight and moments across the plane but nothing within it.

The object has all six degrees of freedom, counted from the gripper (three slides and a ball joint) and not from the
world: MuJoCo's contacts leave out the acceleration that the motion of both bodies itself brings (Jdot qdot), and two
bodies that swing round together, one counted from the world, would creep apart by 2 mm/s in a fast move.
"""

from __future__ import annotations

import math

import mujoco
import numpy as np

from slip_sim_bridge.sim.model import (
    FORCE_SENSOR,
    OBJECT,
    PAD,
    TORQUE_SENSOR,
    arm_spec,
    compile_spec,
    set_object_inertia,
)
from slip_sim_bridge.sim.params import BridgeParams

PAD_JOINTS = ("native_pad_upper", "native_pad_lower")
FRICTION_PAIRS = PAD_JOINTS
OBJECT_JOINTS = ("native_object_x", "native_object_y", "native_object_z", "native_object_ball")

_PLATE_HALF_SIZE = 1.0  # m; the object cannot leave the pads
_PLATE_HALF_THICKNESS = 0.005  # m
_TIP_RADIUS = 0.005  # m
_PAD_MASS = 1e-4  # kg each: light, so that the jaw force keeps them down on a sliding plate (they lift off at 1 g)
_ROLLER_CIRCLE = 0.05  # m
_ROLLERS_PER_SIDE = 3
_SOLREF = (0.002, 1.0)  # s, -: contacts as stiff as sub-steps of 0.25 ms allow with a factor of 8
_NOSLIP_ITERATIONS = 30


def build_native_model(params: BridgeParams, urdf_text: str) -> mujoco.MjModel:
    """Compile arm, pads, rollers, free object and sensors; joint friction of the URDF is left out.

    Raises:
        InputError: where the URDF does not parse or lacks the frame or a joint.

    Implements: ours: elliptic cones, condim 4, noslip solver, normal force by slides.
    """
    spec = arm_spec(params, urdf_text)
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.noslip_iterations = _NOSLIP_ITERATIONS
    spec.option.noslip_tolerance = 0.0
    for geom in spec.geoms:
        geom.contype = geom.conaffinity = 0

    pad = spec.body(params.ee_frame).add_body(name=PAD)
    site = pad.add_site(name=PAD)
    for name, kind in ((FORCE_SENSOR, mujoco.mjtSensor.mjSENS_FORCE), (TORQUE_SENSOR, mujoco.mjtSensor.mjSENS_TORQUE)):
        spec.add_sensor(name=name, type=kind, objtype=mujoco.mjtObj.mjOBJ_SITE, objname=site.name)

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
    return compile_spec(spec)


def _add_geom(body: mujoco.MjsBody, name: str, kind: mujoco.mjtGeom, size: list[float], position: list[float]) -> None:
    body.add_geom(name=name, type=kind, size=size, pos=position, mass=0.0, contype=0, conaffinity=0)


def _add_pair(spec: mujoco.MjSpec, geom: str, *, condim: int) -> None:
    pair = spec.add_pair(name=geom, geomname1=geom, geomname2=OBJECT, condim=condim)
    pair.solref = np.array(_SOLREF)
