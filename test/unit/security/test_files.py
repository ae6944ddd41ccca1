"""Files made by somebody who means harm: refused in one line, with little memory, and nothing else is touched."""

from __future__ import annotations

import itertools
import os
import re
import resource
import socket
import zlib
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import lz4.frame
import pytest
import yaml
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.records import Chunk, Schema

from slip_bags.format import parse_custom_data, parse_qos
from slip_bags.reader import Bag, chunk_records
from slip_core import compiled
from slip_core.compiled import check_private
from slip_core.errors import InputError, ProtocolError
from slip_core.files.plain_yaml import DEEPEST, parse_json, read_yaml
from slip_core.files.urdf import DEEPEST as DEEPEST_URDF
from slip_core.files.urdf import base_of, on_base, parse_urdf
from slip_core.files.urdf_file import read_urdf
from slip_core.grasp_params import BaseParams, ObjectParams
from slip_core.params import build, load_yaml, parse_assignment
from slip_sim_bridge.plant.model import arm_spec
from slip_vic.experiments.rows import read_json, read_rows
from slip_vic.presets import preset_text
from slip_vic.retime.path import read_points
from slip_vic.run.commands import native_command
from slip_vic.run.domain import PORT, PORTS, domain_id, domains_in_use
from slip_vic.run.lock import is_locked, locked
from slip_vic.scenarios.parameter_files import config_files, write_files
from slip_vic.scenarios.scenario import load
from slip_vic.setup.arm.write import Arm
from slip_vic_controller.robot import Robot

SRC = Path(__file__).parents[3] / "src"
ROOM = 32 << 20  # bytes of address space beyond what is there: a bomb needs more
LAUGHS = "\n".join(["a0: &a0 [x, x]", *(f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 10)}]" for k in range(1, 12))])


@contextmanager
def little_memory() -> Iterator[None]:
    """Let nothing in the block take much memory."""
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    before = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (used + ROOM, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, before)


# -- YAML -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("[" * 200_000, "nested"),
        ("{a: " * 200_000, "nested"),
        ("- " * 200_000, "nested"),
        (LAUGHS, "alias a0"),
        ("&a [*a]", "alias a"),
        ("- 1\n" * 600_000, "more than 2097152 characters"),
        ("!!python/object/apply:os.system [true]", "python/object"),
        ("!!bool 3", "tag"),
        ("a: 1\nb: {c: 1, d: 2, c: 3}", "the key c twice(.|\n)*line 2"),
    ],
)
def test_yaml_that_is_more_than_it_looks_is_refused(text: str, what: str, tmp_path: Path) -> None:
    with little_memory(), pytest.raises(yaml.YAMLError, match=what):
        read_yaml(text)
    with little_memory():
        assert parse_custom_data(text) == {}
        assert parse_qos(text) == ()
    with pytest.raises(InputError):
        parse_assignment(f"controller.gains.k_s={text}")
    path = tmp_path / "bomb.yaml"
    path.write_text(text)
    for read in (load_yaml, lambda path: load(str(path), law="vic")):
        with little_memory(), pytest.raises(InputError, match=r"bomb\.yaml") as found:
            read(path)
        assert "\n" not in str(found.value)


@pytest.mark.parametrize(
    ("call", "file"), [(r"yaml\.(safe_|full_|unsafe_)?load\w*\(", "plain_yaml.py"), (r"click\.s?echo", "cli.py")]
)
def test_there_is_one_place_that_reads_yaml_and_one_that_prints(call: str, file: str) -> None:
    found = [path.name for path in SRC.rglob("*.py") for _ in re.finditer(call, path.read_text(encoding="utf-8"))]
    assert found == [file]


def test_ordinary_yaml_is_read(tmp_path: Path) -> None:
    nested: object = 1
    for _ in range(DEEPEST):
        nested = [nested]
    text = "a: [1, 2]\nb: {c: d}\ne: &e [1, 2]\n"
    assert read_yaml(text) == yaml.safe_load(text)
    assert read_yaml("[" * DEEPEST + "]" * DEEPEST) is not None
    assert read_yaml("") is None
    with pytest.raises(yaml.YAMLError, match="nested"):
        read_yaml(yaml.safe_dump(nested, default_flow_style=True).replace("1", "[1]"))


@pytest.mark.parametrize("text", ["yes", "off", "1:30", "0o17", "2026-11-29", "true", "[true, 0.0]", "9" * 4301])
def test_what_is_no_number_is_refused_as_a_mass_with_its_line(text: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="mass"):
        build(ObjectParams, dict([parse_assignment(f"mass={text}")]), "here")
    (tmp_path / "a.yaml").write_text(f"# a comment\ninertia: [1, 1, 1, 0, 0, 0]\nmass: {text}\n")
    with pytest.raises(InputError, match="a.yaml: par" if "true" in text else "a.yaml, line 3: parameter mass: got "):
        build(ObjectParams, load_yaml(tmp_path / "a.yaml"), "file a.yaml")


@pytest.mark.parametrize("dumper", [yaml.SafeDumper, getattr(yaml, "CSafeDumper", yaml.SafeDumper)])
def test_text_that_knows_its_line_is_written_as_text(dumper: type) -> None:
    read = read_yaml("file: 7dof.urdf\nname: on\n")
    assert yaml.load(yaml.dump(read, Dumper=dumper), Loader=yaml.SafeLoader) == {"file": "7dof.urdf", "name": "on"}


def test_plain_scalars_are_what_both_versions_of_yaml_agree_on() -> None:
    read = read_yaml("[1, -1.5e+3, 0x1f, .5, .inf, true, ~, yes, 1:30, 010, 1_0, 2026-11-29]")
    assert read == [1, -1500.0, 31, 0.5, float("inf"), True, None, "yes", "1:30", "010", "1_0", "2026-11-29"]


# -- any file ---------------------------------------------------------------------------------------------------------

XACRO = '<robot name="a" xmlns:xacro="http://www.ros.org/wiki/xacro">{}</robot>'
INCLUDES = XACRO.format('<xacro:include filename="part.xacro"/>')

READERS: dict[str, Callable[[Path], object]] = {
    "parameters.yaml": load_yaml,
    "scenario.yaml": lambda path: load(str(path), law="vic"),
    "sensor.yaml": lambda path: load("paper_planar", law="vic", sensor=str(path)),
    "arm.urdf": lambda path: read_urdf(str(path), "URDF"),
    "arm.urdf.xacro": lambda path: read_urdf(str(path), "URDF"),
    "part.xacro": lambda path: read_urdf(str(path.with_name("a.xacro")), ""),
    "controller.yaml": lambda path: native_command(path.parent, load("paper_planar").controller),
    "path.csv": lambda path: read_points(path, ()),
    "run.mcap": Bag,
    "rows.csv": read_rows,
    "rows.json": read_json,
}


@pytest.mark.parametrize("name", READERS)
def test_a_pipe_a_device_and_a_text_without_end_are_no_input_file(tmp_path: Path, name: str) -> None:
    (tmp_path / "a.xacro").write_text(INCLUDES)
    (tmp_path / "build").mkdir()
    (tmp_path / "build" / "slip_vic_node").touch()
    path = tmp_path / name
    os.mkfifo(path)
    with pytest.raises(InputError, match="regular file"):
        READERS[name](path)
    path.unlink()
    path.symlink_to("/dev/zero")
    with pytest.raises(InputError, match="regular file"):
        READERS[name](path)
    path.unlink()
    with path.open("wb") as file:
        file.truncate(1 << 40)
    if path.suffix not in (".mcap", ".xacro") and name != "rows.csv":
        with pytest.raises(InputError, match=r"bytes|rows of an experiment"):
            READERS[name](path)


def test_json_that_is_nested_deeply_or_has_endless_numbers_is_no_json() -> None:
    for text in ("[" * 100_000, "9" * 4301):
        with pytest.raises(ValueError, match=r"JSON|digits"):
            parse_json(text)


def test_parameter_files_of_a_scenario_stay_in_their_folder(tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text(preset_text("scenarios", "paper_planar"))
    for name in (tmp_path / "mine.yaml", Path(os.path.relpath(tmp_path / "mine.yaml"))):
        write_files(tmp_path / "out", config_files([str(name)]))
        assert {path.parent for path in tmp_path.rglob("*.yaml")} == {tmp_path, tmp_path / "out" / "mine"}
    (tmp_path / "...yaml").write_text(preset_text("scenarios", "paper_planar"))
    for names in (["paper_planar", "paper_planar"], [str(tmp_path / "...yaml")]):
        with pytest.raises(InputError, match="another name for each scenario"):
            config_files(names)


# -- URDF -------------------------------------------------------------------------------------------------------------

ENTITIES = (
    '<!DOCTYPE robot [<!ENTITY a "x">' + "".join(f'<!ENTITY b{k} "&a;&a;">' for k in range(3)) + "]><robot>&a;</robot>"
)


def row_of_links(count: int, joints: str = "") -> str:
    """A URDF with `count` fixed joints in a row."""
    links = "".join(f'<link name="l{k}"/>' for k in range(count + 1))
    fixed = (
        f'<joint name="j{k}" type="fixed"><parent link="l{k}"/><child link="l{k + 1}"/></joint>' for k in range(count)
    )
    return f'<robot name="row">{links}{"".join(fixed)}{joints}</robot>'


SECOND = '<joint name="again" type="fixed"><parent link="l0"/><child link="l2"/></joint>'
RING = '<joint name="back" type="fixed"><parent link="l3"/><child link="l0"/></joint>'


@pytest.mark.parametrize(
    ("text", "what"),
    [
        (row_of_links(5000), "joints in a row"),
        (row_of_links(3, SECOND), "one tree"),
        (row_of_links(3, RING), "one tree"),
        (ENTITIES, "document type"),
        ('<!doctype robot SYSTEM "file:///etc/passwd"><robot/>', "document type"),
        ('<mujoco><include file="/etc/passwd"/></mujoco>', "<mujoco>"),
        ("<robot", "a URDF"),
        ("", "a URDF"),
        ("<robot>" + " " * (5 << 20) + "</robot>", "characters"),
    ],
)
def test_what_is_no_plain_urdf_reaches_no_parser_of_a_physics_library(text: str, what: str) -> None:
    scenario = load("paper_planar", law="vic")
    for read in (
        parse_urdf,
        lambda text: on_base(text, BaseParams(position=(1.0, 0.0, 0.0))),
        Arm,
        lambda text: Robot(text, "ee", scenario.controller.joint_names),
        lambda text: arm_spec(scenario.bridge, text),
    ):
        with pytest.raises(InputError, match=what) as found:
            read(text)
        assert len(str(found.value)) < 1000


def test_the_deepest_tree_is_read_by_the_libraries() -> None:
    """An arm behind as many fixed joints in a row as are accepted."""
    scenario = load("paper_planar", law="vic")
    base = base_of(parse_urdf(scenario.urdf))
    room = DEEPEST_URDF - len(parse_urdf(scenario.urdf).findall("joint"))
    front = row_of_links(room).removeprefix('<robot name="row">').removesuffix("</robot>")
    front += f'<joint name="to_arm" type="fixed"><parent link="l{room}"/><child link="{base}"/></joint>'
    text = scenario.urdf.replace("</robot>", front + "</robot>")
    robot = Robot(text, scenario.controller.ee_frame, scenario.controller.joint_names)
    assert robot.joint_names == scenario.controller.joint_names
    assert arm_spec(scenario.bridge, text) is not None


# -- bags -------------------------------------------------------------------------------------------------------------


def chunk(compression: str, data: bytes, size: int) -> Chunk:
    return Chunk(compression, data, 0, 0, 0, size)


def bombs() -> dict[str, bytes]:
    """64 MiB of zeros, without saying so."""
    zeros = bytes(1 << 26)
    packer = zstandard.ZstdCompressor(write_content_size=False).compressobj()
    return {"zstd": packer.compress(zeros) + packer.flush(), "lz4": lz4.frame.compress(zeros, store_size=False)}


def test_a_chunk_gives_no_more_than_it_says() -> None:
    for compression, packed in bombs().items():
        with little_memory():
            with pytest.raises(ValueError, match="holds more"):
                list(chunk_records(chunk(compression, packed, 1000)))
            with pytest.raises(ValueError, match="chunk of"):
                list(chunk_records(chunk(compression, packed, 1 << 40)))


def test_a_chunk_is_what_was_compressed() -> None:
    schema = RecordBuilder()
    Schema(1, os.urandom(5000) + bytes(100_000), "ros2msg", "a/msg/B").write(schema)
    data = schema.end()
    for compression, packed in (("zstd", zstandard.compress(data)), ("lz4", lz4.frame.compress(data)), ("", data)):
        good = Chunk(compression, packed, 0, 0, zlib.crc32(data), len(data))
        again = RecordBuilder()
        for record in chunk_records(good):
            record.write(again)
        assert again.end() == data
        good.uncompressed_crc += 1
        with pytest.raises(InputError, match="crc"):
            list(chunk_records(good))
        with pytest.raises(ValueError, match="holds"):
            list(chunk_records(chunk(compression, packed, len(data) + 1)))


# -- folders ----------------------------------------------------------------------------------------------------------


def test_machine_code_comes_from_a_folder_that_no_other_user_can_write_to(tmp_path: Path) -> None:
    folder, me = tmp_path / "compiled", os.geteuid()
    folder.mkdir(mode=0o700)
    check_private(folder, me)
    with pytest.raises(InputError, match="this user alone"):
        check_private(folder, me + 1)
    folder.chmod(0o755)  # as after chmod -R a+rX
    check_private(folder, me)
    for mode in (0o770, 0o707):
        folder.chmod(mode)
        with pytest.raises(InputError, match="remove it"):
            check_private(folder, me)
    folder.chmod(0o700)
    link = tmp_path / "link"
    link.symlink_to(folder)
    with pytest.raises(InputError, match="remove it"):
        check_private(link, me)


def test_the_compiler_looks_at_the_folder_before_it_loads(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    package = tmp_path / "made_up"
    package.mkdir()
    (package / "__init__.py").touch()
    folder = compiled.code_folder.__wrapped__(package)
    assert folder.stat().st_mode & 0o777 == 0o700
    folder.chmod(0o777)
    with pytest.raises(InputError, match="machine code"):
        compiled.code_folder.__wrapped__(package)


def test_a_cache_that_cannot_be_written_is_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    (tmp_path / "locks" / "slip_vic" / "domains" / "5.").mkdir(parents=True)
    (tmp_path / "__init__.py").touch()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    with pytest.raises(InputError, match=r"Not a directory, .*set XDG_CACHE_HOME"), domain_id():
        pass
    with pytest.raises(InputError, match=r"Not a directory, .*set XDG_CACHE_HOME"):
        compiled.code_folder.__wrapped__(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "locks"))
    with pytest.raises(ProtocolError, match="Is a directory; set XDG_CACHE_HOME"), domain_id(5):
        pass


def test_a_domain_is_for_one_run_in_each_namespace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Domain 6 is skipped for the lock, 7 for a port of another program."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr("slip_vic.run.domain._turns", itertools.repeat(5))
    with domain_id(6) as wanted, socket.socket(type=socket.SOCK_DGRAM) as other, domain_id(6, "/left") as shared:
        other.bind(("127.0.0.1", PORT + 7 * PORTS + 11))
        with domain_id() as free:
            assert (wanted, shared, free) == (6, 6, 8)
            assert set(domains_in_use()) == {6, 8}
        again = pytest.raises(InputError, match=f"ROS domain 6: got a run, process {os.getpid()} on ")
        with again, domain_id(6, "left"):
            pass
    assert domains_in_use() == []


def test_who_waits_for_a_lock_names_its_owner(tmp_path: Path) -> None:
    first, owners = ExitStack(), list[str]()
    first.enter_context(locked(tmp_path / "lock"))

    def waits(owner: str) -> None:
        owners.append(owner)
        first.close()

    with locked(tmp_path / "lock", waits):
        assert is_locked(tmp_path / "lock")
    assert owners == [f"process {os.getpid()} on {os.uname().nodename}"]
    assert not is_locked(tmp_path / "lock")
