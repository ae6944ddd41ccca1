"""Scenarios: one file describes object, grasp, task and gains; here it becomes the parameters of both nodes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal, get_args

import numpy as np
import yaml
from pydantic import AfterValidator, Field

from slip_core.arms import ONE_ARM, ParamsOfArms, model_of_arms, params_of_arms
from slip_core.errors import InputError, UnknownName, printable
from slip_core.files.urdf import on_base
from slip_core.files.urdf_file import arm_urdf
from slip_core.grasp_params import ArmParams, BaseParams, Three
from slip_core.params import (
    Assignments,
    ParameterModel,
    build,
    flat_names,
    flatten,
    load_yaml,
    names_of,
    nested_names,
    parameter_infos,
    parse_assignments,
    parse_mapping,
    validate,
)
from slip_sim_bridge.params import BridgeParams
from slip_vic.presets import preset_text
from slip_vic.presets.models import DrivePreset, GripperPreset, Preset, SensorPreset, load_preset
from slip_vic_controller.params.controller_params import ControllerParams

if TYPE_CHECKING:
    from slip_vic.experiments.law import Law as OwnLaw
    from slip_vic.run.in_process import Tick
    from slip_vic.run.run import Run

Law = Literal["classical", "vic", "governed", "governed_follow", "printed"]
"""classical: impedance control without slip; vic: the paper's law, with internal feedback between several arms;
governed: that below the reference governor; governed_follow: and the grip follows the load; printed: the paper's law
and nothing else, each arm with its own wrench."""
LAWS: tuple[Law, ...] = get_args(Law)
OWN_WRENCH: Final = ("classical", "printed")
"""Laws in which each of several arms has its own contact only, and no internal feedback."""
Mode = Literal["lockstep", "realtime"]
NodeValues = dict[str, dict[str, Any]]
"""Values by dotted name, of the nodes "controller" and "bridge"."""
NODES: dict[str, tuple[str, type[ParameterModel]]] = {
    "controller": ("slip_vic_controller", ControllerParams),
    "bridge": ("slip_sim_bridge", BridgeParams),
}

PARTS: Final = {
    "slip": ("sensors.slip", "slip_sensor", False),
    "wrench": ("sensors.wrench", "wrench_sensor", False),
    "drive": ("drive", "drive", True),
    "joint": ("sensors.joint", "joint_sensor", True),
    "grip": ("grip", "grip", False),
}
"""Parts of a preset: where the bridge has one, where the controller has it, and whether its lists are of joints."""

BOUNDED: dict[str, Any] = {"gains.spin": "bounded"}
"""Of the controller, in real time. The printed law, which follows the object's spin wherever it goes, loses the object
with a single control period of delay (docs/sensors.md), and can ask for more than the arm has (docs/safety.md)."""

PRINTED: dict[str, Any] = {"controller": "printed", "slip_estimator": "measured", "gains.spin": "follow"}
"""Of the controller with the printed law: slip samples as they come, and none of the extensions."""

GOVERNED: dict[str, Any] = {"governor.mode": "slow_down", "gains.spin": "bounded"}
"""Of the controller that is governed: the law below it bounds spin."""

STIFF: Final = (20.0, 18.0)
"""Least stiffness where several governed arms hold an object [N/m, N m/rad]: with the paper's 5 N/m, an arm that the
friction of its gears keeps 1 cm off is pulled back with less than that friction, and the other arms pull at it."""


class GraspFile(ParameterModel):
    """Where and how an arm holds the object."""

    position: Three
    orientation_xyzw: tuple[float, float, float, float]


class ArmFile(ParameterModel):
    """What belongs to one of several arms alone."""

    base: BaseParams = BaseParams()
    grasp: GraspFile
    controller: dict[str, Any] = Field(default_factory=dict)
    bridge: dict[str, Any] = Field(default_factory=dict)


class ScenarioFile(ParameterModel):
    """The file's outer form; the inner values are checked by the nodes' own parameter models.

    shared, controller, bridge are those of every arm; several arms are below `arms`, each with its base and grasp.
    """

    name: Annotated[str, AfterValidator(printable)]
    description: str
    sources: str | list[str] = Field(default_factory=list)
    duration_s: float = Field(gt=0.0)
    shared: dict[str, Any] = Field(default_factory=dict)
    controller: dict[str, Any] = Field(default_factory=dict)
    bridge: dict[str, Any] = Field(default_factory=dict)
    arms: dict[str, ArmFile] = Field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Scenario:
    """A scenario with all overrides applied: one object, and the arms that hold it; "" is the name of an only arm.

    controllers, bridges: validated parameters of each arm by its name; urdfs: of each arm, without a base; placed: on
    the bases that the controllers are configured with.
    """

    name: str
    description: str
    text: str
    law: Law
    controllers: Mapping[str, ControllerParams]
    bridges: Mapping[str, BridgeParams]
    urdfs: Mapping[str, str]
    placed: Mapping[str, str]

    @property
    def several(self) -> bool:
        """Whether several arms hold the object."""
        return len(self.controllers) > 1

    @property
    def controller(self) -> Any:
        """Parameters of the controller node; of several arms, those of each below its name."""
        return params_of_arms(ControllerParams, self.controllers)

    @property
    def bridge(self) -> Any:
        """Parameters of the bridge node; of several arms, those of each below its name."""
        return params_of_arms(BridgeParams, self.bridges)

    @property
    def urdf(self) -> str:
        """The URDF of the first arm."""
        return next(iter(self.urdfs.values()))

    def ticks(self) -> Iterator[Tick]:
        """Run in this process and yield every tick: what the sensors measured, and what the controller answered."""
        from slip_vic.run.in_process import run_in_process

        return run_in_process(self)

    def run(self, law: OwnLaw | None = None) -> Run:
        """Run in this process to the end, or until the object is lost; return the results.

        Args:
            law: your own control law; None: the controller's.

        Raises:
            InputError: parameters and URDF that do not fit; your law fails.
        """
        from slip_vic.experiments.driven import driven, watched
        from slip_vic.experiments.law import Law as OwnLaw
        from slip_vic.run.judge import judge

        if law is None:
            return judge(self.ticks(), self)
        if not isinstance(law, OwnLaw):
            raise InputError("law", got=law, expected="a slip_vic.Law: needs, reset(setup) and step(seen)")
        run = judge(driven(self, law), watched(self))
        if run.outcome == "failed":
            raise InputError(f"law {type(law).__name__}", got=run.reason, expected="docs/your_law.md")
        return run

    @property
    def first(self) -> BridgeParams:
        """Parameters of the first arm in the bridge; those of the world are equal for all."""
        return next(iter(self.bridges.values()))

    @property
    def duration_s(self) -> float:
        """Simulated time of a run [s]."""
        return self.first.duration_s

    @property
    def seed(self) -> int:
        """Seed of the sensors' noise."""
        return self.first.seed

    def check(self) -> None:
        """Make controller and simulation once, so that inconsistencies are reported before any process starts.

        Compiles the control cycle if that has not been done on this machine.

        Raises:
            InputError: e.g. a URDF without the frame, joints missing or in another order, a path out of reach;
                more contacts than arms.
        """
        from slip_vic.run.prepare import prepare

        prepare()
        from slip_sim_bridge.session import BridgeSession
        from slip_vic.scenarios.reach import check_start
        from slip_vic_controller.config.controller import Controller
        from slip_vic_controller.robot import Robot

        for params in self.controllers.values():
            contacts = params.contacts.count
            if contacts not in (1, len(self.controllers)):
                raise InputError(
                    "parameter contacts.position", got=f"{contacts} contacts",
                    expected=f"one for each arm, {len(self.controllers)}",
                    fix="several arms that hold one object are below `arms` in the scenario: docs/governor.md",
                )  # fmt: skip
        Controller(self.controllers, self.placed, lockstep=True)
        BridgeSession(self.bridges, self.urdfs)
        for name, known in self.controllers.items():
            robot = Robot(self.placed[name], known.ee_frame, known.joint_names, known.gravity)
            check_start(robot, known, self.bridges[name])


def load(
    scenario: str | Path,
    *,
    law: Law = "governed",
    sensor: str | Path = "",
    drive: str | Path = "",
    gripper: str | Path = "",
    seed: int = 0,
    mode: Mode = "lockstep",
    set: Assignments = (),
    parameters: Mapping[str, Any] | Path | None = None,
) -> Scenario:
    """Return a scenario, ready to run.

        scenario = slip_vic.load("paper_planar", law="vic", sensor="vision_60", set=["object.mass=0.6"])
        scenario.bridge.grip.force          # the parameters of both sides
        scenario.controller.gains.k_s
        run = scenario.run()

    Args:
        scenario: see `scenario_names()`, or a YAML file.
        law: classical, vic, governed, governed_follow or printed.
        sensor: slip sensor, see `preset_names("sensors")`, or a YAML file; empty: the scenario's own.
        drive: the arm's drives and encoders, see `preset_names("drives")`, or a YAML file; empty: ideal.
        gripper: see `preset_names("grippers")`, or a YAML file; empty: ideal.
        seed: of the sensors' noise.
        mode: lockstep, or realtime for nodes, which brings `BOUNDED`.
        set: overrides, as on the command line or as a mapping. An override names a node's parameter,
            "controller.gains.k_s=500", or one that both nodes share, "object.mass=0.6"; of several arms it is that of
            all, or of the one whose name comes first, "right.bridge.base.position=[0.0, -0.5, 0.0]". Another arm is
            "robot_description_file=FILE".
        parameters: of the controller: by dotted name, or a parameter file, e.g. of `slip-vic tune`. They come after the
            presets, and before the overrides.

    Raises:
        InputError: an unknown name (the nearest are suggested), a bad value, a file that cannot be read.
    """
    text, origin = preset_text("scenarios", str(scenario)), f"scenario {scenario}"
    outer = validate(ScenarioFile, parse_mapping(text, origin), origin)
    model_of_arms(ParamsOfArms, tuple(outer.arms))  # refuses names that are none
    values = {name: _values(outer, name) for name in outer.arms or (ONE_ARM,)}
    for own in values.values():
        own["bridge"]["duration_s"] = outer.duration_s
        own["bridge"]["seed"] = seed
        for node in own.values():
            node["mode"] = mode
            file = str(node.get("robot_description_file", ""))
            if file and not file.startswith("package://"):  # by a path from the folder of the scenario's file
                node["robot_description_file"] = str(Path(scenario).parent / file)
        own["controller"] |= law_settings(law, len(values), own["controller"])
        if law == "governed_follow":
            own["bridge"]["grip.control"] = "follow"
        if mode == "realtime":
            own["controller"] |= BOUNDED
        for model, name in ((SensorPreset, sensor), (DrivePreset, drive), (GripperPreset, gripper)):
            if str(name):
                apply_preset(own, load_preset(model, str(name)))
        if law == "printed":
            own["controller"] |= PRINTED
    given = read_parameters(parameters) if isinstance(parameters, Path) else parameters or {}
    _apply_parameters(values, given, keep_sensor=bool(str(sensor)))
    for own in values.values():
        _tell_friction(own, origin)
    for key, value in parse_assignments(set):
        _assign(values, key, value)
    controllers, bridges, urdfs, placed = {}, {}, {}, {}
    for name, own in values.items():
        called = f"{origin}: {name}" if name else origin
        _own_contacts(own, law)
        controllers[name] = build(ControllerParams, own["controller"], f"{called}: controller")
        if controllers[name].wrench.source == "none":
            own["bridge"]["sensors.wrench.silent"] = True  # nor does anybody wait for it
        bridges[name] = build(BridgeParams, own["bridge"], f"{called}: bridge")
        urdfs[name] = arm_urdf(bridges[name])
        placed[name] = on_base(urdfs[name], controllers[name].base)
    return Scenario(outer.name, outer.description, text, law, controllers, bridges, urdfs, placed)


def law_settings(law: Law, arms: int, given: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a law sets in the controller of each of so many arms, which is otherwise as `given`."""
    if law not in LAWS:
        raise UnknownName("law", law, LAWS)
    settings: dict[str, Any] = {"controller": "classical" if law == "classical" else "vic"}
    if law in OWN_WRENCH and arms > 1:
        settings["gains.kappa"] = 0.0
    if law == "governed_follow":
        settings["grip.control"] = "follow"
    if law.startswith("governed"):
        settings |= GOVERNED | (stiffened(given) if arms > 1 else {})
    return settings


def stiffened(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return stiffness and damping of a controller, axes softer than `STIFF` raised to it, their damping ratio kept."""
    given = {name: value for name, value in values.items() if name in ("gains.stiffness", "gains.damping")}
    gains = build(ControllerParams, given, "scenario").gains
    factor = np.maximum(1.0, np.repeat(STIFF, 3) / gains.stiffness)
    stiffness, damping = factor * gains.stiffness, np.sqrt(factor) * gains.damping
    return {"gains.stiffness": stiffness.tolist(), "gains.damping": damping.tolist()}


def _own_contacts(own: NodeValues, law: Law) -> None:
    """Let the bridge have its own contact only, and the controller too where the law has its own wrench alone."""
    for node in ("bridge", "controller") if law in OWN_WRENCH else ("bridge",):
        for key, count in (("position", 3), ("orientation_xyzw", 4), ("slip_axes", 6)):
            if isinstance(value := own[node].get(f"contacts.{key}"), list | tuple):
                own[node][f"contacts.{key}"] = value[:count]


def _apply_parameters(values: dict[str, NodeValues], parameters: Mapping[str, Any], *, keep_sensor: bool) -> None:
    """Put parameters of the controller over those of the scenario; of several arms, those below an arm's name too."""
    given = flat_names(dict(parameters))
    common = {key: v for key, v in given.items() if key.partition(".")[0] not in ("arms", *filter(None, values))}
    for name, own in values.items():
        # gains are the file's; the mode and a sensor that was named are those of the command
        known = own["controller"]
        kept = {key: v for key, v in known.items() if key == "mode" or (keep_sensor and "_sensor." in key)}
        mine = {key.removeprefix(f"{name}."): v for key, v in given.items() if name and key.startswith(f"{name}.")}
        known |= common | mine | kept


def read_parameters(file: Path) -> dict[str, Any]:
    """Return the controller's parameters in a ROS parameter file or a plain one.

    Raises:
        InputError: an unreadable file, or one of another node.
    """
    content = load_yaml(file)
    nodes = {name: node for name, node in content.items() if isinstance(node, dict) and "ros__parameters" in node}
    if not nodes:
        return flat_names(content)
    wanted = NODES["controller"][0]
    found = [node["ros__parameters"] for name, node in nodes.items() if name.rpartition("/")[2] in (wanted, "**")]
    if len(found) != 1 or not isinstance(found[0], dict) or len(nodes) < len(content):
        got, expected = f"parameters of {[*content]}", f"one mapping of names to values, parameters of {wanted}"
        raise InputError(f"file {file}", got=got, expected=expected)
    return flat_names(found[0])


def apply_preset(values: NodeValues, preset: Preset) -> None:
    """Let the bridge simulate what a preset holds, and set the controller to match."""
    given = {name: value for name, value in values["bridge"].items() if name == "joint_names"}
    joints = len(build(ArmParams, given, "scenario").joint_names)
    for name, value in flatten(preset).items():
        part, _, own = name.partition(".")
        if part in PARTS:
            simulated, known, of_joints = PARTS[part]
            fitted = cut_or_extend(value, joints) if of_joints else value
            values["bridge"][f"{simulated}.{own}"] = fitted
            if f"{known}.{own}" in names_of(ControllerParams):
                values["controller"][f"{known}.{own}"] = fitted
    values["controller"] |= flat_names(preset.controller)
    if isinstance(preset, DrivePreset):
        values["controller"]["command.interface"] = preset.drive.interface
        for node in values.values() if preset.period_s is not None else ():
            node["control_period_s"] = preset.period_s


def cut_or_extend(value: Any, joints: int) -> Any:
    """Return a list of another arm's joints for this number of joints: cut, or its last number for further ones.

    What is no list, or has one number for all joints, is returned as it is.
    """
    if not isinstance(value, list) or len(value) < 2:
        return value
    return [*value[:joints], *[value[-1]] * (joints - len(value))]


def _tell_friction(values: NodeValues, origin: str) -> None:
    """Configure the governor with the scenario's friction, unless the scenario sets it itself."""
    bridge = build(BridgeParams, values["bridge"], f"{origin}: bridge")
    friction = {
        "governor.friction_limit": round(bridge.friction.mu_s * bridge.grip.force, 12),
        "governor.torsional_radius": bridge.friction.torsional_radius,
        "grip.nominal_force": bridge.grip.force,
    }
    values["controller"] = friction | values["controller"]


def _values(outer: ScenarioFile, arm: str) -> NodeValues:
    """Return what a scenario sets for one arm, per node, under dotted names."""
    own = outer.arms.get(arm)
    common: NodeValues = {"controller": outer.controller, "bridge": outer.bridge}
    values = {node: flat_names(outer.shared) | flat_names(common[node]) for node in NODES}
    if own is None:
        return values
    grasps = [own.grasp, *(other.grasp for name, other in outer.arms.items() if name != arm)]
    axes = values["controller"].get("contacts.slip_axes")
    contacts: dict[str, Any] = {
        "contacts.position": [x for grasp in grasps for x in grasp.position],
        "contacts.orientation_xyzw": [x for grasp in grasps for x in grasp.orientation_xyzw],
    }
    if isinstance(axes, list):
        contacts["contacts.slip_axes"] = [*axes] * len(grasps)
    base = {f"base.{name}": value for name, value in flatten(own.base).items()}
    for node, inner in (("controller", own.controller), ("bridge", own.bridge)):
        values[node] |= contacts | base | flat_names(inner)
    return values


def _assign(values: dict[str, NodeValues], key: str, value: Any) -> None:
    """Apply an assignment: to every arm, or to the one whose name comes first."""
    first, _, rest = key.partition(".")
    chosen, name = ([first], rest) if first and first in values else (list(values), key)
    node, _, inner = name.partition(".")
    if node in NODES and inner in names_of(NODES[node][1]):
        owners, name = [node], inner
    else:
        owners = [node for node in NODES if name in names_of(NODES[node][1])]
    if not owners:
        names = {node: {info.name for info in parameter_infos(model)} for node, (_, model) in NODES.items()}
        known = {f"{node}.{name}" for node in names for name in names[node]} | (names["controller"] & names["bridge"])
        raise UnknownName("parameter", key, known, where="--set")
    for arm in chosen:
        for owner in owners:
            values[arm][owner] |= {name: value}


def ros_parameter_file(params: ParameterModel, node_name: str) -> str:
    """Return all parameters of one node as a ROS parameter file, valid in any namespace.

    rcl's parser refuses empty lists: those that are the defaults are left out, others are a list of one empty text.
    """
    defaults = flatten(type(params)())
    wanted = {name: value for name, value in flatten(params).items() if value != [] or value != defaults[name]}
    nested = nested_names({name: [""] if value == [] else value for name, value in wanted.items()})
    return yaml.safe_dump(
        {f"/**/{node_name}": {"ros__parameters": nested}}, sort_keys=False, default_flow_style=None, width=120
    )
