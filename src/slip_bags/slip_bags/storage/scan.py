"""Walk the records of an MCAP file with every length checked: for files that may be cut or damaged.

Nothing here trusts a number in the file before comparing it with what is there. Whole files are read with the `mcap`
package.
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
from mcap.records import Chunk
from mcap.writer import MCAP0_MAGIC

MAGIC: Final = MCAP0_MAGIC
MAX_CHUNK_BYTES: Final = 1 << 28
"""Beyond any chunk a recorder writes; stops a damaged size, or a small file made for it, from taking all memory."""
_HEAD: Final = struct.Struct("<BQ")
_CHUNK: Final = struct.Struct("<QQQI")
_PIECE: Final = 1 << 16


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


def records(data: Data, start: int, end: int) -> Iterator[RawRecord]:
    """Yield the complete records in ``data[start:end]``, in file order; stop at the first that is cut."""
    position = start
    while position + _HEAD.size <= end:
        opcode, length = _HEAD.unpack(data[position : position + _HEAD.size])
        content = position + _HEAD.size
        if opcode == 0 or length > end - content:
            return
        yield RawRecord(opcode, position, content + length, data[content : content + length])
        position = content + length


def chunk_content(chunk: Chunk) -> bytes:
    """Return the records in a chunk.

    Raises:
        one of `DAMAGE`: where it is cut, larger than it says, of unknown compression, or its CRC is wrong.
    """
    size, packed = chunk.uncompressed_size, chunk.data
    if size > MAX_CHUNK_BYTES:
        raise DamagedError(f"chunk of {size} bytes, more than {MAX_CHUNK_BYTES}")
    if chunk.compression not in ("", "zstd", "lz4"):
        raise DamagedError(f"unknown compression {chunk.compression!r}")
    content = _unpacked(chunk.compression, packed, size)
    if len(content) != size:
        raise DamagedError(f"chunk declares {size} bytes and holds {'more' if len(content) > size else len(content)}")
    if chunk.uncompressed_crc not in (0, zlib.crc32(content)):
        raise DamagedError("a chunk's CRC is wrong")
    return content


def _unpacked(compression: str, packed: bytes, size: int) -> bytes:
    """Return what was compressed, and one byte more than `size` at most, whatever the data says of itself."""
    if compression == "zstd":
        with zstandard.ZstdDecompressor().stream_reader(packed) as reader:
            return reader.read(size + 1)
    if compression == "lz4":
        try:
            return bytes(lz4.frame.LZ4FrameDecompressor().decompress(packed, max_length=size + 1))
        except RuntimeError as error:
            raise DamagedError(str(error)) from None
    return packed


def partial_chunk(body: bytes) -> bytes:
    """Return the beginning of a cut chunk's content, as far as it can be decompressed; no CRC can vouch for it."""
    with contextlib.suppress(*DAMAGE, RuntimeError):
        compression, position = _string(body, _CHUNK.size)
        packed = body[position + 8 :]
        if compression == "zstd":
            return _beginning(packed)
        return _unpacked(compression, packed, MAX_CHUNK_BYTES)
    return b""


def _beginning(packed: bytes) -> bytes:
    """Return what can be read of a cut zstd frame."""
    found = bytearray()
    with contextlib.suppress(zstandard.ZstdError), zstandard.ZstdDecompressor().stream_reader(packed) as reader:
        while len(found) < MAX_CHUNK_BYTES and (piece := reader.read(_PIECE)):
            found += piece
    return bytes(found)


def next_chunk(data: Data, start: int) -> int | None:
    """Return the offset of the next thing from `start` on that looks like a compressed chunk record, or None."""
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
