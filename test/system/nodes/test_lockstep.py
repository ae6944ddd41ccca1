"""Lockstep over DDS gives the numbers of the in-process loop, bit for bit, and gives them again."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from slip_bags.reader import Bag
from slip_core.stamps import stamp_to_ns
from slip_vic.run.in_process import run_in_process
from test.system.conftest import Recording, noisy_scenario, record

SEVERAL = ("/tf", "/diagnostics")


def decoded(bag: Path) -> dict[str, list[Any]]:
    """Return every message of a bag as nested plain values; /diagnostics and all else included.

    Several sources speak on the topics of `SEVERAL`: no promise is made about whose message comes first.
    """
    with Bag(bag) as opened:
        found = {name: [plain(m.value) for m in opened.messages(name)] for name in opened.topics}
    return {name: sorted(values, key=repr) if name in SEVERAL else values for name, values in found.items()}


def plain(value: Any) -> Any:
    if hasattr(value, "__slots__"):
        return tuple(plain(getattr(value, name)) for name in value.__slots__)
    if isinstance(value, np.ndarray):
        return value.tobytes()
    if isinstance(value, float):
        return value.hex()
    if isinstance(value, list | tuple):
        return tuple(plain(item) for item in value)
    return value


@pytest.fixture(scope="module")
def recorded(noisy_run: Recording, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    again = record(tmp_path_factory.mktemp("again"), noisy_scenario(5))
    return {"first": noisy_run.bag, "again": again.bag}


def test_same_seed_same_messages(recorded: dict[str, Path]) -> None:
    first, again = decoded(recorded["first"]), decoded(recorded["again"])
    assert first.keys() == again.keys()
    for topic in first:
        assert first[topic] == again[topic], topic


def test_dds_equals_in_process_and_another_seed_is_another_run(recorded: dict[str, Path]) -> None:
    ticks = list(run_in_process(noisy_scenario(5)))
    other = [tick.result.command.effort.tobytes() for tick in run_in_process(noisy_scenario(6))]
    assert other != [tick.result.command.effort.tobytes() for tick in ticks]
    with Bag(recorded["first"]) as bag:
        commands = [m.value for m in bag.messages("/effort_command")]
        states = [m.value for m in bag.messages("/joint_states")]
        slips = [m.value for m in bag.messages("/slip_velocity")]
    assert len(commands) == len(states) == len(ticks) == 600
    for tick, command, state in zip(ticks, commands, states, strict=True):
        assert stamp_to_ns(command.header.stamp) == stamp_to_ns(state.header.stamp) == tick.outputs.stamp_ns
        assert np.array(state.position).tobytes() == tick.outputs.arms[0].joint.position.tobytes()
        assert np.array(command.effort).tobytes() == tick.result.command.effort.tobytes()
    published = [sample for tick in ticks for sample in tick.outputs.arms[0].slips]
    assert [stamp_to_ns(m.header.stamp) for m in slips] == [sample.stamp_ns for sample in published]
    assert [m.twist.linear.x for m in slips] == [sample.twist[0] for sample in published]
