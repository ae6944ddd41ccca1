"""A commanded motion that does not happen is named with its joint, and nothing else is."""

import numpy as np
import pytest

from slip_core.records import new, record
from slip_vic_controller.law.arm import ARM
from slip_vic_controller.law.evaluation import EVALUATION
from slip_vic_controller.safety.conditions import NOTHING, Why, describe
from slip_vic_controller.safety.following import FAR, FAR_TURNED, RESTS, rests_far_off, what_keeps
from test.support.call import call

N = 3
BIAS, FORCE = np.array([1.0, -2.0, 0.5]), np.array([0.0, 1.0, 0.0, 0.0, 0.0, 0.0])
J = np.random.default_rng(0).normal(size=(6, N))


def kept_by(extra: np.ndarray, commanded: np.ndarray) -> Why:
    """Return what keeps an arm 50 mm off whose efforts exceed what it needs at rest by `extra` [N m]."""
    arm, law = record(new(ARM), ARM), record(new(EVALUATION), EVALUATION)
    arm.bias[:N], arm.J[:, :N], law.error_linear = BIAS, J, 0.05
    return Why(*call(what_keeps, N, arm, law, FORCE, BIAS - J.T @ FORCE + extra, commanded))


@pytest.mark.parametrize(("commanded", "joint"), [([0.0, 0.0, 0.0], "b"), ([0.1, 0.0, -0.3], "c")])
def test_stuck_joint_is_named(commanded: list[float], joint: str) -> None:
    """That with most torque, or that with the fastest command."""
    found = kept_by(np.array([0.1, -4.0, 0.2]), np.array(commanded))
    assert describe(found, ("a", "b", "c")).startswith(f"{joint} does not follow: ")
    assert found.value == pytest.approx({"b": -4.0, "c": 0.2}[joint])
    assert found.limit == 0.05


def test_balanced_arm_is_not_stuck() -> None:
    """An object of another weight balances it far off."""
    assert kept_by(np.full(N, 0.02), np.zeros(N)) == NOTHING


@pytest.mark.parametrize(
    ("error", "angle", "speed", "far"),
    [
        (1.1 * FAR, 0.0, 0.0, True),
        (0.0, 1.1 * FAR_TURNED, 0.9 * RESTS, True),
        (0.9 * FAR, 0.9 * FAR_TURNED, 0.0, False),
        (0.05, 1.0, 1.1 * RESTS, False),
    ],
)
def test_moving_or_near_arm_follows(error: float, angle: float, speed: float, far: bool) -> None:
    law = record(new(EVALUATION), EVALUATION)
    law.error_linear, law.error_angular = error, angle
    assert call(rests_far_off, law, np.array([speed, 0.0, 0.0, 0.0, 0.0, 0.0])) == far
