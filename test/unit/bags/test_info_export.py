"""What `bag info` measures, what `bag export` writes, and the commands around them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner

from slip_bags.cli import bag as bag_command
from slip_bags.export import dataframe, export, file_name
from slip_bags.format import QosProfile, TopicInfo
from slip_bags.info import bag_report
from slip_bags.reader import Bag
from slip_bags.typedefs import find_definition
from slip_bags.writer import BagWriter, WriterOptions
from slip_core.errors import InputError
from test.support.bag_maker import STORE, SUITE_TOPICS, encode, make_bag

WRENCH = "geometry_msgs/msg/WrenchStamped"
JOINTS = "sensor_msgs/msg/JointState"
MS = 1_000_000


def wrench(stamp_ns: int):
    types = STORE.types
    vector = types["geometry_msgs/msg/Vector3"]
    time = types["builtin_interfaces/msg/Time"](*divmod(stamp_ns, 10**9))
    header = types["std_msgs/msg/Header"](stamp=time, frame_id="ee")
    return types[WRENCH](
        header=header,
        wrench=types["geometry_msgs/msg/Wrench"](force=vector(0.1, 0.2, 0.3), torque=vector(1.0, 2.0, 3.0)),
    )


def write(folder: Path, rows: list[tuple[int, int, int]], **options: object) -> None:
    """Write wrenches given as (log time, sequence, stamp), all in milliseconds or numbers."""
    writer = BagWriter(folder, WriterOptions(**options))
    definition = find_definition(WRENCH)
    writer.add_topic(TopicInfo("/w", WRENCH, (QosProfile(),), definition.type_hash), definition.text)
    for log_ms, sequence, stamp_ms in rows:
        writer.write("/w", log_ms * MS, log_ms * MS, sequence, encode(wrench(stamp_ms * MS)))
    writer.close()


def run(*arguments: object):
    result = CliRunner().invoke(bag_command, [str(part) for part in arguments])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result


def test_rates_gaps_losses_and_stamps(tmp_path):
    rows = [(0, 1, 10), (10, 2, 20), (20, 3, 15), (50, 7, 15), (60, 8, 30)]
    write(tmp_path / "bag", rows)
    with Bag(tmp_path / "bag") as bag:
        (topic,) = bag_report(bag).topics
    assert topic.message_count == 5
    assert topic.rate_hz == pytest.approx(4 / 0.060)
    assert topic.largest_gap_ms == pytest.approx(30.0)
    assert (topic.lost, topic.stamps_backward, topic.stamps_repeated) == (3, 1, 1)
    assert topic.qos == "reliable, volatile"


def test_the_recorders_own_count_is_believed(tmp_path):
    counted = {"recorder": json.dumps({"topics": {"/w": {"lost": 42}}})}
    write(tmp_path / "bag", [(0, 1, 0), (10, 2, 0)], custom_data=counted)
    with Bag(tmp_path / "bag") as bag:
        assert bag_report(bag).topics[0].lost == 42


def test_bag_without_messages(tmp_path):
    write(tmp_path / "bag", [])
    with Bag(tmp_path / "bag") as bag:
        report = bag_report(bag)
    assert (report.message_count, report.start_ns, report.topics[0].rate_hz) == (0, None, None)
    assert "0 in 0.000 s" in run("info", tmp_path / "bag").output


def test_contradicting_metadata_is_noted(tmp_path):
    write(tmp_path / "bag", [(0, 1, 0), (10, 2, 0)])
    path = tmp_path / "bag" / "metadata.yaml"
    path.write_text(path.read_text().replace("message_count: 2", "message_count: 3").replace("volatile", "unknown"))
    with Bag(tmp_path / "bag") as bag:
        notes = " ".join(bag_report(bag).notes)
    assert "count different messages" in notes
    assert "disagree about QoS" in notes


def test_info_as_text_and_json(tmp_path):
    options = WriterOptions(custom_data={"scenario": "paper"}, attachments={"controller.params.yaml": b"gains: 1\n"})
    content = make_bag(tmp_path / "bag", count=5, options=options)
    text = run("info", tmp_path / "bag").output
    for part in ("bag_0.mcap", "controller.params.yaml (9 B)", "scenario", "zstd", *SUITE_TOPICS):
        assert part in text
    data = json.loads(run("info", tmp_path / "bag", "--json", "--no-scan").output)
    assert data["message_count"] == 5 * len(content)
    assert [topic["name"] for topic in data["topics"]] == sorted(SUITE_TOPICS)
    assert run("info", tmp_path / "bag", "--attachment", "controller.params.yaml").output == "gains: 1\n"
    with pytest.raises(InputError, match=r"known: controller\.params\.yaml|did you mean"):
        run("info", tmp_path / "bag", "--attachment", "x")


@pytest.mark.parametrize("file_format", ["csv", "parquet"])
def test_exported_numbers_are_the_recorded_ones_bit_by_bit(tmp_path, file_format):
    content = make_bag(tmp_path / "bag", count=40, topics={"/w": WRENCH})
    run("export", tmp_path / "bag", "-o", tmp_path / "out", "--format", file_format)
    path = tmp_path / "out" / f"w.{file_format}"
    read = pd.read_csv(path) if file_format == "csv" else pd.read_parquet(path)
    rows = content["/w"]
    assert read["log_time_ns"].tolist() == [row[0] for row in rows]
    names = [row[3].header.frame_id for row in rows]
    assert read["header.frame_id"].fillna("").tolist() == names
    assert read["stamp_ns"].tolist() == [row[3].header.stamp.sec * 10**9 + row[3].header.stamp.nanosec for row in rows]
    for part, axis in (("force", "x"), ("torque", "z")):
        expected = np.array([getattr(getattr(row[3].wrench, part), axis) for row in rows])
        found = read[f"wrench.{part}.{axis}"].to_numpy()
        assert (found.view(np.uint64) == expected.view(np.uint64)).all()


@pytest.mark.parametrize("count", [1, 3])
def test_joint_states_get_columns_by_joint(tmp_path, count):
    types = STORE.types
    header = wrench(5).header
    writer = BagWriter(tmp_path / "bag", WriterOptions())
    definition = find_definition(JOINTS)
    writer.add_topic(TopicInfo("/j", JOINTS, (), definition.type_hash), definition.text)
    for index in range(count):
        values = np.array([index, 10.0 + index])
        message = types[JOINTS](header, ["shoulder", "elbow"], values, values * 2, np.zeros(0))
        writer.write("/j", index, index, index, encode(message))
    writer.close()
    with Bag(tmp_path / "bag") as bag:
        table = dataframe(bag, "j")
    assert table["position.elbow"].tolist() == [10.0, 11.0, 12.0][:count]
    assert table["velocity.shoulder"].tolist() == [0.0, 2.0, 4.0][:count]
    assert not [name for name in table if name.startswith("effort")]


def test_fields_of_varying_length_become_json(tmp_path):
    content = make_bag(tmp_path / "bag", count=30, topics={"/d": "std_msgs/msg/Float64MultiArray"})
    with Bag(tmp_path / "bag") as bag:
        table = dataframe(bag, "/d")
    assert [json.loads(cell) for cell in table["data"]] == [row[3].data.tolist() for row in content["/d"]]


def test_every_suite_topic_can_be_exported(tmp_path):
    make_bag(tmp_path / "bag", count=10)
    with Bag(tmp_path / "bag") as bag:
        written = export(bag, (), tmp_path / "out", "parquet")
    assert [rows for _, rows in written] == [10] * len(SUITE_TOPICS)
    assert {path.name for path, _ in written} == {f"{file_name(name)}.parquet" for name in SUITE_TOPICS}


def test_export_refuses_what_exists_and_what_is_unknown(tmp_path):
    make_bag(tmp_path / "bag", count=2, topics={"/w": WRENCH})
    with pytest.raises(InputError, match="no such topic"):
        run("export", tmp_path / "bag", "-o", tmp_path / "out", "-t", "nothing")
    assert not (tmp_path / "out").exists()
    (tmp_path / "out").mkdir()
    with pytest.raises(InputError, match="a new folder"):
        run("export", tmp_path / "bag", "-o", tmp_path / "out")


def test_recover_command_names_its_output(tmp_path):
    make_bag(tmp_path / "bag", count=20, topics={"/w": WRENCH})
    (tmp_path / "bag" / "metadata.yaml").unlink()
    with pytest.raises(InputError, match="bag recover"):
        run("info", tmp_path / "bag")
    output = run("recover", tmp_path / "bag").output
    assert f"{tmp_path / 'bag_recovered'}: 20 messages on 1 topics" in output
    assert "recovered bag" in run("info", tmp_path / "bag_recovered").output


def test_record_without_topics_says_what_to_give():
    with pytest.raises(InputError, match="--all or --regex"):
        run("record")


def test_every_topic_has_a_file_name() -> None:
    names = {"/a/b": "a.b", "/left/slip velocity": "left.slip_velocity", "/": "topic", "": "topic"}
    assert {topic: file_name(topic) for topic in names} == names
