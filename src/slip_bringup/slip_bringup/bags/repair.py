"""Give an MCAP file without an end its index, summary and footer, inside the space it already has.

For the recorder on a full disk: what was written is kept, the last chunks make room where room is needed.
"""

from __future__ import annotations

import mmap
import os
import struct
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path

from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    ChunkIndex,
    DataEnd,
    Footer,
    McapRecord,
    MessageIndex,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

from slip_bringup.bags.scan import MAGIC, RawRecord, message_fields, open_chunk, records


@dataclass(slots=True)
class _Group:
    """A chunk with its message index records: what is kept or dropped as one."""

    end: int
    index: ChunkIndex
    counts: dict[int, int]
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class ClosedFile:
    """What a file contains after `close_in_place`: per topic counts and the span of log times."""

    counts: dict[str, int]
    start_ns: int
    end_ns: int

    @property
    def message_count(self) -> int:
        """Messages on all topics."""
        return sum(self.counts.values())


def close_in_place(path: Path, spare_bytes: int = 0) -> ClosedFile:
    """Cut `path` behind its last complete chunk and append summary and footer; never needs more space than now.

    Chunks are dropped from the end until the result is at least `spare_bytes` smaller than the file was.

    Implements: ours: a full disk must leave a bag that every reader opens.
    """
    size = path.stat().st_size
    with open(path, "rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        indexes, groups, data_end = _walk(data)
    while True:
        end = groups[-1].end if groups else data_end
        tail, closed = _tail(end, indexes, groups)
        if end + len(tail) + spare_bytes <= size or not groups:
            break
        groups.pop()
    with open(path, "r+b") as target:
        target.truncate(end)
        target.seek(end)
        target.write(tail)
        target.flush()
        os.fsync(target.fileno())
    return closed


def _walk(data: mmap.mmap) -> tuple[list[AttachmentIndex | MetadataIndex], list[_Group], int]:
    """Return the indexes of attachments and metadata, the complete chunk groups, and the end of what precedes them."""
    indexes: list[AttachmentIndex | MetadataIndex] = []
    groups: list[_Group] = []
    missing = 0
    end = len(MAGIC)
    for record in records(data, len(MAGIC), len(data)):
        if record.opcode == Opcode.CHUNK:
            if missing:
                groups.pop()
                return indexes, groups, end
            groups.append(_group(record))
            missing = len(groups[-1].counts)
        elif record.opcode == Opcode.MESSAGE_INDEX and missing:
            index = MessageIndex.read(_stream(record))
            group = groups[-1]
            group.index.message_index_offsets[index.channel_id] = record.offset
            group.index.message_index_length += record.end - record.offset
            group.end = record.end
            missing -= 1
        elif record.opcode in (Opcode.ATTACHMENT, Opcode.METADATA, Opcode.HEADER):
            # These are written before the first chunk or, by a regular close, behind the last.
            if record.opcode == Opcode.ATTACHMENT and not groups:
                indexes.append(_attachment_index(record))
            elif record.opcode == Opcode.METADATA and not groups:
                name = Metadata.read(_stream(record)).name
                indexes.append(MetadataIndex(record.offset, record.end - record.offset, name))
            if not groups:
                end = record.end
        else:
            break
    if missing:
        groups.pop()
    return indexes, groups, end


def _group(record: RawRecord) -> _Group:
    content = open_chunk(record.body)
    group = _Group(
        end=record.end,
        index=ChunkIndex(
            chunk_length=record.end - record.offset,
            chunk_start_offset=record.offset,
            compression=content.compression,
            compressed_size=content.compressed_bytes,
            message_end_time=content.end_ns,
            message_index_length=0,
            message_index_offsets={},
            message_start_time=content.start_ns,
            uncompressed_size=len(content.data),
        ),
        counts={},
    )
    for inner in records(content.data, 0, len(content.data)):
        if inner.opcode == Opcode.MESSAGE:
            channel_id = message_fields(inner.body)[0]
            group.counts[channel_id] = group.counts.get(channel_id, 0) + 1
        elif inner.opcode == Opcode.SCHEMA:
            schema = Schema.read(_stream(inner))
            group.schemas[schema.id] = schema
        elif inner.opcode == Opcode.CHANNEL:
            channel = Channel.read(_stream(inner))
            group.channels[channel.id] = channel
    return group


def _tail(
    end: int, indexes: Sequence[AttachmentIndex | MetadataIndex], groups: Sequence[_Group]
) -> tuple[bytes, ClosedFile]:
    schemas = {key: value for group in groups for key, value in group.schemas.items()}
    channels = {key: value for group in groups for key, value in group.channels.items()}
    counts: dict[int, int] = {}
    for group in groups:
        for channel_id, count in group.counts.items():
            counts[channel_id] = counts.get(channel_id, 0) + count
    attachments = [index for index in indexes if isinstance(index, AttachmentIndex)]
    metadata = [index for index in indexes if isinstance(index, MetadataIndex)]
    start_ns = min((group.index.message_start_time for group in groups), default=0)
    end_ns = max((group.index.message_end_time for group in groups), default=0)
    statistics = Statistics(
        attachment_count=len(attachments),
        channel_count=len(channels),
        channel_message_counts=counts,
        chunk_count=len(groups),
        message_count=sum(counts.values()),
        message_end_time=end_ns,
        message_start_time=start_ns,
        metadata_count=len(metadata),
        schema_count=len(schemas),
    )
    sections: list[tuple[Opcode, Sequence[McapRecord]]] = [
        (Opcode.SCHEMA, list(schemas.values())),
        (Opcode.CHANNEL, list(channels.values())),
        (Opcode.STATISTICS, [statistics]),
        (Opcode.CHUNK_INDEX, [group.index for group in groups]),
        (Opcode.ATTACHMENT_INDEX, attachments),
        (Opcode.METADATA_INDEX, metadata),
    ]
    head = _built(DataEnd(0).write)
    summary_start = end + len(head)
    summary, offsets = RecordBuilder(), RecordBuilder()
    for opcode, section in sections:
        start = summary.count
        for record in section:
            record.write(summary)
        if section:
            SummaryOffset(opcode, summary_start + start, summary.count - start).write(offsets)
    offset_start = summary_start + summary.count
    body = summary.end() + offsets.end()
    footer = struct.pack("<BQQQ", Opcode.FOOTER, 20, summary_start, offset_start)
    crc = zlib.crc32(footer, zlib.crc32(body))
    tail = head + body + _built(Footer(summary_start, offset_start, crc).write) + MAGIC
    return tail, ClosedFile({channels[key].topic: count for key, count in counts.items()}, start_ns, end_ns)


def _attachment_index(record: RawRecord) -> AttachmentIndex:
    attachment = Attachment.read(_stream(record))
    return AttachmentIndex(
        offset=record.offset,
        length=record.end - record.offset,
        log_time=attachment.log_time,
        create_time=attachment.create_time,
        data_size=len(attachment.data),
        name=attachment.name,
        media_type=attachment.media_type,
    )


def _stream(record: RawRecord) -> ReadDataStream:
    return ReadDataStream(BytesIO(record.body))


def _built(write: Callable[[RecordBuilder], None]) -> bytes:
    builder = RecordBuilder()
    write(builder)
    return builder.end()
