"""Bags under other topic names: of one arm in a namespace, and of two arms made of a bag of one."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from slip_bags.reader import Bag
from slip_bags.writer import BagWriter

SHARED = {"/object_state": ["/object/object_state"], "/object_description": ["/object/object_description"]}


def two_arms(source: Path, folder: Path) -> None:
    """Write a bag with the topics in `left/` and `right/`, the object's in `object/`; both arms are in one place."""
    bag = Bag(source)
    topics = [name for name in bag.topics if name != "/clock"]
    copy_bag(source, folder, {name: SHARED.get(name, [f"/left{name}", f"/right{name}"]) for name in topics})


def copy_bag(source: Path, folder: Path, names: Mapping[str, Sequence[str]]) -> None:
    """Write the messages of some topics into a new bag, each topic under its new names."""
    bag = Bag(source)
    writer = BagWriter(folder, bag.custom_data, bag.attachments)
    try:
        for name, copies in names.items():
            for copy in copies:
                writer.add_topic(
                    replace(bag.topics[name], name=copy, message_count=0), bag._schemas[name].data.decode()
                )
        for message in bag.raw(names):
            for copy in names[message.topic]:
                writer.write(copy, *message[1:])
    finally:
        writer.close()
