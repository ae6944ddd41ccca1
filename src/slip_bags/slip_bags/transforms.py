"""Make `/tf` out of what a bag holds: joint states with their URDF, and the poses of odometry.

Without `/tf` a viewer draws every link at the origin. Joint states belong to the `robot_description` of their own
namespace, whose links get that namespace as prefix; the base stands in `world`. Odometry is the transform from its
frame to its child frame.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Final

from slip_bags.format import QosProfile, TopicInfo
from slip_bags.reader import RawMessage
from slip_bags.series import Series
from slip_bags.typedefs import find_definition
from slip_core.files.link_tree import Link, poses_on_parents, read_links
from slip_core.stamps import stamp_of
from slip_msgs_py.messages.layout import Schema
from slip_msgs_py.messages.transforms import TOPIC, TYPE, TYPE_HASH, TransformEncoder

WORLD: Final = "world"
RATE_HZ: Final = 50.0
_PERIOD_NS: Final = round(1e9 / RATE_HZ)
WAITING: Final = 10_000
"""Joint states kept until their URDF is known: the newest 10 s at 1 kHz."""
SOURCES: Final = {
    "sensor_msgs/msg/JointState": "joint_states",
    "std_msgs/msg/String": "robot_description",
    "nav_msgs/msg/Odometry": "",
}
"""Types that are looked at, and the last word of the topic, where it matters."""


def tf_topic() -> tuple[TopicInfo, str]:
    """Return the topic as a bag announces it, with the text of its schema."""
    qos = QosProfile(history="keep_last", depth=100)
    return TopicInfo(TOPIC, TYPE, (qos,), TYPE_HASH), find_definition(TYPE).text


@dataclass(slots=True)
class _Source:
    """What was last sent of one topic, and how its messages become transforms."""

    schema: Schema
    next_ns: int = 0
    waiting: deque[RawMessage] = field(default_factory=lambda: deque(maxlen=WAITING))
    links: list[Link] | None = None
    encoder: TransformEncoder | None = None


def _namespace(topic: str) -> str:
    return topic.rpartition("/")[0].strip("/")


class Transforms:
    """Turns messages into messages on `/tf`, at most `RATE_HZ` per source, by their stamps.

    Args:
        types: type names by topic, of the topics that may be given.
        urdfs: URDF by namespace ("" is none), where it is not on a topic.
    """

    def __init__(self, types: Mapping[str, str], *, urdfs: Mapping[str, str] | None = None) -> None:
        self._urdfs = dict(urdfs or {})
        self._sources: dict[str, _Source] = {}
        self._count = 0
        for name, kind in types.items():
            self.add_topic(name, kind)

    def add_topic(self, name: str, kind: str) -> None:
        """Look at messages of this topic too, if their type says something about frames."""
        if kind in SOURCES and name.endswith(SOURCES[kind]):
            self._sources[name] = _Source(Schema.from_text(kind, find_definition(kind).text))

    def feed(self, message: RawMessage) -> Iterator[RawMessage]:
        """Yield the messages on `/tf` that a message leads to.

        A late description, as on a busy machine, costs none: joint states wait for it. What is made is the same in
        whatever order the two arrive.

        Raises:
            InputError: a description that is no URDF.
        """
        source = self._sources.get(message.topic)
        if source is None:
            return
        if source.schema.type_name.endswith("String"):
            self._urdfs[_namespace(message.topic)] = str(Series(source.schema, [message])["data"][0])
            for other in self._sources.values():
                waiting, other.waiting = other.waiting, deque(maxlen=WAITING)
                for one in waiting:
                    yield from self._transform(
                        other,
                        RawMessage(one.topic, message.log_time_ns, message.publish_time_ns, one.sequence, one.data),
                    )
            return
        yield from self._transform(source, message)

    def _transform(self, source: _Source, message: RawMessage) -> Iterator[RawMessage]:
        namespace, urdf = _namespace(message.topic), ""
        if source.schema.type_name.endswith("JointState"):
            urdf = self._urdfs.get(namespace, self._urdfs.get("", ""))
            if not urdf:
                source.waiting.append(message)
                return
        stamp_ns = stamp_of(message.data)
        if source.next_ns - _PERIOD_NS <= stamp_ns < source.next_ns:  # an older one is a clock that restarted
            return
        row = Series(source.schema, [message])
        data = self._arm(source, row, namespace, urdf, stamp_ns) if urdf else self._body(source, row, stamp_ns)
        if data is not None:
            source.next_ns = stamp_ns + _PERIOD_NS
            self._count += 1
            yield RawMessage(TOPIC, message.log_time_ns, message.publish_time_ns, self._count, data)

    def _arm(self, source: _Source, row: Series, namespace: str, urdf: str, stamp_ns: int) -> bytes | None:
        if row["position"].shape[1:] != row["name"].shape[1:]:
            return None
        if source.links is None or source.encoder is None:
            source.links = read_links(urdf)
            prefix = f"{namespace}/" if namespace else ""
            frames = [
                (prefix + source.links[link.parent].name if link.parent >= 0 else WORLD, prefix + link.name)
                for link in source.links
            ]
            source.encoder = TransformEncoder(frames)
        positions = dict(zip(row["name"][0], row["position"][0].tolist(), strict=True))
        return source.encoder.encode(stamp_ns, poses_on_parents(source.links, positions))

    def _body(self, source: _Source, row: Series, stamp_ns: int) -> bytes:
        if source.encoder is None:
            source.encoder = TransformEncoder([(str(row["header.frame_id"][0]), str(row["child_frame_id"][0]))])
        return source.encoder.encode(stamp_ns, row.columns("pose.pose.position", "pose.pose.orientation"))
