"""The published numbers: their names and order on the topic, and what they are without the law."""

from __future__ import annotations

import math

import numpy as np

from slip_core.records import new
from slip_vic_controller.law.rotation import exponential
from slip_vic_controller.law.symbols import SYMBOLS, no_symbols, published
from slip_vic_controller.sizes import MAX_JOINTS
from test.support.call import call, flat
from test.support.law_cases import random_case

AXES = ("x", "y", "z", "rx", "ry", "rz")
FLAGS = ("safe", "near_singular_arm", "near_singular_attitude")
ONES = ("gate", "V_e", "V_s", "sigma_min", "damping_squared", "k_s", "sliding")
SIX = [
    "position", "desired", "s", "twist", "h_ee", "v_s", "e", "e_dot", "K", "D", "comp", "Lambda", "Theta", "Z", "a_d",
    "a_C", "h_o", "v_o", "a_o", "Phi2",
]  # fmt: skip


def test_names_and_their_order_are_those_of_the_topic() -> None:
    """Recordings are read by these names."""
    for joints in (3, 7, MAX_JOINTS):
        numbers = [str(j + 1) for j in range(joints)]
        expected = [
            *FLAGS,
            *(f"{name}_{j}" for name in ("effort", "saturated") for j in numbers),
            *ONES,
            *(f"{name}_{axis}" for name in SIX for axis in AXES),
            *(f"{name}_{j}" for name in ("tau_task", "tau_null", "tau_bias") for j in numbers),
        ]
        names, places = published(joints)
        assert list(names) == expected
        assert len(set(places)) == len(names)
    assert (published(MAX_JOINTS)[1] == np.arange(SYMBOLS.itemsize // 8)).all()


def test_poses_and_flags_are_those_of_the_tick() -> None:
    case = random_case(1)
    case.config.effort_limit[:] = 1e-3
    found, numbers = case.evaluate(), case.symbols()
    assert numbers["safe"] == 0.0
    assert sum(numbers[f"saturated_{j + 1}"] for j in range(7)) == found.saturated.sum() == 7
    assert [numbers[f"effort_{j + 1}"] for j in range(7)] == found.effort[:7].tolist()
    for name, pose in (("position", case.arm), ("desired", case.reference), ("s", case.slips[0])):
        assert [numbers[f"{name}_{axis}"] for axis in AXES[:3]] == pose.position.tolist()
        R = flat(call(exponential, [numbers[f"{name}_{axis}"] for axis in AXES[3:]]))
        np.testing.assert_allclose(R, pose.rotation, atol=1e-12)
    assert [numbers[f"tau_bias_{j + 1}"] for j in range(7)] == case.arm.bias[:7].tolist()


def test_what_was_not_evaluated_is_no_number() -> None:
    out = new(SYMBOLS)
    call(no_symbols, np.arange(7.0), np.zeros(7, np.int64), out)
    names, places = published(7)
    numbers = dict(zip(names, out[places].tolist(), strict=True))
    assert [numbers.pop(name) for name in FLAGS] == [1.0, 0.0, 0.0]
    assert [numbers.pop(f"effort_{j + 1}") for j in range(7)] == list(range(7))
    assert [numbers.pop(f"saturated_{j + 1}") for j in range(7)] == [0.0] * 7
    assert all(map(math.isnan, numbers.values()))
