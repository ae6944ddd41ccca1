"""The texts of rosbag2: its keys, in its order, with its values."""

from __future__ import annotations

import json
import textwrap

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from slip_bags.format import QosProfile, TopicInfo, metadata_tree, parse_custom_data, parse_qos, qos_text, yaml_text

# Written down from what the Jazzy storage plugin writes.
QOS = """\
- history: unknown
  depth: 0
  reliability: reliable
  durability: transient_local
  deadline:
    sec: 9223372036
    nsec: 854775807
  lifespan:
    sec: 9223372036
    nsec: 854775807
  liveliness: automatic
  liveliness_lease_duration:
    sec: 9223372036
    nsec: 854775807
  avoid_ros_namespace_conventions: false"""
METADATA = f"""\
rosbag2_bagfile_information:
  version: 9
  storage_identifier: mcap
  duration:
    nanoseconds: 2
  starting_time:
    nanoseconds_since_epoch: 1700000000000000000
  message_count: 3
  topics_with_message_count:
    - topic_metadata:
        name: /a
        type: std_msgs/msg/String
        serialization_format: cdr
        offered_qos_profiles:
          []
        type_description_hash: ""
      message_count: 0
    - topic_metadata:
        name: /b
        type: std_msgs/msg/String
        serialization_format: cdr
        offered_qos_profiles:
{textwrap.indent(QOS, 10 * " ")}
        type_description_hash: ""
      message_count: 3
  compression_format: ""
  compression_mode: ""
  relative_file_paths:
    - x_0.mcap
  files:
    - path: x_0.mcap
      starting_time:
        nanoseconds_since_epoch: 1700000000000000000
      duration:
        nanoseconds: 2
      message_count: 3
  custom_data: ~
  ros_distro: jazzy"""
LATCHED = QosProfile(durability="transient_local")
TOPICS = (TopicInfo("/a", "std_msgs/msg/String"), TopicInfo("/b", "std_msgs/msg/String", (LATCHED,), 3))
SPAN = 1_700_000_000_000_000_000, 1_700_000_000_000_000_002


def same(text: str, expected: str) -> bool:
    """The same YAML, the keys in the same order."""
    return json.dumps(yaml.safe_load(text)) == json.dumps(yaml.safe_load(expected))


def test_qos_text_is_rosbag2s():
    assert same(qos_text([LATCHED]), QOS)
    assert same(qos_text([LATCHED, LATCHED]), f"{QOS}\n{QOS}")
    assert yaml.safe_load(qos_text([])) == []


def test_metadata_text_is_rosbag2s():
    lines = METADATA.splitlines()[1:]
    assert same(yaml_text(metadata_tree("x_0.mcap", TOPICS, SPAN, {})), "\n".join(line[2:] for line in lines))


def test_empty_bag_starts_at_the_end_of_time():
    tree = metadata_tree("x_0.mcap", (), None, {})
    assert tree["starting_time"] == {"nanoseconds_since_epoch": 9223372036854775807}
    assert tree["topics_with_message_count"] == []


@pytest.mark.parametrize(
    "text", ["", "7", "- 1", "- {history: 3}", "a: [", "- {history: [], depth: x}", QOS.replace("reliable", "1")]
)
def test_other_forms_of_qos_are_none(text):
    assert parse_qos(text) == ()


@pytest.mark.parametrize("text", ["", "[]", "a: b", "a: [", "custom_data: 3", "custom_data: ~", "\x00"])
def test_other_forms_of_custom_data_are_none(text):
    assert parse_custom_data(text) == {}


@given(
    custom=st.dictionaries(st.text(min_size=1), st.text(), max_size=4),
    qos=st.lists(st.sampled_from([QosProfile(), LATCHED]), max_size=3),
)
def test_any_text_survives_and_stays_text(custom, qos):
    """As text also where it looks like a number."""
    printable = {_legal(key): _legal(value) for key, value in custom.items()}
    assert parse_custom_data(yaml_text(metadata_tree("x_0.mcap", (), None, printable))) == printable
    assert parse_qos(qos_text(qos)) == tuple(qos)


def _legal(text: str) -> str:
    """Lone surrogates cannot be written as UTF-8; they are replaced."""
    return text.encode("utf-8", "replace").decode("utf-8")
