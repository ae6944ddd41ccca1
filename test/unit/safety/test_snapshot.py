"""A snapshot is the whole state: a session that is given its bytes goes on with equal bytes, from any cycle."""

from __future__ import annotations

import numpy as np
import pytest

from slip_core.errors import InputError
from slip_core.params import build, flatten
from slip_core.types import JointSample
from slip_vic_controller.params.controller_params import ControllerParams
from slip_vic_controller.safety.modes import Request
from test.support.made_up import LOAD, POSITION, SLIP, MadeUp, N

KINDS = (
    {"gains__k_s": 100.0, "trajectory__kind": "quintic", "trajectory__displacement": (0.1, 0.0, 0.05)},
    {"gains__k_s": 100.0, "slip_estimator": "observer", "gains__spin": "bounded"},
    {"gains__k_s": 100.0, "attitude": "rpy"},
)
CYCLES = 160


def disturbed_cycle(made_up: MadeUp, k: int) -> bytes:
    """Run cycle k of a run in which everything happens that a state must remember; return what came of it."""
    rng = np.random.default_rng(k)
    slip = SLIP + 0.002 * rng.normal(size=6) if k > 10 else np.zeros(6)
    if 70 <= k < 80:
        slip = slip + np.nan
    position = POSITION + 0.01 * np.sin(0.1 * k) + (0.3 if 40 <= k < 46 else 0.0)
    position = position + (np.nan if 30 <= k < 33 else 0.0)
    if k == 90:
        made_up.session.request(Request.HOLD)
    if k == 100:
        made_up.session.request(Request.ENABLE)
    joint = JointSample(made_up.stamp_ns, position, 0.05 * rng.normal(size=N), 0.1 * np.ones(N))
    result = made_up.cycle(joint, LOAD + 0.1 * rng.normal(size=6), slip if k % 2 else None)
    return made_up.session.snapshot().tobytes() + result.outputs.tobytes() + result.inputs.tobytes()


def test_a_session_goes_on_from_the_bytes_of_any_cycle() -> None:
    for kind in KINDS:
        made_up, snapshots, results = MadeUp(**kind), [], []
        for k in range(CYCLES):
            if k == 15:  # a ramp is under way in what follows
                values = flatten(made_up.controller.first.params) | {"object.mass": 0.6}
                made_up.session.retune(build(ControllerParams, values, "test"))
            snapshots.append((made_up.session.snapshot(), made_up.stamp_ns, made_up.now_ns, made_up.tick))
            results.append(disturbed_cycle(made_up, k))
        for first in (0, 1, 14, 31, 43, 45, 75, 95):
            other = MadeUp(**kind)
            state, other.stamp_ns, other.now_ns, other.tick = snapshots[first]
            other.session.restore(state)
            for k in range(first, min(CYCLES, first + 25)):
                if k == 15:
                    other.session.retune(build(ControllerParams, values, "test"))
                assert disturbed_cycle(other, k) == results[k], (kind, first, k)


def test_a_state_of_another_size_is_refused() -> None:
    with pytest.raises(InputError, match="controller state"):
        MadeUp().session.restore(MadeUp(slip_estimator="observer", gains__k_s=100.0).session.snapshot())
