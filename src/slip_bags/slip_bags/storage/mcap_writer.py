"""Write one MCAP file chunk by chunk, and give it an end inside the space it has when the disk is full.

The `mcap` package forms the records other than messages. Its own writer is not used: it cannot end a file inside the
space it has, and it takes 3.6 us for a message of a recorded run where this one takes 1.1 us (`python
test/system/bags/measure.py writer`), of the 18 us that the recorder needs for it in all.
"""

from __future__ import annotations

import io
import os
import struct
import zlib
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import lz4.frame
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

from slip_bags.storage.scan import MAGIC

CHUNK_BYTES: Final = 786432  # rosbag2's chunk size
LEVEL: Final = 3  # of zstd: its default
_MESSAGE: Final = struct.Struct("<BQHIQQ")
_MESSAGE_FIELDS_BYTES: Final = 22
_MESSAGE_OPCODE: Final = int(Opcode.MESSAGE)
_COMPRESSIONS: Final[Mapping[str, tuple[str, Callable[[bytes], bytes]]]] = {
    "zstd": ("zstd", zstandard.ZstdCompressor(LEVEL).compress),
    "lz4": ("lz4", lz4.frame.compress),
    "none": ("", bytes),
}
COMPRESSIONS: Final = tuple(_COMPRESSIONS)


@dataclass(frozen=True, slots=True)
class _WrittenChunk:
    end: int
    index: ChunkIndex
    counts: Mapping[int, int]


@dataclass(frozen=True, slots=True)
class Contents:
    """What a file holds: messages per topic, first and last log time (0 without messages)."""

    counts: Counter[str]
    start_ns: int
    end_ns: int


class McapWriter:
    """One file; `start` first, then topics and messages, then `finish`.

    Args:
        file: a new file, unbuffered.
        compression: one of `COMPRESSIONS`.
    """

    def __init__(self, file: io.FileIO, compression: str) -> None:
        self._file = file
        self._compression, self._compress = _COMPRESSIONS[compression]
        self._position = 0
        self._head_end = 0
        self._schemas: list[Schema] = []
        self._channels: list[Channel] = []
        self._attachments: list[AttachmentIndex] = []
        self._metadata: list[MetadataIndex] = []
        self._chunks: list[_WrittenChunk] = []
        self._content = bytearray()
        self._index: dict[int, list[int]] = {}  # per channel: log time, offset, log time, offset ...
        self._times: list[int] = []

    @property
    def size(self) -> int:
        """Bytes in the file, without the running chunk."""
        return self._position

    @property
    def contents(self) -> Contents:
        """What has been given to this writer, the running chunk included."""
        written = self._contents(self._chunks)
        running = {self._channels[key - 1].topic: len(index) // 2 for key, index in self._index.items()}
        times = [*self._times, *((written.start_ns, written.end_ns) if written.counts else ())]
        return Contents(written.counts + Counter(running), min(times, default=0), max(times, default=0))

    def start(
        self, profile: str, library: str, attachments: Mapping[str, tuple[str, bytes]], metadata: Metadata
    ) -> None:
        """Write what precedes the messages; attachments are given as media type and data by name."""
        self._write(MAGIC + _built(Header(profile, library)))
        self.add_metadata(metadata)
        for name, (media_type, data) in attachments.items():
            record = _built(Attachment(0, 0, name, media_type, data))
            index = AttachmentIndex(self._position, len(record), 0, 0, len(data), name, media_type)
            self._write(record)
            self._attachments.append(index)
        self._head_end = self._position

    def add_schema(self, name: str, encoding: str, data: bytes) -> int:
        """Announce a message type; returns its number."""
        schema = Schema(len(self._schemas) + 1, data, encoding, name)
        self._schemas.append(schema)
        self._content += _built(schema)
        return schema.id

    def schema_id(self, name: str) -> int | None:
        """Return the number of a message type that was announced, else None."""
        return next((schema.id for schema in self._schemas if schema.name == name), None)

    def add_channel(self, topic: str, encoding: str, schema_id: int, metadata: Mapping[str, str]) -> int:
        """Announce a topic; returns its number."""
        channel = Channel(len(self._channels) + 1, topic, encoding, dict(metadata), schema_id)
        self._channels.append(channel)
        self._content += _built(channel)
        return channel.id

    def add_message(self, channel_id: int, log_time_ns: int, publish_time_ns: int, sequence: int, data: bytes) -> None:
        """Append one message to the running chunk; a full chunk is written."""
        content = self._content
        index = self._index.get(channel_id)
        if index is None:
            index = self._index[channel_id] = []
        index += (log_time_ns, len(content))
        self._times.append(log_time_ns)
        content += _MESSAGE.pack(
            _MESSAGE_OPCODE,
            _MESSAGE_FIELDS_BYTES + len(data),
            channel_id,
            sequence & 0xFFFFFFFF,
            log_time_ns,
            publish_time_ns,
        )
        content += data
        if len(content) > CHUNK_BYTES:
            self.flush()

    def add_metadata(self, metadata: Metadata) -> None:
        """Write a metadata record."""
        record = _built(metadata)
        index = MetadataIndex(self._position, len(record), metadata.name)
        self._write(record)
        self._metadata.append(index)

    def flush(self) -> None:
        """Write the running chunk, if it has messages, and its index."""
        if not self._index:
            return
        content = bytes(self._content)
        packed = self._compress(content)
        start_ns, end_ns = min(self._times), max(self._times)
        record = _built(Chunk(self._compression, packed, end_ns, start_ns, zlib.crc32(content), len(content)))
        parts, offsets, position = [record], {}, self._position + len(record)
        for channel_id, index in self._index.items():
            body = struct.pack(f"<HI{len(index)}Q", channel_id, 8 * len(index), *index)
            offsets[channel_id] = position
            parts.append(struct.pack("<BQ", Opcode.MESSAGE_INDEX, len(body)) + body)
            position += len(parts[-1])
        chunk_index = ChunkIndex(
            chunk_length=len(record),
            chunk_start_offset=self._position,
            compression=self._compression,
            compressed_size=len(packed),
            message_end_time=end_ns,
            message_index_length=position - self._position - len(record),
            message_index_offsets=offsets,
            message_start_time=start_ns,
            uncompressed_size=len(content),
        )
        counts = {channel_id: len(index) // 2 for channel_id, index in self._index.items()}
        self._content, self._index, self._times = bytearray(), {}, []
        self._write(b"".join(parts))
        self._chunks.append(_WrittenChunk(position, chunk_index, counts))

    def finish(self, metadata: Metadata) -> None:
        """Write the running chunk, the last metadata record, the summary and the end."""
        self.flush()
        self.add_metadata(metadata)
        self._write(self._tail(self._position, self._chunks, self._metadata))

    def finish_in_place(self, spare_bytes: int) -> Contents:
        """After a failed write: cut behind the last whole chunk and end the file there; returns what it holds.

        Chunks are dropped from the end until the file is at least `spare_bytes` smaller than it was, so that no
        more space is needed than it has.

        Raises:
            ValueError: not even the head of the file was written.
        """
        if not self._head_end:
            raise ValueError("the file has no beginning")
        size = os.fstat(self._file.fileno()).st_size
        chunks = list(self._chunks)
        metadata = [index for index in self._metadata if index.offset < self._head_end]
        while True:
            end = chunks[-1].end if chunks else self._head_end
            tail = self._tail(end, chunks, metadata)
            if end + len(tail) + spare_bytes <= size or not chunks:
                break
            chunks.pop()
        self._file.truncate(end)
        self._file.seek(end)
        self._write(tail)
        return self._contents(chunks)

    def _write(self, data: bytes) -> None:
        view = memoryview(data)
        while view:
            view = view[self._file.write(view) :]
        self._position += len(data)

    def _contents(self, chunks: Sequence[_WrittenChunk]) -> Contents:
        counts: Counter[str] = Counter()
        for chunk in chunks:
            for channel_id, count in chunk.counts.items():
                counts[self._channels[channel_id - 1].topic] += count
        start_ns = min((chunk.index.message_start_time for chunk in chunks), default=0)
        return Contents(counts, start_ns, max((chunk.index.message_end_time for chunk in chunks), default=0))

    def _tail(self, end: int, chunks: Sequence[_WrittenChunk], metadata: Sequence[MetadataIndex]) -> bytes:
        """Return all that comes behind `end`: end of data, summary, footer, magic."""
        contents = self._contents(chunks)
        counts: Counter[int] = Counter()
        for chunk in chunks:
            counts.update(chunk.counts)
        statistics = Statistics(
            attachment_count=len(self._attachments),
            channel_count=len(self._channels),
            channel_message_counts=dict(counts),
            chunk_count=len(chunks),
            message_count=counts.total(),
            message_end_time=contents.end_ns,
            message_start_time=contents.start_ns,
            metadata_count=len(metadata),
            schema_count=len(self._schemas),
        )
        sections: list[tuple[Opcode, Sequence[McapRecord]]] = [
            (Opcode.SCHEMA, self._schemas),
            (Opcode.CHANNEL, self._channels),
            (Opcode.STATISTICS, [statistics]),
            (Opcode.CHUNK_INDEX, [chunk.index for chunk in chunks]),
            (Opcode.ATTACHMENT_INDEX, self._attachments),
            (Opcode.METADATA_INDEX, metadata),
        ]
        data_end = _built(DataEnd(0))
        start = end + len(data_end)
        summary, offsets = b"", b""
        for opcode, section in sections:
            body = b"".join(_built(record) for record in section)
            if body:
                offsets += _built(SummaryOffset(opcode, start + len(summary), len(body)))
            summary += body
        offset_start = start + len(summary)
        head = struct.pack("<BQQQ", Opcode.FOOTER, 20, start, offset_start)
        footer = Footer(start, offset_start, zlib.crc32(head, zlib.crc32(summary + offsets)))
        return data_end + summary + offsets + _built(footer) + MAGIC


def _built(record: McapRecord) -> bytes:
    builder = RecordBuilder()
    record.write(builder)
    return bytes(builder.end())
