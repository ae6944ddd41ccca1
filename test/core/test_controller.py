"""The tick as a whole: safe on any input, pure, saturating with a flag, slip integrated, records read-only."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from slip_core.errors import InputError
from slip_core.params import build
from slip_core.types import CartesianReference, JointSample, SlipSample, WrenchSample
from slip_vic_controller.core.controller import VicController
from slip_vic_controller.core.rotation import exp_so3, log_so3
from slip_vic_controller.params import ControllerParams

from .small_arm import HOME, small_arm_urdf

ROUNDING = 1e-10
NAN, INF = float("nan"), float("inf")
JOINT = JointSample(1_000_000, np.array(HOME), np.full(7, 0.05), np.zeros(7))
WRENCH = (WrenchSample(0, np.array([0.1, 0.2, -4.9, 0.0, 0.0, 0.01])),)
SLIP = (SlipSample(0, np.array([0.004, -0.002, 0.0, 0.0, 0.0, 0.03])),)


def make(**values: Any) -> VicController:
    return VicController(build(ControllerParams, values, "test"), small_arm_urdf())


CONTROLLER = make()
START = CONTROLLER.initial_state(JointSample(0, np.array(HOME), np.zeros(7), np.zeros(7)))


def with_value(values: np.ndarray, index: int, value: float) -> np.ndarray:
    out = np.array(values)
    out[index] = value
    return out


def bad_inputs() -> dict[str, tuple[Any, Any, Any, Any]]:
    still = CartesianReference(START.start_position, START.start_rotation, np.zeros(6), np.zeros(6))
    bad_reference = CartesianReference(
        START.start_position, START.start_rotation, with_value(np.zeros(6), 3, NAN), still.twist
    )
    short_reference = CartesianReference(START.start_position, START.start_rotation, np.zeros(5), still.twist)
    joint, velocity = JOINT.position, JOINT.velocity
    return {
        "joint position": (JointSample(1, with_value(joint, 2, NAN), velocity, joint), WRENCH, SLIP, None),
        "joint velocity": (JointSample(1, joint, with_value(velocity, 6, INF), joint), WRENCH, SLIP, None),
        "has not 7 values": (JointSample(1, joint[:6], velocity, joint), WRENCH, SLIP, None),
        "older": (JointSample(-1, joint, velocity, joint), WRENCH, SLIP, None),
        "not of 1 contacts": (JOINT, WRENCH * 2, SLIP, None),
        "wrench of contact 0": (JOINT, (WrenchSample(0, with_value(WRENCH[0].wrench, 0, NAN)),), SLIP, None),
        "wrench of contact 0 ": (JOINT, (WrenchSample(0, np.zeros(3)),), SLIP, None),
        "slip of contact 0 is invalid": (JOINT, WRENCH, (SlipSample(0, np.full(6, NAN), valid=False),), None),
        "slip of contact 0 is not": (JOINT, WRENCH, (SlipSample(0, np.full(6, INF)),), None),
        "reference twist": (JOINT, WRENCH, SLIP, bad_reference),
        "reference twist ": (JOINT, WRENCH, SLIP, short_reference),
        "no finite torque": (JointSample(1, joint, np.full(7, 1e140), joint), WRENCH, SLIP, None),
    }  # fmt: skip


@pytest.mark.parametrize("reason", bad_inputs())
def test_bad_input_gives_a_safe_command_and_a_reason(reason: str) -> None:
    joint, wrenches, slips, reference = bad_inputs()[reason]
    result = CONTROLLER.step(START, joint, wrenches, slips, reference)
    assert result.diagnostics.status == "safe"
    assert reason.strip() in result.diagnostics.reason
    assert result.diagnostics.terms is None
    assert np.isfinite(result.command.effort).all()
    assert (np.abs(result.command.effort) <= CONTROLLER.arm.effort_limit).all()
    good = CONTROLLER.step(result.state, JOINT, WRENCH, SLIP)
    assert good.diagnostics.status == "ok"


@pytest.mark.parametrize("reason", bad_inputs())
def test_bad_input_does_not_reach_the_memory_of_an_observer(reason: str) -> None:
    controller = make(slip_estimator="observer")
    start = controller.initial_state(JointSample(0, np.array(HOME), np.zeros(7), np.zeros(7)))
    joint, wrenches, slips, reference = bad_inputs()[reason]
    result = controller.step(start, joint, wrenches, slips, reference)
    assert result.diagnostics.status == "safe"
    assert reason.replace("torque", "").strip() in result.diagnostics.reason
    assert result.state.observer is start.observer
    assert controller.step(result.state, JOINT, WRENCH, SLIP).diagnostics.status == "ok"


def test_safe_command_holds_against_gravity_and_brakes() -> None:
    invalid = (SlipSample(0, np.full(6, NAN), valid=False),)
    result = CONTROLLER.step(START, JOINT, WRENCH, invalid)
    expected = CONTROLLER.arm.gravity(JOINT.position) - 2.0 * JOINT.velocity
    np.testing.assert_allclose(result.command.effort, expected, atol=ROUNDING)


def test_safe_command_uses_the_last_finite_position() -> None:
    moved = CONTROLLER.step(START, JOINT, WRENCH, SLIP).state
    blind = JointSample(2_000_000, np.full(7, NAN), np.full(7, NAN), np.zeros(7))
    result = CONTROLLER.step(moved, blind, WRENCH, SLIP)
    np.testing.assert_allclose(result.command.effort, CONTROLLER.arm.gravity(JOINT.position), atol=ROUNDING)
    assert (result.state.position == JOINT.position).all()
    assert result.command.stamp_ns == 2_000_000


any_float = st.floats(allow_nan=True, allow_infinity=True, width=64)


@given(arrays(float, 7, elements=any_float), arrays(float, 7, elements=any_float), arrays(float, 6, elements=any_float),
       arrays(float, 6, elements=any_float), st.integers(0, 2**62))  # fmt: skip
@settings(max_examples=80, deadline=None, suppress_health_check=[HealthCheck.filter_too_much])
@pytest.mark.filterwarnings("error")
def test_no_input_whatever_breaks_the_tick(q, qd, h, v, stamp) -> None:
    for controller in (CONTROLLER, RPY):
        result = controller.step(START, JointSample(stamp, q, qd, qd), (WrenchSample(0, h),), (SlipSample(0, v),))
        assert np.isfinite(result.command.effort).all()
        assert (np.abs(result.command.effort) <= controller.arm.effort_limit).all()


RPY = make(attitude="rpy")


@pytest.mark.parametrize("size", [1e3, 1e8, 1e30, 1e75, 1e150])
@pytest.mark.parametrize("which", ["velocity", "wrench", "slip"])
@pytest.mark.filterwarnings("error")
def test_huge_values_end_clipped_or_safe(which: str, size: float) -> None:
    joint = JointSample(1_000_000, JOINT.position, np.full(7, size if which == "velocity" else 0.0), np.zeros(7))
    wrench = (WrenchSample(0, np.full(6, size if which == "wrench" else 0.0)),)
    slip = (SlipSample(0, np.full(6, size if which == "slip" else 0.0)),)
    result = CONTROLLER.step(START, joint, wrench, slip)
    assert np.isfinite(result.command.effort).all()
    assert (np.abs(result.command.effort) <= CONTROLLER.arm.effort_limit).all()
    assert result.diagnostics.saturated.any() or result.diagnostics.status == "safe"


def test_saturation_is_flagged_per_joint() -> None:
    wrench = (WrenchSample(0, np.array([0.0, 0.0, 120.0, 0.0, 0.0, 0.0])),)
    result = CONTROLLER.step(START, JOINT, wrench, SLIP)
    terms, limit = result.diagnostics.terms, CONTROLLER.arm.effort_limit
    assert terms is not None
    assert (result.diagnostics.saturated == (np.abs(terms.torque.torque) > limit)).all()
    assert result.diagnostics.saturated.any()
    assert not result.diagnostics.saturated.all()
    np.testing.assert_allclose(result.command.effort, np.clip(terms.torque.torque, -limit, limit), atol=ROUNDING)


def test_tick_is_pure() -> None:
    """Same arguments, same bits, whatever was computed in between; the state handed in is untouched."""
    first = CONTROLLER.step(START, JOINT, WRENCH, SLIP)
    CONTROLLER.step(START, JointSample(5_000_000, JOINT.position + 0.3, -JOINT.velocity, JOINT.effort), WRENCH, SLIP)
    again = CONTROLLER.step(START, JOINT, WRENCH, SLIP)
    assert (first.command.effort == again.command.effort).all()
    assert first.diagnostics.scalars() == again.diagnostics.scalars()
    assert (START.slips[0].position == 0.0).all()


def test_two_controllers_do_not_share_memory() -> None:
    other = make()
    before = CONTROLLER.step(START, JOINT, WRENCH, SLIP).command.effort
    other.step(START, JointSample(9_000_000, JOINT.position - 0.4, JOINT.velocity, JOINT.effort), WRENCH, SLIP)
    assert (CONTROLLER.step(START, JOINT, WRENCH, SLIP).command.effort == before).all()


def test_all_arrays_of_the_records_are_read_only() -> None:
    result = CONTROLLER.step(START, JOINT, WRENCH, SLIP)
    terms = result.diagnostics.terms
    assert terms is not None
    seen = 0
    diagnostics = result.diagnostics
    arm = [terms.arm.record]
    records = (result.state, arm, terms.attitude, terms.slip, terms.grasp, terms.law, terms.torque, terms)
    for record in (*records, (diagnostics.effort, diagnostics.saturated, result.command.effort)):
        for part in record:
            if isinstance(part, np.ndarray):
                seen += 1
                assert not part.flags.writeable
    assert seen > 35
    for s in result.state.slips:
        assert not s.position.flags.writeable
        assert not s.rotation.flags.writeable


def test_slip_displacement_is_integrated_over_ticks() -> None:
    """0.2 s at a constant slip twist, with ticks of 1, 2 and 3 ms: the displacement is the exponential's."""
    twist = np.array([0.02, -0.01, 0.0, 0.0, 0.0, 0.9])
    state, stamp = START, 0
    for k in range(100):
        stamp += (1 + k % 3) * 1_000_000
        joint = JointSample(stamp, JOINT.position, np.zeros(7), np.zeros(7))
        state = CONTROLLER.step(state, joint, WRENCH, (SlipSample(stamp, twist),)).state
    t = stamp * 1e-9
    np.testing.assert_allclose(log_so3(state.slips[0].rotation), twist[3:] * t, atol=ROUNDING)
    angle = twist[5] * t
    V = np.array([[np.sin(angle), np.cos(angle) - 1.0], [1.0 - np.cos(angle), np.sin(angle)]]) / angle
    np.testing.assert_allclose(state.slips[0].position[:2], V @ twist[:2] * t, atol=ROUNDING)


def test_slip_outside_the_slip_axes_is_not_used() -> None:
    masked = make(**{"contacts.slip_axes": (True, True, False, False, False, True)})
    odd = (SlipSample(0, SLIP[0].twist + np.array([0.0, 0.0, 0.5, 0.4, 0.3, 0.0])),)
    left, right = (masked.step(START, JOINT, WRENCH, slip) for slip in (SLIP, odd))
    assert (left.command.effort == right.command.effort).all()


def test_classical_does_not_need_slip() -> None:
    classical = make(controller="classical")
    invalid = (SlipSample(0, np.full(6, NAN), valid=False),)
    result = classical.step(START, JOINT, WRENCH, invalid)
    assert result.diagnostics.status == "ok"
    assert (result.command.effort == classical.step(START, JOINT, WRENCH, SLIP).command.effort).all()


def test_feed_forward_can_be_switched_off() -> None:
    trajectory = {"kind": "quintic", "displacement": (0.1, 0.0, 0.0), "duration_s": 1.0}
    joint = JointSample(200_000_000, JOINT.position, JOINT.velocity, np.zeros(7))
    on, off = (
        make(trajectory=trajectory, feed_forward=value).step(START, joint, WRENCH, SLIP) for value in (True, False)
    )
    assert on.diagnostics.terms is not None
    assert off.diagnostics.terms is not None
    assert on.diagnostics.terms.law.a_d[0] > 0.1
    assert (off.diagnostics.terms.law.a_d == 0.0).all()


def test_at_rest_on_the_reference_the_torque_is_gravity_and_load() -> None:
    at_rest = JointSample(0, JOINT.position, np.zeros(7), np.zeros(7))
    result = CONTROLLER.step(START, at_rest, WRENCH, (SlipSample(0, np.zeros(6)),))
    terms = result.diagnostics.terms
    assert terms is not None
    np.testing.assert_allclose(
        result.command.effort, CONTROLLER.arm.gravity(JOINT.position) - terms.arm.J.T @ terms.h_ee, atol=ROUNDING
    )


def test_trajectory_starts_at_its_time_from_the_first_pose() -> None:
    moving = make(trajectory={"kind": "quintic", "displacement": (0.1, 0.0, 0.0), "start_s": 0.5, "duration_s": 1.0})
    begin = moving.initial_state(JointSample(7_000_000_000, JOINT.position, np.zeros(7), np.zeros(7)))

    def desired(t: float) -> np.ndarray:
        joint = JointSample(7_000_000_000 + round(t * 1e9), JOINT.position, np.zeros(7), np.zeros(7))
        terms = moving.step(begin, joint, WRENCH, SLIP).diagnostics.terms
        assert terms is not None
        return terms.reference.position - begin.start_position

    np.testing.assert_allclose(desired(0.5), 0.0, atol=ROUNDING)
    np.testing.assert_allclose(desired(1.0), [0.05, 0.0, 0.0], atol=ROUNDING)
    np.testing.assert_allclose(desired(3.0), [0.1, 0.0, 0.0], atol=ROUNDING)


def test_given_reference_replaces_the_trajectory() -> None:
    goal = CartesianReference(
        START.start_position + 0.1, exp_so3(np.array([0, 0, 0.2])) @ START.start_rotation, np.zeros(6), np.zeros(6)
    )
    terms = CONTROLLER.step(START, JOINT, WRENCH, SLIP, goal).diagnostics.terms
    assert terms is not None
    np.testing.assert_allclose(terms.law.e, [-0.1, -0.1, -0.1, 0.0, 0.0, -0.2], atol=ROUNDING)


def test_scalars_have_the_same_names_in_every_tick() -> None:
    good = CONTROLLER.step(START, JOINT, WRENCH, SLIP).diagnostics.scalars()
    safe = CONTROLLER.step(START, JOINT, WRENCH, (SlipSample(0, np.full(6, NAN), valid=False),)).diagnostics.scalars()
    assert list(good) == list(safe)
    assert all(isinstance(value, float) for value in (*good.values(), *safe.values()))
    assert np.isfinite(list(good.values())).all()
    assert np.isnan(safe["gate"])
    assert safe["safe"] == 1.0
    assert good["v_s_x"] != 0.0
    assert good["K_x"] < 5.0
    assert 0.0 < good["gate"] < 1.0


def test_posture_is_the_first_measured_or_the_parameter() -> None:
    assert (START.posture == HOME).all()
    posed = make(**{"nullspace.posture": (0.1,) * 7})
    assert (posed.initial_state(JOINT).posture == 0.1).all()


@pytest.mark.parametrize("q", [np.zeros(6), np.full(7, NAN)])
def test_start_from_a_bad_joint_state_is_an_input_error(q: np.ndarray) -> None:
    with pytest.raises(InputError, match="joint position"):
        CONTROLLER.initial_state(JointSample(0, q, np.zeros(7), np.zeros(7)))


def test_singular_posture_is_reported_and_bounded() -> None:
    joint = JointSample(1_000_000, np.zeros(7), np.zeros(7), np.zeros(7))
    result = CONTROLLER.step(START, joint, WRENCH, (SlipSample(0, np.zeros(6)),))
    assert "arm" in result.diagnostics.near_singular
    assert result.diagnostics.scalars()["near_singular_arm"] == 1.0
    assert np.isfinite(result.command.effort).all()


def test_scalars_carry_the_records_values() -> None:
    diagnostics = CONTROLLER.step(START, JOINT, WRENCH, SLIP).diagnostics
    scalars, terms = diagnostics.scalars(), diagnostics.terms
    assert terms is not None
    expected = {
        "effort_3": diagnostics.effort[2],
        "gate": terms.law.gate,
        "V_e": terms.V_e,
        "V_s": terms.V_s,
        "position_y": terms.arm.position[1],
        "desired_z": terms.reference.position[2],
        "s_rz": log_so3(terms.slip.rotation)[2],
        "twist_x": terms.arm.twist[0],
        "h_ee_z": terms.h_ee[2],
        "v_s_x": terms.law.v_s[0],
        "a_C_rz": terms.law.a_C[5],
        "h_o_x": terms.grasp.h_o[0],
        "Phi2_y": terms.grasp.Phi2[1],
        "tau_task_1": terms.torque.task[0],
        "tau_null_7": terms.torque.null[6],
        "tau_bias_4": terms.arm.bias[3],
    }
    assert {name: scalars[name] for name in expected} == pytest.approx(expected, rel=1e-12, abs=1e-15)
