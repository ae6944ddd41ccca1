"""MCAP files read with the `mcap` package, with a bound on what is held in memory.

A size that a file declares is checked before memory is taken for it: `mcap` itself unpacks whatever a chunk contains.
"""

from __future__ import annotations

import heapq
import itertools
import os
import stat
import struct
import zlib
from collections.abc import Collection, Iterator
from io import BytesIO
from pathlib import Path
from typing import IO, Final

import lz4.frame
import zstandard
from mcap.exceptions import McapError
from mcap.reader import SeekingReader
from mcap.records import Attachment, AttachmentIndex, Chunk, ChunkIndex, McapRecord, Message
from mcap.stream_reader import StreamReader
from mcap.writer import MCAP0_MAGIC

from slip_core.errors import InputError

MAX_BYTES: Final = 512 << 20
"""Bytes of one file that are in memory at once."""
MAX_MESSAGES: Final = 1_000_000
"""Messages of one file that are in memory at once: some 350 MB beside their bytes."""
LATEST_NS: Final = 2**63 - 1
_HEAD_BYTES: Final = 9  # opcode and length of a record
# What parsing a damaged file raises, here and in the mcap package.
DAMAGE: Final = (
    OSError,
    McapError,
    struct.error,
    ValueError,
    KeyError,
    IndexError,
    OverflowError,
    MemoryError,
    EOFError,
    RuntimeError,
    zstandard.ZstdError,
)


class DamagedError(ValueError):
    """A record whose content contradicts itself; the message says how."""


def open_file(path: Path) -> IO[bytes]:
    """Open a regular file for reading; a FIFO would block, and a device need not end.

    Raises:
        InputError: not readable, or not a regular file.
    """
    try:
        if not stat.S_ISREG(path.stat().st_mode):
            raise InputError(f"file {path}", got="no regular file", expected="a readable file")
        return open(path, "rb")
    except OSError as error:
        raise InputError(f"file {path}", got=error, expected="a readable file") from None


def open_mcap(path: Path) -> IO[bytes]:
    """Open a file that begins as MCAP.

    Raises:
        InputError: not readable, empty, or another kind of file.
    """
    file = open_file(path)
    head = file.read(len(MCAP0_MAGIC))
    if head != MCAP0_MAGIC:
        file.close()
        got = "something else" if head else "an empty file"
        raise InputError(f"bag file {path}", got=got, expected="an MCAP file")
    file.seek(0)
    return file


def chunk_records(chunk: Chunk) -> Iterator[McapRecord]:
    """Yield the records in a chunk.

    Raises:
        one of `DAMAGE`: cut, larger than declared, of unknown compression, or with a wrong CRC.
    """
    content = _content(chunk)
    stream = BytesIO(content)
    records = StreamReader(stream, skip_magic=True).records
    while stream.tell() < len(content):
        yield next(records)


def _content(chunk: Chunk) -> bytes:
    size = chunk.uncompressed_size
    if size > MAX_BYTES:
        raise DamagedError(f"chunk of {size} bytes, more than {MAX_BYTES}")
    if chunk.compression == "zstd":
        with zstandard.ZstdDecompressor().stream_reader(chunk.data) as reader:
            content = reader.read(size + 1)
    elif chunk.compression == "lz4":
        content = bytes(lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, max_length=size + 1))
    elif chunk.compression == "":
        content = chunk.data
    else:
        raise DamagedError(f"unknown compression {chunk.compression!r}")
    if len(content) != size:
        raise DamagedError(f"chunk declares {size} bytes and holds {'more' if len(content) > size else len(content)}")
    if chunk.uncompressed_crc not in (0, zlib.crc32(content)):
        raise DamagedError("a chunk's CRC is wrong")
    return content


class McapFile:
    """An MCAP file with an index.

    Args:
        path: the file.

    Raises:
        InputError: not MCAP, cut, damaged, without an index, or not readable.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._file = open_mcap(path)
        try:
            self.size = os.fstat(self._file.fileno()).st_size
            self._file.seek(max(self.size - len(MCAP0_MAGIC), len(MCAP0_MAGIC)))
            if self._file.read() != MCAP0_MAGIC:
                raise self._error("no end: the recorder was killed or the file was cut")
            self._load()
        except DAMAGE as error:
            self.close()
            raise self._damaged(error) from None
        except InputError:
            self.close()
            raise

    def _load(self) -> None:
        self._file.seek(0)
        self._reader = SeekingReader(self._file, record_size_limit=min(self.size, MAX_BYTES))
        summary = self._reader.get_summary()
        if summary is None or summary.statistics is None:
            raise self._error("no index")
        self._summary, statistics = summary, summary.statistics
        self.schemas, self.channels = summary.schemas, summary.channels
        self.counts = {key: count for key, count in statistics.channel_message_counts.items() if count}
        total = sum(self.counts.values())
        if total and not summary.chunk_indexes:
            raise self._error("no index")
        self.span_ns = (statistics.message_start_time, statistics.message_end_time) if total else None
        self._chunks = sorted(summary.chunk_indexes, key=lambda one: (one.message_start_time, one.chunk_start_offset))
        self.unpacked_bytes = sum(chunk.uncompressed_size for chunk in self._chunks)
        if max((0, *(self.span_ns or ()), *(chunk.message_end_time for chunk in self._chunks))) > LATEST_NS:
            raise DamagedError("times beyond the year 2262")
        if missing := self.counts.keys() - self.channels.keys():
            raise DamagedError(f"messages of unknown channels {sorted(missing)}")

    def close(self) -> None:
        """Release the file."""
        self._file.close()

    @property
    def compressions(self) -> set[str]:
        """The compressions of the chunks; "" is none."""
        return {chunk.compression for chunk in self._chunks}

    def messages(self, topics: Collection[str], start_ns: int, end_ns: int) -> Iterator[tuple[str, Message]]:
        """Yield (topic, message) of these topics with start <= log time <= end, by log time.

        Raises:
            InputError: a chunk is damaged.
        """
        channels = {key: channel.topic for key, channel in self.channels.items() if channel.topic in topics}
        waiting: list[tuple[int, int, str, Message]] = []  # heap; the number keeps the file's order at equal times
        number, held = itertools.count(), 0
        try:
            for chunk in self._chunks:
                if chunk.message_end_time < start_ns or chunk.message_start_time > end_ns:
                    continue
                while waiting and waiting[0][0] < chunk.message_start_time:
                    *_, topic, message = heapq.heappop(waiting)
                    held -= len(message.data)
                    yield topic, message
                for message in self._chunk_messages(chunk):
                    if message.channel_id in channels and start_ns <= message.log_time <= end_ns:
                        held += len(message.data)
                        if held > MAX_BYTES or len(waiting) >= MAX_MESSAGES:
                            raise DamagedError("more messages of one time than memory may hold")
                        entry = (message.log_time, next(number), channels[message.channel_id], message)
                        heapq.heappush(waiting, entry)
            while waiting:
                *_, topic, message = heapq.heappop(waiting)
                yield topic, message
        except DAMAGE as error:
            raise self._damaged(error) from None

    def _chunk_messages(self, index: ChunkIndex) -> Iterator[Message]:
        chunk = self._record(index.chunk_start_offset)
        if not isinstance(chunk, Chunk) or chunk.uncompressed_size != index.uncompressed_size:
            raise DamagedError("an index that points to something else")
        for record in chunk_records(chunk):
            if isinstance(record, Message):
                if not index.message_start_time <= record.log_time <= index.message_end_time:
                    raise DamagedError("a message outside of its chunk's time")
                if record.publish_time > LATEST_NS:
                    raise DamagedError("times beyond the year 2262")
                if record.channel_id not in self.channels:
                    raise DamagedError(f"a message of unknown channel {record.channel_id}")
                yield record

    def attachments(self) -> dict[str, bytes]:
        """Return all attachments by name.

        Raises:
            InputError: one of them is damaged, or they are too large.
        """
        try:
            if sum(index.length for index in self._summary.attachment_indexes) > MAX_BYTES:
                raise DamagedError(f"attachments of more than {MAX_BYTES} bytes")
            found = [self._attachment(index) for index in self._summary.attachment_indexes]
            return {attachment.name: attachment.data for attachment in found}
        except DAMAGE as error:
            raise self._damaged(error) from None

    def _attachment(self, index: AttachmentIndex) -> Attachment:
        record = self._record(index.offset)
        if not isinstance(record, Attachment) or len(record.data) != index.data_size:
            raise DamagedError("an index that points to something else")
        self._file.seek(index.offset + _HEAD_BYTES)
        body = self._file.read(index.length - _HEAD_BYTES)
        (crc,) = struct.unpack("<I", body[-4:])
        if crc not in (0, zlib.crc32(body[:-4])):  # the mcap package does not check it
            raise DamagedError("an attachment's CRC is wrong")
        return record

    def metadata(self) -> dict[str, dict[str, str]]:
        """Return the metadata records by name, the last of each name.

        Raises:
            InputError: one of them is damaged.
        """
        try:
            return {record.name: record.metadata for record in self._reader.iter_metadata()}
        except DAMAGE as error:
            raise self._damaged(error) from None

    def _record(self, offset: int) -> McapRecord:
        self._file.seek(offset)
        limit = min(self.size - offset, MAX_BYTES)
        return next(StreamReader(self._file, skip_magic=True, emit_chunks=True, record_size_limit=limit).records)

    def _damaged(self, error: BaseException) -> InputError:
        return self._error(f"damaged data ({' '.join(str(error).split()) or type(error).__name__})")

    def _error(self, got: str) -> InputError:
        fix = f"`slip-vic bag recover {self.path}` saves what can be read"
        return InputError(f"bag file {self.path}", got=got, expected="a whole MCAP file with an index", fix=fix)
