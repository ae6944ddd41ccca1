"""A bag of two arms, made of a bag of one: its topics in `left/` and `right/`, the object's in `object/`."""

from dataclasses import replace
from pathlib import Path

from slip_bags.reader import Bag
from slip_bags.writer import BagWriter, WriterOptions

SHARED = {"/object_state": ["/object/object_state"], "/object_description": ["/object/object_description"]}


def two_arms(source: Path, folder: Path) -> None:
    """Write the bag; both arms stand in the same place, which only a picture minds."""
    with Bag(source) as bag:
        names = {name: SHARED.get(name, [f"/left{name}", f"/right{name}"]) for name in bag.topics if name != "/clock"}
        writer = BagWriter(folder, WriterOptions(custom_data=bag.custom_data, attachments=bag.attachments))
        try:
            for name, copies in names.items():
                for copy in copies:
                    writer.add_topic(replace(bag.topics[name], name=copy, message_count=0), bag.schema_text(name))
            for message in bag.raw(names):
                for copy in names[message.topic]:
                    writer.write(copy, *message[1:])
        finally:
            writer.close()
