"""Layouts of the packed arrays that the tick's kernel takes and gives; numbers of one meaning lie together.

arm         see `arm_kernel`
tuning      K_D, gamma_k, D_D, gamma_d, M_D (6 each), alpha, k_s, spin_lever, spin_limit, mass, inertia (9), gravity (3)
contacts    one row per contact: position (3), rotation (9), slip_axes (6)
settings    feed-forward 0 or 1, null-space stiffness and damping, sigma_min, singular damping, effort limits (n)
samples     per contact: wrench (6), slip twist (6)
memory      attitude error (3), then per contact the slip displacement: position (3), rotation (9)
reference   position (3), rotation (9), twist (6), acceleration (6)
outcome     see `LawOutcome`
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from slip_core.arrays import Array, readonly
from slip_core.types import CartesianReference
from slip_vic_controller.core.grasp import Contact, SlipDisplacement
from slip_vic_controller.core.impedance import Gains
from slip_vic_controller.core.object_dynamics import ObjectModel


def pack_tuning(gains: Gains, model: ObjectModel) -> Array:
    """Return gains and object; (47,).

    Implements: ours: packed once and used until they change.
    """
    numbers = (gains.alpha, gains.k_s, gains.spin_lever, gains.spin_limit, model.mass)
    diagonals = (gains.K_D, gains.gamma_k, gains.D_D, gains.gamma_d, gains.M_D)
    return readonly(np.concatenate((*diagonals, numbers, model.inertia.ravel(), model.gravity)))


def pack_contacts(contacts: Iterable[Contact]) -> Array:
    """Return the contacts; (k, 18).

    Implements: ours: the kernel's view of the grasp.
    """
    return readonly([np.concatenate((c.position, c.rotation.ravel(), c.slip_axes)) for c in contacts])


def pack_memory(attitude_error: Array, slips: Sequence[SlipDisplacement]) -> Array:
    """Return what the law remembers; (3,) [rad] and (3,) [m], (3, 3) per contact -> (3 + 12 k,).

    Implements: ours: attitude branch and slip displacement are all the law's own memory.
    """
    return readonly(np.concatenate((attitude_error, *(part.ravel() for slip in slips for part in slip))))


def slips_of(memory: Array) -> tuple[SlipDisplacement, ...]:
    """Return the slip displacements of a memory; (3 + 12 k,) -> k of them.

    Implements: ours: the inverse of `pack_memory`.
    """
    rows = memory[3:].reshape(-1, 12)
    return tuple(SlipDisplacement(row[:3], row[3:].reshape(3, 3)) for row in rows)


def pack_reference(reference: CartesianReference) -> Array:
    """Return a reference; (24,) {w}.

    Implements: ours: one array for position, attitude, twist and acceleration.
    """
    parts = (reference.position, reference.rotation.ravel(), reference.twist, reference.acceleration)
    return readonly(np.concatenate(parts))


def unpack_reference(packed: Array) -> CartesianReference:
    """Return the reference of a packed one; (24,) {w}.

    Implements: ours: the inverse of `pack_reference`.
    """
    return CartesianReference(packed[:3], packed[3:12].reshape(3, 3), packed[12:18], packed[18:24])


class LawOutcome:
    """What a tick needs of the law, by name; a view of the packed outcome of n joints.

    near_singular: of the attitude; damping_squared: added near singularities of the arm; gate in [0, 1]; a_C, h_ee (6,)
    {w}; effort (n,) [N m]: torque inside the limits; torque (n,) [N m]: before them; saturated: how many joints are
    beyond. For the supervision: error_linear [m], error_angular [rad], slip_speed [m/s], and on {w}, linear part only,
    the object's acceleration and G^T a_o + Phi2 (3,) [m/s^2].
    """

    __slots__ = ("joints", "packed")

    def __init__(self, packed: Array, joints: int) -> None:
        self.packed, self.joints = packed, joints

    @staticmethod
    def size(joints: int) -> int:
        """Return the length of the packed outcome."""
        return 26 + 2 * joints

    @property
    def ok(self) -> bool:
        """Whether every number is finite and every factor exists."""
        return bool(self.packed[0] == 1.0)

    @property
    def damping_squared(self) -> float:
        """What was added to J B^-1 J^T."""
        return float(self.packed[1])

    @property
    def near_singular(self) -> bool:
        """Whether the attitude error is close to the half turn."""
        return bool(self.packed[2] == 1.0)

    @property
    def gate(self) -> float:
        """Gate of the compensation."""
        return float(self.packed[3])

    @property
    def error_linear(self) -> float:
        """Position error [m]."""
        return float(self.packed[4])

    @property
    def error_angular(self) -> float:
        """Orientation error [rad]."""
        return float(self.packed[5])

    @property
    def slip_speed(self) -> float:
        """Linear slip speed [m/s]."""
        return float(self.packed[6])

    @property
    def object_acceleration(self) -> Array:
        """Acceleration of the object; (3,) [m/s^2] {w}."""
        return self.packed[7:10]

    @property
    def carried(self) -> Array:
        """G^T a_o + Phi2, linear; (3,) [m/s^2] {w}."""
        return self.packed[10:13]

    @property
    def a_C(self) -> Array:
        """Control acceleration; (6,) {w}."""
        return self.packed[13:19]

    @property
    def h_ee(self) -> Array:
        """Wrench on the own pad; (6,) {w}."""
        return self.packed[19:25]

    @property
    def effort(self) -> Array:
        """Torque inside the limits; (n,) [N m]."""
        return self.packed[25 : 25 + self.joints]

    @property
    def torque(self) -> Array:
        """Torque before the limits; (n,) [N m]."""
        return self.packed[25 + self.joints : 25 + 2 * self.joints]

    @property
    def saturated(self) -> int:
        """Number of joints beyond their limits."""
        return int(self.packed[25 + 2 * self.joints])
