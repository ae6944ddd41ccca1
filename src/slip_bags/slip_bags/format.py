"""The texts of rosbag2: ``metadata.yaml`` version 9 and the QoS lists, and what a reader needs of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import yaml

from slip_core.files.plain_yaml import read_yaml

LATEST_NS: Final = 2**63 - 1  # in the year 2262
_UNSET: Final = {"sec": LATEST_NS // 10**9, "nsec": LATEST_NS % 10**9}
_NO_WRAP: Final = 2**31 - 1
_DUMPER = getattr(yaml, "CSafeDumper", yaml.SafeDumper)


@dataclass(frozen=True, slots=True)
class QosProfile:
    """What one publisher offered, as far as it decides who can hear it; names as in rmw."""

    reliability: str = "reliable"
    durability: str = "volatile"


@dataclass(frozen=True, slots=True)
class TopicInfo:
    """One recorded topic: name, type, offered QoS (one entry per publisher), message count."""

    name: str
    type_name: str
    qos: tuple[QosProfile, ...] = ()
    message_count: int = 0
    encoding: str = "cdr"


class BagMessage(NamedTuple):
    """One stored message: received and sent [ns], the publisher's number of it; its CDR bytes, or what they decode to.

    A decoded one has the fields of its type as attributes.
    """

    topic: str
    log_time_ns: int
    publish_time_ns: int
    sequence: int
    value: Any


def qos_text(profiles: Sequence[QosProfile]) -> str:
    """Return the channel metadata ``offered_qos_profiles``."""
    return yaml_text([_qos_tree(profile) for profile in profiles])


def metadata_tree(
    file: str, topics: Sequence[TopicInfo], span_ns: tuple[int, int] | None, custom_data: Mapping[str, str]
) -> dict[str, Any]:
    """Return the content of ``metadata.yaml`` below its root key, which is also the record ``serialized_metadata``.

    Args:
        file: name of the bag's MCAP file.
        topics: all of them, with their counts.
        span_ns: first and last log time [ns], None without messages.
        custom_data: texts of the user.
    """
    start_ns, end_ns = span_ns or (LATEST_NS, LATEST_NS)
    count = sum(topic.message_count for topic in topics)
    return {
        "version": 9,
        "storage_identifier": "mcap",
        "duration": {"nanoseconds": end_ns - start_ns},
        "starting_time": {"nanoseconds_since_epoch": start_ns},
        "message_count": count,
        "topics_with_message_count": [
            {
                "topic_metadata": {
                    "name": topic.name,
                    "type": topic.type_name,
                    "serialization_format": topic.encoding,
                    "offered_qos_profiles": [_qos_tree(profile) for profile in topic.qos],
                    "type_description_hash": "",
                },
                "message_count": topic.message_count,
            }
            for topic in topics
        ],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [file],
        "files": [
            {
                "path": file,
                "starting_time": {"nanoseconds_since_epoch": start_ns},
                "duration": {"nanoseconds": end_ns - start_ns},
                "message_count": count,
            }
        ],
        "custom_data": dict(custom_data) or None,
        "ros_distro": "jazzy",
    }


def parse_qos(text: str) -> tuple[QosProfile, ...]:
    """Read a channel's QoS list; empty where it is absent or of another form.

    Bags of Humble and before have numbers instead of names: they play with the default QoS.
    """
    try:
        return tuple(QosProfile(item["reliability"].lower(), item["durability"].lower()) for item in read_yaml(text))
    except (yaml.YAMLError, TypeError, KeyError, ValueError, AttributeError):
        return ()


def parse_custom_data(text: str) -> dict[str, str]:
    """Read the custom data of a ``serialized_metadata`` record; empty where it is of another form."""
    try:
        return {str(key): str(value) for key, value in read_yaml(text)["custom_data"].items()}
    except (yaml.YAMLError, TypeError, KeyError, ValueError, AttributeError):
        return {}


def _qos_tree(qos: QosProfile) -> dict[str, Any]:
    return {
        "history": "unknown",  # history and depth are not discovered
        "depth": 0,
        "reliability": qos.reliability,
        "durability": qos.durability,
        "deadline": dict(_UNSET),
        "lifespan": dict(_UNSET),
        "liveliness": "automatic",
        "liveliness_lease_duration": dict(_UNSET),
        "avoid_ros_namespace_conventions": False,
    }


def yaml_text(tree: Any) -> str:
    """Return a YAML text without wrapped lines, as rosbag2 writes it."""
    return yaml.dump(tree, Dumper=_DUMPER, sort_keys=False, width=_NO_WRAP)
