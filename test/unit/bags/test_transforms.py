"""Transforms made of a recorded run: decoded by others, where pinocchio and the ground truth have links and object."""

import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio
import pytest
from scipy.spatial.transform import Rotation

from slip_bags.cli import bag as bag_command
from slip_bags.export import export_bag
from slip_bags.reader import Bag, RawMessage
from slip_bags.transforms import RATE_HZ, Transforms, tf_topic
from slip_bags.writer import BagWriter, WriterOptions
from slip_core.errors import InputError
from slip_core.files.link_tree import poses_on_parents, read_links
from slip_description import urdf_text

REFERENCE = Path(__file__).parents[3] / "bags" / "paper_planar_vic"
SAME_M = 1e-12
CHAIN = """<robot name="r"><link name="a"/><link name="b"/><link name="c"/>
<joint name="slide" type="prismatic"><parent link="a"/><child link="b"/><origin xyz="1 0 0" rpy="0 0 1.5707963267948966"/><axis xyz="2 0 0"/></joint>
<joint name="fixed" type="fixed"><parent link="b"/><child link="c"/></joint></robot>"""  # noqa: E501


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("tf") / "bag"
    with Bag(REFERENCE) as source:
        made = export_bag(source, (), folder)
    with Bag(folder) as bag:
        assert made == bag.topics["/tf"].message_count > 0
    return folder


def test_a_slide_moves_along_its_axis() -> None:
    poses = poses_on_parents(read_links(CHAIN), {"slide": 0.5})
    np.testing.assert_allclose(poses[1, :3], [1.0, 0.5, 0.0], atol=SAME_M)
    np.testing.assert_allclose(poses[2], [0, 0, 0, 0, 0, 0, 1], atol=SAME_M)


@pytest.mark.parametrize("text", ["", "<robot", "<robot/>", CHAIN.replace('child link="c"', 'child link="x"')])
def test_no_tree_is_one_line(text: str) -> None:
    with pytest.raises(InputError, match="robot_description"):
        read_links(text)


def test_type_is_that_of_tf2_msgs() -> None:
    info, text = tf_topic()
    assert (info.name, info.type_name) == ("/tf", "tf2_msgs/msg/TFMessage")
    assert [(qos.reliability, qos.durability, qos.depth) for qos in info.qos] == [("reliable", "volatile", 100)]
    assert text.startswith("geometry_msgs/TransformStamped[] transforms\n\n====")


def test_exported_bag_has_all_that_was_and_transforms(exported: Path) -> None:
    with Bag(REFERENCE) as before, Bag(exported) as after:
        assert set(after.topics) == {name for name, t in before.topics.items() if t.message_count} | {"/tf"}
        assert all(
            info.message_count == before.topics[n].message_count for n, info in after.topics.items() if n != "/tf"
        )
        assert after.attachments == before.attachments
        seconds = before.topics["/joint_states"].message_count * 1e-3
        assert after.topics["/tf"].message_count == pytest.approx(2 * RATE_HZ * seconds, rel=0.01)


@pytest.mark.parametrize(("file", "prefix"), [("arm.urdf", ""), ("left.urdf", "left/")])
def test_an_attached_urdf_is_that_of_the_arm_it_is_named_after(tmp_path: Path, file: str, prefix: str) -> None:
    with Bag(REFERENCE) as source:
        info, text = source.topic("joint_states"), source.schema_text("/joint_states")
        attached = {file: source.attachments["arm.urdf"]}
        writer = BagWriter(tmp_path / "in", WriterOptions(attachments=attached))
        writer.add_topic(replace(info, name=f"/{prefix}joint_states"), text)
        for message in itertools.islice(source.raw(["joint_states"]), 100):
            writer.write(f"/{prefix}joint_states", *message[1:])
        writer.close()
    with Bag(tmp_path / "in") as bag:
        assert export_bag(bag, (), tmp_path / "out") > 0


def test_a_topic_without_messages_is_left_out(tmp_path: Path) -> None:
    with Bag(REFERENCE) as source:
        info, text = source.topic("joint_states"), source.schema_text("/joint_states")
        writer = BagWriter(tmp_path / "in", WriterOptions())
        writer.add_topic(info, text)
        writer.add_topic(replace(info, name="/silent"), text)
        for message in itertools.islice(source.raw(["joint_states"]), 3):
            writer.write(*message)
        writer.close()
    with Bag(tmp_path / "in") as silent:
        assert silent.topics["/silent"].message_count == 0
        export_bag(silent, (), tmp_path / "out")
    with Bag(tmp_path / "out") as bag:
        assert set(bag.topics) == {"/joint_states", "/tf"}


def test_links_and_object_are_where_they_were(exported: Path) -> None:
    model = pinocchio.buildModelFromXML(urdf_text())
    data = model.createData()
    with Bag(exported) as bag:
        messages = [message.value for message in bag.messages("/tf")]
        states, truth = bag.series("joint_states"), bag.series("object_state")
    arm = next(m for m in reversed(messages) if len(m.transforms) > 1)
    thing = next(m.transforms[0] for m in reversed(messages) if len(m.transforms) == 1)
    placed = {"world": (np.zeros(3), Rotation.identity())}
    for one in arm.transforms:
        base, turn = placed[one.header.frame_id]
        t, r = one.transform.translation, one.transform.rotation
        placed[one.child_frame_id] = base + turn.apply([t.x, t.y, t.z]), turn * Rotation.from_quat([r.x, r.y, r.z, r.w])

    links = read_links(urdf_text())
    parents = {link.name: links[link.parent].name if link.parent >= 0 else "world" for link in links}
    assert {one.child_frame_id: one.header.frame_id for one in arm.transforms} == parents

    def row_of(series, stamp) -> int:
        return int(np.searchsorted(series.stamp_ns, stamp.sec * 10**9 + stamp.nanosec))

    q = states["position"][row_of(states, arm.transforms[0].header.stamp)]
    pinocchio.framesForwardKinematics(model, data, q)
    for name, (position, turn) in placed.items():
        if name != "world":
            frame = data.oMf[model.getFrameId(name)]
            np.testing.assert_allclose(position, frame.translation, atol=SAME_M, err_msg=name)
            np.testing.assert_allclose(turn.as_matrix(), frame.rotation, atol=SAME_M, err_msg=name)
    assert (thing.header.frame_id, thing.child_frame_id) == ("world", "object")
    row = row_of(truth, thing.header.stamp)
    recorded = [truth[f"pose.pose.position.{axis}"][row] for axis in "xyz"]
    assert [getattr(thing.transform.translation, axis) for axis in "xyz"] == recorded


def test_frames_of_a_namespace_have_its_prefix() -> None:
    with Bag(REFERENCE) as bag:
        (state,) = [m for m, _ in zip(bag.raw(["/joint_states"]), range(1), strict=False)]
    renamed = state._replace(topic="/left/joint_states")
    kinds = {"/left/joint_states": "sensor_msgs/msg/JointState"}
    (made,) = Transforms(kinds, urdfs={"left": urdf_text()}).feed(renamed)
    assert b"left/arm_link7\0" in made.data
    assert list(Transforms(kinds, urdfs={"right": urdf_text()}).feed(renamed)) == []


def test_a_late_description_costs_no_transform() -> None:
    """On a busy machine the first joint states may come before the description: the same is made, a little later."""
    with Bag(REFERENCE) as bag:
        states = [m for m, _ in zip(bag.raw(["/joint_states"]), range(90), strict=False)]
        (description,) = bag.raw(["/robot_description"])
    kinds = {"/joint_states": "sensor_msgs/msg/JointState", "/robot_description": "std_msgs/msg/String"}

    def made(messages: list[RawMessage]) -> list[bytes]:
        transforms = Transforms(kinds)
        return [one.data for message in messages for one in transforms.feed(message)]

    early = made([description, *states])
    assert len(early) == 5
    assert made([*states[:50], description, *states[50:]]) == early
    assert made([*states, description]) == early


def test_export_says_what_it_added(tmp_path: Path) -> None:
    from click.testing import CliRunner

    result = CliRunner().invoke(bag_command, ["export", str(REFERENCE), "-o", str(tmp_path / "x"), "-f", "mcap"])
    assert result.exit_code == 0, result.output
    assert "messages on /tf added" in result.output
