"""Write a rosbag2 bag: a folder of MCAP files and ``metadata.yaml``, safe against a kill at any moment.

Every `flush` closes the running chunk, so that everything before it can be read or recovered; the data
reaches the disk by `fsync` in a thread of its own, because a slow disk must not stop the recorder.
"""

from __future__ import annotations

import contextlib
import os
import threading
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import IO, Final

from mcap.writer import CompressionType, Writer

from slip_bags.format import INFINITE_NS, BagMetadata, FileInfo, TopicInfo, metadata_text, qos_text
from slip_bags.storage.closing import Contents, close_in_place
from slip_core.errors import InputError, SlipVicError

LIBRARY: Final = "slip-vic bag"
CHUNK_BYTES: Final = 786432  # rosbag2's chunk size
COMPRESSIONS: Final = {"zstd": CompressionType.ZSTD, "lz4": CompressionType.LZ4, "none": CompressionType.NONE}
_BUFFER_BYTES: Final = 1 << 20
_METADATA_ROOM: Final = 16384  # blocks that metadata.yaml, its temporary copy and their folder entries take


class StorageError(SlipVicError):
    """The bag could not be written any further; what was flushed before is closed and readable."""


@dataclass(frozen=True, slots=True)
class WriterOptions:
    """How a bag is written; a split limit of 0 means no split."""

    compression: str = "zstd"
    split_bytes: int = 0
    split_duration_ns: int = 0
    custom_data: Mapping[str, str] = field(default_factory=dict)
    attachments: Mapping[str, bytes] = field(default_factory=dict)


class BagWriter:
    """One bag being written; `close` must run for ``metadata.yaml`` to exist.

    Args:
        folder: the bag; must not exist, parents are made.
        options: compression, splitting and what is stored beside the messages.

    Raises:
        InputError: where the folder exists or cannot be made.
        StorageError: where nothing can be written into it.
    """

    def __init__(self, folder: Path, options: WriterOptions) -> None:
        if options.compression not in COMPRESSIONS:
            raise InputError("compression", got=options.compression, expected=", ".join(COMPRESSIONS))
        _make_folder(folder)
        self.folder = folder
        self.custom_data = dict(options.custom_data)
        self._options = options
        self._topics: dict[str, tuple[TopicInfo, str]] = {}
        self._channels: dict[str, int] = {}
        self._finished: list[tuple[str, Contents]] = []
        self._current: _OpenFile | None = None
        self._file_start_ns: int | None = None
        self._closed = False
        self._open_next()

    @property
    def message_count(self) -> int:
        """Messages written so far, over all files."""
        return sum(contents.counts.total() for _, contents in self._all_files())

    def has_topic(self, name: str) -> bool:
        """Whether the topic was announced."""
        return name in self._topics

    def add_topic(self, topic: TopicInfo, schema_text: str) -> None:
        """Announce a topic; its QoS and hash are frozen here, in channel and ``metadata.yaml`` alike."""
        self._topics[topic.name] = (topic, schema_text)
        with self._guarded() as file:
            self._register(file, topic, schema_text)

    def write(self, topic: str, log_time_ns: int, publish_time_ns: int, sequence: int, data: bytes) -> None:
        """Append one CDR message.

        Raises:
            StorageError: where the disk refuses; the bag is closed then.
        """
        if self._must_split(log_time_ns):
            self.split()
        if self._file_start_ns is None:
            self._file_start_ns = log_time_ns
        file = self._current
        if file is None:
            raise self._already_closed()
        try:
            file.writer.add_message(self._channels[topic], log_time_ns, data, publish_time_ns, sequence & 0xFFFFFFFF)
        except OSError as error:
            raise self._failed(error) from None
        contents = file.contents
        if not contents.counts:
            contents.start_ns = contents.end_ns = log_time_ns
        elif log_time_ns > contents.end_ns:
            contents.end_ns = log_time_ns
        elif log_time_ns < contents.start_ns:
            contents.start_ns = log_time_ns
        contents.counts[topic] += 1

    def split(self) -> None:
        """Go on in the next file.

        Raises:
            StorageError: where the disk refuses; the bag is closed then.
        """
        with self._guarded() as file:
            self._finish(file)
        self._open_next()

    def flush(self) -> None:
        """Close the running chunk, hand it to the system and ask for an `fsync`.

        Raises:
            StorageError: where the disk refuses; the bag is closed then.
        """
        with self._guarded() as file:
            file.writer.flush()
        file.syncer.request()

    def close(self) -> BagMetadata:
        """Finish the file and write ``metadata.yaml``; returns what it says. Further calls only return it.

        Raises:
            StorageError: where the disk refuses; the bag is readable then.
        """
        if not self._closed:
            with self._guarded() as file:
                self._finish(file)
                write_metadata(self.folder, self.metadata())
            self._closed = True
        return self.metadata()

    def metadata(self) -> BagMetadata:
        """What ``metadata.yaml`` would say now."""
        files, counts = [], Counter[str]()
        for name, contents in self._all_files():
            total = contents.counts.total()
            start, duration = (contents.start_ns, contents.end_ns - contents.start_ns) if total else (INFINITE_NS, 0)
            files.append(FileInfo(name, start, duration, total))
            counts += contents.counts
        filled = [file for file in files if file.message_count]
        start = min((file.start_ns for file in filled), default=INFINITE_NS)
        return BagMetadata(
            files=tuple(files),
            topics=tuple(
                replace(topic, message_count=counts[name]) for name, (topic, _) in sorted(self._topics.items())
            ),
            start_ns=start,
            duration_ns=max((file.start_ns + file.duration_ns for file in filled), default=start) - start,
            message_count=counts.total(),
            custom_data=self.custom_data,
        )

    def _all_files(self) -> list[tuple[str, Contents]]:
        current = self._current
        return [*self._finished, *([(current.path.name, current.contents)] if current else [])]

    def _open_next(self) -> None:
        path = self.folder / f"{self.folder.resolve().name}_{len(self._finished)}.mcap"
        self._channels, self._file_start_ns = {}, None
        try:
            file = self._current = _OpenFile(path, self._options.compression)
            file.writer.start("ros2", LIBRARY)
            file.writer.add_metadata("rosbag2", self._serialized_metadata())
            for name, data in self._options.attachments.items():
                file.writer.add_attachment(0, 0, name, media_type(name), data)
            for topic, schema_text in self._topics.values():
                self._register(file, topic, schema_text)
            file.writer.flush()
        except OSError as error:
            raise self._failed(error) from None

    def _register(self, file: _OpenFile, topic: TopicInfo, schema_text: str) -> None:
        schema_id = file.schemas.get(topic.type_name)
        if schema_id is None:
            schema_id = file.writer.register_schema(topic.type_name, "ros2msg", schema_text.encode("utf-8"))
            file.schemas[topic.type_name] = schema_id
        metadata = {"offered_qos_profiles": qos_text(topic.qos), "topic_type_hash": topic.type_hash}
        self._channels[topic.name] = file.writer.register_channel(topic.name, topic.encoding, schema_id, metadata)

    def _serialized_metadata(self) -> dict[str, str]:
        return {"serialized_metadata": metadata_text(self.metadata(), root=False)}

    def _must_split(self, log_time_ns: int) -> bool:
        if self._file_start_ns is None:
            return False
        size, duration = self._options.split_bytes, self._options.split_duration_ns
        if duration and log_time_ns - self._file_start_ns > duration:
            return True
        return bool(size and self._current is not None and self._current.size >= size)

    def _finish(self, file: _OpenFile) -> None:
        file.writer.flush()
        file.writer.add_metadata("rosbag2", self._serialized_metadata())
        file.writer.finish()
        file.close()
        self._finished.append((file.path.name, file.contents))
        self._current = None

    @contextlib.contextmanager
    def _guarded(self) -> Iterator[_OpenFile]:
        if self._current is None:
            raise self._already_closed()
        try:
            yield self._current
        except OSError as error:
            raise self._failed(error) from None

    def _already_closed(self) -> StorageError:
        return StorageError(f"bag {self.folder}: it is closed already")

    def _failed(self, error: OSError) -> StorageError:
        self._closed = True
        return StorageError(f"bag {self.folder}: {error.strerror or error}; {self._rescue()}")

    def _rescue(self) -> str:
        """Make what is on the disk readable without needing more space than the bag has; say what became of it."""
        spare = len(metadata_text(self.metadata(), root=True)) + _METADATA_ROOM
        file, self._current = self._current, None
        try:
            if file is not None:
                self._rescue_file(file, spare)
            write_metadata(self.folder, self.metadata())
        except OSError as error:
            return f"closing it failed as well ({error.strerror}); run `slip-vic bag recover {self.folder}`"
        return f"closed with the {self.message_count} messages before, readable"

    def _rescue_file(self, file: _OpenFile, spare: int) -> None:
        file.abandon()
        try:
            contents = close_in_place(file.path, spare)
        except ValueError:
            file.path.unlink()
            return
        self._finished.append((file.path.name, contents))


class _OpenFile:
    """The MCAP file being written."""

    def __init__(self, path: Path, compression: str) -> None:
        self.path = path
        self.contents = Contents()
        self.schemas: dict[str, int] = {}
        self._file = open(path, "xb", buffering=_BUFFER_BYTES)  # noqa: SIM115 - closed by `close`
        self.writer = Writer(self._file, chunk_size=CHUNK_BYTES, compression=COMPRESSIONS[compression])
        self.syncer = _Syncer(self._file)

    @property
    def size(self) -> int:
        """Bytes in the file, without the running chunk."""
        return self._file.tell()

    def close(self) -> None:
        """Bring everything to the disk."""
        self.syncer.stop()
        with self._file:
            self._file.flush()
            os.fsync(self._file.fileno())

    def abandon(self) -> None:
        """Release a file that cannot be written any further."""
        self.syncer.stop()
        with contextlib.suppress(OSError):
            self._file.close()


def write_metadata(folder: Path, metadata: BagMetadata) -> None:
    """Write ``metadata.yaml`` so that it is there completely or not at all."""
    temporary = folder / ".metadata.yaml.tmp"
    try:
        with open(temporary, "w", encoding="utf-8") as file:
            file.write(metadata_text(metadata, root=True))
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, folder / "metadata.yaml")
    finally:
        temporary.unlink(missing_ok=True)


def media_type(name: str) -> str:
    """Return the media type of an attachment by its name's ending."""
    endings = {".yaml": "application/yaml", ".json": "application/json", ".urdf": "application/xml"}
    return endings.get(Path(name).suffix, "text/plain")


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(parents=True)
    except FileExistsError:
        raise InputError(
            f"bag {folder}", got="it exists", expected="a new folder", fix="choose another name or remove it"
        ) from None
    except OSError as error:
        raise InputError(f"bag {folder}", got=error, expected="a folder that can be made") from None


class _Syncer:
    """Runs `os.fsync` on request, at most one at a time, off the recording thread."""

    def __init__(self, file: IO[bytes]) -> None:
        self._file = file
        self._wanted = threading.Event()
        self._stopping = False
        self._thread = threading.Thread(target=self._run, name="bag-fsync", daemon=True)
        self._thread.start()

    def request(self) -> None:
        self._wanted.set()

    def stop(self) -> None:
        self._stopping = True
        self._wanted.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._stopping:
            self._wanted.wait()
            self._wanted.clear()
            if not self._stopping:
                with contextlib.suppress(OSError):  # the recording thread meets the same error and reports it
                    os.fsync(self._file.fileno())
