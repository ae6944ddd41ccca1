"""Make a whole bag out of a killed, cut or damaged one; the original is never changed."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass, field
from pathlib import Path

from slip_bags.format import BagMetadata, TopicInfo, parse_metadata, parse_qos
from slip_bags.storage.salvage import Salvage, SalvagedMessage, salvage
from slip_bags.writer import BagWriter, WriterOptions
from slip_core.errors import InputError


@dataclass(slots=True)
class RecoverReport:
    """What `recover` did: the new bag, and per file what was lost."""

    output: Path
    metadata: BagMetadata | None = None
    files: dict[str, Salvage] = field(default_factory=dict)

    @property
    def bytes_skipped(self) -> int:
        """Bytes of the original that could not be read."""
        return sum(file.bytes_skipped for file in self.files.values())

    @property
    def chunks_dropped(self) -> int:
        """Chunks whose data is damaged."""
        return sum(file.chunks_dropped for file in self.files.values())

    @property
    def messages_dropped(self) -> int:
        """Messages that are damaged or of unknown channels."""
        return sum(file.messages_dropped for file in self.files.values())


def recover(source: Path, output: Path, compression: str = "zstd") -> RecoverReport:
    """Write everything readable of a bag folder or MCAP file into a new bag, tagged ``recovered: "true"``.

    Raises:
        InputError: nothing to read, nothing to save, or the output exists.
        StorageError: the disk refuses.
    """
    report = RecoverReport(output)
    writer: BagWriter | None = None
    try:
        for path in _mcap_files(source):
            found = report.files[path.name] = Salvage()
            topics: set[str] = set()
            for message in salvage(path, found):
                if writer is None:
                    writer = BagWriter(output, WriterOptions(compression, attachments=dict(found.attachments)))
                elif not topics:
                    writer.split()
                if message.channel.topic not in topics:
                    topics.add(message.channel.topic)
                    _add_topic(writer, message)
                writer.write(
                    message.channel.topic,
                    message.log_time_ns,
                    message.publish_time_ns,
                    message.sequence,
                    message.data,
                )
            if writer is not None:
                writer.custom_data.update(_custom_data(found))
        if writer is None:
            raise InputError(f"bag {source}", got="no message that can be read", expected="something to recover")
        writer.custom_data.update(recovered="true", recovered_from=source.name, recovery=_losses(report))
    finally:
        if writer is not None:
            report.metadata = writer.close()
    return report


def _mcap_files(source: Path) -> list[Path]:
    if source.is_file():
        return [source]
    files = sorted(source.glob("*.mcap"), key=_split_number) if source.is_dir() else []
    if not files:
        got = "a folder without MCAP files" if source.is_dir() else "nothing there"
        raise InputError(f"bag {source}", got=got, expected="a bag folder or an MCAP file")
    return files


def _split_number(path: Path) -> tuple[int, str]:
    match = re.search(r"_(\d+)$", path.stem)
    return (int(match[1]) if match else 0, path.name)


def _add_topic(writer: BagWriter, message: SalvagedMessage) -> None:
    if writer.has_topic(message.channel.topic):
        return
    try:
        qos = parse_qos(message.channel.metadata.get("offered_qos_profiles", ""))
    except InputError:
        qos = ()
    type_hash = message.channel.metadata.get("topic_type_hash", "")
    info = TopicInfo(message.channel.topic, message.schema.name, qos, type_hash)
    writer.add_topic(info, message.schema.data.decode("utf-8", "replace"))


def _custom_data(found: Salvage) -> dict[str, str]:
    text = found.metadata.get("rosbag2", {}).get("serialized_metadata")
    try:
        return dict(parse_metadata(text, "metadata record").custom_data) if text else {}
    except InputError:
        return {}


def _losses(report: RecoverReport) -> str:
    return json.dumps(
        {
            "bytes_skipped": report.bytes_skipped,
            "chunks_dropped": report.chunks_dropped,
            "messages_dropped": report.messages_dropped,
            "cut_files": [name for name, file in report.files.items() if file.cut],
        }
    )
