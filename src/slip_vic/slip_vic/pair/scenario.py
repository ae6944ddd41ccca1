"""Scenarios with two arms: one file becomes the parameters of both controllers and of the simulation."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from slip_core.arms import params_of_arms
from slip_core.errors import UnknownName
from slip_core.files.plain_yaml import read_yaml
from slip_core.files.urdf_file import read_urdf
from slip_core.grasp_params import BaseParams, Three
from slip_core.params import (
    ParameterModel,
    build,
    flat_names,
    flatten,
    is_name,
    load_yaml,
    parameter,
    parameter_infos,
    parse_assignment,
    validate,
)
from slip_sim_bridge.params import BridgeParams, PadParams
from slip_vic.presets.drives import load_drive
from slip_vic.presets.sensors import load_sensor
from slip_vic.scenarios import find_scenario, scenario_names, scenario_text
from slip_vic.scenarios.scenario import BOUNDED, Mode, apply_drive, apply_sensor
from slip_vic.scenarios.scenario import Law as OneArmLaw
from slip_vic_controller.parameters.node_params import ControllerNodeParams

if TYPE_CHECKING:
    from slip_sim_bridge.session import BridgeSession
    from slip_vic_controller.session import ControllerSession

SIDES = ("left", "right")

Law = Literal["classical", "leader_follower", "classical_internal", "printed", "shared", "internal", "governed"]
"""Two classical controllers; the same where the right pad follows the left one instead of the path; the first with
internal feedback; the printed law, each arm with its own wrench; all wrenches in h_o; all wrenches and internal
feedback; the same below the reference governor."""
LAWS: tuple[Law, ...] = (
    "classical", "leader_follower", "classical_internal", "printed", "shared", "internal", "governed"
)  # fmt: skip
OWN_WRENCH = ("classical", "leader_follower", "printed")
"""Laws in which each arm knows its own contact only."""


BY_LAW: dict[OneArmLaw, Law] = {"classical": "classical", "vic": "internal", "governed": "governed"}
"""What `--law` means with two arms."""


class Mismatch(ParameterModel):
    """What the simulated world has and the controllers do not know."""

    base_rotation: Three = parameter((0.0, 0.0, 0.0), "error of the right base's attitude, rotation vector", unit="rad")
    base_position: Three = parameter((0.0, 0.0, 0.0), "error of the right base's position", unit="m")
    late_s: float = parameter(0.0, "how much later the right arm's reference runs", unit="s", ge=0.0)
    friction: float = parameter(1.0, "friction of the right pad over what the left one has", gt=0.0)
    mass: float = parameter(1.0, "mass of the object over what the controllers are told", gt=0.0)


class GraspFile(ParameterModel):
    """Where and how an arm holds the object."""

    position: Three
    orientation_xyzw: tuple[float, float, float, float]


class SideFile(ParameterModel):
    """What belongs to one arm alone."""

    base: BaseParams
    grasp: GraspFile
    controller: dict[str, Any] = Field(default_factory=dict)
    bridge: dict[str, Any] = Field(default_factory=dict)


class PairFile(ParameterModel):
    """The file's outer form; the inner values are checked by the nodes' own parameter models."""

    name: str
    description: str
    sources: str | list[str] = Field(default_factory=list)
    duration_s: float = Field(gt=0.0)
    slip_axes: tuple[bool, bool, bool, bool, bool, bool]
    shared: dict[str, Any] = Field(default_factory=dict)
    controller: dict[str, Any] = Field(default_factory=dict)
    bridge: dict[str, Any] = Field(default_factory=dict)
    left: SideFile
    right: SideFile
    pad: PadParams = Field(default_factory=PadParams)
    mismatch: Mismatch = Field(default_factory=Mismatch)


@dataclass(frozen=True, slots=True)
class PairScenario:
    """A scenario with all overrides applied; left first."""

    name: str
    description: str
    text: str
    controllers: tuple[ControllerNodeParams, ...]
    bridges: dict[str, BridgeParams]
    believed: tuple[str, ...]
    """URDFs on the bases that the controllers believe in."""
    urdfs: tuple[str, ...]
    """URDFs without a base: the simulation puts them where they really are."""
    bases: tuple[BaseParams, ...]
    """Where the controllers believe the bases to be."""
    leader: bool = False
    """Whether the right pad is led by the left one; in one process only."""
    law: str = "internal"
    modules: ClassVar[dict[str, str]] = {
        "controller": "slip_vic_controller.main",
        "bridge": "slip_sim_bridge.main",
        "both": "slip_vic.pair.both_nodes",
    }
    """What runs as a process."""

    @property
    def controller(self) -> ParameterModel:
        """Parameters of the node that controls both."""
        return params_of_arms(ControllerNodeParams, dict(zip(SIDES, self.controllers, strict=True)))

    @property
    def bridge(self) -> ParameterModel:
        """Parameters of the bridge node."""
        return params_of_arms(BridgeParams, self.bridges)

    @property
    def duration_s(self) -> float:
        """Simulated time of a run [s]."""
        return self.bridges[SIDES[0]].duration_s

    @property
    def seed(self) -> int:
        """Seed of the sensors' noise."""
        return self.bridges[SIDES[0]].seed

    @property
    def arms(self) -> tuple[tuple[str, ControllerNodeParams], ...]:
        """Prefix of the topics, and parameters of the controller, of each arm."""
        return tuple(zip([f"{side}/" for side in SIDES], self.controllers, strict=True))

    @property
    def descriptions(self) -> dict[str, str]:
        """URDFs as the controllers know them, by the name of the file in a bag."""
        return {f"{side}.urdf": urdf for side, urdf in zip(SIDES, self.believed, strict=True)}

    def check(self) -> None:
        """Make controllers and simulation once, so that what does not fit is said before any process starts.

        Raises:
            InputError: parameters and URDFs that do not fit.
        """
        self.team()
        self.bridge_session()

    def run_parameters(self, peers: tuple[str, ...]) -> tuple[ParameterModel, ParameterModel]:
        """Return the parameters of both nodes for a run with these peers."""
        controller = self.controller
        told = {"expected_subscribers": len(peers)}
        return (
            controller.model_copy(update={side: getattr(controller, side).model_copy(update=told) for side in SIDES}),
            params_of_arms(
                BridgeParams,
                {side: arm.model_copy(update={"wait_for": peers}) for side, arm in self.bridges.items()},
            ),
        )

    def bridge_session(self) -> BridgeSession:
        """Return simulation and sensors of a run."""
        from slip_sim_bridge.session import BridgeSession

        return BridgeSession(self.bridges, dict(zip(SIDES, self.urdfs, strict=True)))

    def team(self) -> ControllerSession:
        """Return the controller of both arms, in lockstep."""
        from slip_vic_controller.session import Controller, ControllerSession

        params, urdfs = (dict(zip(SIDES, each, strict=True)) for each in (self.controllers, self.believed))
        return ControllerSession(Controller(params, urdfs, lockstep=True))


def load_pair(
    name_or_path: str,
    *,
    law: Law = "internal",
    mode: Mode = "lockstep",
    seed: int = 0,
    sensor: str = "",
    drive: str = "",
    assignments: Iterable[str] = (),
) -> PairScenario:
    """Read a scenario with two arms by name or path and apply assignments.

    An assignment names a parameter of both arms (`controller.gains.kappa=0.5`, `bridge.grip.force=6`, `object.mass=2`),
    of one (`left.controller.…`, `right.bridge.…`), of the pads (`pad.stiffness=…`) or a mismatch (`mismatch.late_s=…`).

    Raises:
        InputError: unknown scenario or parameter, bad value, unreadable URDF.
    """
    if law not in LAWS:
        raise UnknownName("law", law, LAWS)
    text, origin = _read(name_or_path)
    outer = validate(PairFile, read_yaml(text), origin)
    sides = {"left": outer.left, "right": outer.right}
    values = {side: _values(outer, sides, side, origin) for side in SIDES}
    mismatch = dict(outer.mismatch.model_dump())
    for side in SIDES:
        node = values[side]
        node["bridge"] |= {"duration_s": outer.duration_s, "seed": seed, "mode": mode, "plant": "elastic"}
        for group, model in (("pad", outer.pad), ("base", sides[side].base)):
            node["bridge"] |= {f"{group}.{name}": value for name, value in flatten(model).items()}
        node["controller"]["mode"] = mode
        node["controller"]["controller"] = (
            "classical" if law.startswith("classical") or law == "leader_follower" else "vic"
        )
        if law in (*OWN_WRENCH, "shared"):
            node["controller"]["gains.kappa"] = 0.0
        if law == "governed":
            node["controller"] |= {"governor.mode": "slow_down"} | BOUNDED
        if sensor:
            apply_sensor(node, load_sensor(sensor))
        if drive:
            apply_drive(node, load_drive(drive))
    for assignment in assignments:
        _assign(values, mismatch, *parse_assignment(assignment))
    wrong = build(Mismatch, mismatch, f"{origin}: mismatch")
    for side in SIDES:
        _own_contacts(values[side], law)
    values["right"]["controller"]["trajectory.start_s"] = (
        float(values["right"]["controller"].get("trajectory.start_s", 0.0)) + wrong.late_s
    )
    bases = outer.left.base, outer.right.base
    controllers = tuple(
        build(ControllerNodeParams, values[side]["controller"], f"{origin}: {side}").model_copy(update={"base": base})
        for side, base in zip(SIDES, bases, strict=True)
    )
    arms = [build(BridgeParams, values[side]["bridge"], f"{origin}: {side}") for side in SIDES]
    friction, grasped = arms[1].friction, arms[0].object
    arms[1] = arms[1].model_copy(
        update={
            "friction": friction.model_copy(
                update={"mu_s": friction.mu_s * wrong.friction, "mu_k": friction.mu_k * wrong.friction}
            )
        }
    )
    heavier = grasped.model_copy(
        update={"mass": grasped.mass * wrong.mass, "inertia": tuple(wrong.mass * x for x in grasped.inertia)}
    )
    arms = [arm.model_copy(update={"object": heavier}) for arm in arms]
    arms[1] = arms[1].model_copy(update={"base": _moved(arms[1].base, wrong)})
    bridges = dict(zip(SIDES, arms, strict=True))
    urdfs = tuple(
        arm.robot_description or read_urdf(arm.robot_description_file, "parameter robot_description_file")
        for arm in arms
    )
    from slip_core.files.placed_urdf import placed_urdf

    believed = tuple(placed_urdf(urdf, base.position, base.rotation) for urdf, base in zip(urdfs, bases, strict=True))
    return PairScenario(
        outer.name, outer.description, text, controllers, bridges, believed, urdfs, bases, law == "leader_follower", law
    )


def is_pair(name_or_path: str) -> bool:
    """Whether a scenario, given by name or path, is one with two arms."""
    if name_or_path in scenario_names(2):
        return True
    path = Path(name_or_path)
    return path.suffix in (".yaml", ".yml") and path.is_file() and {"left", "right"} <= load_yaml(path).keys()


def _read(name_or_path: str) -> tuple[str, str]:
    path = find_scenario(name_or_path)
    if path is None:
        return scenario_text(name_or_path), f"scenario {name_or_path}"
    load_yaml(path)  # for its clear error
    return path.read_text(encoding="utf-8"), f"scenario {path}"


def _values(outer: PairFile, sides: dict[str, SideFile], side: str, origin: str) -> dict[str, dict[str, Any]]:
    """Return what the file sets for one side, per node."""
    own, other = sides[side], sides[SIDES[1 - SIDES.index(side)]]
    contacts = {
        "contacts.position": [*own.grasp.position, *other.grasp.position],
        "contacts.orientation_xyzw": [*own.grasp.orientation_xyzw, *other.grasp.orientation_xyzw],
        "contacts.slip_axes": [*outer.slip_axes, *outer.slip_axes],
    }
    values = {}
    for node, parts in (
        ("controller", (outer.shared, outer.controller, own.controller)),
        ("bridge", (outer.shared, outer.bridge, own.bridge)),
    ):
        values[node] = dict(contacts)
        for part in parts:
            values[node] |= flat_names(part)
    friction = build(BridgeParams, values["bridge"], f"{origin}: {side}")
    told = {
        "governor.friction_limit": round(friction.friction.mu_s * friction.grip.force, 12),
        "governor.torsional_radius": friction.friction.torsional_radius,
    }
    values["controller"] = told | values["controller"]
    return values


def _own_contacts(node: dict[str, dict[str, Any]], law: Law) -> None:
    """Let the bridge know its own contact only, and the controller too where the law has its own wrench alone."""
    for name in ("bridge", "controller") if law in OWN_WRENCH else ("bridge",):
        for key, count in (("position", 3), ("orientation_xyzw", 4), ("slip_axes", 6)):
            node[name][f"contacts.{key}"] = node[name][f"contacts.{key}"][:count]


def _assign(values: dict[str, dict[str, dict[str, Any]]], wrong: dict[str, Any], key: str, value: Any) -> None:
    first, _, rest = key.partition(".")
    if first == "mismatch":
        model, target = Mismatch, wrong
        if rest not in model.model_fields:
            raise UnknownName("parameter", key, [f"{first}.{name}" for name in model.model_fields], where="--set")
        target[rest] = value
        return
    sides = [first] if first in SIDES else list(SIDES)
    name = rest if first in SIDES else key
    node, _, inner = name.partition(".")
    models: dict[str, type[ParameterModel]] = {"controller": ControllerNodeParams, "bridge": BridgeParams}
    owners = (
        [node] if node in models and is_name(models[node], inner) else [m for m in models if is_name(models[m], name)]
    )
    if not owners:
        known = {f"{node}.{info.name}" for node, model in models.items() for info in parameter_infos(model)}
        raise UnknownName("parameter", key, known, where="--set")
    inner = inner if node in models and is_name(models[node], inner) else name
    for side in sides:
        for owner in owners:
            values[side][owner] |= {inner: value}


def _moved(base: BaseParams, wrong: Mismatch) -> BaseParams:
    """Return where a base really stands."""
    from scipy.spatial.transform import Rotation

    rotation = (Rotation.from_rotvec(wrong.base_rotation) * Rotation.from_rotvec(base.rotation)).as_rotvec()
    position = np.array(base.position) + np.array(wrong.base_position)
    return BaseParams(position=tuple(position.tolist()), rotation=tuple(rotation.tolist()))
