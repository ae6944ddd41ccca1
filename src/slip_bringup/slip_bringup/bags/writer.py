"""Write a rosbag2 bag: a folder of MCAP files and ``metadata.yaml``, safe against a kill at any moment.

Every `flush` closes the running chunk, so that everything before it can be read or recovered; the data
reaches the disk by `fsync` in a thread of its own, because a slow disk must not stop the recorder.
"""

from __future__ import annotations

import contextlib
import io
import os
import threading
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

from mcap.writer import CompressionType, Writer

from slip_bringup.bags.format import INFINITE_NS, BagMetadata, FileInfo, TopicInfo, metadata_text, qos_text
from slip_bringup.bags.repair import close_in_place
from slip_bringup.bags.scan import DAMAGE
from slip_msgs_py.errors import InputError, SlipVicError

CHUNK_BYTES: Final = 786432  # rosbag2's chunk size
LIBRARY: Final = "slip-vic bag"
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
    """

    def __init__(self, folder: Path, options: WriterOptions) -> None:
        if options.compression not in COMPRESSIONS:
            raise InputError("compression", got=options.compression, expected=", ".join(COMPRESSIONS))
        _make_folder(folder)
        self.folder = folder
        self.custom_data = dict(options.custom_data)
        self._options = options
        self._topics: dict[str, tuple[TopicInfo, str]] = {}
        self._files: list[FileInfo] = []
        self._finished_counts: Counter[str] = Counter()
        self._closed = False
        self._counts: Counter[str] = Counter()
        self._start_ns, self._end_ns = INFINITE_NS, 0
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._path: Path | None = None
        self._open_next()

    @property
    def message_count(self) -> int:
        """Messages written so far, over all files."""
        return self._finished_counts.total() + self._counts.total()

    def add_topic(self, topic: TopicInfo, schema_text: str) -> None:
        """Announce a topic; its QoS and hash are frozen here, in channel and ``metadata.yaml`` alike."""
        self._topics[topic.name] = (topic, schema_text)
        with self._guarded():
            self._register(topic, schema_text)

    def write(self, topic: str, log_time_ns: int, publish_time_ns: int, sequence: int, data: bytes) -> None:
        """Append one CDR message.

        Raises:
            StorageError: where the disk refuses; the bag is closed then.
        """
        if self._must_split(log_time_ns):
            self.split()
        if self._closed:
            raise self._already_closed()
        try:
            self._writer.add_message(self._channels[topic], log_time_ns, data, publish_time_ns, sequence & 0xFFFFFFFF)
        except OSError as error:
            raise self._failed(error) from None
        self._counts[topic] += 1
        self._start_ns = min(self._start_ns, log_time_ns)
        self._end_ns = max(self._end_ns, log_time_ns)

    def has_topic(self, name: str) -> bool:
        """Whether the topic was announced."""
        return name in self._topics

    def split(self) -> None:
        """Go on in the next file.

        Raises:
            StorageError: where the disk refuses; the bag is closed then.
        """
        with self._guarded():
            self._finish_file()
        self._open_next()

    def flush(self) -> None:
        """Close the running chunk, hand it to the system and ask for an `fsync`.

        Raises:
            StorageError: where the disk refuses; the bag is closed then.
        """
        with self._guarded():
            self._writer.flush()
        self._syncer.request()

    def close(self) -> BagMetadata:
        """Finish the file and write ``metadata.yaml``; returns what it says. Further calls only return it.

        Raises:
            StorageError: where the disk refuses; the bag is readable then.
        """
        if not self._closed:
            with self._guarded():
                self._finish_file()
                write_metadata(self.folder, self.metadata())
            self._closed = True
        return self.metadata()

    def metadata(self) -> BagMetadata:
        """What ``metadata.yaml`` would say now."""
        files = list(self._files)
        if self._path is not None:
            duration = self._end_ns - self._start_ns if self._counts else 0
            files.append(FileInfo(self._path.name, self._start_ns, duration, self._counts.total()))
        filled = [file for file in files if file.message_count]
        start = min((file.start_ns for file in filled), default=INFINITE_NS)
        counts = self._finished_counts + self._counts
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

    def _open_next(self) -> None:
        self._counts, self._schemas, self._channels = Counter(), {}, {}
        self._start_ns, self._end_ns = INFINITE_NS, 0
        self._path = self.folder / f"{self.folder.resolve().name}_{len(self._files)}.mcap"
        with self._guarded():
            self._raw = io.FileIO(self._path, "xb")
            self._stream = io.BufferedWriter(self._raw, _BUFFER_BYTES)
            self._syncer = _Syncer(self._raw)
            compression = COMPRESSIONS[self._options.compression]
            self._writer = Writer(self._stream, chunk_size=CHUNK_BYTES, compression=compression)
            self._writer.start(profile="ros2", library=LIBRARY)
            self._add_metadata_record()
            for name, data in self._options.attachments.items():
                self._writer.add_attachment(0, 0, name, media_type(name), data)
            for topic, schema_text in self._topics.values():
                self._register(topic, schema_text)
            self._writer.flush()

    def _register(self, topic: TopicInfo, schema_text: str) -> None:
        if topic.type_name not in self._schemas:
            text = schema_text.encode("utf-8")
            self._schemas[topic.type_name] = self._writer.register_schema(topic.type_name, "ros2msg", text)
        self._channels[topic.name] = self._writer.register_channel(
            topic.name,
            topic.encoding,
            self._schemas[topic.type_name],
            {"offered_qos_profiles": qos_text(topic.qos), "topic_type_hash": topic.type_hash},
        )

    def _add_metadata_record(self) -> None:
        self._writer.add_metadata("rosbag2", {"serialized_metadata": metadata_text(self.metadata(), root=False)})

    def _must_split(self, log_time_ns: int) -> bool:
        size, duration = self._options.split_bytes, self._options.split_duration_ns
        if not self._counts:
            return False
        return bool((size and self._stream.tell() >= size) or (duration and log_time_ns - self._start_ns > duration))

    def _finish_file(self) -> None:
        self._writer.flush()
        self._add_metadata_record()
        self._writer.finish()
        self._stream.flush()
        self._syncer.stop()
        os.fsync(self._raw.fileno())
        self._stream.close()
        self._retire()

    def _retire(self) -> None:
        self._files = list(self.metadata().files)
        self._finished_counts += self._counts
        self._counts, self._path = Counter(), None

    @contextlib.contextmanager
    def _guarded(self) -> Iterator[None]:
        if self._closed:
            raise self._already_closed()
        try:
            yield
        except OSError as error:
            raise self._failed(error) from None

    def _already_closed(self) -> StorageError:
        return StorageError(f"bag {self.folder}: it is closed already")

    def _failed(self, error: OSError) -> StorageError:
        self._closed = True
        return StorageError(f"bag {self.folder}: {error.strerror or error}; {self._rescue()}")

    def _rescue(self) -> str:
        """Make what is on the disk readable without needing more space than the bag has; say what became of it."""
        recover = f"run `slip-vic bag recover {self.folder}`"
        try:
            if self._path is not None and self._path.exists():
                self._syncer.stop()
                self._raw.close()
                self._close_cut_file(self._path)
            self._path = None
            write_metadata(self.folder, self.metadata())
        except DAMAGE as error:
            return f"closing it failed as well ({error}); {recover}"
        return f"closed with the {self.message_count} messages before, readable"

    def _close_cut_file(self, path: Path) -> None:
        spare = len(metadata_text(self.metadata(), root=True)) + _METADATA_ROOM
        try:
            kept = close_in_place(path, spare)
        except ValueError:
            path.unlink()  # not even the head of the file was written
            self._counts = Counter()
            return
        self._counts = Counter(kept.counts)
        self._start_ns, self._end_ns = (kept.start_ns, kept.end_ns) if kept.counts else (INFINITE_NS, 0)
        self._retire()


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
        got = error.strerror or str(error)
        raise InputError(f"bag {folder}", got=got, expected="a folder that can be made") from None


class _Syncer:
    """Runs `os.fsync` on request, at most one at a time, off the recording thread."""

    def __init__(self, file: io.FileIO) -> None:
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
