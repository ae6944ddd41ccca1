"""Make a whole bag out of a killed, cut or damaged one; the original is never changed."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from mcap.records import Attachment, Channel, Chunk, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import StreamReader

from slip_bags.format import parse_custom_data
from slip_bags.mcap_file import DAMAGE, LATEST_NS, MAX_BYTES, chunk_records, mcap_files, open_mcap, topic_info
from slip_bags.writer import BagWriter
from slip_core.errors import InputError


@dataclass(slots=True)
class Recovery:
    """What was read, and what could not be: chunks with damaged data, files without a readable end."""

    messages: int = 0
    topics: int = 0
    chunks_dropped: int = 0
    cut_files: list[str] = field(default_factory=list)


def recover(source: Path, output: Path) -> Recovery:
    """Write everything readable of a bag folder or MCAP file into a new bag, tagged ``recovered: "true"``.

    Each file is read up to its first damaged record; a chunk whose content is damaged is left out.

    Raises:
        InputError: nothing to read, nothing to save, or the output exists.
        StorageError: the disk refuses.
    """
    writer: BagWriter | None = None
    found = Recovery()
    try:
        for path in mcap_files(source):
            schemas: dict[int, Schema] = {}
            channels: dict[int, Channel] = {}
            attachments: dict[str, bytes] = {}
            custom_data: dict[str, str] = {}
            for record in _records(path, found):
                if isinstance(record, Schema):
                    schemas[record.id] = record
                elif isinstance(record, Channel):
                    channels[record.id] = record
                elif isinstance(record, Attachment):
                    attachments[record.name] = record.data
                elif isinstance(record, Metadata):
                    custom_data |= parse_custom_data(record.metadata.get("serialized_metadata", ""))
                elif isinstance(record, Message) and _is_whole(record, schemas, channels):
                    writer = writer or BagWriter(output, attachments=attachments)
                    channel = channels[record.channel_id]
                    if not writer.has_topic(channel.topic):
                        schema = schemas[channel.schema_id]
                        writer.add_topic(topic_info(channel, schema.name), schema.data.decode("utf-8", "replace"))
                    writer.write(channel.topic, record.log_time, record.publish_time, record.sequence, record.data)
            if writer is not None:
                writer.custom_data.update(custom_data)
        if writer is None:
            raise InputError(f"bag {source}", got="no message that can be read", expected="something to recover")
        lost = json.dumps({"chunks_dropped": found.chunks_dropped, "cut_files": found.cut_files})
        writer.custom_data.update(recovered="true", recovered_from=source.name, recovery=lost)
        found.messages, found.topics = writer.counts.total(), len(writer.counts)
        return found
    finally:
        if writer is not None:
            writer.close()


def _records(path: Path, found: Recovery) -> Iterator[McapRecord]:
    """Yield the records of a file and of its chunks, as far as it can be read."""
    with open_mcap(path) as file:
        records = StreamReader(file, emit_chunks=True, record_size_limit=MAX_BYTES).records
        while True:
            try:
                record = next(records, None)
            except DAMAGE:
                found.cut_files.append(path.name)
                return
            if record is None:
                return
            if not isinstance(record, Chunk):
                yield record
                continue
            try:
                yield from chunk_records(record)
            except DAMAGE:
                found.chunks_dropped += 1


def _is_whole(message: Message, schemas: dict[int, Schema], channels: dict[int, Channel]) -> bool:
    """Return whether a ROS 2 bag can hold the message: times, encoding and schema."""
    channel = channels.get(message.channel_id)
    schema = schemas.get(channel.schema_id) if channel is not None else None
    if channel is None or schema is None or max(message.log_time, message.publish_time) > LATEST_NS:
        return False
    return bool(channel.message_encoding == "cdr" and schema.encoding == "ros2msg")
