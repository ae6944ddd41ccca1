"""The record of one tick: every intermediate symbol of the law, and a flat list of numbers to plot."""

from __future__ import annotations

import math
from dataclasses import InitVar, dataclass, field
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slip_msgs_py.arrays import Array
from slip_msgs_py.types import CartesianReference
from slip_vic_controller.core.arm import ArmTerms
from slip_vic_controller.core.attitude import AttitudeError
from slip_vic_controller.core.grasp import SlipDisplacement
from slip_vic_controller.core.impedance import Gains
from slip_vic_controller.core.law import GraspTerms, LawTerms
from slip_vic_controller.core.lyapunov import V_e, V_s
from slip_vic_controller.core.operational import TorqueTerms
from slip_vic_controller.core.rotation import log_so3

Status = Literal["ok", "safe"]
AXES = ("x", "y", "z", "rx", "ry", "rz")


class TickTerms(NamedTuple):
    """All records of an evaluated law, the gains in effect among them."""

    gains: Gains
    arm: ArmTerms
    reference: CartesianReference
    attitude: AttitudeError
    slip: SlipDisplacement
    h_ee: Array
    grasp: GraspTerms
    law: LawTerms
    torque: TorqueTerms

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
        for array in (*self.arm, *self.grasp, *own, *parts, *torques):
            array.flags.writeable = False


@dataclass(frozen=True, slots=True)
class TickDiagnostics:
    """What happened in a tick.

    status: "ok" or "safe" (the safe command was given, and `reason` says why); near_singular: which fallbacks were at
    work ("arm", "attitude"); effort (n,) [N m] and saturated (n,): the command and which joints were clipped.
    """

    status: Status
    reason: str
    near_singular: tuple[str, ...]
    effort: Array
    saturated: NDArray[np.bool_]
    evaluated: InitVar[TickTerms | None]
    _terms: TickTerms | None = field(init=False)

    def __post_init__(self, evaluated: TickTerms | None) -> None:
        object.__setattr__(self, "_terms", evaluated)

    @property
    def terms(self) -> TickTerms | None:
        """Every symbol of the law, None where it was not evaluated.

        The arrays become read-only when first looked at, so that a tick whose inside nobody reads does not pay for it.
        """
        if self._terms is not None:
            self._terms.freeze()
        return self._terms

    def scalars(self) -> dict[str, float]:
        """Return the numbers worth plotting, the same names in the same order every tick; NaN where not evaluated."""
        values = dict.fromkeys(_names(len(self.effort)), math.nan)
        values["safe"] = float(self.status != "ok")
        values["near_singular_arm"] = float("arm" in self.near_singular)
        values["near_singular_attitude"] = float("attitude" in self.near_singular)
        _put(values, "effort", self.effort, None)
        _put(values, "saturated", self.saturated, None)
        if self._terms is not None:
            _put_terms(values, self._terms)
        return values


def _put(
    values: dict[str, float], name: str, numbers: Array | NDArray[np.bool_], labels: tuple[str, ...] | None
) -> None:
    for i, number in enumerate(numbers.tolist()):
        values[f"{name}_{labels[i] if labels else i + 1}"] = float(number)


_LAW = ("v_s", "e", "e_dot", "K", "D", "comp", "Lambda", "Theta", "Z", "a_d", "a_C")
_GRASP = ("h_o", "v_o", "a_o", "Phi2")
_SIX = ("position", "desired", "twist", "s", "h_ee", *_LAW, *_GRASP)
_ONE = ("gate", "V_e", "V_s", "sigma_min", "damping_squared", "safe", "near_singular_arm", "near_singular_attitude")
_JOINT = ("effort", "saturated", "tau_task", "tau_null", "tau_bias")


def _names(joints: int) -> list[str]:
    six = [f"{name}_{axis}" for name in _SIX for axis in AXES]
    joint = [f"{name}_{i + 1}" for name in _JOINT for i in range(joints)]
    return [*_ONE, *six, *joint]


def _put_terms(values: dict[str, float], t: TickTerms) -> None:
    law, grasp, arm, ref = t.law, t.grasp, t.arm, t.reference
    values |= {"gate": law.gate, "V_e": t.V_e, "V_s": t.V_s}
    values |= {"sigma_min": t.torque.sigma_min, "damping_squared": t.torque.damping_squared}
    for name in _LAW:
        _put(values, name, getattr(law, name), AXES)
    for name in _GRASP:
        _put(values, name, getattr(grasp, name), AXES)
    _put(values, "h_ee", t.h_ee, AXES)
    _put(values, "twist", arm.twist, AXES)
    _put(values, "s", np.concatenate((t.slip.position, log_so3(t.slip.rotation))), AXES)
    _put(values, "position", np.concatenate((arm.position, log_so3(arm.rotation))), AXES)
    _put(values, "desired", np.concatenate((ref.position, log_so3(ref.rotation))), AXES)
    _put(values, "tau_task", t.torque.task, None)
    _put(values, "tau_null", t.torque.null, None)
    _put(values, "tau_bias", arm.bias, None)
