"""VicController: one control tick, from samples to an effort command, composed of the pure parts of this package."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slip_msgs_py.arrays import Array, inertia_from_six, matrix_from_quat_xyzw, readonly, rotate6, vector
from slip_msgs_py.errors import InputError
from slip_msgs_py.types import CartesianReference, EffortCommand, JointSample, SlipSample, WrenchSample
from slip_vic_controller.core.arm import ArmModel
from slip_vic_controller.core.attitude import log_error, rpy_error
from slip_vic_controller.core.diagnostics import Status, TickDiagnostics, TickTerms
from slip_vic_controller.core.grasp import Contact, SlipDisplacement, integrate_slip
from slip_vic_controller.core.impedance import Gains
from slip_vic_controller.core.law import control_law, grasp_terms
from slip_vic_controller.core.object_dynamics import ObjectModel
from slip_vic_controller.core.operational import SingularityPolicy, joint_torque, posture_torque
from slip_vic_controller.core.params import ControllerParams, GainParams
from slip_vic_controller.core.safety import finite, limit_effort, refusal, safe_torque
from slip_vic_controller.core.state import ControllerState
from slip_vic_controller.core.trajectory import make_path, reference_at


class TickResult(NamedTuple):
    """The command of a tick, the state for the next one, and what happened."""

    command: EffortCommand
    state: ControllerState
    diagnostics: TickDiagnostics


class VicController:
    """The controller of one arm. It holds configuration only; what changes is in `ControllerState`.

    Args:
        params: checked parameters.
        urdf_text: the arm; gives kinematics, dynamics and effort limits.

    Raises:
        InputError: the parameters and the URDF do not fit.
    """

    def __init__(self, params: ControllerParams, urdf_text: str) -> None:
        self.params = params
        self.arm = ArmModel(urdf_text, params.ee_frame, params.joint_names, params.gravity)
        self.joint_names = self.arm.joint_names
        self.gains = make_gains(params.gains, classical=params.controller == "classical")
        self.contacts = make_contacts(params)
        inertia = readonly(inertia_from_six(params.object.inertia, "parameter object.inertia"))
        self.object_model = ObjectModel(params.object.mass, inertia, vector(params.gravity, 3, "gravity"))
        self.policy = SingularityPolicy(params.singularity.sigma_min, params.singularity.damping)
        self.path = make_path(params.trajectory)
        self._slip_needed = params.controller == "vic"
        posture, joints = params.nullspace.posture, len(self.joint_names)
        if posture and len(posture) != joints:
            raise InputError("parameter nullspace.posture", got=f"{len(posture)} values", expected=f"{joints} or none")

    def initial_state(self, joint: JointSample) -> ControllerState:
        """Return the state before the first tick: the arm where it is, no slip, the trajectory starting here and now.

        Raises:
            InputError: the joint sample has the wrong size or is not finite.
        """
        count = len(self.joint_names)
        q = vector(joint.position, count, "joint position")
        arm = self.arm.terms(q, vector(joint.velocity, count, "joint velocity"))
        posture = self.params.nullspace.posture
        return ControllerState(
            stamp_ns=joint.stamp_ns,
            start_ns=joint.stamp_ns,
            start_position=readonly(arm.position),
            start_rotation=readonly(arm.rotation),
            posture=vector(posture, count, "posture") if posture else q,
            slips=(SlipDisplacement(readonly(np.zeros(3)), readonly(np.eye(3))),) * len(self.contacts),
            attitude_error=readonly(np.zeros(3)),
            position=q,
        )

    def step(
        self,
        state: ControllerState,
        joint: JointSample,
        wrenches: tuple[WrenchSample, ...],
        slips: tuple[SlipSample, ...],
        reference: CartesianReference | None = None,
    ) -> TickResult:
        """Return command, next state and diagnostics of one tick; never raises, the command is always finite.

        Args:
            state: of the tick before, or `initial_state`.
            joint: the state to answer.
            wrenches: the latest of every contact, in the axes of its pad.
            slips: the latest of every contact, in the axes of its pad.
            reference: desired motion, or None for the built-in trajectory.

        Implements: Eq. (21), (28), (29), the whole law.
        """
        with np.errstate(all="ignore"):  # overflow and NaN are looked for by value, a warning could be an exception
            return self._step(state, joint, wrenches, slips, reference)

    def _step(
        self,
        state: ControllerState,
        joint: JointSample,
        wrenches: tuple[WrenchSample, ...],
        slips: tuple[SlipSample, ...],
        reference: CartesianReference | None,
    ) -> TickResult:
        joints, contacts = len(self.joint_names), len(self.contacts)
        reason = refusal(state.stamp_ns, joints, contacts, self._slip_needed, joint, wrenches, slips, reference)
        if reason:
            return self._safe(state, joint, reason)
        dt = (joint.stamp_ns - state.stamp_ns) * 1e-9
        slip_twists = [
            sample.twist * contact.slip_axes if sample.valid else _NO_SLIP
            for sample, contact in zip(slips, self.contacts, strict=True)
        ]
        displacements = tuple(integrate_slip(s, twist, dt) for s, twist in zip(state.slips, slip_twists, strict=True))
        if reference is None:
            t = (joint.stamp_ns - state.start_ns) * 1e-9 - self.params.trajectory.start_s
            reference = reference_at(self.path, t, state.start_position, state.start_rotation)
        terms = self._evaluate(state, joint, [w.wrench for w in wrenches], slip_twists[0], displacements, reference)
        if not (terms.torque.solved and finite(terms.torque.torque)):
            return self._safe(state, joint, "the law gave no finite torque")
        effort, saturated = limit_effort(terms.torque.torque, self.arm.effort_limit)
        near = ("arm",) * (terms.torque.damping_squared > 0.0) + ("attitude",) * terms.attitude.near_singular
        following = state._replace(
            stamp_ns=joint.stamp_ns,
            slips=displacements,
            attitude_error=terms.attitude.error,
            position=joint.position,
        )
        return _result(joint, following, "ok", "", near, effort, saturated, terms)

    def _evaluate(
        self,
        state: ControllerState,
        joint: JointSample,
        wrenches: Sequence[Array],
        slip_twist: Array,
        displacements: tuple[SlipDisplacement, ...],
        reference: CartesianReference,
    ) -> TickTerms:
        """Evaluate the law for a slip velocity (6,) on pad axes, wherever it comes from."""
        params, gains, q, qd = self.params, self.gains, joint.position, joint.velocity
        arm = self.arm.terms(q, qd)
        R_ee, v_ee = arm.rotation, arm.twist
        v_s = rotate6(R_ee, slip_twist)
        h_ee = rotate6(R_ee, wrenches[0])
        grasp = grasp_terms(self.object_model, self.contacts, displacements, wrenches, R_ee, v_ee, v_s)
        a_d = reference.acceleration if params.feed_forward else _NO_SLIP
        R_d, w_d = reference.rotation, reference.twist[3:]
        if params.attitude == "rpy":
            attitude = rpy_error(R_ee, R_d, v_ee[3:], w_d)
        else:
            attitude = log_error(R_ee, R_d, v_ee[3:], w_d, a_d[3:], state.attitude_error)
        e_p, e_p_dot = arm.position - reference.position, v_ee[:3] - reference.twist[:3]
        law = control_law(gains, self.contacts[0].slip_axes, attitude, e_p, e_p_dot, a_d, R_ee, v_s, grasp)
        tau_0 = posture_torque(q, qd, state.posture, params.nullspace.stiffness, params.nullspace.damping)
        torque = joint_torque(arm.M, arm.bias, arm.J, arm.jdot_qd, law.a_C, h_ee, tau_0, self.policy)
        return TickTerms(gains, self.object_model, arm, reference, attitude, displacements[0], h_ee, grasp, law, torque)

    def _safe(self, state: ControllerState, joint: JointSample, reason: str) -> TickResult:
        """Hold the arm against gravity and brake its joints, from the last finite joint state."""
        size = state.position.shape
        q = joint.position if joint.position.shape == size and finite(joint.position) else state.position
        qd = joint.velocity if joint.velocity.shape == size and finite(joint.velocity) else None
        torque = safe_torque(self.arm.gravity(q), qd, self.params.safety.joint_damping)
        effort, saturated = limit_effort(torque, self.arm.effort_limit)
        following = state._replace(stamp_ns=max(joint.stamp_ns, state.stamp_ns), position=q)
        return _result(joint, following, "safe", reason, (), effort, saturated, None)


def _result(
    joint: JointSample,
    state: ControllerState,
    status: Status,
    reason: str,
    near_singular: tuple[str, ...],
    effort: Array,
    saturated: NDArray[np.bool_],
    terms: TickTerms | None,
) -> TickResult:
    """Put a tick's result together and make all its arrays read-only."""
    for array in (effort, saturated, state.attitude_error, *itertools.chain.from_iterable(state.slips)):
        array.flags.writeable = False
    diagnostics = TickDiagnostics(status, reason, near_singular, effort, saturated, terms)
    return TickResult(EffortCommand(joint.stamp_ns, effort), state, diagnostics)


def make_gains(params: GainParams, *, classical: bool) -> Gains:
    """Return the gains of the law; classical impedance control has gate and fading off.

    Implements: ours: the paper's baseline is the same code with alpha = 0 and gamma = 0.
    """
    on = 0.0 if classical else 1.0
    return Gains(
        K_D=readonly(params.stiffness),
        D_D=readonly(params.damping),
        M_D=readonly(params.inertia),
        gamma_k=readonly([on * params.gamma_kp] * 3 + [on * params.gamma_ko] * 3),
        gamma_d=readonly([on * params.gamma_dp] * 3 + [on * params.gamma_do] * 3),
        alpha=on * params.alpha,
        k_s=params.k_s,
    )


def make_contacts(params: ControllerParams) -> tuple[Contact, ...]:
    """Return the contacts from their flat lists; the first is the own arm's.

    Implements: ours: ROS parameters have no nested lists.
    """
    flat = params.contacts
    count = len(flat.position) // 3
    return tuple(
        Contact(
            position=readonly(flat.position[3 * i : 3 * i + 3]),
            rotation=readonly(matrix_from_quat_xyzw(flat.orientation_xyzw[4 * i : 4 * i + 4])),
            slip_axes=readonly(flat.slip_axes[6 * i : 6 * i + 6]),
        )
        for i in range(count)
    )


_NO_SLIP = readonly(np.zeros(6))
