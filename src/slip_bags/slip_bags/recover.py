"""Make a whole bag out of a killed, cut or damaged one; the original is never changed."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from mcap.records import Attachment, Channel, Chunk, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import StreamReader

from slip_bags.format import parse_custom_data
from slip_bags.mcap_file import DAMAGE, LATEST_NS, chunk_records, mcap_files, topic_info
from slip_bags.writer import BagWriter
from slip_core.errors import InputError
from slip_core.files.resources import MAX_BYTES, open_file


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
    try:
        for path in mcap_files(source):
            schemas: dict[int, Schema] = {}
            channels: dict[int, Channel] = {}
            for record in _records(path, losses):
                if isinstance(record, Schema):
                    schemas[record.id] = record
                elif isinstance(record, Channel):
                    channels[record.id] = record
                elif isinstance(record, Attachment):
                    attachments[record.name] = record.data
                elif isinstance(record, Metadata):
                    custom_data |= parse_custom_data(record.metadata.get("serialized_metadata", ""))
                elif isinstance(record, Message) and (channel := channels.get(record.channel_id)) is not None:
                    schema = schemas.get(channel.schema_id)
                    is_ros = schema is not None and (channel.message_encoding, schema.encoding) == ("cdr", "ros2msg")
                    if schema is None or not is_ros or max(record.log_time, record.publish_time) > LATEST_NS:
                        continue
                    writer = writer or BagWriter(output, attachments=attachments)
                    if not writer.has_topic(channel.topic):
                        writer.add_topic(topic_info(channel, schema.name), schema.data.decode("utf-8", "replace"))
                    writer.write(channel.topic, record.log_time, record.publish_time, record.sequence, record.data)
        if writer is None:
            raise InputError(f"bag {source}", got="no message that can be read", expected="something to recover")
        line = f"{writer.counts.total()} messages on {len(writer.counts)} topics"
        line = ", ".join((line, *(f"not readable: {loss}" for loss in losses)))
        writer.custom_data.update(custom_data, recovered="true", recovered_from=source.name, recovery=line)
        return line
    finally:
        if writer is not None:
            writer.close()


def _records(path: Path, losses: list[str]) -> Iterator[McapRecord]:
    """Yield the records of a file and of its chunks, as far as it can be read."""
    with open_file(path, f"file {path}") as file:
        records = StreamReader(file, emit_chunks=True, record_size_limit=MAX_BYTES).records
        while True:
            try:
                record = next(records, None)
            except DAMAGE:
                losses.append(f"the end of {path.name}")
                return
            if record is None:
                return
            if not isinstance(record, Chunk):
                yield record
                continue
            try:
                contents = chunk_records(record)
            except DAMAGE:
                losses.append(f"a chunk of {path.name}")
            else:
                yield from contents
