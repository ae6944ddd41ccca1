"""A commanded motion that does not happen is named with its joint, and nothing else is."""

import numpy as np

from slip_core.records import new, record
from slip_vic_controller.law.arm import ARM
from slip_vic_controller.law.law import EVALUATION
from slip_vic_controller.safety.following import FAR, FOLLOWING, STUCK_NS, Following, stuck, watch_following
from slip_vic_controller.safety.modes import Mode
from slip_vic_controller.safety.reasons import Cause, Reason, describe
from slip_vic_controller.sizes import NEVER
from test.support.made_up import POSITION, law_at_work
from test.support.made_up import N as ARM_JOINTS

N, MS = 3, 1_000_000
BIAS, FORCE = np.array([1.0, -2.0, 0.5]), np.array([0.0, 1.0, 0.0, 0.0, 0.0, 0.0])
J = np.random.default_rng(0).normal(size=(6, N))


def begun() -> Following:
    state: Following = record(new(FOLLOWING), FOLLOWING)
    state.since_ns = NEVER
    return state


def watch(state: Following, now_ns: int, error: float, speed: float, extra: np.ndarray, angle: float = 0.0) -> None:
    """One cycle of an arm whose efforts exceed what it needs at rest by `extra` [N m]."""
    arm, law = record(new(ARM), ARM), record(new(EVALUATION), EVALUATION)
    arm.twist[0], arm.bias[:N], arm.J[:, :N] = speed, BIAS, J
    law.error_linear, law.error_angular = error, angle
    watch_following(state, N, arm, law, FORCE, BIAS - J.T @ FORCE + extra, now_ns)


def test_a_joint_whose_torque_has_no_effect_is_named() -> None:
    state, extra = begun(), np.array([0.1, -4.0, 0.2])
    for ms in range(STUCK_NS // MS + 1):
        watch(state, ms * MS, 0.05, 0.0, extra)
        assert not stuck(state, ms * MS)
    assert stuck(state, STUCK_NS + MS)
    assert state.joint == 1
    assert np.isclose(state.torque, -4.0)
    text = describe(Reason(Cause.NOT_FOLLOWING, state.joint, 0, state.torque, state.error), ("a", "b", "c"))
    assert text.startswith("b does not follow: -4.00 N m")
    assert "50 mm" in text


def test_a_pad_that_is_only_turned_away_is_reported_by_its_angle() -> None:
    state = begun()
    for ms in range(STUCK_NS // MS + 2):
        watch(state, ms * MS, 0.0, 0.0, np.array([0.1, -4.0, 0.2]), angle=0.2)
    text = describe(Reason(Cause.NOT_FOLLOWING, state.joint, 0, state.torque, state.error), ("a", "b", "c"))
    assert text.startswith("b does not follow: -4.00 N m")
    assert "rests 11.5 degrees off" in text


def test_an_arm_that_moves_or_is_near_follows() -> None:
    """One that another weight balances far off has no torque without effect either."""
    for error, speed, torque in ((0.9 * FAR, 0.0, 1.0), (0.05, 0.01, 1.0), (0.05, 0.0, 0.02)):
        state = begun()
        for ms in range(2 * STUCK_NS // MS):
            watch(state, ms * MS, error, speed, np.full(N, torque))
        assert not stuck(state, 2 * STUCK_NS)


def test_an_arm_that_comes_back_elsewhere_is_held_there_at_once() -> None:
    """After a silence nobody knows where it went: efforts for the old posture would kick it."""
    made_up, rest = law_at_work(), np.zeros(ARM_JOINTS)
    made_up.run(20)
    made_up.pass_time(500 * MS)
    made_up.session.watchdog(made_up.now_ns)
    there = POSITION + 0.3
    made_up.cycle(made_up.joint(there, rest))
    result = made_up.cycle(made_up.joint(there, rest))
    assert result.mode == Mode.HOLD or result.mode.follows
    np.testing.assert_allclose(made_up.state.law.position[:ARM_JOINTS], there, atol=1e-6)
    assert made_up.run(20, joint={"position": there, "velocity": rest}).mode != Mode.FAULT


def test_a_jump_without_a_silence_is_not_believed_at_once() -> None:
    made_up, rest = law_at_work(), np.zeros(ARM_JOINTS)
    made_up.run(20)
    made_up.cycle(made_up.joint(POSITION + 0.3, rest))
    made_up.cycle(made_up.joint(POSITION + 0.3, rest))
    np.testing.assert_allclose(made_up.state.law.position[:ARM_JOINTS], POSITION, atol=1e-6)
