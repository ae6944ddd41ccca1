"""Make a whole bag out of a killed, cut or damaged one; the original is never changed."""

from __future__ import annotations

from contextlib import ExitStack, closing
from pathlib import Path

from mcap.records import Attachment, Channel, Message, Metadata, Schema

from slip_bags.format import parse_custom_data
from slip_bags.reader import mcap_file, records_of, topic_info
from slip_bags.writer import BagWriter
from slip_core.errors import InputError
from slip_core.files.resources import bounded_memory, open_file


def recover(source: Path, output: Path) -> str:
    """Write everything readable of a bag folder or MCAP file into a new bag, tagged ``recovered: "true"``.

    The file is read up to its first damaged record; a chunk whose content is damaged is left out. Return one line of
    text: what was saved, and what could not be.

    Raises:
        InputError: nothing to read, nothing to save, or the output exists.
        StorageError: the disk refuses.
    """
    writer: BagWriter | None = None
    losses: list[str] = []
    attachments: dict[str, bytes] = {}
    custom_data: dict[str, str] = {}
    schemas: dict[int, Schema] = {}
    channels: dict[int, Channel] = {}
    path = mcap_file(source)
    with bounded_memory(f"bag {source}"), open_file(path, f"file {path}") as file, ExitStack() as stack:
        for record in records_of(file, lambda part, _: losses.append(f", not readable: {part}")):
            if isinstance(record, Schema):
                schemas[record.id] = record
            elif isinstance(record, Channel):
                schema = schemas.get(record.schema_id)
                if schema is not None and (record.message_encoding, schema.encoding) == ("cdr", "ros2msg"):
                    channels[record.id] = record
            elif isinstance(record, Attachment):
                attachments[record.name] = record.data
            elif isinstance(record, Metadata):
                custom_data |= parse_custom_data(record.metadata.get("serialized_metadata", ""))
            elif isinstance(record, Message) and record.channel_id in channels:
                channel = channels[record.channel_id]
                writer = writer or stack.enter_context(closing(BagWriter(output, attachments=attachments)))
                if channel.topic not in writer.counts:
                    schema = schemas[channel.schema_id]
                    writer.add_topic(topic_info(channel, schema.name), schema.data.decode("utf-8", "replace"))
                writer.write(channel.topic, record.log_time, record.publish_time, record.sequence, record.data)
        if writer is None:
            raise InputError(f"bag {source}", got="no message that can be read", expected="something to recover")
        line = f"{writer.counts.total()} messages on {len(writer.counts)} topics{''.join(losses)}"
        writer.custom_data.update(custom_data, recovered="true", recovered_from=source.name, recovery=line)
        return line
