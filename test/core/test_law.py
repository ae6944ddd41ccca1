"""The whole tick against the slow second implementation, on random states."""

from __future__ import annotations

import numpy as np
import pytest

from slip_core.params import build
from slip_core.types import CartesianReference, JointSample, SlipSample, WrenchSample
from slip_vic_controller.core.attitude import LOG_REPORT
from slip_vic_controller.core.controller import VicController
from slip_vic_controller.core.grasp import SlipDisplacement
from slip_vic_controller.core.packing import pack_memory
from slip_vic_controller.params import ControllerParams

from .law_referee import RefereeInput, exponential, referee_law
from .small_arm import HOME, small_arm_urdf

REFEREE = 1e-9  # relative to the symbol's largest element: two routes through ill-scaled inverses in double precision
STATES = 5
SLIP_AXES = {"all": (1, 1, 1, 1, 1, 1), "pad": (1, 1, 0, 0, 0, 1)}


def random_case(rng: np.random.Generator, attitude: str, contacts: int, axes: str, kind: str, urdf: str):
    """Return a controller, the arguments of one tick at a random state, and the same for the referee."""
    quats = rng.normal(size=(contacts, 4))
    quats /= np.linalg.norm(quats, axis=1, keepdims=True)
    mask = SLIP_AXES[axes] * contacts
    inertia = (0.004, 0.006, 0.005, 0.0005, -0.0003, 0.0002)
    params = build(
        ControllerParams,
        {
            "controller": kind,
            "attitude": attitude,
            "object": {"mass": 0.8, "inertia": inertia},
            "contacts.position": tuple(rng.normal(scale=0.1, size=3 * contacts)),
            "contacts.orientation_xyzw": tuple(quats.ravel()),
            "contacts.slip_axes": tuple(bool(v) for v in mask),
            "gains.stiffness": tuple(rng.uniform(2.0, 9.0, 6)),
            "gains.gamma_ko": 30.0,
            "gains.alpha": 15.0,
            "gains.k_s_mode": "fixed",  # stamps are of no interest here, so none may slow k_s down
            "singularity.sigma_min": 1e-9,
        },
        "test",
    )
    controller = VicController(params, urdf)
    q = np.array(HOME) + rng.normal(scale=0.3, size=7)
    joint = JointSample(5_000_000, q, rng.normal(scale=0.4, size=7), np.zeros(7))
    state = controller.initial_state(JointSample(0, np.array(HOME), np.zeros(7), np.zeros(7)))
    moved = tuple(SlipDisplacement(rng.normal(scale=0.03, size=3), exponential(rng.normal(size=3))) for _ in quats)
    state = state._replace(memory=pack_memory(np.zeros(3), moved), stamp_ns=joint.stamp_ns)
    wrenches = tuple(WrenchSample(0, rng.normal(size=6)) for _ in quats)
    slips = tuple(SlipSample(0, rng.normal(scale=0.03, size=6)) for _ in quats)
    arm = controller.arm.terms(joint.position, joint.velocity)
    reference = CartesianReference(
        arm.position + rng.normal(scale=0.1, size=3),
        exponential(rng.normal(scale=0.5, size=3)) @ arm.rotation,
        rng.normal(size=6),
        rng.normal(size=6),
    )
    J = np.array([[inertia[0], *inertia[3:5]], [inertia[3], inertia[1], inertia[5]], [*inertia[4:6], inertia[2]]])
    gains, fading = params.gains, float(kind == "vic")
    given = RefereeInput(
        arm=arm,
        reference=reference,
        wrenches=[w.wrench for w in wrenches],
        slip_twist=slips[0].twist * mask[:6],
        slip_positions=[s.position for s in moved],
        slip_rotations=[s.rotation for s in moved],
        contact_positions=[c.position for c in controller.contacts],
        contact_rotations=[_matrix(quat) for quat in quats],
        slip_axes=np.array(mask[:6], float),
        mass=0.8,
        inertia=J,
        gravity=np.array([0.0, 0.0, -9.81]),
        K_D=np.array(gains.stiffness),
        D_D=np.array(gains.damping),
        M_D=np.array(gains.inertia),
        gamma_k=fading * np.array([100.0] * 3 + [30.0] * 3),
        gamma_d=fading * np.full(6, 100.0),
        alpha=15.0 * fading,
        k_s=1000.0,
        attitude=attitude,
        tau_0=10.0 * (np.array(HOME) - q) - 2.0 * joint.velocity,
    )
    return controller, (state, joint, wrenches, slips, reference), given


def _matrix(quat_xyzw: np.ndarray) -> np.ndarray:
    """Return the rotation matrix of a quaternion by way of its rotation vector."""
    q = quat_xyzw / np.linalg.norm(quat_xyzw)
    return exponential(2.0 * np.arccos(q[3]) * q[:3] / np.linalg.norm(q[:3]))


def assert_same(name: str, got, expected) -> None:
    expected = np.asarray(expected)
    largest = max(float(np.abs(expected).max()), 1.0)
    assert float(np.abs(np.asarray(got) - expected).max()) <= REFEREE * largest, name


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("kind", ["vic", "classical"])
@pytest.mark.parametrize("axes", ["all", "pad"])
@pytest.mark.parametrize("contacts", [1, 3])
@pytest.mark.parametrize("attitude", ["log", "rpy"])
def test_tick_equals_referee(attitude: str, contacts: int, axes: str, kind: str, seed: int) -> None:
    rng, urdf = np.random.default_rng(seed), small_arm_urdf()
    for _ in range(STATES):
        controller, arguments, given = random_case(rng, attitude, contacts, axes, kind, urdf)
        expected = referee_law(given)
        result = controller.step(*arguments)
        assert result.diagnostics.status == "ok"
        terms = result.diagnostics.terms
        assert terms is not None
        assert np.linalg.norm(expected["e"][3:]) < LOG_REPORT
        for name in ("v_s", "e", "e_dot", "K", "D", "gate", "comp", "Lambda", "Theta", "a_C"):
            assert_same(name, getattr(terms.law, name), expected[name])
        for name in ("R_o", "r", "v_o", "h_o", "a_o", "Phi2"):
            assert_same(name, getattr(terms.grasp, name), expected[name])
        assert_same("h_ee", terms.h_ee, expected["h_ee"])
        assert_same("null", terms.torque.null, expected["tau_null"])
        assert_same("torque", terms.torque.torque, expected["tau"])
        assert_same("P", terms.P, expected["P"])
        assert_same("G", terms.G, expected["G"])
        limit = controller.arm.effort_limit
        assert_same("effort", result.command.effort, np.clip(terms.torque.torque, -limit, limit))


def test_referee_tells_a_wrong_sign() -> None:
    """The comparison is not blind: a referee with the orientation error turned round disagrees."""
    controller, arguments, given = random_case(np.random.default_rng(1), "log", 1, "all", "vic", small_arm_urdf())
    given.reference = CartesianReference(
        given.reference.position, given.arm.rotation.T, given.reference.twist, given.reference.acceleration
    )
    terms = controller.step(*arguments).diagnostics.terms
    assert terms is not None
    with pytest.raises(AssertionError):
        assert_same("torque", terms.torque.torque, referee_law(given)["tau"])


def test_classical_is_the_law_with_gate_and_fading_off() -> None:
    """The slip velocity changes nothing in the classical torque, and the gate is exactly zero."""
    controller, (state, joint, wrenches, slips, reference), _ = random_case(
        np.random.default_rng(3), "log", 1, "all", "classical", small_arm_urdf()
    )
    moving = controller.step(state, joint, wrenches, slips, reference).diagnostics.terms
    still = tuple(SlipSample(0, np.zeros(6)) for _ in slips)
    resting = controller.step(state, joint, wrenches, still, reference).diagnostics.terms
    assert moving is not None
    assert resting is not None
    assert moving.law.gate == 0.0
    assert (moving.law.K == controller.gains.K_D).all()
    assert (moving.torque.torque == resting.torque.torque).all()
