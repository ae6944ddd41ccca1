"""End an MCAP file whose writing failed inside the space that it has: on a full disk the `mcap` package cannot."""

from __future__ import annotations

import mmap
import os
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path

from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    McapRecord,
    MessageIndex,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
)

from slip_bags.storage.scan import MAGIC, RawRecord, chunk_content, records


@dataclass(slots=True)
class _WholeChunk:
    index: ChunkIndex
    counts: Counter[int]
    end: int


@dataclass(slots=True)
class Contents:
    """What a file holds: messages per topic, first and last log time (0 without messages)."""

    counts: Counter[str] = field(default_factory=Counter)
    start_ns: int = 0
    end_ns: int = 0


def close_in_place(path: Path, spare_bytes: int) -> Contents:
    """Cut a file without an end behind its last whole chunk and end it there; returns what it holds then.

    Chunks are dropped from the end until the file is at least `spare_bytes` smaller than it was, so that no more
    space is needed than it has.

    Raises:
        ValueError: the file has no beginning.
        OSError: the disk refuses.
    """
    with open(path, "r+b") as file:
        size = os.fstat(file.fileno()).st_size
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
            found = _Found.of(data, size)
        while True:
            end = found.chunks[-1].end if found.chunks else found.head_end
            tail = found.tail(end)
            if end + len(tail) + spare_bytes <= size or not found.chunks:
                break
            found.chunks.pop()
        file.truncate(end)
        file.seek(end)
        file.write(tail)
        file.flush()
        os.fsync(file.fileno())
    return found.contents()


@dataclass(slots=True)
class _Found:
    """What a file without an end has, in whole records."""

    head_end: int = 0
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    attachments: list[AttachmentIndex] = field(default_factory=list)
    metadata: list[MetadataIndex] = field(default_factory=list)
    chunks: list[_WholeChunk] = field(default_factory=list)

    @classmethod
    def of(cls, data: mmap.mmap, size: int) -> _Found:
        found, chunk, defined = cls(), None, False
        for record in records(data, len(MAGIC), size):
            if record.opcode == Opcode.DATA_END:
                break
            stream, length = ReadDataStream(BytesIO(record.body)), record.end - record.offset
            if record.opcode == Opcode.CHUNK:
                chunk, defined = Chunk.read(stream), False
                found.chunks.append(_WholeChunk(_index(record, chunk), Counter(), record.end))
            elif record.opcode == Opcode.MESSAGE_INDEX and chunk is not None:
                index = MessageIndex.read(stream)
                if index.channel_id not in found.channels and not defined:
                    found._define(chunk)
                    defined = True
                found.chunks[-1].counts[index.channel_id] = len(index.records)
                found.chunks[-1].index.message_index_offsets[index.channel_id] = record.offset
                found.chunks[-1].index.message_index_length += length
                found.chunks[-1].end = record.end
            elif not found.chunks:
                found.head_end = record.end
                if record.opcode == Opcode.METADATA:
                    name = Metadata.read(stream).name
                    found.metadata.append(MetadataIndex(record.offset, length, name))
                elif record.opcode == Opcode.ATTACHMENT:
                    file = Attachment.read(stream)
                    times, size_ = (file.log_time, file.create_time), len(file.data)
                    found.attachments.append(
                        AttachmentIndex(record.offset, length, *times, size_, file.name, file.media_type)
                    )
        if not found.head_end:
            raise ValueError("the file has no beginning")
        if chunk is not None:
            written = sum(record.opcode == Opcode.MESSAGE for record in _inside(chunk))
            if found.chunks[-1].counts.total() != written:  # its index is cut
                found.chunks.pop()
        return found

    def _define(self, chunk: Chunk) -> None:
        for record in _inside(chunk):
            if record.opcode == Opcode.SCHEMA:
                schema = Schema.read(ReadDataStream(BytesIO(record.body)))
                self.schemas[schema.id] = schema
            elif record.opcode == Opcode.CHANNEL:
                channel = Channel.read(ReadDataStream(BytesIO(record.body)))
                self.channels[channel.id] = channel

    def contents(self) -> Contents:
        counts: Counter[str] = Counter()
        for chunk in self.chunks:
            for channel_id, count in chunk.counts.items():
                counts[self.channels[channel_id].topic] += count
        start_ns = min((chunk.index.message_start_time for chunk in self.chunks), default=0)
        return Contents(counts, start_ns, max((chunk.index.message_end_time for chunk in self.chunks), default=0))

    def tail(self, end: int) -> bytes:
        """Return all that comes behind `end`: end of data, summary, footer, magic."""
        counts: Counter[int] = Counter()
        for chunk in self.chunks:
            counts.update(chunk.counts)
        whole = self.contents()
        statistics = Statistics(
            attachment_count=len(self.attachments),
            channel_count=len(self.channels),
            channel_message_counts=dict(counts),
            chunk_count=len(self.chunks),
            message_count=counts.total(),
            message_end_time=whole.end_ns,
            message_start_time=whole.start_ns,
            metadata_count=len(self.metadata),
            schema_count=len(self.schemas),
        )
        data_end = _built([DataEnd(0)])
        indexes = [*(chunk.index for chunk in self.chunks), *self.attachments, *self.metadata]
        summary = _built([*self.schemas.values(), *self.channels.values(), statistics, *indexes])
        return data_end + summary + _built([Footer(end + len(data_end), 0, 0)]) + MAGIC


def _index(record: RawRecord, chunk: Chunk) -> ChunkIndex:
    return ChunkIndex(
        chunk_length=record.end - record.offset,
        chunk_start_offset=record.offset,
        compression=chunk.compression,
        compressed_size=len(chunk.data),
        message_end_time=chunk.message_end_time,
        message_index_length=0,
        message_index_offsets={},
        message_start_time=chunk.message_start_time,
        uncompressed_size=chunk.uncompressed_size,
    )


def _inside(chunk: Chunk) -> Iterator[RawRecord]:
    content = chunk_content(chunk)
    return records(content, 0, len(content))


def _built(parts: Sequence[McapRecord]) -> bytes:
    builder = RecordBuilder()
    for record in parts:
        record.write(builder)
    return bytes(builder.end())
