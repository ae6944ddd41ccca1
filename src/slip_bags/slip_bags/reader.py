"""The one way to read a bag: folder or file, by topic, raw or decoded; no ROS needed.

    with Bag("out/vic") as bag:
        bag.topics["/wrench"].message_count
        bag.series("/wrench")["wrench.force.x"]        # (n,) array; .stamp_ns, .log_time_ns beside it
        for message in bag.messages("/wrench"):        # one by one, decoded
            message.value.wrench.force.x

Topics may be given without the leading slash.
"""

from __future__ import annotations

import functools
import itertools
import os
from bisect import bisect_left
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import replace
from operator import attrgetter
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final, NamedTuple

from mcap.reader import SeekingReader
from mcap.records import Chunk, ChunkIndex, Message, Schema
from mcap.stream_reader import StreamReader
from mcap.summary import Summary
from mcap_ros2.decoder import DecoderFactory

from slip_bags.format import TopicInfo, parse_custom_data
from slip_bags.mcap_file import (
    DAMAGE,
    LATEST_NS,
    RECORD_BYTES,
    DamagedError,
    chunk_records,
    mcap_files,
    topic_info,
)
from slip_bags.series import Series
from slip_core.errors import InputError, nearest
from slip_core.files.resources import MAX_BYTES, open_file

MOST_CHANNELS: Final = 4096
MAX_DECODED: Final = MAX_BYTES // 32
"""Bytes of a message that is decoded: an object for each byte is the most that it can become."""


class RawMessage(NamedTuple):
    """One stored message, not decoded; times in nanoseconds."""

    topic: str
    log_time_ns: int
    publish_time_ns: int
    sequence: int
    data: bytes


class DecodedMessage(NamedTuple):
    """One decoded message; `value` has the fields of its type as attributes."""

    log_time_ns: int
    publish_time_ns: int
    sequence: int
    value: Any


class Bag:
    """A bag opened for reading; a context manager.

    Args:
        path: a rosbag2 folder with one MCAP file, or the file.

    Attributes:
        topics: by name, sorted.
        span_ns: first and last log time [ns], None without messages.
        size_bytes: size of the file.

    Raises:
        InputError: no bag, a bag of another storage, cut or damaged; with what to do about it.
    """

    def __init__(self, path: Path | str) -> None:
        self.path = Path(path)
        self.file, *others = mcap_files(self.path)
        if others:
            fix = f"`slip-vic bag recover {self.path}` joins them"
            raise InputError(f"bag {self.path}", got=f"{1 + len(others)} files", expected="one MCAP file", fix=fix)
        self._file = open_file(self.file, f"file {self.file}")
        try:
            self.size_bytes = os.fstat(self._file.fileno()).st_size
            self._reader = SeekingReader(self._file, record_size_limit=min(self.size_bytes, MAX_BYTES))
            self._load(self._reader.get_summary())
        except DAMAGE as error:
            self.close()
            got = "no MCAP file with a readable end: the recorder was killed or the file is cut"
            raise self._damaged(error, got) from None

    def _load(self, summary: Summary | None) -> None:
        if summary is None or summary.statistics is None:
            raise DamagedError("no index")
        counts, chunks = summary.statistics.channel_message_counts, summary.chunk_indexes
        times = summary.statistics.message_start_time, summary.statistics.message_end_time
        if (total := sum(counts.values())) and not chunks:
            raise DamagedError("no index")
        if len(summary.channels) > MOST_CHANNELS or len({one.chunk_start_offset for one in chunks}) < len(chunks):
            raise DamagedError(f"more than {MOST_CHANNELS} channels, or chunks that are listed twice")
        if max(*times, *(chunk.message_end_time for chunk in chunks)) > LATEST_NS:
            raise DamagedError("times beyond the year 2262")
        self._channels = {key: channel.topic for key, channel in summary.channels.items()}
        self._schemas: dict[str, Schema | None] = {}
        topics: dict[str, TopicInfo] = {}
        for key, channel in summary.channels.items():
            schema = self._schemas[channel.topic] = summary.schemas.get(channel.schema_id)
            known = topics.get(channel.topic) or topic_info(channel, schema.name if schema is not None else "")
            topics[channel.topic] = replace(known, message_count=known.message_count + counts.get(key, 0))
        self.topics: Mapping[str, TopicInfo] = MappingProxyType(dict(sorted(topics.items())))
        self.span_ns = times if total else None
        self._chunks = sorted(chunks, key=lambda one: (one.message_start_time, one.chunk_start_offset))
        self._attached_bytes = sum(index.length for index in summary.attachment_indexes)

    def __enter__(self) -> Bag:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Release the file."""
        self._file.close()

    @property
    def message_count(self) -> int:
        """Messages of all topics."""
        return sum(topic.message_count for topic in self.topics.values())

    @functools.cached_property
    def custom_data(self) -> Mapping[str, str]:
        """The texts that the recorder stored."""
        found: dict[str, str] = {}
        try:
            for record in self._reader.iter_metadata():
                found = parse_custom_data(record.metadata.get("serialized_metadata", "")) or found
        except DAMAGE as error:
            raise self._damaged(error) from None
        return MappingProxyType(found)

    @functools.cached_property
    def attachments(self) -> Mapping[str, bytes]:
        """Attached files by name."""
        try:
            if self._attached_bytes > MAX_BYTES:
                raise DamagedError(f"attachments of more than {MAX_BYTES} bytes")
            return MappingProxyType({record.name: record.data for record in self._reader.iter_attachments()})
        except DAMAGE as error:
            raise self._damaged(error) from None

    def topic(self, name: str) -> TopicInfo:
        """Return a topic, with or without the leading slash.

        Raises:
            InputError: the bag has no such topic; with the nearest names.
        """
        for candidate in (name, f"/{name}"):
            if candidate in self.topics:
                return self.topics[candidate]
        raise InputError(f"topic {name} of bag {self.path}", got="no such topic", expected=nearest(name, self.topics))

    def ending(self, name: str, arm: str = "") -> str | None:
        """Return the first topic that is called so in any namespace, of an arm below its name; None without one."""
        own = f"/{arm}/{name}" if arm else f"/{name}"
        return next((topic for topic in self.topics if topic.endswith(own)), None)

    def raw(self, topics: Collection[str] | None = None) -> Iterator[RawMessage]:
        """Yield stored messages in order of log time, of some topics or of all.

        Raises:
            InputError: no such topic, or damaged data, which is found when it is reached.
        """
        wanted = set(self.topics) if topics is None else {self.topic(name).name for name in topics}
        source = self._all if len(wanted) == 1 and self._is_short else self._stored()
        return (message for message in source if message.topic in wanted)

    @property
    def _is_short(self) -> bool:
        size = sum(chunk.uncompressed_size for chunk in self._chunks)
        return size + RECORD_BYTES * self.message_count <= MAX_BYTES // 2

    @functools.cached_property
    def _all(self) -> list[RawMessage]:
        """All messages of a short bag: a chunk holds all topics, so one pass serves all of them."""
        count = self.message_count
        found = list(itertools.islice(self._stored(), count + 1))
        if len(found) > count:
            raise self._damaged(DamagedError("more messages than the index states"))
        return found

    def _stored(self) -> Iterator[RawMessage]:
        """Yield all messages by log time; those of equal times in the order of the file."""
        waiting: list[RawMessage] = []
        starts = [chunk.message_start_time for chunk in self._chunks]
        try:
            for chunk, following in zip(self._chunks, [*starts[1:], LATEST_NS + 1], strict=True):
                waiting += self._chunk_messages(chunk)
                if sum(RECORD_BYTES + len(message.data) for message in waiting) > MAX_BYTES:
                    raise DamagedError("more messages of one time than memory may hold")
                waiting.sort(key=attrgetter("log_time_ns"))
                due = bisect_left(waiting, following, key=attrgetter("log_time_ns"))
                yield from waiting[:due]
                del waiting[:due]
        except DAMAGE as error:
            raise self._damaged(error) from None

    def _chunk_messages(self, index: ChunkIndex) -> Iterator[RawMessage]:
        self._file.seek(index.chunk_start_offset)
        limit = min(self.size_bytes, MAX_BYTES)
        chunk = next(StreamReader(self._file, skip_magic=True, emit_chunks=True, record_size_limit=limit).records)
        if not isinstance(chunk, Chunk) or chunk.uncompressed_size != index.uncompressed_size:
            raise DamagedError("an index that points to something else")
        for record in chunk_records(chunk):
            if isinstance(record, Message):
                if max(record.log_time, record.publish_time) > LATEST_NS:
                    raise DamagedError("times beyond the year 2262")
                topic = self._channels[record.channel_id]
                yield RawMessage(topic, record.log_time, record.publish_time, record.sequence, record.data)

    def messages(self, topic: str) -> Iterator[DecodedMessage]:
        """Yield the messages of one topic, decoded, in order of log time.

        Raises:
            InputError: no such topic, a schema or message that cannot be decoded, or damaged data.
        """
        info = self.topic(topic)
        decode = self._decoder(info)
        for message in self.raw([info.name]):
            try:
                if len(message.data) > MAX_DECODED:
                    raise DamagedError(f"{len(message.data)} bytes, more than {MAX_DECODED}")
                value = decode(message.data)
            except Exception as error:  # the decoder is generated from the file's own schema: anything may happen
                got = " ".join(str(error).split()) or type(error).__name__
                raise InputError(f"message on {info.name}", got=got, expected=f"a {info.type_name}") from None
            yield DecodedMessage(message.log_time_ns, message.publish_time_ns, message.sequence, value)

    def series(self, topic: str) -> Series:
        """Return all messages of one topic as columns.

        Raises:
            InputError: as `messages`.
        """
        return Series(topic, self.messages(topic))

    def schema_text(self, topic: str) -> str:
        """Return the stored definition of a topic's type, with all it refers to.

        Raises:
            InputError: no such topic, or no definition stored.
        """
        return self._schema(self.topic(topic)).data.decode("utf-8", "replace")

    def _schema(self, info: TopicInfo) -> Schema:
        schema = self._schemas[info.name]
        if schema is None or info.encoding != "cdr" or schema.encoding != "ros2msg" or not schema.data:
            got = f"{info.encoding} with {schema.encoding if schema is not None and schema.data else 'no schema'}"
            raise InputError(f"topic {info.name}", got=got, expected="cdr with a ros2msg schema")
        return schema

    def _decoder(self, info: TopicInfo) -> Callable[[bytes], Any]:
        schema = self._schema(info)
        try:
            decode = DecoderFactory().decoder_for(info.encoding, schema)
        except Exception as error:  # third-party parser on the file's own text
            got = " ".join(str(error).split())
            raise InputError(f"schema of {info.name}", got=got, expected="message definitions") from None
        assert decode is not None
        return decode

    def _damaged(self, error: BaseException, what: str = "damaged data") -> InputError:
        got = f"{what} ({' '.join(str(error).split()) or type(error).__name__})"
        fix = f"`slip-vic bag recover {self.path}` saves what can be read"
        return InputError(f"bag file {self.file}", got=got, expected="a whole MCAP file with an index", fix=fix)
