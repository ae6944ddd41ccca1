"""Get everything readable out of one MCAP file that is cut or damaged."""

from __future__ import annotations

import contextlib
import mmap
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Final

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, Message, Metadata, Schema

from slip_bags.storage.scan import (
    DAMAGE,
    MAGIC,
    DamagedError,
    RawRecord,
    chunk_content,
    next_chunk,
    partial_chunk,
    records,
)
from slip_core.errors import InputError

_HEAD: Final = struct.Struct("<BQ")
_FOOTER: Final = struct.Struct("<BQQQI")
_LATEST_NS: Final = 2**63 - 1
_PRIVATE: Final = 0x80  # opcodes from here on are for private records


@dataclass(slots=True)
class SalvagedMessage:
    """One message with the channel and schema it was written under."""

    channel: Channel
    schema: Schema
    log_time_ns: int
    publish_time_ns: int
    sequence: int
    data: bytes


@dataclass(slots=True)
class Salvage:
    """What was found beside the messages, and what was lost; complete when the iteration is over."""

    attachments: dict[str, bytes] = field(default_factory=dict)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    chunks: int = 0
    chunks_dropped: int = 0
    bytes_skipped: int = 0
    messages_dropped: int = 0
    cut: bool = True


def salvage(path: Path, found: Salvage) -> Iterator[SalvagedMessage]:
    """Yield the messages of a file in file order and note the rest in `found`; the file is only read.

    Chunks whose CRC is wrong are dropped, damaged stretches skipped up to the next chunk, and of a chunk cut
    off by the end of the file the readable beginning is taken.

    Raises:
        InputError: the file cannot be read, is empty, or has nothing of an MCAP file.
    """
    try:
        with open(path, "rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
            yield from _walk(data, path, found)
    except OSError as error:
        raise InputError(f"bag file {path}", got=error, expected="a readable file") from None
    except ValueError:
        raise InputError(f"bag file {path}", got="an empty file", expected="an MCAP file") from None


def _walk(data: mmap.mmap, path: Path, found: Salvage) -> Iterator[SalvagedMessage]:
    position: int | None = len(MAGIC)
    if data[: len(MAGIC)] != MAGIC:
        position = next_chunk(data, 0)
        if position is None:
            raise InputError(f"bag file {path}", got="something else", expected="an MCAP file")
        found.bytes_skipped += position
    _definitions(data, found)
    while position is not None:
        record, position = _next(data, position, found)
        if record is None:
            continue
        if record.opcode in (Opcode.DATA_END, Opcode.FOOTER):
            found.cut = False
            return
        if record.opcode == Opcode.CHUNK:
            yield from _chunk(record, found)
        else:
            yield from _record(record, found)


def _definitions(data: mmap.mmap, found: Salvage) -> None:
    """Take schemas and channels from the summary where there is one: the chunk that has them may be damaged."""
    footer = len(data) - len(MAGIC) - _FOOTER.size
    if footer < len(MAGIC):
        return
    _, length, summary_start, _, _ = _FOOTER.unpack(data[footer : footer + _FOOTER.size])
    if length != _FOOTER.size - _HEAD.size or not summary_start:
        return
    for record in records(data, summary_start, footer):
        if record.opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            for _ in _record(record, found):
                pass  # what it holds goes to `found`


def _next(data: mmap.mmap, position: int, found: Salvage) -> tuple[RawRecord | None, int | None]:
    """Return the record at `position` (None where it is damaged) and where to continue (None at the end)."""
    size = len(data)
    if position + _HEAD.size > size:
        return None, None
    record = next(records(data, position, size), None)
    if record is not None and _plausible(record):
        return record, record.end
    following = next_chunk(data, position + 1)
    if following is None and data[position] == Opcode.CHUNK and record is None:
        body = data[position + _HEAD.size : size]
        return RawRecord(Opcode.CHUNK, position, size, body), None
    found.bytes_skipped += (size if following is None else following) - position
    return None, following


def _plausible(record: RawRecord) -> bool:
    """Whether a record matches its head, so that its length can be trusted."""
    if record.opcode == Opcode.CHUNK:
        try:
            (length_at,) = struct.unpack_from("<I", record.body, 28)
            (packed,) = struct.unpack_from("<Q", record.body, 32 + length_at)
        except struct.error:
            return False
        return bool(32 + length_at + 8 + packed == len(record.body))
    return record.opcode in Opcode.__members__.values() or record.opcode >= _PRIVATE


def _chunk(record: RawRecord, found: Salvage) -> Iterator[SalvagedMessage]:
    found.chunks += 1
    data: bytes | None = None
    if not _plausible(record):
        data = partial_chunk(record.body)  # cut off by the end of the file: its data is shorter than it says
    else:
        with contextlib.suppress(*DAMAGE):
            data = chunk_content(Chunk.read(ReadDataStream(BytesIO(record.body))))
    if data is None:
        found.chunks_dropped += 1
        found.bytes_skipped += record.end - record.offset
        return
    for inner in records(data, 0, len(data)):
        yield from _record(inner, found)


def _record(record: RawRecord, found: Salvage) -> Iterator[SalvagedMessage]:
    stream = ReadDataStream(BytesIO(record.body))
    try:
        if record.opcode == Opcode.SCHEMA:
            schema = Schema.read(stream)
            found.schemas[schema.id] = schema
        elif record.opcode == Opcode.CHANNEL:
            channel = Channel.read(stream)
            found.channels[channel.id] = channel
        elif record.opcode == Opcode.METADATA:
            metadata = Metadata.read(stream)
            found.metadata[metadata.name] = metadata.metadata
        elif record.opcode == Opcode.ATTACHMENT:
            attachment = Attachment.read(stream)
            found.attachments[attachment.name] = attachment.data
        elif record.opcode == Opcode.MESSAGE:
            yield _message(record.body, found)
    except DAMAGE:
        if record.opcode == Opcode.MESSAGE:
            found.messages_dropped += 1
        else:
            found.bytes_skipped += record.end - record.offset


def _message(body: bytes, found: Salvage) -> SalvagedMessage:
    message = Message.read(ReadDataStream(BytesIO(body)), len(body))
    channel = found.channels[message.channel_id]
    schema = found.schemas[channel.schema_id]
    latest = max(message.log_time, message.publish_time)
    if latest > _LATEST_NS or channel.message_encoding != "cdr" or schema.encoding != "ros2msg":
        raise DamagedError("a message that a ROS 2 bag cannot hold")
    return SalvagedMessage(channel, schema, message.log_time, message.publish_time, message.sequence, message.data)
