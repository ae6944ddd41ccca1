"""A commanded motion that does not happen is named with its joint, and nothing else is."""

import numpy as np

from slip_core.records import new, record
from slip_vic_controller.law.arm import ARM
from slip_vic_controller.law.law import EVALUATION
from slip_vic_controller.safety.conditions import Why, describe
from slip_vic_controller.safety.following import FAR, FOLLOWING, STUCK_NS, Following, find_what_keeps, stays_far, stuck
from slip_vic_controller.safety.limit_avoidance import MOTION_LIMITS
from slip_vic_controller.sizes import NEVER

N, MS = 3, 1_000_000
BIAS, FORCE = np.array([1.0, -2.0, 0.5]), np.array([0.0, 1.0, 0.0, 0.0, 0.0, 0.0])
J = np.random.default_rng(0).normal(size=(6, N))
NOTHING = np.zeros(N)
RANGE = record(new(MOTION_LIMITS), MOTION_LIMITS)
RANGE.near_lower[:], RANGE.near_upper[:] = -1.5, 1.5


def begun() -> Following:
    state: Following = record(new(FOLLOWING), FOLLOWING)
    state.since_ns = NEVER
    return state


def watch(
    state: Following, now_ns: int, error: float, speed: float, extra: np.ndarray, angle: float = 0.0,
    q: np.ndarray = NOTHING, commanded: np.ndarray = NOTHING, reference: float = 0.1,
) -> None:  # fmt: skip
    """One cycle of an arm whose efforts exceed what it needs at rest by `extra` [N m]; reference: its speed [m/s]."""
    arm, law = record(new(ARM), ARM), record(new(EVALUATION), EVALUATION)
    arm.bias[:N], arm.J[:, :N] = BIAS, J
    law.error_linear, law.error_angular = error, angle
    twist, effort = np.array([speed, 0.0, 0.0, 0.0, 0.0, 0.0]), BIAS - J.T @ FORCE + extra
    moves = np.array([0.0, reference, 0.0, 0.0, 0.0, 0.0])
    if stays_far(state, twist, moves, law, now_ns):
        find_what_keeps(state, RANGE, N, q, arm, law, FORCE, effort, commanded)


def words(state: Following) -> str:
    return describe(Why(state.cause, 0, 0, state.joint, state.value, state.error, -1, 0.0), ("a", "b", "c"))


def test_stuck_joint_is_named() -> None:
    state, extra = begun(), np.array([0.1, -4.0, 0.2])
    for ms in range(STUCK_NS // MS + 1):
        watch(state, ms * MS, 0.05, 0.0, extra)
        assert not stuck(state, ms * MS)
    assert stuck(state, STUCK_NS + MS)
    assert state.joint == 1
    assert np.isclose(state.value, -4.0)
    text = words(state)
    assert text.startswith("b does not follow: -4.00 N m")
    assert "50 mm" in text


def test_joint_at_range_end_is_named() -> None:
    """Limit avoidance balances what the law wants there."""
    for error, angle, rests in ((0.116, 0.0, "116 mm"), (0.0, 0.2, "11.5 degrees")):
        state = begun()
        for ms in range(STUCK_NS // MS + 2):
            watch(state, ms * MS, error, 0.0, NOTHING, angle, q=np.array([0.0, -1.6, 1.55]))
        assert stuck(state, STUCK_NS + MS)
        assert (
            words(state) == f"b is at the end of its range, at -1.60 rad, and the pad stays {rests} off its reference"
        )


def test_moving_or_near_arm_follows() -> None:
    """One that another weight balances far off has no torque without effect either."""
    for error, speed, torque in ((0.9 * FAR, 0.0, 1.0), (0.05, 0.01, 1.0), (0.05, 0.0, 0.02)):
        state = begun()
        for ms in range(2 * STUCK_NS // MS):
            watch(state, ms * MS, error, speed, np.full(N, torque))
        assert not stuck(state, 2 * STUCK_NS)
