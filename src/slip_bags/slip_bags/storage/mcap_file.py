"""One MCAP file opened for reading with the `mcap` package; every number that it would trust is checked before."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field, replace
from io import BytesIO
from pathlib import Path
from typing import Final

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.reader import FOOTER_SIZE, SeekingReader
from mcap.records import Attachment, AttachmentIndex, Channel, Chunk, ChunkIndex, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import StreamReader, breakup_chunk

from slip_bags.storage.scan import DAMAGE, MAGIC, MAX_CHUNK_BYTES, DamagedError, chunk_content
from slip_core.errors import InputError

_HEAD: Final = struct.Struct("<BQ")
_CHUNK: Final = struct.Struct(
    "<BQQQQII"
)  # opcode, length, first and last time, size, CRC, length of the compression's name
_LENGTH: Final = struct.Struct("<Q")
_FRAME_HEAD_BYTES: Final = 18  # of zstd, at most
MAX_UNPACKED: Final = 1 << 30
MAX_RATIO: Final = 100
"""A file of this suite holds 2 to 20 times its size; one that claims much more was made to take all memory."""
_LATEST_NS: Final = 2**63 - 1


@dataclass(slots=True)
class _Index:
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    chunks: list[ChunkIndex] = field(default_factory=list)
    attachments: list[AttachmentIndex] = field(default_factory=list)
    metadata_offsets: list[int] = field(default_factory=list)
    counts: dict[int, int] = field(default_factory=dict)
    start_ns: int = 0
    end_ns: int = 0
    # Of a file without a useful index, read as a whole:
    unchunked: list[Message] | None = None
    read_attachments: dict[str, bytes] = field(default_factory=dict)
    read_metadata: dict[str, dict[str, str]] = field(default_factory=dict)

    def note(self, record: McapRecord) -> None:
        """Keep a record of a file that is read as a whole."""
        if isinstance(record, Message):
            assert self.unchunked is not None
            self.unchunked.append(record)
            self.counts[record.channel_id] = self.counts.get(record.channel_id, 0) + 1
        elif isinstance(record, Schema):
            self.schemas[record.id] = record
        elif isinstance(record, Channel):
            self.channels[record.id] = record
        elif isinstance(record, Metadata):
            self.read_metadata[record.name] = record.metadata
        elif isinstance(record, Attachment):
            self.read_attachments[record.name] = record.data


class McapFile:
    """An indexed MCAP file.

    Args:
        path: the file.

    Raises:
        InputError: not MCAP, cut, damaged, or not readable.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            self._file = open(path, "rb")  # noqa: SIM115 - closed by `close`
            self.size = path.stat().st_size
        except OSError as error:
            raise InputError(f"bag {path}", got=error, expected="a readable file") from None
        try:
            self._check_ends()
            self._file.seek(0)
            self._reader = SeekingReader(self._file, validate_crcs=True, record_size_limit=self.size)
            self._checked: set[int] = set()
            self._index = self._load()
        except DAMAGE as error:
            self.close()
            raise self.damaged(error) from None
        except InputError:
            self.close()
            raise

    def close(self) -> None:
        """Release the file."""
        self._file.close()

    @property
    def schemas(self) -> dict[int, Schema]:
        """Schemas by id."""
        return self._index.schemas

    @property
    def channels(self) -> dict[int, Channel]:
        """Channels by id."""
        return self._index.channels

    @property
    def counts(self) -> dict[int, int]:
        """Messages per channel id."""
        return self._index.counts

    @property
    def span_ns(self) -> tuple[int, int] | None:
        """First and last log time, None without messages."""
        return (self._index.start_ns, self._index.end_ns) if sum(self.counts.values()) else None

    @property
    def compressions(self) -> list[str]:
        """The compressions used, sorted; "" is none."""
        return sorted({chunk.compression for chunk in self._index.chunks})

    def messages(
        self, topics: Collection[str], start_ns: int, end_ns: int, *, sort: bool = True
    ) -> Iterator[tuple[str, Message]]:
        """Yield (topic, message) of these topics with start <= log time <= end, by log time or in file order.

        Raises:
            InputError: a chunk is damaged.
        """
        if self._index.unchunked is not None:
            for message in self._index.unchunked:
                topic = self.channels[message.channel_id].topic
                if topic in topics and start_ns <= message.log_time <= end_ns:
                    yield topic, message
        elif start_ns <= end_ns:
            try:
                for chunk in self._index.chunks:
                    if chunk.message_end_time >= start_ns and chunk.message_start_time <= end_ns:
                        self._check_chunk(chunk)
                found = self._reader.iter_messages(
                    topics, log_time_order=sort, starting_at=start_ns, ending_at=min(end_ns, _LATEST_NS)
                )
                for _, channel, message in found:
                    if message.publish_time > _LATEST_NS:
                        raise DamagedError("times beyond the year 2262")
                    yield channel.topic, message
            except DAMAGE as error:
                raise self.damaged(error) from None

    def attachments(self) -> dict[str, bytes]:
        """Return all attachments by name.

        Raises:
            InputError: one of them is damaged.
        """
        contents = dict(self._index.read_attachments)
        try:
            for index in self._index.attachments:
                body = self._record(index.offset, Opcode.ATTACHMENT)
                (crc,) = struct.unpack_from("<I", body, len(body) - 4)
                if crc not in (0, zlib.crc32(body[:-4])):  # which the mcap package does not look at
                    raise DamagedError("an attachment's CRC is wrong")
                attachment = Attachment.read(ReadDataStream(BytesIO(body)))
                contents[attachment.name] = attachment.data
        except DAMAGE as error:
            raise self.damaged(error) from None
        return contents

    def metadata(self) -> dict[str, dict[str, str]]:
        """Return the metadata records by name, the last of each name.

        Raises:
            InputError: one of them is damaged.
        """
        found = dict(self._index.read_metadata)
        try:
            for offset in self._index.metadata_offsets:
                record = Metadata.read(ReadDataStream(BytesIO(self._record(offset, Opcode.METADATA))))
                found[record.name] = record.metadata
        except DAMAGE as error:
            raise self.damaged(error) from None
        return found

    def damaged(self, error: BaseException) -> InputError:
        """Return the error for a file that contradicts itself."""
        detail = " ".join(str(error).split()) or type(error).__name__
        return InputError(
            f"bag file {self.path}",
            got=f"damaged data ({detail})",
            expected="a whole MCAP file",
            fix=f"`slip-vic bag recover {self.path}` saves what can be saved",
        )

    def _check_ends(self) -> None:
        head = self._read(0, min(len(MAGIC), self.size))
        if self.size == 0 or head != MAGIC[: len(head)]:
            got = "an empty file" if self.size == 0 else "something else"
            raise InputError(f"bag file {self.path}", got=got, expected="an MCAP file")
        if self.size < 2 * len(MAGIC) + FOOTER_SIZE or self._read(self.size - len(MAGIC), len(MAGIC)) != MAGIC:
            raise InputError(
                f"bag file {self.path}",
                got="no end: the recorder was killed or the file was cut",
                expected="a whole MCAP file",
                fix=f"`slip-vic bag recover {self.path}` saves what is there",
            )

    def _load(self) -> _Index:
        summary = self._reader.get_summary()
        if summary is None or summary.statistics is None or not summary.channels:
            return self._scan()
        statistics = summary.statistics
        if statistics.message_count and not summary.chunk_indexes:
            return self._scan()
        index = _Index(
            schemas=dict(summary.schemas),
            channels=dict(summary.channels),
            chunks=sorted(summary.chunk_indexes, key=lambda chunk: chunk.message_start_time),
            attachments=list(summary.attachment_indexes),
            metadata_offsets=[item.offset for item in summary.metadata_indexes],
            counts={key: count for key, count in statistics.channel_message_counts.items() if count},
            start_ns=statistics.message_start_time,
            end_ns=statistics.message_end_time,
        )
        self._check_index(index)
        return index

    def _check_index(self, index: _Index) -> None:
        if max(index.start_ns, index.end_ns) > _LATEST_NS:
            raise DamagedError("times beyond the year 2262")
        unpacked = sum(chunk.uncompressed_size for chunk in index.chunks)
        if unpacked > max(MAX_UNPACKED, MAX_RATIO * self.size):
            raise DamagedError(f"{unpacked} bytes in a file of {self.size}")
        for chunk in index.chunks:
            if chunk.chunk_start_offset + chunk.chunk_length > self.size or chunk.message_end_time > _LATEST_NS:
                raise DamagedError("an index that points outside the file")
        missing = index.counts.keys() - index.channels.keys()
        if missing:
            raise DamagedError(f"messages of unknown channels {sorted(missing)}")

    def _check_chunk(self, index: ChunkIndex) -> None:
        """Refuse a chunk that is not what the index says, or that takes more memory than it says when unpacked."""
        offset = index.chunk_start_offset
        if offset in self._checked:
            return
        name = index.compression.encode()
        head = self._read(offset, _CHUNK.size + len(name) + _LENGTH.size + _FRAME_HEAD_BYTES)
        stated = (int(Opcode.CHUNK), index.chunk_length - _HEAD.size, index.uncompressed_size, len(name))
        opcode, length, _, _, size, _, name_length = _CHUNK.unpack_from(head)
        at = _CHUNK.size + len(name)
        (packed,) = _LENGTH.unpack_from(head, at)
        if size > MAX_CHUNK_BYTES:
            raise DamagedError(f"chunk of {size} bytes, more than {MAX_CHUNK_BYTES}")
        if (opcode, length, size, name_length) != stated or head[_CHUNK.size : at] != name:
            raise DamagedError("an index that points to something else")
        if at + _LENGTH.size + packed != index.chunk_length:
            raise DamagedError("a chunk that ends inside a record")
        frame = head[at + _LENGTH.size :]
        if name != b"zstd" or zstandard.frame_content_size(frame) != size:
            chunk_content(Chunk.read(ReadDataStream(BytesIO(self._record(offset, Opcode.CHUNK)))))
        self._checked.add(offset)

    def _scan(self) -> _Index:
        """Read a file without a useful index from its beginning, messages into memory."""
        index, unpacked = _Index(), 0
        index.unchunked = []
        self._file.seek(0)
        stream = StreamReader(self._file, emit_chunks=True, record_size_limit=self.size)
        for record in stream.records:
            if isinstance(record, Chunk):
                unpacked += record.uncompressed_size
                if unpacked > max(MAX_UNPACKED, MAX_RATIO * self.size):
                    raise DamagedError(f"{unpacked} bytes and more in a file of {self.size}")
                content = replace(record, compression="", data=chunk_content(record))
                for inner in breakup_chunk(content):
                    index.note(inner)
            else:
                index.note(record)
        index.unchunked.sort(key=_log_time)
        if index.unchunked:
            index.start_ns, index.end_ns = index.unchunked[0].log_time, index.unchunked[-1].log_time
        self._check_index(index)
        return index

    def _record(self, offset: int, opcode: Opcode) -> bytes:
        head = self._read(offset, _HEAD.size)
        if len(head) < _HEAD.size or head[0] != opcode:
            raise DamagedError("an index that points to something else")
        _, length = _HEAD.unpack(head)
        if length > self.size - offset - _HEAD.size:
            raise DamagedError("a record longer than the file")
        return self._read(offset + _HEAD.size, length)

    def _read(self, offset: int, length: int) -> bytes:
        self._file.seek(offset)
        return self._file.read(length)


def _log_time(message: Message) -> int:
    return message.log_time
