"""Make a whole bag out of a killed, cut or damaged one; the original is never changed."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from mcap.records import Attachment, Channel, Message, Metadata, Schema

from slip_bags.format import TopicInfo, parse_custom_data
from slip_bags.mcap_file import LATEST_NS, mcap_files, records_of, topic_info
from slip_bags.writer import BagWriter
from slip_core.errors import InputError
from slip_core.files.resources import open_file


def recover(source: Path, output: Path) -> str:
    """Write everything readable of a bag folder or MCAP file into a new bag, tagged ``recovered: "true"``.

    Each file is read up to its first damaged record; a chunk whose content is damaged is left out. Return one line of
    text: what was saved, and what could not be.

    Raises:
        InputError: nothing to read, nothing to save, or the output exists.
        StorageError: the disk refuses.
    """
    writer: BagWriter | None = None
    losses: list[str] = []
    attachments: dict[str, bytes] = {}
    custom_data: dict[str, str] = {}

    def lose(name: str, part: str, _: Exception) -> None:
        losses.append(f"{part} of {name}")

    try:
        for path in mcap_files(source):
            schemas: dict[int, Schema] = {}
            channels: dict[int, tuple[TopicInfo, str]] = {}
            with open_file(path, f"file {path}") as file:
                for record in records_of(file, partial(lose, path.name)):
                    if isinstance(record, Schema):
                        schemas[record.id] = record
                    elif isinstance(record, Channel):
                        schema = schemas.get(record.schema_id)
                        if schema is not None and (record.message_encoding, schema.encoding) == ("cdr", "ros2msg"):
                            text = schema.data.decode("utf-8", "replace")
                            channels[record.id] = topic_info(record, schema.name), text
                    elif isinstance(record, Attachment):
                        attachments[record.name] = record.data
                    elif isinstance(record, Metadata):
                        custom_data |= parse_custom_data(record.metadata.get("serialized_metadata", ""))
                    elif isinstance(record, Message) and record.channel_id in channels:
                        if max(record.log_time, record.publish_time) > LATEST_NS:
                            continue
                        topic, text = channels[record.channel_id]
                        writer = writer or BagWriter(output, attachments=attachments)
                        if topic.name not in writer.counts:
                            writer.add_topic(topic, text)
                        writer.write(topic.name, record.log_time, record.publish_time, record.sequence, record.data)
        if writer is None:
            raise InputError(f"bag {source}", got="no message that can be read", expected="something to recover")
        line = f"{writer.counts.total()} messages on {len(writer.counts)} topics"
        line = ", ".join((line, *(f"not readable: {loss}" for loss in losses)))
        writer.custom_data.update(custom_data, recovered="true", recovered_from=source.name, recovery=line)
        return line
    finally:
        if writer is not None:
            writer.close()
