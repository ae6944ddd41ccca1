"""Scenarios: one file describes object, grasp, task and gains; here it becomes the parameters of both nodes."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import yaml
from pydantic import Field

from slip_core.errors import InputError, UnknownName
from slip_core.files.plain_yaml import read_yaml
from slip_core.files.urdf_file import read_urdf
from slip_core.params import (
    ParameterModel,
    build,
    flat_names,
    flatten,
    is_name,
    load_yaml,
    nested_names,
    parameter_infos,
    parse_assignment,
    validate,
)
from slip_sim_bridge.params import BridgeParams
from slip_vic.presets.drives import DrivePreset, load_drive
from slip_vic.presets.sensors import SensorPreset, load_sensor
from slip_vic.scenarios import find_scenario, scenario_text
from slip_vic_controller.parameters.node_params import ControllerNodeParams

if TYPE_CHECKING:
    from slip_core.arrays import Array
    from slip_sim_bridge.session import BridgeSession
    from slip_vic.run.in_process import Tick
    from slip_vic.run.run import Run

Law = Literal["vic", "classical", "governed"]
"""The paper's law, classical impedance control, and the paper's law below the reference governor."""
Estimator = Literal["measured", "observer"]
Mode = Literal["lockstep", "realtime"]
NODES: dict[str, tuple[str, type[ParameterModel]]] = {
    "controller": ("slip_vic_controller", ControllerNodeParams),
    "bridge": ("slip_sim_bridge", BridgeParams),
}

BOUNDED: dict[str, Any] = {"gains.spin": "bounded"}
"""Of the controller, in real time. The printed law, which follows the object's spin wherever it goes, loses the object
with a single control period of delay (docs/sensors.md), and can ask for more than the arm has (docs/safety.md)."""

GOVERNED: dict[str, Any] = {"governor.mode": "slow_down", "gains.spin": "bounded", "gains.give_up": True}
"""Of the controller that is governed: the law below it bounds spin, and gives the compensation up where it fails."""


class ScenarioFile(ParameterModel):
    """The file's outer form; the inner values are checked by the nodes' own parameter models."""

    name: str
    description: str
    sources: str | list[str] = Field(default_factory=list)
    duration_s: float = Field(gt=0.0)
    shared: dict[str, Any] = Field(default_factory=dict)
    controller: dict[str, Any] = Field(default_factory=dict)
    bridge: dict[str, Any] = Field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Scenario:
    """A scenario with all overrides applied: validated parameters of both nodes and the arm's URDF."""

    name: str
    description: str
    text: str
    controller: ControllerNodeParams
    bridge: BridgeParams
    urdf: str
    law: Law = "vic"
    modules: ClassVar[dict[str, str]] = {
        "controller": "slip_vic_controller.main", "bridge": "slip_sim_bridge.main", "both": "slip_vic.run.both_nodes"
    }  # fmt: skip
    """What runs as a process."""

    @property
    def controllers(self) -> Mapping[str, ControllerNodeParams]:
        """Parameters of the controller of each arm by its name."""
        return {"": self.controller}

    @property
    def bridges(self) -> Mapping[str, BridgeParams]:
        """Parameters of the bridge of each arm by its name."""
        return {"": self.bridge}

    @property
    def urdfs(self) -> Mapping[str, str]:
        """The URDF of each arm by its name."""
        return {"": self.urdf}

    def ticks(self) -> Iterator[Tick]:
        """Run in this process and yield every tick, with the next effort in your hands.

            for tick in scenario.ticks():
                tick.effort = my_law(tick.outputs.arms[0].joint, tick.result.arm)

        Without an assignment the effort is the controller's. One that is set goes through the simulated drive, which
        limits it as the real one does.
        """
        from slip_vic.run.in_process import run_in_process

        return run_in_process(self)

    def run(self, law: Callable[[Tick], Array] | None = None) -> Run:
        """Run in this process to the end, or until the object is lost; return what came of it.

        Args:
            law: a control law of one's own: takes each tick, returns the effort of the arm (n,) [N m]. None: the
                controller's.

        Raises:
            InputError: parameters and URDF that do not fit.
        """
        from slip_vic.run.judge import judge
        from slip_vic.run.run import Run
        from slip_vic.run.track import Track

        def driven() -> Iterator[Tick]:
            for tick in self.ticks():
                if law is not None:
                    tick.effort = law(tick)
                yield tick

        track = Track(tuple(self.controllers), whole=True)
        return Run(self, judge(driven(), track), track)

    @property
    def arms(self) -> tuple[tuple[str, ControllerNodeParams], ...]:
        """Prefix of the topics, and parameters of the controller, of each arm: there is one."""
        return (("", self.controller),)

    @property
    def duration_s(self) -> float:
        """Simulated time of a run [s]."""
        return self.bridge.duration_s

    @property
    def seed(self) -> int:
        """Seed of the sensors' noise."""
        return self.bridge.seed

    @property
    def descriptions(self) -> dict[str, str]:
        """The URDF by the name of its file in a bag."""
        return {"arm.urdf": self.urdf}

    def run_parameters(self, peers: tuple[str, ...]) -> tuple[ControllerNodeParams, BridgeParams]:
        """Return the parameters of both nodes for a run with these peers."""
        return (
            self.controller.model_copy(update={"expected_subscribers": len(peers)}),
            self.bridge.model_copy(update={"wait_for": peers}),
        )

    def check(self) -> None:
        """Make controller and simulation once, so that what does not fit is said before any process starts.

        Raises:
            InputError: e.g. a URDF without the frame, joints missing or in another order, a path out of reach;
                more contacts than the bridge simulates.
        """
        from slip_vic_controller.session import Controller

        contacts = len(self.controller.contacts.position) // 3
        if contacts != 1:
            raise InputError(
                "parameter contacts.position",
                got=f"{contacts} contacts",
                expected="1: the bridge simulates one arm",
                fix="two arms that hold one object have scenarios of their own: docs/two_arms.md",
            )
        Controller({"": self.controller}, {"": self.urdf}, lockstep=True)
        self.bridge_session()
        self.check_arm()

    def bridge_session(self) -> BridgeSession:
        """Return simulation and sensors of a run."""
        from slip_sim_bridge.session import BridgeSession

        return BridgeSession({"": self.bridge}, {"": self.urdf})

    def check_arm(self) -> None:
        """Look whether the arm can start where the scenario says, and follow its path.

        Raises:
            InputError: it cannot; or a URDF that does not fit.
        """
        from slip_vic.scenarios.reach import check_start
        from slip_vic_controller.robot import Robot

        known = self.controller
        check_start(Robot(self.urdf, known.ee_frame, known.joint_names, known.gravity), known, self.bridge)


@dataclass(frozen=True, slots=True)
class Texts:
    """Contents of files by the name under which they are asked for: what stands here is not opened.

    So a run can be made on a machine that has none of these files.
    """

    scenarios: Mapping[str, str] = field(default_factory=dict)
    sensors: Mapping[str, str] = field(default_factory=dict)
    drives: Mapping[str, str] = field(default_factory=dict)
    urdfs: Mapping[str, str] = field(default_factory=dict)


NO_TEXTS = Texts()


def load_scenario(
    name_or_path: str,
    *,
    law: Law = "vic",
    mode: Mode = "lockstep",
    seed: int = 0,
    assignments: Iterable[str] = (),
    urdf_file: Path | None = None,
    sensor: str = "",
    drive: str = "",
    estimator: Estimator | None = None,
    texts: Texts = NO_TEXTS,
    parameters: Mapping[str, Any] = MappingProxyType({}),
) -> Scenario:
    """Read a scenario by name or path and apply ``--set`` assignments.

    An assignment names a node's parameter (``controller.gains.k_s=500``, ``bridge.grip.force=0.6``) or,
    without prefix, one that both nodes share (``object.mass=0.6``). Real time brings `BOUNDED`. A
    `sensor` (name or file) gives both nodes what a slip sensor is, and the controller settings that suit it, `drive`
    what the arm's drives and encoders are;
    `parameters` of the controller, `estimator` and assignments come after it, in this order. Files whose contents stand
    in `texts` are not opened.

    Raises:
        InputError: unknown scenario, unknown parameter (nearest names offered), bad value, unreadable URDF.
    """
    text, origin = read_scenario(name_or_path, texts)
    outer = validate(ScenarioFile, read_yaml(text), origin)
    values = _values(outer)
    _find_arm(values, name_or_path)
    values["bridge"]["duration_s"] = outer.duration_s
    values["controller"]["controller"] = "vic" if law == "governed" else law
    if law == "governed":
        values["controller"] |= GOVERNED
    for node in values.values():
        node["mode"] = mode
    if mode == "realtime":
        values["controller"] |= BOUNDED
    values["bridge"]["seed"] = seed
    if urdf_file is not None:
        for node in values.values():
            node["robot_description_file"] = str(urdf_file)
    if sensor:
        apply_sensor(values, load_sensor(sensor, texts.sensors.get(sensor)))
    if drive:
        apply_drive(values, load_drive(drive, texts.drives.get(drive)))
    if parameters:  # gains are the file's, the mode and a sensor that was named are those of the command
        known = values["controller"]
        named = {key: value for key, value in known.items() if key == "mode" or (sensor and "_sensor." in key)}
        known |= flat_names(dict(parameters)) | named
    if estimator is not None:
        values["controller"]["slip_estimator"] = estimator
    _tell_friction(values, origin)
    for assignment in assignments:
        _assign(values, *parse_assignment(assignment))
    controller_params = build(ControllerNodeParams, values["controller"], f"{origin}: controller")
    bridge_params = build(BridgeParams, values["bridge"], f"{origin}: bridge")
    file = bridge_params.robot_description_file
    urdf = (
        bridge_params.robot_description or texts.urdfs.get(file) or read_urdf(file, "parameter robot_description_file")
    )
    return Scenario(outer.name, outer.description, text, controller_params, bridge_params, urdf, law)


def read_parameters(file: Path | None) -> dict[str, Any]:
    """Return the controller's parameters in a ROS parameter file or a plain one; without a file none.

    Raises:
        InputError: an unreadable file, or one of another node.
    """
    if file is None:
        return {}
    content = load_yaml(file)
    nodes = {name: node for name, node in content.items() if isinstance(node, dict) and "ros__parameters" in node}
    if not nodes:
        return flat_names(content)
    wanted = NODES["controller"][0]
    found = [node for name, node in nodes.items() if name.rpartition("/")[2] in (wanted, "**")]
    if not found:
        raise InputError(f"file {file}", got=f"parameters of {', '.join(nodes)}", expected=f"parameters of {wanted}")
    return flat_names(found[0]["ros__parameters"])


def apply_sensor(values: dict[str, dict[str, Any]], preset: SensorPreset) -> None:
    """Put a sensor into the values of both nodes: the bridge simulates it, the controller knows what it is."""
    for part in ("slip", "wrench"):
        flat = flatten(getattr(preset, part))
        known = {info.name for info in parameter_infos(ControllerNodeParams)}
        values["bridge"] |= {f"sensors.{part}.{name}": value for name, value in flat.items()}
        values["controller"] |= {
            f"{part}_sensor.{name}": value for name, value in flat.items() if f"{part}_sensor.{name}" in known
        }
    values["controller"] |= flat_names(preset.controller)


def apply_drive(values: dict[str, dict[str, Any]], preset: DrivePreset) -> None:
    """Put drives and encoders into the values of both nodes: the bridge simulates them, the controller knows of them.

    Raises:
        InputError: drives that take what the controller does not send.
    """
    joints = len(values["bridge"].get("joint_names", BridgeParams.model_fields["joint_names"].default))
    known = {info.name for info in parameter_infos(ControllerNodeParams)}
    for part, group in (("drive", "drive"), ("joint", "sensors.joint")):
        flat = {name: _of_joints(value, joints) for name, value in flatten(getattr(preset, part)).items()}
        values["bridge"] |= {f"{group}.{name}": value for name, value in flat.items()}
        own = "joint_sensor" if part == "joint" else part
        values["controller"] |= {f"{own}.{name}": value for name, value in flat.items() if f"{own}.{name}" in known}
    interface = preset.drive.interface
    if "command.interface" in known:
        values["controller"]["command.interface"] = interface
    elif interface != "effort":
        raise InputError(f"drive with interface {interface}", got="a controller that sends efforts", expected="effort")


def drive_assignments(drive: str, scenario: str, assignments: Iterable[str]) -> tuple[str, ...]:
    """Return the ``--set`` assignments that ``--drive`` stands for, for the arm of a scenario; none without a name."""
    if not drive:
        return ()
    before = load_scenario(scenario, assignments=assignments)
    values: dict[str, dict[str, Any]] = {"controller": {}, "bridge": {"joint_names": before.bridge.joint_names}}
    apply_drive(values, load_drive(drive))
    del values["bridge"]["joint_names"]
    return tuple(
        f"{node}.{name}={json.dumps(value)}" for node, known in values.items() for name, value in known.items()
    )


def _of_joints(value: Any, joints: int) -> Any:
    """Return a list for an arm with this number of joints; one number stays one for all."""
    if not isinstance(value, list) or len(value) < 2:
        return value
    return [*value[:joints], *[value[-1]] * (joints - len(value))]


def _tell_friction(values: dict[str, dict[str, Any]], origin: str) -> None:
    """Tell the controller's governor of the friction that the scenario has, where it does not say so itself."""
    bridge = build(BridgeParams, values["bridge"], f"{origin}: bridge")
    told = {
        "governor.friction_limit": round(bridge.friction.mu_s * bridge.grip.force, 12),
        "governor.torsional_radius": bridge.friction.torsional_radius,
        "grip.told_force": bridge.grip.force,
    }
    values["controller"] = told | values["controller"]


def _find_arm(values: dict[str, dict[str, Any]], name_or_path: str) -> None:
    """Let a scenario file name its arm by a path from its own folder."""
    for node in values.values():
        file = str(node.get("robot_description_file", ""))
        if file and not file.startswith("package://"):
            node["robot_description_file"] = str(Path(name_or_path).parent / file)


def read_scenario(name_or_path: str, texts: Texts = NO_TEXTS) -> tuple[str, str]:
    """Return the text of a scenario and what to call it in messages.

    Raises:
        InputError: unknown scenario, or a file that cannot be read.
    """
    if name_or_path in texts.scenarios:
        return texts.scenarios[name_or_path], f"scenario {name_or_path}"
    path = find_scenario(name_or_path)
    if path is None:
        return scenario_text(name_or_path), f"scenario {name_or_path}"
    load_yaml(path)  # for its clear error
    return path.read_text(encoding="utf-8"), f"scenario {path}"


def _values(outer: ScenarioFile) -> dict[str, dict[str, Any]]:
    """Return what a scenario sets, per node, under dotted names."""
    inner: dict[str, dict[str, Any]] = {"controller": outer.controller, "bridge": outer.bridge}
    return {node: flat_names(outer.shared) | flat_names(inner[node]) for node in NODES}


def _assign(values: dict[str, dict[str, Any]], key: str, value: Any) -> None:
    node, _, rest = key.partition(".")
    if node in values and is_name(NODES[node][1], rest):
        owners, name = [node], rest
    else:
        owners, name = [node for node in values if is_name(NODES[node][1], key)], key
    if not owners:
        names = {node: {info.name for info in parameter_infos(model)} for node, (_, model) in NODES.items()}
        known = {f"{node}.{name}" for node in values for name in names[node]} | (names["controller"] & names["bridge"])
        raise UnknownName("parameter", key, known, where="--set")
    for owner in owners:
        values[owner] |= {name: value}


def urdf_assignment(urdf: Path | None) -> tuple[str, ...]:
    """Return the ``--set`` assignment that ``--urdf`` stands for; none without a file."""
    return () if urdf is None else (f"robot_description_file={json.dumps(str(urdf))}",)


def ros_parameter_file(params: ParameterModel, node_name: str, *, complete: bool = True) -> str:
    """Return the ROS parameter file of one node, valid in any namespace.

    rcl's parser refuses empty lists: those that are the defaults are left out, others are a list of one empty text.

    Args:
        params: the values.
        node_name: whose file it is.
        complete: whether values that are equal to their defaults are written too.
    """
    defaults = flatten(type(params)())
    wanted = {
        name: value for name, value in flatten(params).items() if value != defaults[name] or (complete and value != [])
    }
    nested = nested_names({name: [""] if value == [] else value for name, value in wanted.items()})
    return yaml.safe_dump(
        {f"/**/{node_name}": {"ros__parameters": nested}}, sort_keys=False, default_flow_style=None, width=120
    )
