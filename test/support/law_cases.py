"""Random cases of the law: every record that one evaluation takes, and the same for the referee."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Annotated, Any

import numpy as np

from slip_core.arrays import Array
from slip_core.records import Pose, Record, Records, dtype_of, new, place, record
from slip_vic_controller.contact.observer import MOTION
from slip_vic_controller.law.arm import ARM
from slip_vic_controller.law.attitude import Coordinates
from slip_vic_controller.law.config import LAW_CONFIG
from slip_vic_controller.law.contact import ContactSample
from slip_vic_controller.law.evaluation import EVALUATION
from slip_vic_controller.law.gains import LAW_GAINS
from slip_vic_controller.law.law import evaluate, predict_motion, scale_acceleration
from slip_vic_controller.law.object import integrate_slips
from slip_vic_controller.law.symbols import SYMBOLS, published, symbols
from slip_vic_controller.path import paths
from slip_vic_controller.path.paths import PATH, REFERENCE
from slip_vic_controller.sizes import MAX_CONTACTS
from slip_vic_controller.state import OUTPUTS
from test.referees.law_referee import RefereeInput, exponential
from test.support.call import call

PI = math.pi


class Samples(Record):
    """A sample of each contact."""

    at: Annotated[Records[ContactSample], MAX_CONTACTS]


class Slips(Record):
    """A slip displacement of each contact."""

    at: Annotated[Records[Pose], MAX_CONTACTS]


SAMPLES, SLIPS = dtype_of(Samples), dtype_of(Slips)


def put_reference(path: Array, t: float, position: Array, rotation: Array, out: Array) -> None:
    """Write the REFERENCE of a path at a time to a buffer."""
    planned = call(paths.reference_at, record(path, PATH), t, position, rotation)
    call(paths.put_reference, record(out, REFERENCE), planned)


def reference_of(path: Array, t: float, position: Array, rotation: Array) -> Any:
    """Return the REFERENCE record of a path at a time."""
    out = new(REFERENCE)
    put_reference(path, t, position, rotation, out)
    return record(out, REFERENCE)


def turned(rng: np.random.Generator, angle: float) -> Array:
    axis = rng.standard_normal(3)
    return exponential(angle * axis / np.linalg.norm(axis))


class Case:
    """The buffers of one evaluation, and their records by name."""

    def __init__(self, joints: int, contacts: int) -> None:
        self.joints, self.contacts = joints, contacts
        layouts = (LAW_CONFIG, LAW_GAINS, ARM, SAMPLES, SLIPS, REFERENCE)
        self.buffers = [new(layout) for layout in layouts]
        views = [record(buffer, layout) for buffer, layout in zip(self.buffers, layouts, strict=True)]
        self.config, self.gains, self.arm, self.samples, self.slips, self.reference = views
        self.samples, self.slips = self.samples.at, self.slips.at
        self.follow_error, self.previous = np.zeros(6), np.zeros(3)
        self.q, self.qd, self.posture = np.zeros(joints), np.zeros(joints), np.zeros(joints)
        self.config.joints, self.config.contacts = joints, contacts

    @property
    def v_s(self) -> Array:
        """The slip velocity that the law sees; (6,) {ee}."""
        return np.array(self.config.contact[0].slip_axes * self.samples[0].slip_twist)

    def evaluate(self, factor: float | None = None) -> Any:
        """Return the EVALUATION record; its buffer is `evaluation`. `factor`: of the acceleration that is commanded."""
        given = new(OUTPUTS)
        config, gains, arm, samples, slips, reference = self.buffers
        buffers = {"gains": gains, "samples": samples, "slips": slips, "reference": reference}
        buffers["follow_error"] = self.follow_error
        for name, buffer in buffers.items():
            given[place(OUTPUTS, name)] = buffer
        given_record = record(given, OUTPUTS)
        call(evaluate, config, arm, self.q, self.qd, self.posture, self.previous, given_record)
        if factor is not None:
            call(scale_acceleration, config, arm, self.q, self.qd, self.posture, factor, given_record)
        self.evaluation = given[place(OUTPUTS, "law")]
        return record(self.evaluation, EVALUATION)

    def symbols(self) -> dict[str, float]:
        """Return the published numbers of the case, after `evaluate`."""
        config, gains, arm, _, slips, reference = self.buffers
        out = new(SYMBOLS)
        call(symbols, config, gains, arm, slips, record(reference, REFERENCE), self.evaluation, 0.0, out)
        names, places = published(self.joints)
        return dict(zip(names, out[places].tolist(), strict=True))

    def motion(self, slip_twist: Array) -> tuple[bool, Any]:
        """Return whether every sample is finite, and the MOTION record for an observer."""
        config, gains, arm, samples, slips, _ = self.buffers
        out = new(MOTION)
        finite = call(predict_motion, config, gains, arm, samples, slips, slip_twist, record(out, MOTION))
        return bool(finite), record(out, MOTION)

    def move_slips(self, dt: float) -> None:
        """Integrate the slip displacements in place."""
        config, _, _, samples, slips, _ = self.buffers
        call(integrate_slips, record(config, LAW_CONFIG), samples, slips, dt, slips)

    def referee(self) -> RefereeInput:
        """Return the same case for the referee."""
        n, k, c, g = self.joints, self.contacts, self.config, self.gains.gains
        arm = SimpleNamespace(
            position=self.arm.position, rotation=self.arm.rotation, twist=self.arm.twist, jdot_qd=self.arm.jdot_qd,
            bias=self.arm.bias[:n], J=self.arm.J[:, :n], M=self.arm.M[:n, :n],
        )  # fmt: skip
        return RefereeInput(
            arm=arm,
            reference=self.reference,
            wrenches=[self.samples[i].wrench for i in range(k)],
            slip_twist=self.v_s,
            slip_positions=[self.slips[i].position for i in range(k)],
            slip_rotations=[self.slips[i].rotation for i in range(k)],
            contact_positions=[self.gains.contact_position, *(c.contact[i].position for i in range(1, k))],
            contact_rotations=[c.contact[i].rotation for i in range(k)],
            slip_axes=c.contact[0].slip_axes,
            object=self.gains.object,
            gains=SimpleNamespace(**{name: np.array(g[name]) for name in g.dtype.names}),
            attitude="rpy" if c.attitude == Coordinates.RPY else "log",
            tau_0=c.nullspace_stiffness * (self.posture - self.q) - c.nullspace_damping * self.qd,
            previous=self.previous,
            follow_error=self.follow_error,
            sigma_min=c.sigma_min,
            most_damping=c.most_damping,
            radius=c.radius,
        )


def random_case(
    seed: int,
    *,
    joints: int = 7,
    contacts: int = 1,
    attitude: int = Coordinates.LOG,
    angle: float | None = None,
    slip: float = 0.01,
    spin_limit: float = math.inf,
    length: float = 1.0,
    observed: bool = False,
    slip_axes: Any = None,
    kappa: float = 0.0,
) -> Case:
    """Return a case of ordinary sizes; `angle` is that of the orientation error [rad], `slip` a speed [m/s, rad/s]."""
    rng = np.random.default_rng(seed)
    case = Case(joints, contacts)
    c, g, arm, ref = case.config, case.gains, case.arm, case.reference
    c.attitude = attitude
    c.nullspace_stiffness, c.nullspace_damping = 10.0, 2.0
    # Fewer than six joints are singular at every posture: there the torque needs the damping.
    c.sigma_min, c.most_damping = (0.04 if joints < 6 else 1e-9), 0.3
    c.effort_limit[:joints], c.radius, g.gains.kappa = 87.0, 0.03, kappa
    for i in range(contacts):
        c.contact[i].position[:], c.contact[i].rotation[:] = (
            0.1 * rng.standard_normal(3),
            turned(rng, rng.uniform(0, PI)),
        )
        c.contact[i].slip_axes[:] = rng.integers(0, 2, 6) if slip_axes is None else slip_axes
        case.slips[i].position[:] = 0.01 * rng.standard_normal(3)
        case.slips[i].rotation[:] = turned(rng, rng.uniform(0, 0.5))
        case.samples[i].wrench[:] = rng.standard_normal(6)
        case.samples[i].slip_twist[:] = slip * rng.standard_normal(6)
    g.contact_position[:] = 0.1 * rng.standard_normal(3)
    for name in ("K_D", "D_D", "M_D"):
        getattr(g.gains, name)[:] = rng.uniform(0.5, 50.0, 6)
    g.gains.gamma_k[:], g.gains.gamma_d[:] = rng.uniform(0.0, 100.0, (2, 6))
    g.gains.alpha, g.gains.k_s = rng.uniform(0.0, 100.0), rng.uniform(1.0, 1000.0)
    g.gains.characteristic_length, g.gains.spin_limit = length, spin_limit
    unit = turned(rng, rng.uniform(0.0, PI))
    g.object.mass, g.object.gravity[:] = rng.uniform(0.1, 5.0), rng.standard_normal(3)
    g.object.inertia[:] = unit @ np.diag(rng.uniform(2e-3, 3e-3, 3)) @ unit.T
    root = rng.standard_normal((joints, joints))
    M = root @ root.T + np.eye(joints)
    arm.M[:joints, :joints] = 0.5 * (M + M.T)
    arm.J[:, :joints] = rng.standard_normal((6, joints))
    arm.bias[:joints], arm.jdot_qd[:] = rng.standard_normal(joints), rng.standard_normal(6)
    arm.position[:], arm.twist[:] = rng.standard_normal(3), rng.standard_normal(6)
    arm.rotation[:] = turned(rng, rng.uniform(0.0, PI))
    error = turned(rng, rng.uniform(0.0, 2.0) if angle is None else angle)
    if attitude == Coordinates.RPY:  # away from gimbal lock, where the referee has no answer
        error = exponential(rng.normal(scale=0.4, size=3))
    ref.position[:] = arm.position + 0.1 * rng.standard_normal(3)
    ref.rotation[:] = error.T @ arm.rotation if attitude == Coordinates.LOG else arm.rotation @ error.T
    ref.twist[:], ref.acceleration[:] = rng.standard_normal((2, 6))
    case.follow_error = rng.standard_normal(6) if observed else np.zeros(6)
    case.previous = rng.standard_normal(3)
    case.q, case.qd, case.posture = rng.standard_normal((3, joints))
    return case
