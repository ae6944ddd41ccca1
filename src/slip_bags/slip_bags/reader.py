"""The one way to read a bag: folder or file, by topic, raw or decoded; no ROS needed.

    bag = Bag("out/vic")
    bag.topics["/wrench"].message_count
    bag.series("/wrench")["wrench.force.x"]        # (n,) array; .stamps, .log_time_ns beside it
    for message in bag.messages("/wrench"):        # one by one, decoded
        message.value.wrench.force.x

Topics may be given without the leading slash. A size that a file declares is checked before memory is taken for it:
`mcap` itself unpacks whatever a chunk contains.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from pathlib import Path
from shlex import quote
from types import MappingProxyType
from typing import IO, Any, Final, NoReturn

import lz4.frame
import zstandard
from mcap.reader import SeekingReader
from mcap.records import AttachmentIndex, Channel, Chunk, McapRecord, Message, MetadataIndex, Schema
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap_ros2.decoder import DecoderFactory

from slip_bags.format import LATEST_NS, BagMessage, TopicInfo, parse_custom_data, parse_qos
from slip_bags.series import Series
from slip_core.errors import InputError, nearest
from slip_core.files.resources import MAX_BYTES, bounded_memory, open_file

MOST_CHANNELS: Final = 4096


def mcap_file(path: Path) -> Path:
    """Return the MCAP file of a bag: the only one in its folder, or the path itself.

    Raises:
        InputError: a folder with none or several.
    """
    files = sorted(path.glob("*.mcap")) if path.is_dir() else [path]
    if len(files) != 1:
        fix = "name one file; ros2 bag convert joins several, and unpacks a bag that is compressed as a whole"
        raise InputError(f"bag {path}", got=f"{len(files)} MCAP files", expected="one", fix=fix)
    return files[0]


def chunk_records(chunk: Chunk) -> Iterator[McapRecord]:
    """Yield the records in a chunk.

    Raises:
        ValueError: larger than declared or than memory may hold, cut, or of unknown compression; any error of `mcap`
            and the compression libraries.
    """
    size = chunk.uncompressed_size
    if size > MAX_BYTES // 2:  # its content, and that of each record
        raise ValueError(f"chunk of {size} bytes, more than memory may hold")
    if chunk.compression == "zstd":
        with zstandard.ZstdDecompressor().stream_reader(chunk.data) as reader:
            content = reader.read(size + 1)
    elif chunk.compression == "lz4":
        content = bytes(lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, max_length=size + 1))
    elif chunk.compression == "":
        content = chunk.data
    else:
        raise ValueError(f"unknown compression {chunk.compression!r}")
    if len(content) != size:
        raise ValueError(f"chunk declares {size} bytes and holds {'more' if len(content) > size else len(content)}")
    whole = dataclasses.replace(chunk, compression="", data=content)
    yield from bounded_memory("a chunk of the bag", "a whole one")(breakup_chunk)(whole, validate_crc=True)


def records_of(file: IO[bytes], report: Callable[[str, Exception], None]) -> Iterator[McapRecord]:
    """Yield the records of a file and of its chunks, in their order.

    Args:
        file: at its begin.
        report: called with what is damaged, "the end" or "a chunk", which is left out; it may raise.
    """

    def read(records: Iterator[McapRecord], part: str) -> Iterator[McapRecord]:
        try:
            yield from records
        except Exception as error:  # damaged bytes are parsed here: anything may happen
            report(part, error)

    for record in read(StreamReader(file, emit_chunks=True, record_size_limit=MAX_BYTES).records, "the end"):
        for each in read(chunk_records(record), "a chunk") if isinstance(record, Chunk) else (record,):
            if isinstance(each, Message) and max(each.log_time, each.publish_time) > LATEST_NS:
                report("a message", ValueError("a time beyond the year 2262"))
            else:
                yield each


def topic_info(channel: Channel, type_name: str) -> TopicInfo:
    """Return the topic of a channel."""
    qos = parse_qos(channel.metadata.get("offered_qos_profiles", ""))
    return TopicInfo(channel.topic, type_name, qos, encoding=channel.message_encoding)


class Bag:
    """A bag for reading; its file is open only while messages are read.

    Args:
        path: a rosbag2 folder with one MCAP file, or the file.

    Attributes:
        topics: by name, sorted.
        message_count: of all topics.
        span_ns: first and last log time [ns], None without messages.
        custom_data: the texts that the recorder stored, by name.
        attachments: attached files by name.
        size_bytes: size of the file.

    Raises:
        InputError: no bag, a bag of another storage, cut or damaged; with what to do about it.
    """

    def __init__(self, path: Path | str) -> None:
        self.path = Path(path)
        self.file = mcap_file(self.path)
        with bounded_memory(f"bag {path}"), open_file(self.file, f"file {self.file}") as file:
            self.size_bytes = self.file.stat().st_size
            if self.size_bytes == 0:
                raise InputError(f"bag file {self.file}", got="an empty file", expected="an MCAP file")
            try:
                self._load(file)
            except Exception as error:  # the bytes of a damaged file: anything may happen
                self._refuse("its end: the recorder was killed or the file is cut", error)

    def _load(self, file: IO[bytes]) -> None:
        summary = SeekingReader(file, record_size_limit=min(self.size_bytes, MAX_BYTES)).get_summary()
        if summary is None or summary.statistics is None:
            raise ValueError("no index")
        counts = summary.statistics.channel_message_counts
        times = summary.statistics.message_start_time, summary.statistics.message_end_time
        if len(summary.channels) > MOST_CHANNELS or max(times) > LATEST_NS:
            raise ValueError(f"times beyond the year 2262, or over {MOST_CHANNELS} channels")
        self._channels = {key: channel.topic for key, channel in summary.channels.items()}
        self._schemas: dict[str, Schema | None] = {}
        topics: dict[str, TopicInfo] = {}
        for key, channel in summary.channels.items():
            schema = self._schemas[channel.topic] = summary.schemas.get(channel.schema_id)
            known = topics.get(channel.topic) or topic_info(channel, schema.name if schema is not None else "")
            if schema is not None and schema.name != known.type_name:
                raise ValueError(f"{schema.name} and {known.type_name} on {channel.topic}")
            topics[channel.topic] = dataclasses.replace(known, message_count=known.message_count + counts.get(key, 0))
        self.topics: Mapping[str, TopicInfo] = MappingProxyType(dict(sorted(topics.items())))
        self.message_count = sum(counts.values())
        self.span_ns = times if self.message_count else None
        attached, metadata = (self._listed(file, own) for own in (summary.attachment_indexes, summary.metadata_indexes))
        self.attachments = MappingProxyType({record.name: record.data for record in attached})
        texts = (record.metadata.get("serialized_metadata", "") for record in metadata)
        found = [custom for text in texts if (custom := parse_custom_data(text))]
        self.custom_data = MappingProxyType(found[-1] if found else {})

    def _listed(self, file: IO[bytes], indexes: Iterable[AttachmentIndex | MetadataIndex]) -> Iterator[Any]:
        """Yield the records of an index; one that lists a record many times has more than the file."""
        room = self.size_bytes
        for index in indexes:
            file.seek(index.offset)
            yield next(StreamReader(file, skip_magic=True, record_size_limit=room).records)
            room -= file.tell() - index.offset

    def topic(self, name: str) -> TopicInfo:
        """Return a topic, with or without the leading slash.

        Raises:
            InputError: the bag has no such topic; with the nearest names.
        """
        for candidate in (name, f"/{name}"):
            if candidate in self.topics:
                return self.topics[candidate]
        raise InputError(f"topic {name} of bag {self.path}", got="no such topic", expected=nearest(name, self.topics))

    def raw(self, topics: Collection[str] | None = None) -> Iterator[BagMessage]:
        """Yield stored messages in the order of the file, of some topics or of all.

        Raises:
            InputError: no such topic, or damaged data, which is found when it is reached.
        """
        wanted = set(self.topics) if topics is None else {self.topic(name).name for name in topics}
        source = self._all if len(wanted) == 1 else None
        return (message for message in source or self._stored() if message.topic in wanted)

    @functools.cached_property
    def _all(self) -> list[BagMessage] | None:
        """All messages of a short bag: a chunk holds all topics, so one pass serves all of them."""
        short = self.size_bytes <= MAX_BYTES // 64
        return bounded_memory(f"bag {self.path}")(list)(self._stored()) if short else None

    def _stored(self) -> Iterator[BagMessage]:
        with open_file(self.file, f"file {self.file}") as file:
            for record in records_of(file, self._refuse):
                if isinstance(record, Message):
                    topic = self._channels.get(record.channel_id)
                    if topic is None:
                        self._refuse("a message", ValueError("of no channel"))
                    yield BagMessage(topic, record.log_time, record.publish_time, record.sequence, record.data)

    def messages(self, topic: str) -> Iterator[BagMessage]:
        """Yield the messages of one topic, decoded, in the order of the file.

        Raises:
            InputError: no such topic, a schema or message that cannot be decoded, or damaged data.
        """
        info = self.topic(topic)
        decode = self._decoder(info)
        for message in self.raw([info.name]):
            try:
                value = decode(message.value)
            except Exception as error:  # the decoder is generated from the file's own schema: anything may happen
                got = f"{type(error).__name__}: {error}"
                raise InputError(f"message on {info.name}", got=got, expected=f"a {info.type_name}") from None
            yield message._replace(value=value)

    def series(self, topic: str) -> Series:
        """Return all messages of one topic as columns.

        Raises:
            InputError: as `messages`.
        """
        return bounded_memory(f"topic {topic} of {self.path}")(Series)(topic, self.messages(topic))

    def _decoder(self, info: TopicInfo) -> Callable[[bytes], Any]:
        schema = self._schemas[info.name]
        try:
            decode = DecoderFactory().decoder_for(info.encoding, schema)
            if decode is None or schema is None or not schema.data:
                raise ValueError(f"{info.encoding} with {schema.encoding if schema and schema.data else 'no schema'}")
        except Exception as error:  # third-party parser on the file's own text
            expected = "message definitions (ros2msg) of messages in CDR"
            raise InputError(f"schema of {info.name}", got=str(error), expected=expected) from None
        return decode

    def _refuse(self, part: str, error: Exception) -> NoReturn:
        got = f"damage in {part} ({str(error) or type(error).__name__})"
        fix = f"`slip-vic bag recover {quote(str(self.path))}` saves what can be read"
        raise InputError(f"bag file {self.file}", got=got, expected="a whole MCAP file", fix=fix) from None
