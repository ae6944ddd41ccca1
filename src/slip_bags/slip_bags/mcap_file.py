"""MCAP files for the `mcap` package, with a bound on what is held in memory.

A size that a file declares is checked before memory is taken for it: `mcap` itself unpacks whatever a chunk contains.
"""

from __future__ import annotations

import dataclasses
import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO, Final

import lz4.frame
import zstandard
from mcap.exceptions import McapError
from mcap.records import Channel, Chunk, McapRecord
from mcap.stream_reader import StreamReader, breakup_chunk

from slip_bags.format import TopicInfo, parse_qos
from slip_core.errors import InputError
from slip_core.files.resources import MAX_BYTES

RECORD_BYTES: Final = 350
"""What a record takes in memory beside its content."""
LATEST_NS: Final = 2**63 - 1
# What parsing a damaged file raises, here and in the mcap package.
DAMAGE: Final = (
    OSError, McapError, struct.error, ArithmeticError, ValueError, LookupError, MemoryError, EOFError, RuntimeError,
    zstandard.ZstdError,
)  # fmt: skip


class DamagedError(ValueError):
    """A record whose content contradicts itself; the message says how."""


def mcap_files(path: Path) -> list[Path]:
    """Return the MCAP files of a bag folder in their order, or the one file.

    Raises:
        InputError: a folder without MCAP files.
    """
    if not path.is_dir():
        return [path]
    files = sorted(path.glob("*.mcap"), key=lambda file: (len(file.name), file.name))  # x_2 before x_10
    if not files:
        fix = "a bag that is compressed as a whole: ros2 bag convert"
        raise InputError(f"bag {path}", got="no MCAP file in this folder", expected="at least one", fix=fix)
    return files


def chunk_records(chunk: Chunk) -> list[McapRecord]:
    """Return the records in a chunk.

    Raises:
        one of `DAMAGE`: cut, larger than declared, of unknown compression, or with a wrong CRC.
    """
    size = chunk.uncompressed_size
    if (room := MAX_BYTES - 2 * size) < 0:  # its content, and that of each record
        raise DamagedError(f"chunk of {size} bytes, more than memory may hold")
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
    at = 0
    while at < size and room >= 0:
        at += 9 + int.from_bytes(content[at + 1 : at + 9], "little")
        room -= RECORD_BYTES
    if room < 0:
        raise DamagedError("chunk with more records than memory may hold")
    return breakup_chunk(dataclasses.replace(chunk, compression="", data=content), validate_crc=True)


def records_of(file: IO[bytes], report: Callable[[str, Exception], None]) -> Iterator[McapRecord]:
    """Yield the records of a file and of its chunks, in their order.

    Args:
        file: at its begin.
        report: called with what is damaged, "the end" or "a chunk", which is left out; it may raise.
    """
    records = StreamReader(file, emit_chunks=True, record_size_limit=MAX_BYTES).records
    while True:
        part = "the end"
        try:
            record = next(records, None)
            part = "a chunk"
            contents = chunk_records(record) if isinstance(record, Chunk) else [record]
        except DAMAGE as error:
            report(part, error)
            if part == "the end":
                return
            continue
        if record is None:
            return
        yield from contents


def topic_info(channel: Channel, type_name: str, count: int = 0) -> TopicInfo:
    """Return what a channel says of its topic."""
    return TopicInfo(
        channel.topic,
        type_name,
        parse_qos(channel.metadata.get("offered_qos_profiles", "")),
        channel.metadata.get("topic_type_hash", ""),
        count,
        channel.message_encoding,
    )
