"""Referee: the grasp a second time, in Drake: two compliant pads, a rigid plate, patch contact (hydroelastic), SAP.

The plate has the object's mass and inertia, and its frame {p} is the one the bridge calls so. Friction is Coulomb's in
every point of both patches; a limit surface is what comes of it. The pads are discs of 1.5 torsional radii, so that
uniform pressure gives that radius. One pad is fixed to the hand, the other one is a jaw, pressed with half of the grip.

What the bridge takes for granted is granted here, too: on the axes that cannot slip the hand carries the plate. The
part of the weight along the pads' normal acts on the hand, not on the plate, and counts as measured.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from typing import Final

import numpy as np
from pydrake.common import MemoryFile
from pydrake.geometry import (
    AddCompliantHydroelasticProperties,
    AddContactMaterial,
    AddRigidHydroelasticProperties,
    Cylinder,
    InMemoryMesh,
    Mesh,
    ProximityProperties,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.math import SpatialForce, SpatialVelocity
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import (
    AddMultibodyPlant,
    CoulombFriction,
    ExternallyAppliedSpatialForce,
    MultibodyPlantConfig,
)
from pydrake.multibody.tree import JacobianWrtVariable, PrismaticJoint, SpatialInertia, UnitInertia
from pydrake.systems.framework import DiagramBuilder
from scipy.spatial.transform import Rotation

from slip_core.arrays import inertia_from_six, matrix_from_quat_xyzw
from slip_core.records import new, record
from slip_sim_bridge.plant import DivergenceError, read_out

PAD_THICKNESS: Final = 0.01  # m
MODULUS: Final = 400.0  # Pa
"""Of the pads' foam: the weakest grip presses them in by 0.5 mm. SAP lets a contact that slides glide on a film of
mu v (dt + relaxation time), here up to 0.1 mm; pads that are pressed in by less than that lift off and chatter."""
RELAXATION_S: Final = 0.001  # of the pads: a step
RIM: Final = 20  # edges of the polygon that stands for a pad
PLATE_MESH: Final = 0.05  # m, grid on the plate's faces
PLATE: Final = (0.3, 0.014)  # m, edge and thickness: the pads never come to an edge
SETTLING: Final = 50  # steps
HAND_KG: Final = 1.0  # of a hand without an arm, whose motion is put
JAW_KG: Final = 1e-3


def plate_mesh() -> Mesh:
    """Both faces of the plate as grids of triangles: the finer, the more points the patch has friction in."""
    edge, thickness = PLATE
    n = round(edge / PLATE_MESH)
    marks = np.linspace(-0.5 * edge, 0.5 * edge, n + 1)
    vertices = [(x, y, side * 0.5 * thickness) for side in (-1, 1) for x in marks for y in marks]
    faces = []
    for side, first in ((-1, 1), (1, 1 + (n + 1) ** 2)):
        for corner in (first + i * (n + 1) + j for i in range(n) for j in range(n)):
            across = corner + n + 2
            for triangle in ((corner, corner + n + 1, across), (corner, across, corner + 1)):
                faces.append(triangle[::side])
    lines = ["v {:.9g} {:.9g} {:.9g}".format(*v) for v in vertices] + ["f {} {} {}".format(*f) for f in faces]
    return Mesh(InMemoryMesh(mesh_file=MemoryFile("\n".join(lines), ".obj", "plate")))


def polygon(radius: float) -> tuple[float, float]:
    """Radius of a cylinder that Drake makes a prism of with the area of the disc, and the edges that it has [m]."""
    outer = radius * np.sqrt(np.pi / (0.5 * RIM * np.sin(2.0 * np.pi / RIM)))
    return outer, 2.0 * np.pi * outer / (RIM - 0.5)


def surface(mu: float, edge: float | None = None) -> ProximityProperties:
    """Friction of a surface, and what it is made of: rigid, or soft with a mesh of these edges [m]."""
    made = ProximityProperties()
    AddContactMaterial(friction=CoulombFriction(mu, mu), properties=made)
    made.AddProperty("material", "relaxation_time", RELAXATION_S)
    if edge is None:
        AddRigidHydroelasticProperties(made)
    else:
        AddCompliantHydroelasticProperties(edge, MODULUS, made)
    return made


def without_shapes(robot: ET.Element) -> str:
    """The arm's URDF without what is drawn, and without MuJoCo's own element."""
    for parent, names in [(robot, ("material", "mujoco")), *((link, ("visual", "collision")) for link in robot)]:
        for found in [child for child in parent if child.tag in names]:
            parent.remove(found)
    return ET.tostring(robot, encoding="unicode")


def drake_plant(params, urdfs) -> DrakePlant:
    """Make the plant for a `Simulation` of one arm."""
    (one,), (urdf,) = params.values(), urdfs.values()
    return DrakePlant(one, urdf)


class DrakePlant:
    """Hand, pads and plate of the bridge's parameters; on the arm of `urdf` it is a plant of the bridge."""

    def __init__(self, params, urdf: str | None = None) -> None:
        self.dt, self.mass, self.gravity = params.control_period_s, params.object.mass, np.array(params.gravity)
        self.o_R_p = matrix_from_quat_xyzw(params.contacts.orientation_xyzw[:4])
        self.com = -self.o_R_p.T @ np.array(params.contacts.position[:3])  # on {p}
        mu, radius = params.friction.mu_k, 1.5 * params.friction.torsional_radius
        self.pressed_in = 0.25 * params.grip.force * PAD_THICKNESS / (MODULUS * np.pi * radius**2)

        builder = DiagramBuilder()
        config = MultibodyPlantConfig(
            time_step=self.dt, contact_model="hydroelastic", discrete_contact_approximation="sap"
        )
        self.plant, _ = plant, _ = AddMultibodyPlant(config, builder)
        plant.mutable_gravity_field().set_gravity_vector(params.gravity)
        grasp, plates = plant.AddModelInstance("grasp"), plant.AddModelInstance("plate")
        self.names = []
        if urdf is None:
            self.hand = plant.AddRigidBody("hand", grasp, SpatialInertia.SolidSphereWithMass(HAND_KG, 0.1))
        else:
            robot = ET.fromstring(urdf)
            (arm,) = Parser(plant).AddModelsFromString(without_shapes(robot), "urdf")
            plant.WeldFrames(plant.world_frame(), plant.GetBodyByName(robot.find("link").get("name")).body_frame())
            self.hand, self.names = plant.GetBodyByName(params.ee_frame, arm), list(params.joint_names)
        jaw = plant.AddRigidBody("jaw", grasp, SpatialInertia.SolidSphereWithMass(JAW_KG, 0.01))
        sliding = PrismaticJoint("jaw", self.hand.body_frame(), jaw.body_frame(), [0.0, 0.0, 1.0])
        self.jaw = plant.AddJoint(sliding)
        self.plate = plant.AddRigidBody("plate", plates, self._plate_inertia(params))
        for instance in (grasp, plates):
            plant.set_gravity_enabled(instance, False)
        away, (outer, edge) = 0.5 * (PLATE[1] + PAD_THICKNESS), polygon(radius)
        disc = Cylinder(outer, PAD_THICKNESS)
        plant.RegisterCollisionGeometry(self.plate, RigidTransform(), plate_mesh(), "plate", surface(mu))
        for body, z in ((self.hand, self.pressed_in - away), (jaw, away)):
            plant.RegisterCollisionGeometry(body, RigidTransform([0, 0, z]), disc, "pad", surface(mu, edge))
        plant.Finalize()

        self.diagram = builder.Build()
        self.root = self.diagram.CreateDefaultContext()
        self.context = plant.GetMyMutableContextFromRoot(self.root)
        joints = [plant.GetJointByName(name) for name in self.names]
        self.q_at = np.array([joint.position_start() for joint in joints], int)
        self.v_at = np.array([joint.velocity_start() for joint in joints], int)
        self.layout = read_out(len(joints))
        self.contact_port = plant.get_generalized_contact_forces_output_port(plates)
        self.pushed, self.contact = np.zeros(6), np.zeros(6)
        self.solved = np.zeros(3), np.zeros(3)
        self.start = np.zeros(3), np.eye(3)
        self.initial = np.array(params.initial_position[: len(joints)])
        self.reset([params.grip.force])

    def _plate_inertia(self, params) -> SpatialInertia:
        J = self.o_R_p.T @ inertia_from_six(params.object.inertia) @ self.o_R_p / self.mass
        J = J + self.com @ self.com * np.eye(3) - np.outer(self.com, self.com)  # about {p}
        unit = UnitInertia(J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2])
        return SpatialInertia(self.mass, self.com, unit)

    # Poses and twists [m, rad] {w}, of hand or plate.
    def pose(self, body) -> tuple[np.ndarray, np.ndarray]:
        """Position (3,) and rotation (3, 3)."""
        at = body.EvalPoseInWorld(self.context)
        return at.translation(), at.rotation().matrix()

    def twist(self, body) -> tuple[np.ndarray, np.ndarray]:
        """Velocity (3,) of the origin, and angular velocity (3,)."""
        moving = body.EvalSpatialVelocityInWorld(self.context)
        return moving.translational(), moving.rotational()

    def put(self, body, position, rotation, velocity=(0.0, 0.0, 0.0), turning=(0.0, 0.0, 0.0)) -> None:
        """Put a free body somewhere, in motion."""
        at = RigidTransform(RotationMatrix.ProjectToRotationMatrix(rotation), position)
        self.plant.SetFreeBodyPose(self.context, body, at)
        self.plant.SetFreeBodySpatialVelocity(self.context, body, SpatialVelocity(w=turning, v=velocity))

    # The bridge's interface of a plant.
    def gripped_at(self, _arm: int) -> tuple[float, float]:
        (x_h, R_h), (x_p, _) = self.pose(self.hand), self.pose(self.plate)
        x, y, _ = R_h.T @ (x_p - x_h)
        return float(x), float(y)

    def reset(self, normal_forces) -> None:
        plant, context = self.plant, self.context
        plant.SetVelocities(context, np.zeros(plant.num_velocities()))
        self.jaw.set_translation(context, -self.pressed_in)
        for k in range(SETTLING):
            self._hold_still()
            if k == 0:
                self.put(self.plate, *self.pose(self.hand))
            # An arm that fell during the step would drag the plate, which would then begin with slip.
            effort = self.holding_effort(0, self.initial, 0.0, 0.0) if self.names else np.zeros(0)
            self._step(effort, float(normal_forces[0]))
        self._hold_still()
        self.put(self.plate, *self.pose(self.plate))
        self.solved = np.zeros(3), np.zeros(3)

    def take(self, pose, normal_force: float) -> None:
        """Begin with a hand without an arm at a pose (position (3,), rotation (3, 3)) {w}, at rest."""
        self.start = pose
        self.reset([normal_force])

    def _hold_still(self) -> None:
        if not self.names:
            self.put(self.hand, *self.start)
            return
        q, v = self.plant.GetPositions(self.context), self.plant.GetVelocities(self.context)
        q[self.q_at], v[self.v_at] = self.initial, 0.0
        self.plant.SetPositions(self.context, q)
        self.plant.SetVelocities(self.context, v)

    def advance(self, efforts, normal_forces, drives=None) -> None:
        assert drives is None, "ideal drives only"
        self._step(efforts, float(normal_forces[0]))
        if not np.isfinite(self.plant.GetPositionsAndVelocities(self.context)).all():
            raise DivergenceError("Drake diverged")

    def push(self, wrenches) -> None:
        self.pushed = wrenches[0]

    def holding_effort(self, _arm: int, target, stiffness: float, damping: float):
        """Of the arm and the weight it carries, without the plate's inertia."""
        plant, context, at = self.plant, self.context, self.v_at
        M = plant.CalcMassMatrix(context)[np.ix_(at, at)]
        q, v = plant.GetPositions(context)[self.q_at], plant.GetVelocities(context)[at]
        bias = (plant.CalcBiasTerm(context) - plant.CalcGravityGeneralizedForces(context))[at]
        x_p, R_p = self.pose(self.plate)
        hand, world, point = self.hand.body_frame(), plant.world_frame(), self._on(self.hand, x_p + R_p @ self.com)
        J = plant.CalcJacobianTranslationalVelocity(context, JacobianWrtVariable.kV, hand, point, world, world)[:, at]
        return bias - J.T @ (self.mass * self.gravity) + M @ (stiffness * (target - q) - damping * v)

    def read(self, _arm: int = 0):
        (x_h, R_h), (x_p, R_p) = self.pose(self.hand), self.pose(self.plate)
        v_p, w_p = self.twist(self.plate)
        x_c, carried, out = x_p + R_p @ self.com, self._carried(R_h), new(self.layout)
        read = record(out, self.layout)
        torque, force = self.contact[:3], self.contact[3:]  # on the plate, about {p}
        turning = np.cross(x_c - x_h, carried) - torque - np.cross(x_p - x_h, force)
        read.wrench = np.concatenate((R_h.T @ (carried - force), R_h.T @ turning))
        rotation = Rotation.from_matrix(R_p.T @ R_h).as_rotvec()
        read.slip_displacement = np.concatenate((R_p.T @ (x_h - x_p), rotation))
        sliding, spinning = self.solved if self.names else self._relative()
        read.slip_velocity = np.concatenate((R_h.T @ sliding, R_h.T @ spinning))
        read.object_position, read.object_rotation = x_c, R_p @ self.o_R_p.T
        read.pad_position, read.pad_rotation = x_h, R_h
        read.object_twist = np.concatenate((v_p + np.cross(w_p, x_c - x_p), w_p))
        read.position = self.plant.GetPositions(self.context)[self.q_at]
        read.velocity = self.plant.GetVelocities(self.context)[self.v_at]
        return out

    def _relative(self) -> tuple[np.ndarray, np.ndarray]:
        """Velocity of the pad over the plate's material, and its turning over the plate; (3,) {w}."""
        (v_h, w_h), (v_p, w_p) = self.twist(self.hand), self.twist(self.plate)
        return v_h - v_p - np.cross(w_p, self.pose(self.hand)[0] - self.pose(self.plate)[0]), w_h - w_p

    def slip(self) -> np.ndarray:
        """Pad on the plate: x, y [m] and angle [rad]; (3,) {p}."""
        return record(self.read(), self.layout).slip_displacement[[0, 1, 5]]

    def slip_rate(self) -> np.ndarray:
        """Pad over the plate's material: x, y [m/s] and turning [rad/s]; (3,) {ee}."""
        return record(self.read(), self.layout).slip_velocity[[0, 1, 5]]

    def follow(self, pose, pose_next, normal_force: float) -> None:
        """Move a hand without an arm from one pose to the next in a step; (position (3,), rotation (3, 3)) {w}."""
        velocity = (pose_next[0] - pose[0]) / self.dt
        turning = Rotation.from_matrix(pose_next[1] @ pose[1].T).as_rotvec() / self.dt
        self.put(self.hand, *pose, velocity, turning)
        self._step(np.zeros(0), normal_force)
        self.put(self.hand, *pose_next, velocity, turning)

    def _carried(self, R_h) -> np.ndarray:
        """The part of the weight along the pads' normal; (3,) [N] {w}."""
        normal = R_h[:, 2]
        return normal * (normal @ (self.mass * self.gravity))

    def _on(self, body, point) -> np.ndarray:
        x, R = self.pose(body)
        return R.T @ (point - x)

    def _step(self, effort, normal_force: float) -> None:
        plant, force = self.plant, np.zeros(self.plant.num_velocities())
        force[self.v_at] = effort
        force[self.jaw.velocity_start()] = -0.5 * normal_force
        plant.get_applied_generalized_force_input_port().FixValue(self.context, force)
        x_p, R_p = self.pose(self.plate)
        x_c, carried = x_p + R_p @ self.com, self._carried(self.pose(self.hand)[1])
        weight = self.mass * self.gravity - carried
        acting = [(self.plate, x_c, weight, np.zeros(3)), (self.plate, x_p, self.pushed[:3], self.pushed[3:])]
        if self.names:
            acting.append((self.hand, x_c, carried, np.zeros(3)))
        else:  # the step's load, as it was in the last one, would push a hand that has no arm out of its way
            acting.append((self.hand, x_p, self.contact[3:], self.contact[:3]))
        applied = []
        for body, point, f, tau in acting:
            one = ExternallyAppliedSpatialForce()
            one.body_index, one.p_BoBq_B = body.index(), self._on(body, point)
            one.F_Bq_W = SpatialForce(tau=tau, f=f)
            applied.append(one)
        plant.get_applied_spatial_force_input_port().FixValue(self.context, applied)
        before, hand_before = plant.GetPositions(self.context).copy(), self.pose(self.hand)
        self.diagram.ExecuteForcedEvents(self.root)
        self.contact = self.contact_port.Eval(self.context)
        if self.names:
            self._solved_twists(before, hand_before)

    def _solved_twists(self, before, hand_before) -> None:
        """Take slip from where the solver holds the contact: the posture before the step.

        In the posture after it the hand's velocity differs by Jdot qd dt, up to 0.05 mm/s here, and its way by half of
        that, because joints move the hand on a curve and the free plate's step is straight. Neither is slip, but 0.2 mm
        add up on the path, and the controller takes the speed for one. So the plate goes along with the hand's curve.
        """
        plant, after = self.plant, self.plant.GetPositions(self.context).copy()
        plant.SetPositions(self.context, before)
        self.solved, (v_h, w_h) = self._relative(), self.twist(self.hand)
        plant.SetPositions(self.context, after)
        (x_h, R_h), (x_p, R_p), (v_p, w_p) = self.pose(self.hand), self.pose(self.plate), self.twist(self.plate)
        straight = Rotation.from_rotvec(self.dt * w_h).as_matrix() @ hand_before[1]
        self.put(self.plate, x_p + x_h - hand_before[0] - self.dt * v_h, R_h @ straight.T @ R_p, v_p, w_p)
