"""`slip-vic arm`: what it finds in a URDF, what it writes, and what it says where it cannot."""

from __future__ import annotations

import functools
import itertools
import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

from slip_core.errors import InputError
from slip_core.files.urdf import chain, is_physical, named, parse_urdf
from slip_core.params import build
from slip_core.topics import TOPICS
from slip_vic.cli import main
from slip_vic.run.in_process import run_in_process
from slip_vic.scenarios.reach import REACHED, follow, pad_path
from slip_vic.scenarios.scenario import load, read_parameters
from slip_vic.setup.arm import posture
from slip_vic.setup.arm.driver import DRIVERS
from slip_vic.setup.arm.hand import find_hand, fingers
from slip_vic.setup.arm.posture import Start
from slip_vic.setup.arm.write import ROTOR, Arm, failing, write_arm
from slip_vic.setup.arm.write_urdf import PAD, possible_inertia
from slip_vic_controller.config.controller import Controller
from slip_vic_controller.params.controller_params import ControllerParams
from slip_vic_controller.robot import Robot
from slip_vic_controller.safety.conditions import Mode
from test.support.odd_arm import JOINTS, odd_arm_urdf, with_joint, with_link

ROUNDING = 1e-9
URDF = odd_arm_urdf()


@pytest.fixture(autouse=True)
def few_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(posture, "SAMPLES", 120)


@pytest.fixture
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "odd.urdf").write_text(URDF)
    return tmp_path / "odd.urdf"


@functools.cache
def planar() -> tuple[Arm, dict[str, Any], Start]:
    """Return the arm, and its start in paper_planar."""
    arm = Arm(URDF)
    return arm, *arm.task("paper_planar", 1.0)[:2]


def test_the_hand_is_found() -> None:
    hand = find_hand(parse_urdf(URDF))
    assert (hand.link, hand.joints, hand.approach, hand.normal) == ("tool0", JOINTS, "x", "z")
    assert len(hand.said) == 3


def test_what_is_given_is_taken() -> None:
    hand = find_hand(parse_urdf(URDF), "link_6", "y", "x")
    assert (hand.link, hand.approach, hand.normal, hand.said) == ("link_6", "y", "x", ())
    np.testing.assert_allclose(hand.rotation, [[0, 0, 1], [1, 0, 0], [0, 1, 0]], atol=ROUNDING)
    assert find_hand(parse_urdf(URDF), "link_6").approach == "y"


def test_a_hand_at_its_last_joint_reaches_away_from_the_joint_before() -> None:
    behind = with_joint(URDF, "gripper", "0 0.05 0", "0 0 0")
    forward, backward = (with_joint(behind, "joint_6", "0 0 0.1", text) for text in ("0 0.1 0.1", "0 -0.1 0.1"))
    assert [find_hand(parse_urdf(text)).approach for text in (forward, backward)] == ["x", "-x"]


def test_the_joint_that_carries_a_gripper_is_no_finger() -> None:
    """What closes is named after the gripper, or is between two of its links."""
    bare = re.sub(r'<(link|joint) name="(left|right)_finger.*?</(link|joint)>', "", URDF).replace("gripper", "tool")
    for text, last in ((URDF, "joint_6"), (bare, "gripper_yaw")):
        hand = find_hand(parse_urdf(text.replace("link_6", "gripper_link").replace("joint_6", last)))
        assert hand.joints == (*JOINTS[:-1], last)
    for name, child in (("gripper", "prop"), ("joint_7", "gripper_moving")):
        closing = f"""<link name="{child}"/><joint name="{name}" type="revolute"><parent link="gripper_link"/>
            <child link="{child}"/><limit lower="0" upper="1" effort="1" velocity="1"/></joint></robot>"""
        root = parse_urdf(bare.replace("link_6", "gripper_link").replace("</robot>", closing))
        assert (fingers(root), find_hand(root).joints) == ({name}, JOINTS)


def test_an_arm_without_a_gripper_closes_as_assumed() -> None:
    bare = URDF.replace("prismatic", "fixed")
    hand = find_hand(parse_urdf(bare))
    assert hand.normal == "y"
    assert "assumed" in hand.said[-1]


def test_limits_that_are_unknown_are_given_or_assumed() -> None:
    """Drives with loops of their own need no effort: the arm's weight at its end is more than any joint carries."""
    none = URDF.replace('effort="150"', 'effort="-1"')
    given = Arm(none, limits={"*": {"effort": 150.0}, "joint_6": {"effort": 28.0, "velocity": 2.0}}).robot
    np.testing.assert_array_equal(given.effort_limit, [150.0] * 5 + [28.0])
    np.testing.assert_array_equal(given.velocity_limit, [3.0] * 5 + [2.0])
    assumed = Arm(none, by_effort=False)
    stretched = np.abs(assumed.robot.gravity(np.array([0.0, np.pi / 2, 0.0, 0.0, 0.0, 0.0])))
    assert (assumed.robot.effort_limit == assumed.robot.effort_limit[0]).all()
    assert stretched.max() < assumed.robot.effort_limit[0] < 3.0 * stretched.max()
    assert any("is assumed" in line for line in assumed.said)


def test_an_arm_with_five_joints_goes_where_it_can() -> None:
    """The pad stays level on the path, and the path turns it as the arm does."""
    arm = Arm(URDF, locked={"joint_5": 0.0})
    content, start, said = arm.task("paper_planar", 0.5)
    assert start.way.given[:3].all()
    assert not start.way.given.all()
    assert "5 joints: the law commands x, y, z" in said[0]
    first, last = (arm.robot.frame(q) for q in start.way.joints[[0, -1]])
    turned = Rotation.from_rotvec(content["controller"]["trajectory"]["rotation"]).as_matrix()
    np.testing.assert_allclose(last[1], turned @ first[1], atol=1e-6)
    np.testing.assert_allclose(last[0] - first[0], [0.2, 0.15, 0.0], atol=2 * REACHED)


def test_servos_at_50_hz_carry_with_five_joints(tmp_path: Path) -> None:
    """Governed: no slip, at the goal, though nothing is known of efforts; steps of the encoders are no slip."""
    arm = Arm(URDF.replace('effort="150"', 'effort="0"'), locked={"joint_5": 0.0}, by_effort=False)
    content = arm.task("paper_planar", 0.5)[0]
    write_arm(arm, {"paper_planar": content}, tmp_path, Path("odd.urdf"), "position_50")
    run = load(str(tmp_path / "paper_planar.yaml"), law="governed", drive="position_50").run()
    assert run.outcome == "ok", run.reason
    assert not any("the wrench shows" in text for _, text in run.modes[""])
    assert run.worst("slip_linear_m") < REACHED
    assert run.worst("final_error_m") < 2e-3  # a step of the encoders at the arm's length


def test_a_start_inside_the_margin_of_a_limit_will_not_do() -> None:
    arm, _, start = planar()
    known = load("paper_planar", law="vic").controller
    near = start._replace(way=start.way._replace(margin=np.full(6, 0.9 * known.safety.limits.position_margin)))
    assert "0.09 rad from its limit" in failing(near, arm.robot, known)


def test_a_follower_stands_where_its_leader_puts_it() -> None:
    root = parse_urdf(Arm(URDF, locked={"left_finger_joint": 0.02}).urdf)
    origin = named(root, "joint")["right_finger_joint"].find("origin")
    assert origin is not None
    assert float(origin.get("xyz", "").split()[2]) == pytest.approx(-0.02)


def test_the_pad_frame_is_where_the_hand_is() -> None:
    arm = Arm(URDF, reach=0.15)
    q = np.array([0.3, -0.4, 0.7, 0.2, -1.1, 0.5])
    (at, turned, _), (hand, axes, _) = arm.robot.frame(q), Robot(arm.urdf, "tool0", JOINTS).frame(q)
    np.testing.assert_allclose(at, hand + 0.15 * axes[:, 0], atol=ROUNDING)
    np.testing.assert_allclose(turned, axes, atol=ROUNDING)
    assert [joint.get("name") for joint in chain(parse_urdf(arm.urdf), PAD)][-1] == "slip_pad_joint"


def test_an_inertia_that_no_body_has_becomes_the_nearest_possible() -> None:
    rng = np.random.default_rng(3)
    for _ in range(100):
        axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        moments = rng.uniform(0.0, 1.0, 3)
        given = axes @ np.diag(moments) @ axes.T
        mended = possible_inertia(given)
        assert is_physical(mended)
        if is_physical(given) and np.sort(moments)[:2].sum() > 1.01 * moments.max():
            np.testing.assert_allclose(mended, given, atol=1e-6)
    arm = Arm(with_link(URDF, "link_2", 'izz="0.01"', 'izz="0.05"'))
    assert any("link_2" in line and "principal moments" in line for line in arm.said)


def test_a_wrist_without_inertia_gets_that_of_a_rotor() -> None:
    light = URDF
    for link in ("link_6", "gripper", "left_finger", "right_finger"):
        for key in ("ixx", "iyy", "izz"):
            light = with_link(light, link, f'{key}="[^"]*"', f'{key}="1e-7"')
        light = with_link(light, link, 'mass value="[^"]*"', 'mass value="1e-3"')
    content, _, said = Arm(light).task("paper_planar", 1.0)
    assert content["shared"]["drive"] == {"armature": [ROTOR]}
    assert "joint_6" in said[0]
    assert "drive" not in planar()[1]["shared"]


def test_the_folder_runs_from_anywhere(file: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    arm, content, start = planar()
    assert failing(start, arm.robot, load("paper_planar", law="vic").controller) == ""
    written = write_arm(arm, {"paper_planar": content}, Path("made"), file)
    assert [path.name for path in written] == [
        "arm.urdf", "paper_planar.yaml", "paper_planar_controller_realtime.yaml",
    ]  # fmt: skip
    monkeypatch.chdir("/")
    scenario = load(str(tmp_path / "made" / "paper_planar.yaml"), law="governed", set=["bridge.duration_s=0.1"])
    scenario.check()
    ticks = list(run_in_process(scenario))
    assert {tick.result.mode for tick in ticks[5:]} == {Mode.ACTIVE}
    assert max(np.linalg.norm(tick.outputs.truth.slip_displacement) for tick in ticks) < REACHED


def test_the_start_has_the_hand_in_the_attitude_of_the_scenario() -> None:
    arm, known = Arm(URDF), load("vertical_plane", law="vic")
    _, start, _ = arm.task("vertical_plane", 0.5)
    own = Robot(known.urdf, known.controller.ee_frame, known.controller.joint_names)
    wanted = own.frame(np.array(known.bridge.initial_position))[1]
    np.testing.assert_allclose(arm.robot.frame(start.posture)[1], wanted, atol=2 * REACHED)


def test_the_way_follows_the_path() -> None:
    (arm, _, start), known = planar(), load("paper_planar", law="vic")
    times, path = pad_path(known.controller.trajectory)
    way = follow(arm.robot, start.posture, times, path, np.zeros(3))
    assert (way.share, way.speed.max() < 0.5) == (1.0, True)
    origin = arm.robot.frame(start.posture)[0]
    for q, point in zip(way.joints, path, strict=True):
        np.testing.assert_allclose(arm.robot.frame(q)[0], origin + point[:3], atol=REACHED)
    assert path[-1].tolist() == pytest.approx([0.4, 0.3, 0.0, 0.0, 0.0, 0.8])
    assert way.sigma == pytest.approx(min(np.linalg.svd(arm.robot.frame(q)[2])[1][-1] for q in way.joints))


def test_a_smaller_path_has_equal_accelerations() -> None:
    arm, content, _ = planar()
    whole, half = (one["controller"]["trajectory"] for one in (content, arm.task("paper_planar", 0.5)[0]))
    for key in ("displacement", "rotation"):
        np.testing.assert_allclose(half[key], 0.5 * np.array(whole[key]), atol=ROUNDING)
        acceleration = [np.array(one[key]) / one["duration_s"] ** 2 for one in (whole, half)]
        np.testing.assert_allclose(*acceleration, rtol=1e-6)


TWO = URDF.replace("</robot>", "") + "".join(
    f'<link name="other_{i}"/><joint name="other_joint_{i}" type="revolute"><parent link="'
    + ("world" if i == 1 else f"other_{i - 1}") + f'"/><child link="other_{i}"/></joint>' for i in range(1, 7)
) + "</robot>"  # fmt: skip
BAD = {
    "no file": (["nowhere.urdf"], "", ["nowhere.urdf"]),
    "unknown link": (["odd.urdf", "--ee", "tol0"], URDF, ["unknown link 'tol0'", "tool0"]),
    "too few joints": (
        ["odd.urdf", *(f"--lock=joint_{i}=0" for i in (1, 2, 3, 4))], URDF, ["2 moving joints", "at least 3"]
    ),
    "two arms": (["odd.urdf"], TWO, ["2 arms", "other_6"]),
    "no joint": (["odd.urdf"], '<robot name="x"><link name="a"/></robot>', ["no moving joint"]),
    "one axis for two": (["odd.urdf", "--approach", "z", "--normal", "-z"], URDF, ["--normal"]),
    "an axis that cannot be told": (
        ["odd.urdf"], with_joint(URDF, "gripper", "1.5707963267948966", "0.8"), ["--approach", "axis"]
    ),
    "a lock without value": (["odd.urdf", "--lock", "joint_1"], URDF, ["--lock", "JOINT=VALUE"]),
    "a lock of nothing": (["odd.urdf", "--lock", "elbow=1"], URDF, ["unknown joint 'elbow'"]),
    "a missing limit": (
        ["odd.urdf"], with_joint(URDF, "joint_2", "<limit[^>]*>", ""), ["joint_2", "velocity limit 0", "--limit"]
    ),
    "no effort": (["odd.urdf"], URDF.replace('effort="150"', 'effort="0"', 1), ["joint_1", "limit 0", "--limit"]),
    "a placeholder for an effort": (["odd.urdf"], URDF.replace('effort="150"', 'effort="1"'), ["limit 1", "--drive"]),
    "no velocity": (
        ["odd.urdf", "--drive", "velocity_500"], URDF.replace('velocity="3"', 'velocity="-1"'), ["velocity limit -1"]
    ),
    "a limit below 0": (["odd.urdf", "--limit", "*=-1,3"], URDF, ["--limit", "JOINT=EFFORT,VELOCITY"]),
    "a limit of nothing": (["odd.urdf", "--limit", "elbow=1,3"], URDF, ["unknown joint 'elbow'"]),
    "an argument without value": (["odd.urdf", "--arg", "size"], URDF, ["--arg", "NAME:=VALUE"]),
    "an argument of a URDF": (["odd.urdf", "--arg", "size:=3"], URDF, ["arguments size", ".xacro"]),
    "a file that is cut": (["odd.urdf"], URDF[:999], ["error: URDF odd.urdf: got", "a URDF; "]),
    "a lock in millimetres": (
        ["odd.urdf", "--lock", "left_finger_joint=20"], URDF, ["--lock left_finger_joint", "within its limits"]
    ),
    "a reach in millimetres": (["odd.urdf", "--reach", "120"], URDF, ["--reach", "metres"]),
    "a reach that is no number": (["odd.urdf", "--reach", "nan"], URDF, ["--reach", "metres"]),
    "an unknown scenario": (["odd.urdf", "--scenario", "paper"], URDF, ["paper_planar"]),
    "a path out of reach": (["odd.urdf", "--scale", "3"], URDF, ["paper_planar", "a smaller --scale"]),
    "too weak": (["odd.urdf"], URDF.replace('effort="150"', 'effort="12"'), ["effort limit"]),
}  # fmt: skip


def test_what_cannot_be_used_is_said_in_one_line(
    file: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(posture, "SAMPLES", 40)
    for case, (arguments, text, words) in BAD.items():
        file.write_text(text)
        monkeypatch.setattr("sys.argv", ["slip-vic", "arm", *arguments])
        capsys.readouterr()
        assert main() == 2, case
        errors = [line for line in capsys.readouterr().err.splitlines() if line]
        assert len(errors) == 1, (case, errors)
        assert all(word in errors[0] for word in words), (case, errors)
        assert [path.name for path in file.parent.iterdir()] == ["odd.urdf"], case


def test_the_file_for_the_real_arm_is_safe_to_start(tmp_path: Path) -> None:
    """It holds, stays in HOLD, is governed with friction that it learns, and every line says what it is."""
    arm, content, _ = planar()
    *_, file = write_arm(arm, {"paper_planar": content}, tmp_path, Path("odd.urdf"))
    assert file.name == "paper_planar_controller_realtime.yaml"
    params = build(ControllerParams, read_parameters(file), "the file")
    assert (params.mode, params.trajectory.kind, params.safety.auto_enable) == ("realtime", "hold", False)
    assert (params.governor.mode, params.governor.friction, params.gains.spin) == ("slow_down", "unknown", "bounded")
    pairs = list(itertools.pairwise(file.read_text().splitlines()))
    values = [(above, line) for above, line in pairs if line.startswith("    ") and "#" not in line]
    assert all(above.startswith("    # ") and len(above) > 12 for above, _ in values)
    names = {line.split(":")[0].strip() for _, line in values}
    assert {"control_period_s", "effort.gravity", "trajectory.kind", "safety.auto_enable", "joint_names"} <= names
    assert params.command.interface == "effort"
    *_, file = write_arm(arm, {"paper_planar": content}, tmp_path, Path("odd.urdf"), "velocity_500")
    params = build(ControllerParams, read_parameters(file), "the file")
    assert (params.command.interface, params.drive.delay_s, params.trajectory.kind) == ("velocity", 0.004, "hold")
    assert params.control_period_s == pytest.approx(0.002)


def test_a_file_that_was_edited_stays(tmp_path: Path) -> None:
    arm, content, _ = planar()
    for _ in range(2):
        write_arm(arm, {"paper_planar": content}, tmp_path, Path("odd.urdf"), "velocity_500", "vision_60")
    file = tmp_path / "paper_planar_controller_realtime.yaml"
    assert build(ControllerParams, read_parameters(file), "the file").slip_sensor.rate_hz == 60.0
    file.write_text(edited := file.read_text().replace("auto_enable: false", "auto_enable: true"))
    with pytest.raises(InputError, match=r"realtime\.yaml: got a file that was edited"):
        write_arm(arm, {"paper_planar": content}, tmp_path, Path("odd.urdf"))
    assert file.read_text() == edited


@pytest.mark.parametrize("name", sorted(DRIVERS))
def test_a_driver_gets_its_controllers_and_remaps(name: str, tmp_path: Path) -> None:
    """The joints in their order, each remap from a topic of ours, and parameters that our controller starts with."""
    arm, content, _ = planar()
    driver = DRIVERS[name]
    if "wrench.frame" in driver.settings:
        assert driver.settings["wrench.frame"] in named(parse_urdf(arm.urdf), "link")
    write_arm(arm, {"paper_planar": content}, tmp_path, Path("odd.urdf"), driver.drive, "", driver)
    known = yaml.safe_load((tmp_path / "controllers.yaml").read_text())
    params = build(ControllerParams, read_parameters(tmp_path / "paper_planar_controller_realtime.yaml"), "file")
    kind = params.command.interface
    forward = known[f"forward_{kind}_controller"]["ros__parameters"]
    of = "forward_command_controller/ForwardCommandController"
    assert forward == {"type": of, "joints": list(JOINTS), "interface_name": kind}
    manager = known["controller_manager"]["ros__parameters"]
    assert manager["update_rate"] * params.control_period_s == pytest.approx(1.0)
    launch = ElementTree.parse(tmp_path / "paper_planar.launch.xml").getroot()
    *spawners, node = launch.findall("node")
    assert [(one.get("name"), one.get("default")) for one in launch.findall("arg")] == [("ros_args", "")]
    assert node.get("ros_args") == "$(var ros_args)"
    for spawner in spawners:
        one = spawner.get("args", "").partition(" --param-file")[0]
        assert known[one]["ros__parameters"]["type"] == manager[one]["type"]
    remaps = {str(one.get("from")): one.get("to") for one in node.findall("remap")}
    assert set(remaps) <= set(TOPICS)
    assert remaps[f"{kind}_controller/commands"] == f"/forward_{kind}_controller/commands"
    assert (params.effort.gravity, params.wrench.sign) == (
        ("robot_compensates", -1) if name == "franka" else ("include", 1)
    )
    assert params.publish_effort_array or kind != "effort"
    Controller({"": params.model_copy(update={"robot_description": arm.urdf})}, {"": arm.urdf}, lockstep=False)


def test_continuous_joints_without_limits_get_those_that_are_given() -> None:
    bare = re.sub(r"<limit[^>]*/>", "", URDF.replace('type="revolute"', 'type="continuous"'))
    with pytest.raises(InputError, match=r"velocity limit 0, which means unknown.*--limit"):
        Arm(bare)
    Arm(bare, limits={"*": {"effort": 28.0, "velocity": 3.1}})


def test_a_pad_inside_the_flange_is_said() -> None:
    assert any("the object sits in the flange" in line for line in Arm(URDF).said)
    assert not any("flange" in line for line in Arm(URDF, reach=0.12).said)
