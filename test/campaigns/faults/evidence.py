"""The bag that a violation leaves: the trial run again, every message kept."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from rclpy.serialization import serialize_message

from slip_bags.format import QosProfile, TopicInfo
from slip_bags.typedefs import find_definition
from slip_bags.writer import BagWriter, WriterOptions
from slip_core.topics import topic
from slip_msgs_py.messages import to_msgs
from test.campaigns.faults.campaign import plan_of
from test.campaigns.faults.plan import TOPICS, Plan
from test.campaigns.faults.trial import Trial
from test.campaigns.faults.wire import Wire

MODE = "controller/mode"


def leave_bag(seed: int, trial: int, out: Path, interface: str = "") -> Path:
    """Run an in-process trial again and write what bridge and controller sent; return the bag's folder."""
    plan = plan_of(seed, trial, interface)
    again = Trial(plan, keep=True)
    outcome = again.run()
    controller = again.scenario.controller
    wires = {name: Wire(name, controller.joint_names, controller.ee_frame, plan.interface) for name in TOPICS}

    def messages() -> Iterator[tuple[int, str, bytes]]:
        for now_ns, name, content in outcome.record:
            message: Any = to_msgs.string(content) if name == MODE else wires[name].message(content)
            yield now_ns, name, serialize_message(message)

    return write_bag(out / f"trial_{seed}_{trial}", messages(), notes_of(plan, outcome.violations))


def notes_of(plan: Plan, violations: Sequence[str]) -> dict[str, str]:
    """Return what the bag of a violation says of itself."""
    return {
        "seed": str(plan.seed),
        "trial": str(plan.trial),
        "plan": repr(plan),
        "violations": "\n".join(violations),
    }


def write_bag(
    wanted: Path, messages: Iterable[tuple[int, str, bytes]], notes: Mapping[str, str], prefixes: Sequence[str] = ("",)
) -> Path:
    """Write messages (time [ns], topic, bytes) into a new bag; return its folder; prefixes: of each arm's topics."""
    folder = _new_folder(wanted)
    writer = BagWriter(folder, WriterOptions(custom_data=notes))
    for prefix, name in itertools.product(prefixes, (*TOPICS, MODE)):
        definition = find_definition(topic(name).type)
        info = TopicInfo(f"/{prefix}{name}", topic(name).type, (QosProfile(),), definition.type_hash)
        writer.add_topic(info, definition.text)
    for sequence, (now_ns, name, data) in enumerate(messages, start=1):
        writer.write(f"/{name}", now_ns, now_ns, sequence, data)
    writer.close()
    return folder


def _new_folder(wanted: Path) -> Path:
    folder, count = wanted, 1
    while folder.exists():
        folder, count = wanted.with_name(f"{wanted.name}_{count}"), count + 1
    return folder
