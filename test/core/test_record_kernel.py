"""The plotted numbers of a tick by the kernel against those taken from the record, symbol by symbol."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from slip_core.arrays import Array
from slip_core.params import build
from slip_core.types import JointSample, SlipSample, WrenchSample
from slip_vic_controller.core.controller import VicController
from slip_vic_controller.core.diagnostics import TickDiagnostics, described, numbers_of
from slip_vic_controller.params import ControllerParams

from .small_arm import HOME, small_arm_urdf

EQUAL = 1e-12  # of the largest number of its kind: the kernel adds in another order and frame
STRETCHED = (0.0, 0.0, 0.0, -1e-4, 0.0, 0.0, 0.0)
TWO_CONTACTS = {
    "contacts.position": [0.0, 0.0, 0.05, 0.0, 0.0, -0.05],
    "contacts.orientation_xyzw": [0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0],
    "contacts.slip_axes": [1.0, 1.0, 0.0, 0.0, 0.0, 1.0] * 2,
}
CASES: dict[str, tuple[dict[str, Any], tuple[float, ...]]] = {
    "vic": ({}, HOME),
    "observer": ({"slip_estimator": "observer"}, HOME),
    "observer alone": ({"slip_estimator": "observer", "observer.correct_follow": False}, HOME),
    "classical": ({"controller": "classical"}, HOME),
    "no feed-forward": ({"feed_forward": False}, HOME),
    "two contacts": (TWO_CONTACTS, HOME),
    "nearly stretched": ({}, STRETCHED),
    "roll, pitch, yaw": ({"attitude": "rpy"}, HOME),
}


def records(name: str) -> list[TickDiagnostics]:
    """Return the records of some ticks of random motion; slip comes and goes."""
    values, home = CASES[name]
    controller = VicController(build(ControllerParams, values, "test"), small_arm_urdf())
    rng, contacts = np.random.default_rng(5), len(controller.contacts)
    q = np.array(home)
    state = controller.initial_state(JointSample(0, q, np.zeros(7), np.zeros(7)))
    found = []
    for tick in range(1, 60):
        qd = 0.3 * rng.standard_normal(7)
        q = q + 1e-3 * qd
        joint = JointSample(tick * 1_000_000, q, qd, np.zeros(7))
        wrenches = tuple(WrenchSample(joint.stamp_ns, rng.standard_normal(6)) for _ in range(contacts))
        slip = 0.02 * rng.standard_normal(6) * (tick > 20)
        slips = tuple(SlipSample(joint.stamp_ns, slip) for _ in range(contacts))
        result = controller.step(state, joint, wrenches, slips)
        assert result.diagnostics.status == "ok", result.diagnostics.reason
        state = result.state
        found.append(result.diagnostics)
    return found


def by_kind(names: list[str], values: Array) -> dict[str, Array]:
    """Return the numbers of each symbol."""
    kinds: dict[str, list[float]] = {}
    for name, value in zip(names, values, strict=True):
        kinds.setdefault(name.rsplit("_", 1)[0], []).append(value)
    return {kind: np.array(numbers) for kind, numbers in kinds.items()}


@pytest.mark.parametrize("name", CASES)
def test_every_symbol_equals_the_record(name: str) -> None:
    for record in records(name):
        assert record.terms is not None
        assert record.describe is not None
        names = list(record.scalars())[-described(7) :]
        found, expected = by_kind(names, record.describe()), by_kind(names, numbers_of(record.terms))
        # What a_C is made of decides how far its parts round; sigma_min is a root of a difference near zero.
        scale = max(1.0, *(float(np.abs(expected[kind]).max()) for kind in ("comp", "Z", "Lambda", "a_o", "a_C")))
        for kind, values in expected.items():
            loose = {"tau_task": 1e3, "tau_null": 1e3, "sigma": 1e4}.get(kind, 1.0)
            own = max(scale, float(np.abs(values).max()))
            np.testing.assert_allclose(found[kind], values, rtol=0.0, atol=loose * EQUAL * own, err_msg=kind)


def test_what_was_not_evaluated_is_no_number() -> None:
    controller = VicController(build(ControllerParams, {}, "test"), small_arm_urdf())
    joint = JointSample(0, np.array(HOME), np.zeros(7), np.zeros(7))
    wrenches = (WrenchSample(0, np.zeros(6)),)
    safe = controller.step(controller.initial_state(joint), joint, wrenches, (SlipSample(0, np.full(6, np.inf)),))
    assert safe.diagnostics.status == "safe"
    numbers = list(safe.diagnostics.scalars().values())
    assert all(map(math.isnan, numbers[-described(7) :]))
