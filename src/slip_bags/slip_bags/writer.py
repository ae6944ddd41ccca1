"""Write a rosbag2 bag: a folder with one MCAP file and ``metadata.yaml``.

`flush` closes the running chunk and brings it to the disk: what was written before survives a kill or a power failure,
and `slip-vic bag recover` makes a whole bag of it.
"""

from __future__ import annotations

import contextlib
import os
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from shlex import quote
from typing import Any, Final

from mcap.writer import Writer

from slip_bags.format import TopicInfo, metadata_tree, qos_text, yaml_text
from slip_core.errors import InputError, SlipVicError

CHUNK_BYTES: Final = 786432  # rosbag2's chunk size
_BUFFER_BYTES: Final = 1 << 20


class StorageError(SlipVicError):
    """The disk refuses; what was flushed before can be recovered."""


class BagWriter:
    """One bag being written; `close` must run for it to be whole.

    Every method raises StorageError where the disk refuses.

    Args:
        folder: the bag; must not exist, parents are made.
        custom_data: texts for ``metadata.yaml``; may change until `close`.
        attachments: files stored beside the messages, by name.

    Attributes:
        counts: messages written, by topic.

    Raises:
        InputError: the folder exists or cannot be made.
        StorageError: nothing can be written into it.
    """

    def __init__(
        self, folder: Path, custom_data: Mapping[str, str] | None = None, attachments: Mapping[str, bytes] | None = None
    ) -> None:
        self._path = folder / f"{folder.resolve().name}_0.mcap"
        try:
            folder.mkdir(parents=True)
            self._file = open(self._path, "xb", buffering=_BUFFER_BYTES)  # noqa: SIM115 - closed by `close`
        except OSError as error:
            fix = "choose another name or remove it"
            raise InputError(f"bag {folder}", got=error, expected="a new folder that can be made", fix=fix) from None
        self.folder = folder
        self.custom_data = dict(custom_data or {})
        self._topics: dict[str, TopicInfo] = {}
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self.counts: Counter[str] = Counter()
        self._span_ns: tuple[int, int] | None = None
        with self._reporting():
            self._writer = Writer(self._file, chunk_size=CHUNK_BYTES)
            self._writer.start("ros2", "slip-vic bag")
            self._add_metadata()
            for name, data in (attachments or {}).items():
                self._writer.add_attachment(0, 0, name, "application/octet-stream", data)

    def add_topic(self, topic: TopicInfo, schema_text: str) -> None:
        """Add a topic; its QoS is the same in the channel and in ``metadata.yaml``."""
        with self._reporting():
            if topic.type_name not in self._schemas:
                schema = self._writer.register_schema(topic.type_name, "ros2msg", schema_text.encode("utf-8"))
                self._schemas[topic.type_name] = schema
            metadata = {"offered_qos_profiles": qos_text(topic.qos)}
            schema = self._schemas[topic.type_name]
            self._channels[topic.name] = self._writer.register_channel(topic.name, topic.encoding, schema, metadata)
        self._topics[topic.name] = topic

    def write(self, topic: str, log_time_ns: int, publish_time_ns: int, sequence: int, data: bytes) -> None:
        """Append one CDR message."""
        with self._reporting():
            channel = self._channels[topic]
            self._writer.add_message(channel, log_time_ns, data, publish_time_ns, sequence & 0xFFFFFFFF)
        first, last = self._span_ns or (log_time_ns, log_time_ns)
        self._span_ns = min(first, log_time_ns), max(last, log_time_ns)
        self.counts[topic] += 1

    def flush(self) -> None:
        """Close the running chunk and bring it to the disk."""
        with self._reporting():
            self._writer.flush()
            self._sync()

    def close(self) -> None:
        """Finish the file and write ``metadata.yaml``; further calls do nothing."""
        if self._file.closed:
            return
        with self._reporting():
            self._add_metadata()
            self._writer.finish()
            self._sync()
            self._file.close()
            temporary = self.folder / ".metadata.yaml.tmp"  # metadata.yaml is there completely or not at all
            with open(temporary, "w", encoding="utf-8") as file:
                file.write(yaml_text({"rosbag2_bagfile_information": self._metadata()}))
                file.flush()
                os.fsync(file.fileno())
            os.replace(temporary, self.folder / "metadata.yaml")

    def _sync(self) -> None:
        self._file.flush()
        os.fsync(self._file.fileno())

    def _metadata(self) -> dict[str, Any]:
        topics = [replace(topic, message_count=self.counts[name]) for name, topic in sorted(self._topics.items())]
        return metadata_tree(self._path.name, topics, self._span_ns, self.custom_data)

    def _add_metadata(self) -> None:
        self._writer.add_metadata("rosbag2", {"serialized_metadata": yaml_text(self._metadata())})

    @contextlib.contextmanager
    def _reporting(self) -> Iterator[None]:
        """End the bag at the first error of the disk, and say what to do."""
        if self._file.closed:
            raise StorageError(f"bag {self.folder}: it is closed already")
        try:
            yield
        except OSError as error:
            with contextlib.suppress(OSError):
                self._file.close()
            fix = f"`slip-vic bag recover {quote(str(self.folder))}` saves the messages before"
            raise StorageError(f"bag {self.folder}: {error.strerror or error}; {fix}") from None
