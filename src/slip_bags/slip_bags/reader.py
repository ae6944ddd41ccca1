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
import heapq
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import replace
from operator import attrgetter
from pathlib import Path, PurePath
from types import MappingProxyType
from typing import Any, NamedTuple

from mcap.records import Message
from mcap.records import Schema as McapSchema
from mcap_ros2.decoder import DecoderFactory

from slip_bags.format import BagMetadata, TopicInfo, parse_metadata, parse_qos
from slip_bags.mcap_file import LATEST_NS, MAX_BYTES, MAX_MESSAGES, McapFile, open_file
from slip_bags.series import Series
from slip_core.errors import InputError, nearest
from slip_msgs_py.messages.layout import Schema

_TIME = attrgetter("log_time_ns")


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
        path: a rosbag2 folder with ``metadata.yaml``, or one MCAP file.

    Raises:
        InputError: no bag, a bag of another storage, cut or damaged; with what to do about it.
    """

    def __init__(self, path: Path | str) -> None:
        self.path = Path(path)
        self.metadata = _folder_metadata(self.path) if self.path.is_dir() else None
        paths = [self.path]
        if self.metadata is not None:
            paths = [self.path / file.path for file in self.metadata.files]
        self._files: list[McapFile] = []
        try:
            for file in paths:
                self._files.append(McapFile(file))
            self.topics: Mapping[str, TopicInfo] = MappingProxyType(self._collect_topics())
        except InputError:
            self.close()
            raise

    def __enter__(self) -> Bag:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Release the files."""
        for file in self._files:
            file.close()

    @property
    def message_count(self) -> int:
        """Messages of all topics."""
        return sum(topic.message_count for topic in self.topics.values())

    @property
    def span_ns(self) -> tuple[int, int] | None:
        """First and last log time of the bag [ns], None without messages."""
        spans = [file.span_ns for file in self._files if file.span_ns is not None]
        return (min(start for start, _ in spans), max(end for _, end in spans)) if spans else None

    @property
    def size_bytes(self) -> int:
        """Size of all MCAP files."""
        return sum(file.size for file in self._files)

    @property
    def compressions(self) -> list[str]:
        """Compressions used by the chunks, sorted; "" is none."""
        return sorted(set().union(*(file.compressions for file in self._files)))

    @functools.cached_property
    def custom_data(self) -> Mapping[str, str]:
        """The custom data of ``metadata.yaml``, or of the file's own copy of it."""
        if self.metadata is not None:
            return MappingProxyType(dict(self.metadata.custom_data))
        text = self._files[0].metadata().get("rosbag2", {}).get("serialized_metadata")
        if text is None:
            return MappingProxyType({})
        return MappingProxyType(dict(parse_metadata(text, f"metadata in {self.path}").custom_data))

    @functools.cached_property
    def attachments(self) -> Mapping[str, bytes]:
        """Attached files by name."""
        return MappingProxyType({name: data for file in self._files for name, data in file.attachments().items()})

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

    def raw(
        self, topics: Collection[str] | None = None, *, start_ns: int | None = None, end_ns: int | None = None
    ) -> Iterator[RawMessage]:
        """Yield stored messages in order of log time, `start_ns` <= log time <= `end_ns`; None is no limit.

        Raises:
            InputError: no such topic, or damaged data, which is found when it is reached.
        """
        wanted = set(self.topics) if topics is None else {self.topic(name).name for name in topics}
        first = 0 if start_ns is None else start_ns
        last = LATEST_NS if end_ns is None else end_ns
        if start_ns is None and end_ns is None and len(wanted) == 1 and self._is_short:
            yield from self._by_topic[next(iter(wanted))]
        else:
            yield from self._stored(wanted, first, last)

    @property
    def _is_short(self) -> bool:
        return sum(file.unpacked_bytes for file in self._files) <= MAX_BYTES and self.message_count <= MAX_MESSAGES

    @functools.cached_property
    def _by_topic(self) -> dict[str, list[RawMessage]]:
        """All messages of a short bag: a chunk holds all topics, so one pass serves all of them."""
        found: dict[str, list[RawMessage]] = {name: [] for name in self.topics}
        for number, message in enumerate(self._stored(set(self.topics), 0, LATEST_NS)):
            if number >= MAX_MESSAGES:
                raise InputError(f"bag {self.path}", got="more messages than its index states", expected="a whole bag")
            found[message.topic].append(message)
        return found

    def _stored(self, topics: Collection[str], first_ns: int, last_ns: int) -> Iterator[RawMessage]:
        streams = [map(_raw, file.messages(topics, first_ns, last_ns)) for file in self._files]
        return heapq.merge(*streams, key=_TIME)

    def messages(
        self, topic: str, *, start_ns: int | None = None, end_ns: int | None = None
    ) -> Iterator[DecodedMessage]:
        """Yield the messages of one topic, decoded, in order of log time.

        Raises:
            InputError: no such topic, a schema or message that cannot be decoded, or damaged data.
        """
        info = self.topic(topic)
        decode = self._decoder(info)
        for message in self.raw([info.name], start_ns=start_ns, end_ns=end_ns):
            try:
                value = decode(message.data)
            except Exception as error:  # the decoder is generated from the file's own schema: anything may happen
                raise InputError(f"message on {info.name}", got=str(error), expected=f"a {info.type_name}") from None
            yield DecodedMessage(message.log_time_ns, message.publish_time_ns, message.sequence, value)

    def series(self, topic: str, *, start_ns: int | None = None, end_ns: int | None = None) -> Series:
        """Return all messages of one topic as columns.

        Raises:
            InputError: as `messages`.
        """
        info = self.topic(topic)
        schema = self._mcap_schema(info)
        text = schema.data.decode("utf-8", "replace")
        return Series(Schema.from_text(schema.name, text), self.raw([info.name], start_ns=start_ns, end_ns=end_ns))

    def schema_text(self, topic: str) -> str:
        """Return the stored definition of a topic's type, with all it refers to.

        Raises:
            InputError: no such topic, or no definition stored.
        """
        return self._mcap_schema(self.topic(topic)).data.decode("utf-8", "replace")

    def _decoder(self, info: TopicInfo) -> Callable[[bytes], Any]:
        schema = self._mcap_schema(info)
        try:
            return DecoderFactory().decoder_for(info.encoding, schema)
        except Exception as error:  # third-party parser on the file's own text
            raise InputError(f"schema of {info.name}", got=str(error), expected="message definitions") from None

    def _mcap_schema(self, info: TopicInfo) -> McapSchema:
        for file in self._files:
            for channel in file.channels.values():
                schema = file.schemas.get(channel.schema_id)
                if channel.topic == info.name and schema is not None:
                    if info.encoding != "cdr" or schema.encoding != "ros2msg" or not schema.data:
                        got = f"{info.encoding} with schema {schema.encoding or 'none'}, {len(schema.data)} bytes"
                        raise InputError(f"topic {info.name}", got=got, expected="cdr with a ros2msg schema")
                    return schema
        raise InputError(f"topic {info.name}", got="no schema", expected="cdr with a ros2msg schema")

    def _collect_topics(self) -> dict[str, TopicInfo]:
        found: dict[str, TopicInfo] = {}
        for file in self._files:
            for channel in file.channels.values():
                known = found.get(channel.topic)
                count = file.counts.get(channel.id, 0)
                if known is not None:
                    found[channel.topic] = replace(known, message_count=known.message_count + count)
                    continue
                schema = file.schemas.get(channel.schema_id)
                found[channel.topic] = TopicInfo(
                    name=channel.topic,
                    type_name=schema.name if schema is not None else "",
                    qos=parse_qos(channel.metadata.get("offered_qos_profiles", "")),
                    type_hash=channel.metadata.get("topic_type_hash", ""),
                    message_count=count,
                    encoding=channel.message_encoding,
                )
        return dict(sorted(found.items()))


def _raw(stored: tuple[str, Message]) -> RawMessage:
    topic, message = stored
    return RawMessage(topic, message.log_time, message.publish_time, message.sequence, message.data)


def read_series(path: Path | str, topic: str) -> Series:
    """Return one topic of a bag as columns: a mapping of field paths to arrays, with `stamp_ns` and `log_time_ns`.

    Raises:
        InputError: no bag, no such topic, or damaged data.
    """
    with Bag(path) as bag:
        return bag.series(topic)


def _folder_metadata(folder: Path) -> BagMetadata:
    what = f"bag {folder}"
    path = folder / "metadata.yaml"
    files = sorted(file.name for file in folder.glob("*.mcap"))
    if not path.exists():
        if not files:
            raise InputError(what, got="a folder without metadata.yaml and MCAP files", expected="a bag")
        fix = f"`slip-vic bag recover {folder}` makes one, or open {folder / files[0]} by itself"
        raise InputError(what, got="no metadata.yaml: the recorder was killed", expected="a closed bag", fix=fix)
    try:
        with open_file(path) as file:
            text = file.read(MAX_BYTES).decode("utf-8")
    except UnicodeDecodeError as error:
        raise InputError(str(path), got=str(error), expected="a text") from None
    metadata = parse_metadata(text, str(path))
    if metadata.storage != "mcap":
        raise InputError(what, got=f"storage {metadata.storage}", expected="mcap", fix="convert it: ros2 bag convert")
    if metadata.compression_format or metadata.compression_mode not in ("", "none", "NONE"):
        got = f"{metadata.compression_format} compression of whole {metadata.compression_mode.lower() or 'file'}s"
        raise InputError(what, got=got, expected="compression inside MCAP (zstd, lz4, none)")
    if not metadata.files:
        raise InputError(str(path), got="no relative_file_paths", expected="the bag's MCAP files")
    for item in metadata.files:
        if PurePath(item.path).is_absolute() or ".." in PurePath(item.path).parts:
            raise InputError(str(path), got=item.path, expected="files of the bag's own folder")
        if not (folder / item.path).is_file():
            got = f"{item.path} is missing"
            raise InputError(what, got=got, expected=f"the files of metadata.yaml, found {files}")
    return metadata
