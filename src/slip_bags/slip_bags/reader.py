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
import os
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from shlex import quote
from types import MappingProxyType
from typing import Any, Final, NamedTuple, NoReturn

from mcap.reader import SeekingReader
from mcap.records import Message, Schema
from mcap.summary import Summary
from mcap_ros2.decoder import DecoderFactory

from slip_bags.format import RawMessage, TopicInfo, parse_custom_data
from slip_bags.mcap_file import (
    DAMAGE,
    LATEST_NS,
    RECORD_BYTES,
    DamagedError,
    mcap_files,
    records_of,
    topic_info,
)
from slip_bags.series import Series
from slip_core.errors import InputError, nearest
from slip_core.files.resources import MAX_BYTES, open_file

MOST_CHANNELS: Final = 4096
MAX_DECODED: Final = MAX_BYTES // 32
"""Bytes of a message that is decoded: an object for each byte is the most that it can become."""


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
            fix = f"`slip-vic bag recover {quote(str(self.path))}` joins them"
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
        counts = summary.statistics.channel_message_counts
        times = summary.statistics.message_start_time, summary.statistics.message_end_time
        if len(summary.channels) > MOST_CHANNELS or max(times) > LATEST_NS:
            raise DamagedError(f"times beyond the year 2262, or over {MOST_CHANNELS} channels")
        self._channels = {key: channel.topic for key, channel in summary.channels.items()}
        self._schemas: dict[str, Schema | None] = {}
        topics: dict[str, TopicInfo] = {}
        for key, channel in summary.channels.items():
            schema = self._schemas[channel.topic] = summary.schemas.get(channel.schema_id)
            known = topics.get(channel.topic) or topic_info(channel, schema.name if schema is not None else "")
            topics[channel.topic] = replace(known, message_count=known.message_count + counts.get(key, 0))
        self.topics: Mapping[str, TopicInfo] = MappingProxyType(dict(sorted(topics.items())))
        self.span_ns = times if any(counts.values()) else None
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
        """Yield stored messages in the order of the file, of some topics or of all.

        Raises:
            InputError: no such topic, or damaged data, which is found when it is reached.
        """
        wanted = set(self.topics) if topics is None else {self.topic(name).name for name in topics}
        source = self._all if len(wanted) == 1 else None
        return (message for message in source or self._stored() if message.topic in wanted)

    @functools.cached_property
    def _all(self) -> list[RawMessage] | None:
        """All messages of a short bag: a chunk holds all topics, so one pass serves all of them."""
        found, room = [], MAX_BYTES // 2
        for message in self._stored():
            room -= RECORD_BYTES + len(message.data)
            if room < 0:
                return None
            found.append(message)
        return found

    def _stored(self) -> Iterator[RawMessage]:
        with open_file(self.file, f"file {self.file}") as file:
            for record in records_of(file, self._refuse):
                if isinstance(record, Message):
                    topic = self._channels.get(record.channel_id)
                    if topic is None or max(record.log_time, record.publish_time) > LATEST_NS:
                        self._refuse("a message", DamagedError("of no channel, or of a time beyond the year 2262"))
                    yield RawMessage(topic, record.log_time, record.publish_time, record.sequence, record.data)

    def _refuse(self, part: str, error: Exception) -> NoReturn:
        raise self._damaged(error, f"damaged data in {part}") from None

    def messages(self, topic: str) -> Iterator[DecodedMessage]:
        """Yield the messages of one topic, decoded, in the order of the file.

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
        fix = f"`slip-vic bag recover {quote(str(self.path))}` saves what can be read"
        return InputError(f"bag file {self.file}", got=got, expected="a whole MCAP file with an index", fix=fix)
