"""The node in C++: runs that `bag verify` takes, the bits of Python in trials, services, end."""

# ruff: noqa: F811 - fixtures are found by name

from __future__ import annotations

import ctypes
import math
import os
import shutil
import signal
import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters, SetParameters
from rclpy.parameter import Parameter, parameter_value_to_python

from slip_bags.reader import Bag
from slip_core.errors import InputError
from slip_core.params import build, flatten, parameter_infos
from slip_msgs_py.environment import choose_transport
from slip_msgs_py.ros_params import descriptor
from slip_vic.replay.run_data import read_run
from slip_vic.replay.verify import verify_run
from slip_vic.run.commands import native_command
from slip_vic.run.in_process import ClosedLoop, run_in_process
from slip_vic.run.launcher import Launcher
from slip_vic.scenarios.scenario import load
from slip_vic_controller.params.controller_params import ControllerParams
from slip_vic_controller.safety.conditions import Reason, Why
from slip_vic_controller.session.words import describe
from test.campaigns.attacks.suite import run_attacks, with_numbers
from test.campaigns.faults.beside import BesideNative, compile_more
from test.campaigns.faults.campaign import judge
from test.support.one_arm import OneArm, one_arm
from test.support.ros import Processes, node_in
from test.system.native.conftest import SHORT, call
from test.system.nodes.test_modes import (  # noqa: F401
    BRIDGE_ENDLESS,
    CONTROLLER_SLOW,
    Start,
    Watcher,
    follow_transitions,
    start,
    watcher,
)

pytestmark = [
    pytest.mark.skipif(shutil.which("cmake") is None, reason="no cmake"),
    pytest.mark.timeout(600),  # the first one compiles the node, for minutes on a slow machine
]
HERE = Path(__file__).parent
REACHED_M = 2e-4  # the impedance has 4 time constants to settle on a 2 mm step


# -- words -------------------------------------------------------------------------------------------


def test_words_are_those_of_python(library: Path) -> None:
    sources = HERE / "words_main.cpp", "node/words.cpp"
    call("c++", "-std=c++17", "-I.", "-Inode", *sources, "-o", "words", cwd=library)
    whys = [
        Why(reason, fault, over, which, 0.123456, 1e6)
        for reason in Reason
        for fault in (0, Reason.SILENT.value)
        for over in (0, 1)
        for which in (-1, 0, 1, 5, 12)
    ]
    data = b"".join(np.array(why[:4], np.int64).tobytes() + np.array(why[4:]).tobytes() for why in whys)
    done = subprocess.run([library / "words"], input=data, capture_output=True, check=True)
    assert done.stdout.decode().splitlines() == [describe(why, ("one", "two")) for why in whys]


# -- runs over DDS -----------------------------------------------------------------------------------

RUNS = {
    "noise and a slow sensor of displacements": (
        "vic", ("slip_input=displacement", "bridge.sensors.slip.noise_linear=1e-3", "bridge.sensors.slip.rate_hz=120.0",
                "bridge.sensors.wrench.noise_force=0.05", "controller.publish_effort_array=true",
                "drive.armature=[0.05]"),
    ),
    "planned, after a tare that measures noise": (
        "governed", ("controller.tare.duration_s=0.1", "controller.slip_estimator=observer",
                     "bridge.sensors.slip.noise_linear=1e-4", "bridge.sensors.joint.noise_velocity=0.01",
                     "bridge.sensors.wrench.noise_force=0.05"),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", RUNS)
def test_lockstep_run_is_that_of_python_and_verifies(built: Path, tmp_path: Path, name: str) -> None:
    law, assignments = RUNS[name]
    scenario = load("paper_planar", law=law, seed=3, set=(SHORT, *assignments))
    folder = with_numbers(built, scenario, tmp_path / "export")
    result = Launcher(scenario, bag=tmp_path / "bag", native=folder).run()
    assert result.lost == 0
    bag = Bag(tmp_path / "bag")
    runs = read_run(bag)
    found = verify_run(runs)
    assert found.identical, found.text()
    loop = ClosedLoop(scenario)
    expected = [tick.commands[0].numbers.tobytes() for tick in run_in_process(scenario, loop)]
    assert (loop.session.config is loop.session.controller.config) == ("tare" not in name)
    assert [one.tobytes() for one in runs[""].commands] == expected[: found.cycles]
    assert len(expected) - found.cycles in (0, 1)


TAKEN = {
    "gains.stiffness": [20.0, 20.0, 400.0, 450.0, 450.0, 4.5], "gains.k_s": 300.0, "object.mass": 0.55,
    "contacts.position": [0.021, 0.001, 0.0], "safety.hold_stiffness": 200.0,
}  # fmt: skip
REFUSED = (
    ("gains.stiffness", [1e9] * 6), ("gains.stiffness", [5.0] * 5), ("gains.stiffness", [9e4] * 6),
    ("gains.damping", [0.5] * 6), ("gains.damping", [*[5.0] * 5, math.nan]), ("gains.inertia", [0.0] * 6),
    ("gains.k_s", 0.5), ("object.inertia", [1.0, 1.0, 5.0, 0.0, 0.0, 0.0]), ("contacts.position", [2.0, 0.0, 0.0]),
    ("contacts.position", [0.0] * 6), ("nullspace.stiffness", 3.0),
)  # fmt: skip
OF_ROS = {
    "Trying to set a read-only parameter: mode.": ("mode", "lockstep"),
    "Wrong parameter type, expected 'Type.DOUBLE' got 'Type.INTEGER'": ("gains.k_s", 300),
    "Parameter gains.k_s out of range Min: 1e-06, Max: 1000000.0, value: 2000000.0": ("gains.k_s", 2e6),
    "Invalid access to undeclared parameter(s): ['no.such']": ("no.such", 1.0),
}


def refusal(params: ControllerParams, urdf: str, name: str, value: object) -> str:
    """Return why Python refuses a change."""
    with pytest.raises(InputError) as refused:
        OneArm(one_arm(params, urdf, lockstep=False)).retune(
            build(ControllerParams, flatten(params) | {name: value}, "slip_vic_controller")
        )
    return str(refused.value)


def test_parameters_change_in_a_real_time_run_which_verifies(built: Path, tmp_path: Path) -> None:
    scenario = load("paper_planar", law="vic", mode="realtime", set=("bridge.duration_s=6.0",))
    folder = with_numbers(built, scenario, tmp_path / "export")
    launcher = Launcher(scenario, bag=tmp_path / "bag", native=folder)
    choose_transport()
    given = [Parameter(name, value=value) for name, value in (*TAKEN.items(), *REFUSED, *OF_ROS.values())]

    def talk(domain: int) -> tuple[Any, ...]:
        with node_in(domain) as node:
            watcher = Watcher(node)
            watcher.wait_law()

            def call(kind: Any, name: str, **fields: Any) -> Any:
                return watcher.call(kind, f"/slip_vic_controller/{name}", kind.Request(**fields))

            results = call(
                SetParameters, "set_parameters", parameters=[one.to_parameter_msg() for one in given]
            ).results
            names = call(ListParameters, "list_parameters").result.names
            values = call(GetParameters, "get_parameters", names=names).values
            return results, names, values, call(DescribeParameters, "describe_parameters", names=names).descriptors

    with ThreadPoolExecutor() as pool:
        talks: list[Any] = []
        launcher.run(on_domain=lambda domain: talks.append(pool.submit(talk, domain)))
    results, names, values, described = talks[0].result()
    tuned = build(ControllerParams, flatten(scenario.controller) | TAKEN, "test")
    reasons = [result.reason for result in results]
    assert [result.successful for result in results] == [not reason for reason in reasons]
    assert reasons == [""] * len(TAKEN) + [refusal(tuned, scenario.urdf, *one) for one in REFUSED] + [*OF_ROS]
    assert names == [info.name for info in parameter_infos(ControllerParams)]
    shown = {name: parameter_value_to_python(value) for name, value in zip(names, values, strict=True)}
    assert shown == flatten(tuned)
    for info, of_ros in zip(parameter_infos(ControllerParams), described, strict=True):
        of_ros.type = 0  # which rclpy adds
        assert of_ros == descriptor(info)
    runs = read_run(Bag(tmp_path / "bag"))
    found = verify_run(runs)
    assert found.identical, found.text()
    assert found.cycles > 100
    assert [change.gains.k_s for changes in runs[""].changes.values() for change in changes][-1] == 300.0


# -- services, end -----------------------------------------------------------------------------------


def started(processes: Processes, built: Path, folder: Path, *assignments: str) -> Any:
    """Return the node, in real time."""
    scenario = load("paper_planar", law="vic", mode="realtime", set=(SHORT, *CONTROLLER_SLOW, *assignments))
    return processes.start("native", [built / "build" / "slip_vic_node", with_numbers(built, scenario, folder)])


def test_transitions_lead_to_its_end(
    watcher: Watcher, start: Start, processes: Processes, built: Path, tmp_path: Path
) -> None:
    native = started(processes, built, tmp_path / "export", "controller.auto_activate=false")
    follow_transitions(watcher, start, native)


def test_services_and_silence_change_the_mode(
    watcher: Watcher, start: Start, processes: Processes, built: Path, tmp_path: Path
) -> None:
    native = started(processes, built, tmp_path / "export")
    bridge = start("bridge", *BRIDGE_ENDLESS)
    watcher.wait_law()
    assert watcher.trigger("tare").message == "the law is active: call ~/hold first"
    assert watcher.trigger("hold").success
    watcher.wait_mode("HOLD", "hold requested", "call ~/enable")
    assert watcher.trigger("tare").message.startswith("tare.duration_s is 0")
    assert watcher.trigger("reset_fault").success
    assert watcher.trigger("enable").success
    watcher.wait_mode("ACTIVE")
    processes.kill(bridge)
    watcher.wait_mode("HOLD", "joint state is silent")
    assert processes.stop(native, signal.SIGTERM) == 0
    watcher.spin(lambda: len(watcher.commands[-1].effort) == 0, "the end of commands")


@pytest.mark.parametrize(("kind", "topic"), [("topic", "reference"), ("goal", "goal")])
def test_reference_and_goal_are_followed(
    watcher: Watcher, start: Start, processes: Processes, built: Path, tmp_path: Path, kind: str, topic: str
) -> None:
    from geometry_msgs.msg import PoseStamped, Transform, Vector3
    from std_msgs.msg import String
    from trajectory_msgs.msg import MultiDOFJointTrajectory, MultiDOFJointTrajectoryPoint

    native = started(processes, built, tmp_path / "export", f"controller.trajectory.kind={kind}")
    poses: list[Any] = []
    said: list[str] = []
    watcher.node.create_subscription(PoseStamped, "controller/ee_pose", poses.append, 10)
    watcher.node.create_subscription(String, "controller/goal", lambda m: said.append(m.data), 10)
    publisher = watcher.node.create_publisher(MultiDOFJointTrajectory, topic, 10)
    start("bridge", *BRIDGE_ENDLESS)
    watcher.spin(lambda: poses and publisher.get_subscription_count(), "the first pose")
    here = poses[0].pose
    pose = Transform(translation=Vector3(x=here.position.x + 0.002, y=here.position.y, z=here.position.z))
    pose.rotation = here.orientation
    message = MultiDOFJointTrajectory(points=[MultiDOFJointTrajectoryPoint(transforms=[pose])])
    message.points[0].time_from_start.sec = 1

    def arrived() -> bool:
        if kind == "topic" or not any("moves" in line for line in said):
            publisher.publish(message)
        return abs(poses[-1].pose.position.x - pose.translation.x) < REACHED_M

    watcher.spin(arrived, "the pad at the reference")
    if kind == "goal":
        watcher.spin(lambda: any("reached" in line for line in said), "the goal")
    publisher.publish(MultiDOFJointTrajectory())
    watcher.spin(lambda: any(f"{topic}: message refused" in line for line in native.lines), "the refusal")
    assert processes.stop(native, signal.SIGTERM) == 0


@pytest.mark.parametrize(
    ("arguments", "line"),
    {
        "no folder": ((), "error: slip_vic_node: got no folder, expected one of `slip-vic export`"),
        "no export": (("/",), "error: //controller.bin: got no such file"),
        "two folders": (("{folder}", "b"), "error: slip_vic_node: got more arguments than a folder"),
        "other parameter": (("{folder}", "--ros-args", "-p", "mass:=1.0"), "error: parameter mass: got a value"),
        "no number": (
            ("{folder}", "--ros-args", "-p", "expected_subscribers:=0"), "error: parameter expected_subscribers: got",
        ),
        "no ROS argument": (("{folder}", "--ros-args", "--nonsense"), "error: --ros-args: got an unknown argument"),
        "cut state": (("{cut}",), "/state.bin: got 8 bytes, expected the state of one arm"),
        "several arms": (("{two}",), "got 2 arms, expected one"),
    }.values(),
)  # fmt: skip
def test_bad_input_is_one_line(built: Path, tmp_path: Path, arguments: tuple[str, ...], line: str) -> None:
    both = (built / "controller.bin").read_bytes() * 2
    for folder, name, data in (("cut", "state.bin", bytes(8)), ("two", "controller.bin", both)):
        shutil.copytree(built, tmp_path / folder, ignore=shutil.ignore_patterns("build", "node", "*.a", "run.bin"))
        (tmp_path / folder / name).write_bytes(data)
    words = [of.format(folder=built, cut=tmp_path / "cut", two=tmp_path / "two") for of in arguments]
    done = subprocess.run(
        [built / "build" / "slip_vic_node", *words], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert line in done.stderr


def test_export_of_other_parameters_is_refused(built: Path) -> None:
    scenario = load("paper_planar", law="vic", set=("controller.gains.alpha=7.0",))
    with pytest.raises(InputError, match="other parameters, expected those of the controller in this run"):
        native_command(built, scenario.controller)
    with pytest.raises(InputError, match="no such file, expected the node of an export"):
        native_command(built / "node", scenario.controller)


def test_node_needs_no_python(built: Path) -> None:
    environment = {name: value for name, value in os.environ.items() if name != "LD_LIBRARY_PATH"}
    done = subprocess.run(
        ["ldd", built / "build" / "slip_vic_node"], capture_output=True, text=True, env=environment, check=True
    )
    assert "libpython" not in done.stdout
    assert "not found" not in done.stdout


# -- the fault campaign: the session beside Python's, and attacks on the process ----------------------


def test_both_sessions_give_the_same_bits_in_trials(built: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    compile_more(built)
    for trial in (*range(14), 43):  # 43 changes gains
        verdict = judge(7, trial, native=built)
        assert verdict.violations == ()
        assert verdict.commands > 100
    host = ctypes.CDLL(str(built / "build" / "beside.so"))
    assert 0 < host.slip_vic_room_used() < 13107  # a fifth of the room for temporary arrays
    monkeypatch.delattr(BesideNative, "add_wrench")  # Python alone gets them
    (violation,) = judge(7, 0, native=built).violations
    assert "state differs" in violation


def test_promise_is_kept_under_attack(built: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("ROS_DOMAIN_ID", raising=False)
    rows = run_attacks(["messages that are none", "transitions and parameters at once"], tmp_path, print, built)
    assert [row.violations for row in rows] == [(), ()]
    assert all(row.kept for row in rows)
