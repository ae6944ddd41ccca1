"""The record of one tick: every intermediate symbol of the law, and a flat list of numbers to plot."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slip_core.arrays import Array, readonly
from slip_core.types import CartesianReference
from slip_vic_controller.core.arm import ArmTerms
from slip_vic_controller.core.attitude import AttitudeError
from slip_vic_controller.core.grasp import SlipDisplacement, grasp_matrix
from slip_vic_controller.core.impedance import Gains
from slip_vic_controller.core.law import GraspTerms, LawTerms
from slip_vic_controller.core.lyapunov import V_e, V_s
from slip_vic_controller.core.object_dynamics import ObjectModel, P
from slip_vic_controller.core.observer_types import SlipEstimate
from slip_vic_controller.core.operational import TorqueTerms
from slip_vic_controller.core.packing import LawOutcome
from slip_vic_controller.core.rotation import log_so3

Status = Literal["ok", "safe"]
AXES = ("x", "y", "z", "rx", "ry", "rz")


class TickTerms(NamedTuple):
    """All records of an evaluated law, the gains and the object in effect among them."""

    gains: Gains
    object_model: ObjectModel
    arm: ArmTerms
    reference: CartesianReference
    attitude: AttitudeError
    slip: SlipDisplacement
    h_ee: Array
    grasp: GraspTerms
    law: LawTerms
    torque: TorqueTerms
    estimate: SlipEstimate | None

    @property
    def G(self) -> Array:
        """Grasp matrix of the own contact, Eq. (18); (6, 6) {w}."""
        return grasp_matrix(self.grasp.r)

    @property
    def P(self) -> Array:
        """The P of Eq. (20); (6, 6) {w}."""
        return P(self.object_model, self.grasp.R_o, self.grasp.v_o[3:], self.grasp.r)

    @property
    def V_e(self) -> float:
        """Lyapunov function of the impedance, Eq. (24) [J]."""
        return V_e(self.gains.M_D, self.gains.K_D, self.law.e, self.law.e_dot)

    @property
    def V_s(self) -> float:
        """Lyapunov function of the slip, Eq. (30)."""
        return V_s(self.law.v_s)

    def freeze(self) -> None:
        """Make the arrays read-only that a tick has made; those handed in are so already."""
        law, attitude, torque = self.law, self.attitude, self.torque
        own = (self.h_ee, law.v_s, law.e, law.e_dot, law.K, law.D, law.comp, law.Lambda, law.Theta, law.Z, law.a_C)
        parts = (attitude.error, attitude.rate, attitude.T_e, attitude.T_e_inverse, attitude.Theta)
        torques = (torque.torque, torque.task, torque.null, torque.force)
        for array in (*self.grasp, *own, *parts, *torques):
            array.setflags(write=False)


class Glance(NamedTuple):
    """What the supervision looks at in every tick; the reference is packed."""

    arm: ArmTerms
    reference: Array
    law: LawOutcome


@dataclass(slots=True, eq=False)
class TickDiagnostics:
    """What happened in a tick.

    status: "ok" or "safe" (the safe command was given, and `reason` says why); near_singular: which fallbacks were at
    work ("arm", "attitude"); effort (n,) [N m] and saturated (n,): the command and which joints were clipped; glance:
    the few numbers that every cycle needs, None where the law was not evaluated.
    """

    status: Status
    reason: str
    near_singular: tuple[str, ...]
    effort: Array
    saturated: NDArray[np.bool_]
    glance: Glance | None
    evaluate: Callable[[], TickTerms] | None = field(repr=False, compare=False)
    describe: Callable[[], Array] | None = field(repr=False, compare=False)
    _terms: TickTerms | None = field(init=False, default=None, repr=False, compare=False)

    @property
    def terms(self) -> TickTerms | None:
        """Every symbol of the law, None where it was not evaluated.

        Worked out by the plain form when first looked at, so that a tick whose inside nobody reads does not pay for it.
        """
        if self._terms is None and self.evaluate is not None:
            terms = self.evaluate()
            terms.freeze()
            self._terms = terms
        return self._terms

    def scalars(self) -> dict[str, float]:
        """Return the numbers worth plotting, the same names in the same order every tick; NaN where not evaluated."""
        flags = (self.status != "ok", "arm" in self.near_singular, "attitude" in self.near_singular)
        names = _names(len(self.effort))
        numbers = [*map(float, flags), *self.effort.tolist(), *map(float, self.saturated.tolist())]
        if self.describe is not None:
            numbers += self.describe().tolist()
        else:
            numbers += [math.nan] * (len(names) - len(numbers))
        return dict(zip(names, numbers, strict=True))


_FLAGS = ("safe", "near_singular_arm", "near_singular_attitude")
_ONE = ("gate", "V_e", "V_s", "sigma_min", "damping_squared", "k_s", "sliding", "slip_significance")
_POSES = ("position", "desired", "s")
_LAW = ("v_s", "e", "e_dot", "K", "D", "comp", "Lambda", "Theta", "Z", "a_d", "a_C")
_GRASP = ("h_o", "v_o", "a_o", "Phi2")
_ESTIMATE = ("slip_deviation", "slip_error")
_JOINT = ("tau_task", "tau_null", "tau_bias")


@functools.lru_cache
def _names(joints: int) -> tuple[str, ...]:
    def each_joint(*names: str) -> list[str]:
        return [f"{name}_{i + 1}" for name in names for i in range(joints)]

    six = [f"{name}_{axis}" for name in (*_POSES, "twist", "h_ee", *_LAW, *_GRASP, *_ESTIMATE) for axis in AXES]
    return (*_FLAGS, *each_joint("effort", "saturated"), *_ONE, *six, *each_joint(*_JOINT))


def described(joints: int) -> int:
    """Return how many numbers `numbers_of` gives.

    Implements: ours: the size of what `record_kernel.describe` writes.
    """
    return len(_names(joints)) - len(_FLAGS) - 2 * joints


def numbers_of(t: TickTerms) -> Array:
    """Return the numbers of a law that was evaluated, in the order of the names after the command; (described(n),).

    Implements: ours: what `record_kernel.describe` works out without the record.
    """
    poses = ((t.arm.position, t.arm.rotation), (t.reference.position, t.reference.rotation), t.slip)
    arrays = (
        *(part for position, rotation in poses for part in (position, log_so3(rotation))),
        t.arm.twist,
        t.h_ee,
        *(getattr(t.law, name) for name in _LAW),
        *(getattr(t.grasp, name) for name in _GRASP),
        *((_NOT_ESTIMATED, _NOT_ESTIMATED) if t.estimate is None else (np.sqrt(t.estimate.variance), t.estimate.error)),
        t.torque.task,
        t.torque.null,
        t.arm.bias,
    )
    ones = [t.law.gate, t.V_e, t.V_s, t.torque.sigma_min, t.torque.damping_squared, t.gains.k_s]
    ones += [0.0, 0.0] if t.estimate is None else [float(t.estimate.sliding), t.estimate.significance]
    return np.concatenate((ones, *arrays))


_NOT_ESTIMATED = readonly(np.zeros(6))
