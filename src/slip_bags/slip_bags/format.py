"""The texts of rosbag2: ``metadata.yaml`` version 9 and the QoS lists."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import yaml

from slip_core.errors import InputError
from slip_core.files.plain_yaml import read_yaml

INFINITE_NS: Final = 2**63 - 1
VERSION: Final = 9
ROS_DISTRO: Final = "jazzy"


@dataclass(frozen=True, slots=True)
class QosProfile:
    """The QoS one publisher offered; names as in rmw, times in nanoseconds."""

    reliability: str = "reliable"
    durability: str = "volatile"
    history: str = "unknown"
    depth: int = 0
    deadline_ns: int = INFINITE_NS
    lifespan_ns: int = INFINITE_NS
    liveliness: str = "automatic"
    liveliness_lease_ns: int = INFINITE_NS
    avoid_ros_namespace_conventions: bool = False


@dataclass(frozen=True, slots=True)
class TopicInfo:
    """One recorded topic: name, type, offered QoS (one entry per publisher), RIHS01 hash, message count."""

    name: str
    type_name: str
    qos: tuple[QosProfile, ...] = ()
    type_hash: str = ""
    message_count: int = 0
    encoding: str = "cdr"


@dataclass(frozen=True, slots=True)
class FileInfo:
    """One MCAP file of the bag."""

    path: str
    start_ns: int = INFINITE_NS
    duration_ns: int = 0
    message_count: int = 0


@dataclass(frozen=True, slots=True)
class BagMetadata:
    """Everything in ``metadata.yaml``."""

    files: tuple[FileInfo, ...]
    topics: tuple[TopicInfo, ...] = ()
    start_ns: int = INFINITE_NS
    duration_ns: int = 0
    message_count: int = 0
    custom_data: Mapping[str, str] = field(default_factory=dict)
    ros_distro: str = ROS_DISTRO
    storage: str = "mcap"
    compression_format: str = ""
    compression_mode: str = ""
    version: int = VERSION


def qos_text(profiles: Sequence[QosProfile]) -> str:
    """Return the channel metadata ``offered_qos_profiles``."""
    return _text([_qos_tree(profile) for profile in profiles])


def metadata_text(metadata: BagMetadata, *, root: bool) -> str:
    """Return ``metadata.yaml`` (`root` True) or the MCAP record ``serialized_metadata`` (`root` False)."""
    tree: dict[str, Any] = {
        "version": VERSION,
        "storage_identifier": metadata.storage,
        "duration": {"nanoseconds": metadata.duration_ns},
        "starting_time": {"nanoseconds_since_epoch": metadata.start_ns},
        "message_count": metadata.message_count,
        "topics_with_message_count": [
            {
                "topic_metadata": {
                    "name": topic.name,
                    "type": topic.type_name,
                    "serialization_format": topic.encoding,
                    "offered_qos_profiles": [_qos_tree(profile) for profile in topic.qos],
                    "type_description_hash": topic.type_hash,
                },
                "message_count": topic.message_count,
            }
            for topic in metadata.topics
        ],
        "compression_format": metadata.compression_format,
        "compression_mode": metadata.compression_mode,
        "relative_file_paths": [file.path for file in metadata.files],
        "files": [
            {
                "path": file.path,
                "starting_time": {"nanoseconds_since_epoch": file.start_ns},
                "duration": {"nanoseconds": file.duration_ns},
                "message_count": file.message_count,
            }
            for file in metadata.files
        ],
        "custom_data": dict(metadata.custom_data) or None,
        "ros_distro": metadata.ros_distro,
    }
    return _text({"rosbag2_bagfile_information": tree} if root else tree)


def parse_qos(text: str | Sequence[Any] | None) -> tuple[QosProfile, ...]:
    """Read a QoS list as a channel or ``metadata.yaml`` stores it; empty where it is absent or of another form.

    Bags of Humble and before have numbers instead of names: they play with the default QoS.
    """
    try:
        items = read_yaml(text) if isinstance(text, str) else text
        return tuple(_qos(item) for item in items or ())
    except (yaml.YAMLError, TypeError, ValueError, KeyError, IndexError, AttributeError, OverflowError):
        return ()


def parse_metadata(text: str, what: str) -> BagMetadata:
    """Read ``metadata.yaml`` or the text of a ``serialized_metadata`` record; `what` names it in the error.

    Raises:
        InputError: it is not YAML, or a key that rosbag2 needs is missing or of another kind.
    """
    try:
        tree = read_yaml(text)
        tree = tree.get("rosbag2_bagfile_information", tree)
        files = tuple(_file(item) for item in tree.get("files") or ())
        return BagMetadata(
            files=files or tuple(FileInfo(str(path)) for path in tree["relative_file_paths"]),
            topics=tuple(_topic(item) for item in tree["topics_with_message_count"] or ()),
            start_ns=int(tree["starting_time"]["nanoseconds_since_epoch"]),
            duration_ns=int(tree["duration"]["nanoseconds"]),
            message_count=int(tree["message_count"]),
            custom_data={str(key): str(value) for key, value in (tree.get("custom_data") or {}).items()},
            ros_distro=str(tree.get("ros_distro") or ""),
            storage=str(tree["storage_identifier"]),
            compression_format=str(tree.get("compression_format") or ""),
            compression_mode=str(tree.get("compression_mode") or ""),
            version=int(tree["version"]),
        )
    except (yaml.YAMLError, TypeError, KeyError, ValueError, AttributeError, OverflowError) as error:
        expected = "YAML with rosbag2_bagfile_information as rosbag2 writes it"
        got = f"{type(error).__name__} {' '.join(str(error).split())}"
        raise InputError(what, got=got, expected=expected) from None


def _qos_tree(qos: QosProfile) -> dict[str, Any]:
    def duration(nanoseconds: int) -> dict[str, int]:
        return {"sec": nanoseconds // 10**9, "nsec": nanoseconds % 10**9}

    return {
        "history": qos.history,
        "depth": qos.depth,
        "reliability": qos.reliability,
        "durability": qos.durability,
        "deadline": duration(qos.deadline_ns),
        "lifespan": duration(qos.lifespan_ns),
        "liveliness": qos.liveliness,
        "liveliness_lease_duration": duration(qos.liveliness_lease_ns),
        "avoid_ros_namespace_conventions": qos.avoid_ros_namespace_conventions,
    }


def _qos(item: Any) -> QosProfile:
    def name(key: str) -> str:
        if not isinstance(item[key], str):
            raise TypeError(key)
        return str(item[key])

    def duration(key: str) -> int:
        return int(item[key]["sec"]) * 10**9 + int(item[key]["nsec"])

    return QosProfile(
        reliability=name("reliability"),
        durability=name("durability"),
        history=name("history"),
        depth=int(item["depth"]),
        deadline_ns=duration("deadline"),
        lifespan_ns=duration("lifespan"),
        liveliness=name("liveliness"),
        liveliness_lease_ns=duration("liveliness_lease_duration"),
        avoid_ros_namespace_conventions=bool(item["avoid_ros_namespace_conventions"]),
    )


def _topic(item: Any) -> TopicInfo:
    topic = item["topic_metadata"]
    return TopicInfo(
        name=str(topic["name"]),
        type_name=str(topic["type"]),
        qos=parse_qos(topic.get("offered_qos_profiles")),
        type_hash=str(topic.get("type_description_hash") or ""),
        message_count=int(item["message_count"]),
        encoding=str(topic["serialization_format"]),
    )


def _file(item: Any) -> FileInfo:
    return FileInfo(
        path=str(item["path"]),
        start_ns=int(item["starting_time"]["nanoseconds_since_epoch"]),
        duration_ns=int(item["duration"]["nanoseconds"]),
        message_count=int(item["message_count"]),
    )


def _text(tree: Any) -> str:
    return yaml.dump(tree, Dumper=_DUMPER, sort_keys=False, width=_NO_WRAP, allow_unicode=True)


_NO_WRAP = 2**31 - 1
_DUMPER = getattr(yaml, "CSafeDumper", yaml.SafeDumper)
