"""Walk the records of an MCAP file with every length checked: for files that may be cut or damaged.

Nothing here trusts a number in the file before comparing it with what is there; the `mcap` package's
reader is used for whole files, this module for the others.
"""

from __future__ import annotations

import contextlib
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, Protocol, overload

import lz4.frame
import zstandard
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC

MAGIC: Final = MCAP0_MAGIC
MAX_CHUNK_BYTES: Final = 1 << 30  # beyond any chunk a recorder writes; stops a damaged size from taking all memory
_HEAD: Final = struct.Struct("<BQ")
_CHUNK: Final = struct.Struct("<QQQI")
_MESSAGE: Final = struct.Struct("<HIQQ")


# What parsing a damaged file can raise, here and in the mcap package.
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
    zstandard.ZstdError,
)


class DamagedError(ValueError):
    """A record whose content contradicts itself; the message says how."""


class Data(Protocol):
    """What is scanned: bytes or a memory map."""

    def __len__(self) -> int: ...
    @overload
    def __getitem__(self, index: int) -> int: ...
    @overload
    def __getitem__(self, index: slice) -> bytes: ...
    def __getitem__(self, index: int | slice) -> int | bytes: ...
    def find(self, sub: bytes, start: int, /) -> int: ...  # noqa: D102


@dataclass(frozen=True, slots=True)
class RawRecord:
    """One complete record: where it starts and ends, and its content without opcode and length."""

    opcode: int
    offset: int
    end: int
    body: bytes


@dataclass(frozen=True, slots=True)
class ChunkContent:
    """A chunk after decompression; `intact` says that the stored CRC agrees (or that there is none)."""

    start_ns: int
    end_ns: int
    compression: str
    compressed_bytes: int
    data: bytes
    intact: bool


def records(data: Data, start: int, end: int) -> Iterator[RawRecord]:
    """Yield the complete records in ``data[start:end]``, in file order; stop at the first that is cut.

    Implements: ours: opcode, length and content must all lie inside.
    """
    position = start
    while position + _HEAD.size <= end:
        opcode, length = _HEAD.unpack(data[position : position + _HEAD.size])
        content = position + _HEAD.size
        if opcode == 0 or length > end - content:
            return
        yield RawRecord(opcode, position, content + length, data[content : content + length])
        position = content + length


def open_chunk(body: bytes) -> ChunkContent:
    """Decompress a chunk record.

    Raises:
        DamagedError: where the header does not fit, the compression is unknown or the data cannot be decompressed.
    """
    try:
        start_ns, end_ns, size, crc = _CHUNK.unpack_from(body)
        compression, position = _string(body, _CHUNK.size)
        (length,) = struct.unpack_from("<Q", body, position)
    except struct.error:
        raise DamagedError("chunk header is cut") from None
    packed = body[position + 8 :]
    if length != len(packed):
        raise DamagedError(f"chunk says {length} bytes and has {len(packed)}")
    if size > MAX_CHUNK_BYTES:
        raise DamagedError(f"chunk of {size} bytes, more than {MAX_CHUNK_BYTES}")
    content = _decompress(compression, packed, size)
    if len(content) != size:
        raise DamagedError(f"chunk says {size} bytes and holds {len(content)}")
    intact = crc == 0 or zlib.crc32(content) == crc
    return ChunkContent(start_ns, end_ns, compression, len(packed), content, intact)


def message_fields(body: bytes) -> tuple[int, int, int, int, bytes]:
    """Split a message record into channel id, sequence, log time, publish time and payload.

    Raises:
        DamagedError: where it is shorter than its fixed fields.
    """
    if len(body) < _MESSAGE.size:
        raise DamagedError("message record is cut")
    channel, sequence, log_time, publish_time = _MESSAGE.unpack_from(body)
    return channel, sequence, log_time, publish_time, body[_MESSAGE.size :]


def partial_chunk(body: bytes) -> bytes:
    """Return the beginning of a cut chunk's content, as far as it can be decompressed; no CRC can vouch for it.

    Implements: ours: the messages before the cut are whole.
    """
    with contextlib.suppress(*DAMAGE, RuntimeError):
        compression, position = _string(body, _CHUNK.size)
        packed = body[position + 8 :]
        if compression == "":
            return packed
        if compression == "zstd":
            return zstandard.ZstdDecompressor().decompressobj().decompress(packed)
        if compression == "lz4":
            return bytes(lz4.frame.LZ4FrameDecompressor().decompress(packed, max_length=MAX_CHUNK_BYTES))
    return b""


def next_chunk(data: Data, start: int) -> int | None:
    """Return the offset of the next thing from `start` on that looks like a compressed chunk record, or None.

    Implements: ours: finds the way again behind damage, by the name of the compression.
    """
    found = [offset for name in (b"zstd", b"lz4") if (offset := _next_chunk_of(data, start, name)) is not None]
    return min(found, default=None)


def _next_chunk_of(data: Data, start: int, compression: bytes) -> int | None:
    pattern = struct.pack("<I", len(compression)) + compression
    lead = _HEAD.size + _CHUNK.size
    at = data.find(pattern, start + lead)
    while at >= 0:
        offset = at - lead
        opcode, length = _HEAD.unpack(data[offset : offset + _HEAD.size])
        if opcode == Opcode.CHUNK and length <= len(data) - offset - _HEAD.size:
            return offset
        at = data.find(pattern, at + 1)
    return None


def _string(body: bytes, position: int) -> tuple[str, int]:
    (length,) = struct.unpack_from("<I", body, position)
    raw = body[position + 4 : position + 4 + length]
    return raw.decode("utf-8", "replace"), position + 4 + length


def _decompress(compression: str, packed: bytes, size: int) -> bytes:
    try:
        if compression == "":
            return packed
        if compression == "zstd":
            if zstandard.frame_content_size(packed) > size:
                raise DamagedError("zstd frame is larger than the chunk says")
            return zstandard.ZstdDecompressor().decompress(packed, max_output_size=size)
        if compression == "lz4":
            return bytes(lz4.frame.LZ4FrameDecompressor().decompress(packed, max_length=size))
    except (*DAMAGE, RuntimeError) as error:
        raise DamagedError(f"{compression} data: {error}") from None
    raise DamagedError(f"unknown compression {compression!r}")
