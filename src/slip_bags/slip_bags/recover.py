"""Make a whole bag out of a killed, cut or damaged one; the original is never changed."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from mcap.records import Attachment, Channel, Chunk, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import StreamReader

from slip_bags.format import BagMetadata, TopicInfo, parse_metadata, parse_qos
from slip_bags.mcap_file import DAMAGE, LATEST_NS, MAX_BYTES, chunk_records, open_mcap
from slip_bags.writer import BagWriter
from slip_core.errors import InputError


@dataclass(slots=True)
class Losses:
    """What could not be read: chunks with damaged data, and files without a readable end."""

    chunks_dropped: int = 0
    cut_files: list[str] = field(default_factory=list)


def recover(source: Path, output: Path) -> tuple[BagMetadata, Losses]:
    """Write everything readable of a bag folder or MCAP file into a new bag, tagged ``recovered: "true"``.

    Each file is read up to its first damaged record; a chunk whose content is damaged is left out.

    Raises:
        InputError: nothing to read, nothing to save, or the output exists.
        StorageError: the disk refuses.
    """
    writer: BagWriter | None = None
    losses = Losses()
    try:
        for path in _mcap_files(source):
            schemas: dict[int, Schema] = {}
            channels: dict[int, Channel] = {}
            attachments: dict[str, bytes] = {}
            custom_data: dict[str, str] = {}
            for record in _records(path, losses):
                if isinstance(record, Schema):
                    schemas[record.id] = record
                elif isinstance(record, Channel):
                    channels[record.id] = record
                elif isinstance(record, Attachment):
                    attachments[record.name] = record.data
                elif isinstance(record, Metadata):
                    custom_data |= _custom_data(record)
                elif isinstance(record, Message) and _is_whole(record, schemas, channels):
                    writer = writer or BagWriter(output, attachments=attachments)
                    channel = channels[record.channel_id]
                    if not writer.has_topic(channel.topic):
                        _add_topic(writer, channel, schemas[channel.schema_id])
                    times = (record.log_time, record.publish_time)
                    writer.write(channel.topic, *times, record.sequence, record.data)
            if writer is not None:
                writer.custom_data.update(custom_data)
        if writer is None:
            raise InputError(f"bag {source}", got="no message that can be read", expected="something to recover")
        lost = json.dumps({"chunks_dropped": losses.chunks_dropped, "cut_files": losses.cut_files})
        writer.custom_data.update(recovered="true", recovered_from=source.name, recovery=lost)
        return writer.close(), losses
    finally:
        if writer is not None:
            writer.close()


def _mcap_files(source: Path) -> list[Path]:
    if not source.is_dir():
        return [source]
    files = sorted(source.glob("*.mcap"), key=_split_number)
    if not files:
        raise InputError(f"bag {source}", got="a folder without MCAP files", expected="a bag folder or an MCAP file")
    return files


def _split_number(path: Path) -> tuple[int, str]:
    match = re.search(r"_(\d+)$", path.stem)
    return (int(match[1]) if match else 0, path.name)


def _records(path: Path, losses: Losses) -> Iterator[McapRecord]:
    """Yield the records of a file and of its chunks, as far as it can be read."""
    with open_mcap(path) as file:
        records = StreamReader(file, emit_chunks=True, record_size_limit=MAX_BYTES).records
        while True:
            try:
                record = next(records, None)
            except DAMAGE:
                losses.cut_files.append(path.name)
                return
            if record is None:
                return
            if not isinstance(record, Chunk):
                yield record
                continue
            try:
                yield from chunk_records(record)
            except DAMAGE:
                losses.chunks_dropped += 1


def _is_whole(message: Message, schemas: dict[int, Schema], channels: dict[int, Channel]) -> bool:
    """Return whether a ROS 2 bag can hold the message: times, encoding and schema."""
    channel = channels.get(message.channel_id)
    schema = schemas.get(channel.schema_id) if channel is not None else None
    if channel is None or schema is None or max(message.log_time, message.publish_time) > LATEST_NS:
        return False
    return bool(channel.message_encoding == "cdr" and schema.encoding == "ros2msg")


def _add_topic(writer: BagWriter, channel: Channel, schema: Schema) -> None:
    info = TopicInfo(
        channel.topic,
        schema.name,
        parse_qos(channel.metadata.get("offered_qos_profiles", "")),
        channel.metadata.get("topic_type_hash", ""),
    )
    writer.add_topic(info, schema.data.decode("utf-8", "replace"))


def _custom_data(record: Metadata) -> dict[str, str]:
    try:
        text = record.metadata["serialized_metadata"]
        return dict(parse_metadata(text, "metadata record").custom_data)
    except (KeyError, InputError):
        return {}
