"""Whatever arrives on a topic: the node's own decoding refuses it in one line or takes it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from slip_core.types import JointCommand, JointSample, SlipSample, WrenchSample
from test.campaigns.faults.channel import DAMAGED
from test.campaigns.faults.plan import EFFORT, JOINT, SLIP, WRENCH
from test.campaigns.faults.wire import Wire

JOINTS = tuple(f"arm_joint{i}" for i in range(1, 8))
NS, SEVEN, SIX = 1_000_000_000, np.linspace(-1.0, 1.0, 7), np.linspace(-1.0, 1.0, 6)
SAMPLES = {
    JOINT: JointSample(NS, SEVEN, SEVEN, SEVEN), EFFORT: JointCommand(NS, SEVEN), WRENCH: WrenchSample(NS, SIX),
    SLIP: SlipSample(NS, SIX),
}  # fmt: skip


def sound(sample: Any) -> None:
    """What is delivered has the sizes that everything behind it relies on."""
    if isinstance(sample, JointSample):
        assert sample.position.shape == sample.velocity.shape == sample.effort.shape == (len(JOINTS),)
    elif isinstance(sample, WrenchSample):
        assert sample.wrench.shape == (6,)
    elif isinstance(sample, SlipSample):
        assert sample.twist.shape == (6,)
        assert sample.valid == np.isfinite(sample.twist).all()
    else:
        assert sample.numbers.shape in ((0,), (len(JOINTS),))


@pytest.mark.parametrize("kind", DAMAGED)
@pytest.mark.parametrize("name", SAMPLES)
def test_damaged_message(name: str, kind: str) -> None:
    """Bytes that are nearly a message get far into the decoder; any exception but a refusal is a crash."""
    if kind == "wrong_names" and name not in (JOINT, EFFORT):
        return
    wire, rng = Wire(name, JOINTS, "ee"), np.random.default_rng(1)
    for _ in range(200):
        sample = wire.receive(wire.damaged(wire.message(SAMPLES[name]), kind, rng))
        if sample is not None:
            sound(sample)
