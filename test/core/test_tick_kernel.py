"""The tick's kernels against the plain forms, which are the documentation and their referee."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pytest

from slip_core.arrays import Array, rotate6
from slip_core.types import CartesianReference
from slip_vic_controller.core.arm import ArmTerms
from slip_vic_controller.core.attitude import log_error
from slip_vic_controller.core.grasp import Contact, SlipDisplacement, integrate_slip
from slip_vic_controller.core.impedance import Gains
from slip_vic_controller.core.law import GraspTerms, LawTerms, control_law, grasp_terms
from slip_vic_controller.core.object_dynamics import ObjectModel
from slip_vic_controller.core.observer_run_kernel import MOTION
from slip_vic_controller.core.operational import SingularityPolicy, joint_torque, posture_torque
from slip_vic_controller.core.packing import (
    LawOutcome,
    pack_contacts,
    pack_memory,
    pack_reference,
    pack_tuning,
    slips_of,
)
from slip_vic_controller.core.rotation import exp_so3
from slip_vic_controller.core.tick_kernel import evaluate, predict_motion

# Relative to the largest intermediate of the case: the fast form adds the same numbers in another order and frame.
EQUAL = 1e-12
SEEDS = range(40)
PI = math.pi
JOINTS = 7
REGULAR = SingularityPolicy(1e-9, 0.1)
STIFFNESS, DAMPING, LIMIT = 10.0, 2.0, 87.0
Q, QD, POSTURE = np.linspace(-1.0, 1.0, JOINTS), np.linspace(0.4, -0.3, JOINTS), np.linspace(0.5, -0.2, JOINTS)


@dataclass(frozen=True)
class Case:
    """All arguments of both forms."""

    gains: Gains
    model: ObjectModel
    contacts: tuple[Contact, ...]
    slips: tuple[SlipDisplacement, ...]
    wrenches: tuple[Array, ...]
    slip_twist: Array
    follow_error: Array | None
    arm: ArmTerms
    reference: CartesianReference
    feed_forward: bool
    previous: Array


def turned(rng: np.random.Generator, angle: float) -> Array:
    axis = rng.standard_normal(3)
    return exp_so3(angle * axis / np.linalg.norm(axis))


def random_case(
    seed: int,
    *,
    contacts: int = 1,
    angle: float | None = None,
    slip: float = 0.01,
    spin_limit: float = math.inf,
    lever: float = 1.0,
    observed: bool = False,
    feed_forward: bool = True,
) -> Case:
    """Return a case of ordinary sizes; `angle` is that of the orientation error."""
    rng = np.random.default_rng(seed)
    R_ee = turned(rng, rng.uniform(0.0, PI))
    error = turned(rng, rng.uniform(0.0, 2.0) if angle is None else angle)
    unit = turned(rng, rng.uniform(0.0, PI))
    gains = Gains(
        *(rng.uniform(0.5, 50.0, 6) for _ in range(3)),
        gamma_k=rng.uniform(0.0, 100.0, 6),
        gamma_d=rng.uniform(0.0, 100.0, 6),
        alpha=rng.uniform(0.0, 100.0),
        k_s=rng.uniform(1.0, 1000.0),
        spin_lever=lever,
        spin_limit=spin_limit,
    )
    root = rng.standard_normal((JOINTS, JOINTS))
    arm = ArmTerms.of(
        M=root @ root.T + np.eye(JOINTS),
        bias=rng.standard_normal(JOINTS),
        J=rng.standard_normal((6, JOINTS)),
        jdot_qd=rng.standard_normal(6),
        position=rng.standard_normal(3),
        rotation=R_ee,
        twist=rng.standard_normal(6),
    )
    reference = CartesianReference(
        arm.position + 0.1 * rng.standard_normal(3), error.T @ R_ee, rng.standard_normal(6), rng.standard_normal(6)
    )
    return Case(
        gains,
        ObjectModel(rng.uniform(0.1, 5.0), unit @ np.diag(rng.uniform(2e-3, 3e-3, 3)) @ unit.T, rng.standard_normal(3)),
        tuple(
            Contact(0.1 * rng.standard_normal(3), turned(rng, rng.uniform(0, PI)), rng.integers(0, 2, 6).astype(float))
            for _ in range(contacts)
        ),
        tuple(
            SlipDisplacement(0.01 * rng.standard_normal(3), turned(rng, rng.uniform(0, 0.5))) for _ in range(contacts)
        ),
        tuple(rng.standard_normal(6) for _ in range(contacts)),
        slip * rng.standard_normal(6),
        rng.standard_normal(6) if observed else None,
        arm,
        reference,
        feed_forward,
        rng.standard_normal(3),
    )


def plain(case: Case) -> tuple[GraspTerms, LawTerms, Array, bool]:
    """Evaluate the plain form as the controller does."""
    R_ee, v_ee = case.arm.rotation, case.arm.twist
    v_s = rotate6(R_ee, case.slip_twist * case.contacts[0].slip_axes)
    grasp = grasp_terms(case.model, case.contacts, case.slips, case.wrenches, R_ee, v_ee, v_s)
    if case.follow_error is not None:
        grasp = grasp._replace(follow=grasp.follow + rotate6(R_ee, case.follow_error))
    reference = case.reference
    a_d = reference.acceleration if case.feed_forward else np.zeros(6)
    attitude = log_error(R_ee, reference.rotation, v_ee[3:], reference.twist[3:], a_d[3:], case.previous)
    e_p, e_p_dot = case.arm.position - reference.position, v_ee[:3] - reference.twist[:3]
    law = control_law(case.gains, case.contacts[0].slip_axes, attitude, e_p, e_p_dot, a_d, R_ee, v_s, grasp)
    return grasp, law, rotate6(R_ee, case.wrenches[0]), attitude.near_singular


def fast(case: Case, policy: SingularityPolicy = REGULAR, dt: float = 0.0) -> tuple[LawOutcome, Array]:
    """Return outcome and memory of the kernel."""
    samples = np.concatenate([np.concatenate((h, np.zeros(6))) for h in case.wrenches])
    samples[6:12] = case.slip_twist
    out, memory = np.empty(LawOutcome.size(JOINTS)), np.empty(3 + 12 * len(case.contacts))
    settings = np.array((float(case.feed_forward), STIFFNESS, DAMPING, *policy, *(LIMIT,) * JOINTS))
    evaluate(
        case.arm.record, pack_tuning(case.gains, case.model), pack_contacts(case.contacts), settings, samples,
        np.zeros(6) if case.follow_error is None else case.follow_error, pack_memory(case.previous, case.slips),
        pack_reference(case.reference), Q, QD, POSTURE, dt, memory, out,
    )  # fmt: skip
    return LawOutcome(out, JOINTS), memory


def assert_equal(case: Case) -> None:
    found, memory = fast(case)
    grasp, law, h_ee, near = plain(case)
    carried = grasp.follow + grasp.Phi2
    # The compensation k_s v_s, the impedance and a_o are what rounding errors of a_C come from.
    scale = max(
        1.0, *np.abs(law.Z), *np.abs(law.Theta), *np.abs(carried), *np.abs(case.gains.k_s * law.v_s), *np.abs(grasp.a_o)
    )
    np.testing.assert_allclose(found.a_C, law.a_C, rtol=0.0, atol=EQUAL * scale)
    np.testing.assert_allclose(found.object_acceleration, grasp.a_o[:3], rtol=0.0, atol=EQUAL * scale)
    np.testing.assert_allclose(found.carried, carried[:3], rtol=0.0, atol=EQUAL * scale)
    np.testing.assert_allclose(found.h_ee, h_ee, rtol=0.0, atol=EQUAL)
    assert found.gate == pytest.approx(law.gate, abs=EQUAL)
    assert found.error_linear == pytest.approx(np.linalg.norm(law.e[:3]), abs=EQUAL)
    assert found.error_angular == pytest.approx(np.linalg.norm(law.e[3:]), abs=EQUAL)
    assert found.slip_speed == pytest.approx(np.linalg.norm(law.v_s[:3]), abs=EQUAL)
    assert found.near_singular == near
    assert found.ok
    np.testing.assert_allclose(memory[:3], law.e[3:], rtol=0.0, atol=EQUAL)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("contacts", [1, 2, 4])
def test_ordinary_cases(seed: int, contacts: int) -> None:
    assert_equal(random_case(seed, contacts=contacts))


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("angle", [0.0, 1e-9, 0.0999, 0.1001, 1.0, 2.0, 2.2, PI - 0.21, PI - 0.19, PI - 1e-3])
def test_every_size_of_orientation_error(seed: int, angle: float) -> None:
    assert_equal(random_case(seed, angle=angle))


@pytest.mark.parametrize("seed", SEEDS)
def test_the_branch_beyond_the_half_turn(seed: int) -> None:
    case = random_case(seed, angle=PI - 0.3)
    _, law, _, _ = plain(case)
    for previous in (law.e[3:], -law.e[3:]):
        assert_equal(Case(**{**case.__dict__, "previous": previous}))


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("slip", [0.0, 1e-12, 1e-3, 10.0])
def test_every_speed_of_slip(seed: int, slip: float) -> None:
    assert_equal(random_case(seed, slip=slip))


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("spin_limit", [0.0, 1.0, 1e9])
def test_bounded_spin(seed: int, spin_limit: float) -> None:
    assert_equal(random_case(seed, spin_limit=spin_limit, lever=0.03))


@pytest.mark.parametrize("seed", SEEDS)
def test_observer_and_no_feed_forward(seed: int) -> None:
    assert_equal(random_case(seed, observed=True))
    assert_equal(random_case(seed, feed_forward=False))


def test_the_comparison_sees_a_difference() -> None:
    case = random_case(0)
    other, _ = fast(Case(**{**case.__dict__, "gains": case.gains._replace(k_s=case.gains.k_s * (1.0 + 1e-9))}))
    with pytest.raises(AssertionError):
        np.testing.assert_allclose(other.a_C, plain(case)[1].a_C, rtol=0.0, atol=EQUAL)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("sigma_min", [1e-9, 0.5, 3.0])
def test_torque(seed: int, sigma_min: float) -> None:
    """From the kernel's own a_C on, so that only the torque map is compared; sigma of these J is around 0.3 to 1.5."""
    case, policy = random_case(seed), SingularityPolicy(sigma_min, 0.1)
    found, _ = fast(case, policy)
    arm, tau_0 = case.arm, posture_torque(Q, QD, POSTURE, STIFFNESS, DAMPING)
    expected = joint_torque(arm.M, arm.bias, arm.J, arm.jdot_qd, found.a_C, found.h_ee, tau_0, policy)
    scale = np.abs(expected.force).max() * np.abs(arm.J).max()
    np.testing.assert_allclose(found.torque, expected.torque, rtol=0.0, atol=100 * EQUAL * scale)
    assert found.damping_squared == pytest.approx(expected.damping_squared, abs=EQUAL)
    np.testing.assert_array_equal(found.effort, np.clip(found.torque, -LIMIT, LIMIT))
    assert found.saturated == np.count_nonzero(np.abs(found.torque) > LIMIT)


def test_torque_near_and_at_singularities() -> None:
    case = random_case(3)
    J = case.arm.J.copy()
    for shrink in (1e-3, 1e-6, 0.0):
        u, sigma, v = np.linalg.svd(J, full_matrices=False)
        sigma[-1] *= shrink
        arm = case.arm
        singular = ArmTerms.of(arm.M, arm.bias, (u * sigma) @ v, arm.jdot_qd, arm.position, arm.rotation, arm.twist)
        policy = SingularityPolicy(0.05, 0.1)
        found, _ = fast(Case(**{**case.__dict__, "arm": singular}), policy)
        tau_0 = posture_torque(Q, QD, POSTURE, STIFFNESS, DAMPING)
        expected = joint_torque(arm.M, arm.bias, singular.J, arm.jdot_qd, found.a_C, found.h_ee, tau_0, policy)
        assert found.damping_squared == pytest.approx(expected.damping_squared, rel=1e-6)
        np.testing.assert_allclose(found.torque, expected.torque, rtol=1e-9, atol=1e-9 * np.abs(expected.force).max())


def test_a_mass_matrix_that_is_none_is_reported() -> None:
    case = random_case(0)
    arm = case.arm
    bad = ArmTerms.of(-arm.M, arm.bias, arm.J, arm.jdot_qd, arm.position, arm.rotation, arm.twist)
    assert not fast(Case(**{**case.__dict__, "arm": bad}))[0].ok


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("contacts", [1, 3])
def test_slip_displacement(seed: int, contacts: int) -> None:
    case, dt = random_case(seed, contacts=contacts, slip=1.0), 0.01
    _, memory = fast(case, dt=dt)
    twists = [case.slip_twist * case.contacts[0].slip_axes] + [np.zeros(6)] * (contacts - 1)
    for found, before, twist in zip(slips_of(memory), case.slips, twists, strict=True):
        expected = integrate_slip(before, twist, dt)
        np.testing.assert_allclose(found.position, expected.position, rtol=0.0, atol=EQUAL)
        np.testing.assert_allclose(found.rotation, expected.rotation, rtol=0.0, atol=EQUAL)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("contacts", [1, 3])
def test_motion_for_the_observer(seed: int, contacts: int) -> None:
    case, out = random_case(seed, contacts=contacts), np.empty(MOTION)
    slip = case.slip_twist * case.contacts[0].slip_axes
    samples = np.concatenate([np.concatenate((h, np.zeros(6))) for h in case.wrenches])
    tuning, grips = pack_tuning(case.gains, case.model), pack_contacts(case.contacts)
    predict_motion(case.arm.record, tuning, grips, samples, pack_memory(case.previous, case.slips), slip, out)
    grasp, _, h_ee, _ = plain(Case(**{**case.__dict__, "follow_error": None}))
    force = grasp.follow - np.concatenate((case.model.gravity, np.zeros(3)))
    known = (case.arm.rotation.ravel(), case.arm.twist)
    expected = (*known, grasp.follow + grasp.Phi2, force, -h_ee[:3] / case.model.mass, grasp.v_o[3:])
    scale = max(1.0, np.abs(grasp.a_o).max())
    np.testing.assert_allclose(out, np.concatenate(expected), rtol=0.0, atol=EQUAL * scale)


@pytest.mark.parametrize("place", [0, 6, 13])
def test_samples_that_are_not_finite_are_seen_before_the_observer_is_told(place: int) -> None:
    case, out = random_case(1, contacts=2), np.empty(MOTION)
    tuning, grips = pack_tuning(case.gains, case.model), pack_contacts(case.contacts)
    samples, memory = np.zeros(24), pack_memory(case.previous, case.slips)
    assert predict_motion(case.arm.record, tuning, grips, samples, memory, np.zeros(6), out) == 1
    samples[place] = math.nan
    assert predict_motion(case.arm.record, tuning, grips, samples, memory, np.zeros(6), out) == 0
