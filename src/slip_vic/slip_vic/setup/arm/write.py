"""From a URDF to a folder that runs: the arm, one scenario file per task, parameters for the real arm; and a report."""

from __future__ import annotations

import hashlib
import math
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import yaml
from scipy.spatial.transform import Rotation

from slip_core.arrays import Array
from slip_core.errors import InputError
from slip_core.files.plain_yaml import read_yaml
from slip_core.files.urdf import NO_LIMIT, parse_urdf
from slip_core.params import build, flat_names, flatten, nested_names
from slip_core.types import AXES
from slip_vic.presets import preset_text
from slip_vic.scenarios.parameter_files import commented_file, write_files
from slip_vic.scenarios.reach import pad_path
from slip_vic.scenarios.scenario import NODES, Scenario, load
from slip_vic.setup.arm.driver import Driver, driver_files
from slip_vic.setup.arm.hand import Hand, find_hand
from slip_vic.setup.arm.posture import Start, best_start, postures
from slip_vic.setup.arm.write_urdf import PAD, Limits, arm_urdf
from slip_vic_controller.law.gains import judge_inertia
from slip_vic_controller.params.controller_params import ControllerParams
from slip_vic_controller.robot import Robot

URDF_NAME = "arm.urdf"
DIGESTS = "slip_vic_arm.sha256"
LONGEST_REACH_M = 1.0
ROTOR = 1e-3
"""Inertia that a rotor has behind its gears at least [kg m2]; with 0.2 of it the laws work as with 20 times."""
_ROUNDED = 9
_LENGTHS = {"displacement", "rotation", "waypoints", "radius"}
_TIMES = {"start_s", "duration_s", "period_s", "ramp_s"}


_ALWAYS = (
    "mode", "control_period_s", "robot_description_file", "ee_frame", "joint_names", "gravity", "effort.gravity",
    "trajectory.kind", "governor.mode", "governor.friction", "safety.auto_enable", "object.mass", "contacts.position",
)  # fmt: skip
"""Parameters that the file for the real arm names although they have their defaults."""
_REAL_HEAD = """\
# The first start on the real arm: it holds where it is (trajectory.kind hold), stays in HOLD until it is enabled
# (safety.auto_enable false), and is governed. Read every line; then follow docs/robot.md: gravity and signs first,
# `slip-vic bringup` next, a motion last.
"""


class Arm:
    """An arm that was read from a file.

    Args:
        text: the URDF as distributed; name: its name in errors.
        link, approach, normal: of the hand; empty ones are found.
        reach: from the link's origin to the pad centre [m].
        locked: joints that stay somewhere: name -> position [rad, m].
        limits: in the place of those of the file, as in `arm_urdf`.
        by_effort: whether its drives have an effort interface.

    Raises:
        InputError: what keeps it from being used, with the name of the joint or link.
    """

    def __init__(
        self,
        text: str,
        *,
        name: str = "robot_description",
        link: str = "",
        approach: str = "",
        normal: str = "",
        reach: float = 0.0,
        locked: dict[str, float] | None = None,
        limits: Limits | None = None,
        by_effort: bool = True,
    ) -> None:
        if not abs(reach) <= LONGEST_REACH_M:
            raise InputError("--reach", got=f"{reach:g}", expected=f"metres, within {LONGEST_REACH_M:g}")
        root = parse_urdf(text, name)
        stays = locked or {}
        self.hand: Hand = find_hand(root, link, approach, normal, tuple(stays))
        self.urdf, said = arm_urdf(root, self.hand, reach, stays, limits or {}, by_effort=by_effort)
        self.said = [*self.hand.said, *said]
        if reach == 0.0:
            at = "the pad centre is at that link's origin: the object sits in the flange"
            self.said.append(f"{at} (--reach METRES moves it out)")
        self.robot = Robot(self.urdf, PAD, self.hand.joints)

    def task(self, base: str, scale: float) -> tuple[dict[str, Any], Start, list[str]]:
        """Return the content of a scenario file for this arm, the start that was found for it, and what was assumed.

        Args:
            base: a scenario; its arm's hand starts in the attitude that this one's starts in.
            scale: of the path's size; its time has the root of it, so that accelerations stay.

        Raises:
            InputError: where no start has the whole path within reach, speed and effort.
        """
        known = load(base)
        controller = known.controller
        rotation = Robot(known.urdf, controller.ee_frame, controller.joint_names).frame(
            np.array(known.bridge.initial_position)
        )[1]
        times, path = pad_path(controller.trajectory)
        weight = controller.object.mass * np.array(controller.gravity)
        robot = Robot(self.urdf, PAD, self.hand.joints, controller.gravity)
        start = best_start(robot, postures(robot, rotation), math.sqrt(scale) * times, scale * path, weight)
        reason = failing(start, robot, controller)
        if start is None or reason:
            fix = "try a smaller --scale, another --scenario, --approach or --normal"
            if len(self.hand.joints) > len(AXES):
                fix += ", or keep a joint that is too slow where it is: --lock JOINT=VALUE"
            expected = "a start from which its path can be followed"
            raise InputError(f"scenario {known.name} with this arm", got=reason, expected=expected, fix=fix)
        content, said = self._content(base, start, scale), []
        if not start.way.given.all():
            said.append(self._follows(content["controller"]["trajectory"], start, path[-1]))
        wrist = judge_inertia(controller, robot.joint_names, robot.inertia)
        if not wrist.holds:
            content["shared"]["drive"] = {"armature": [ROTOR]}
            said.append(f"{wrist.reason}: {ROTOR:g} kg m2 is assumed for every joint, correct it from the data sheet")
        return content, start, said

    def _follows(self, trajectory: dict[str, Any], start: Start, end: Array) -> str:
        """Let a path turn the hand as an arm with few joints does that follows it; return a line about it.

        trajectory: of the scenario file, changed; end: of its path (6,) [m, rad].
        """
        first, last = (self.robot.frame(q)[1] for q in start.way.joints[[0, -1]])
        turned = np.round(Rotation.from_matrix(last @ first.T).as_rotvec(), _ROUNDED).tolist()
        if "rotation" in trajectory:
            trajectory["rotation"] = turned
        axes = [[name for name, there in zip(AXES, start.way.given, strict=True) if there == kept] for kept in (1, 0)]
        asked, does = (", ".join(f"{value:.2f}" for value in values) for values in (end[3:], turned))
        return (
            f"{len(self.hand.joints)} joints: the law commands {', '.join(axes[0])}; the arm's posture decides "
            f"{', '.join(axes[1])}: the hand turns by [{does}] rad on this path, for [{asked}] in the scenario"
        )

    def _content(self, base: str, start: Start, scale: float) -> dict[str, Any]:
        text = preset_text("scenarios", base)
        content: dict[str, Any] = read_yaml(text)
        content |= {key: nested_names(flat_names(content.get(key, {}))) for key in ("shared", "controller", "bridge")}
        shared, controller, bridge = content["shared"], content["controller"], content["bridge"]
        controller.setdefault("trajectory", {})
        shared |= {
            "robot_description_file": URDF_NAME, "joint_names": list(self.hand.joints), "ee_frame": PAD,
        }  # fmt: skip
        for part in (controller, bridge):
            part.pop("robot_description_file", None)
        if scale != 1.0:
            _scale(controller["trajectory"], scale)
        way = start.way
        bridge["initial_position"] = np.round(start.posture, _ROUNDED).tolist()
        sources = content.get("sources", [])
        sources = [sources] if isinstance(sources, str) else sources
        content["sources"] = [
            *(line for line in sources if not line.startswith("initial_position")),
            f"initial_position: by `slip-vic arm`; on the whole path every joint stays {way.margin.min():.2f} away "
            f"from its limits and the smallest singular value of the Jacobian above {way.sigma:.2f}",
        ]
        return content


def _scale(trajectory: dict[str, Any], scale: float) -> None:
    """Make a trajectory of a scenario file larger or smaller, at equal accelerations."""
    for keys, factor in ((_LENGTHS, scale), (_TIMES, math.sqrt(scale))):
        for key in keys & trajectory.keys():
            trajectory[key] = np.round(np.multiply(factor, trajectory[key]), _ROUNDED).tolist()


def failing(start: Start | None, robot: Robot, params: ControllerParams) -> str:
    """Return why a start will not do; empty where it will."""
    if start is None:
        return "no posture with the hand in the attitude of the start"
    way, least = start.way, params.singularity.sigma_min
    if way.blocked:
        return f"a path that ends after {100.0 * way.share:.0f} % of its time: {way.blocked}"
    share, limit = max((way.speed, "velocity"), (way.load, "effort"), key=lambda one: float(one[0].max()))
    worst = int(share.argmax())
    if share[worst] >= 1.0:
        return f"{robot.joint_names[worst]} at {100.0 * share[worst]:.0f} % of its {limit} limit on the path"
    near = int(way.margin.argmin())
    if way.margin[near] < params.safety.limits.position_margin:
        margin = params.safety.limits.position_margin
        return f"{robot.joint_names[near]} {way.margin[near]:.2g} rad from its limit on the path, inside {margin:g}"
    if way.sigma < least:
        return f"a path through a singular posture (least singular value {way.sigma:.2g}, sigma_min is {least:g})"
    return ""


def write_arm(
    arm: Arm, tasks: dict[str, dict[str, Any]], folder: Path, source: Path, drive: str = "", sensor: str = "",
    driver: Driver | None = None,
) -> list[Path]:  # fmt: skip
    """Write the arm, its scenarios and the parameter files for the real one; return their paths.

    Args:
        arm: the arm.
        tasks: content of its scenario files by their names.
        folder: where to.
        source: file of the arm.
        drive, sensor: names or files, of which the parameters for the real arm have the interface, rates and delays.
        driver: of the real arm, for which it gets controllers and launch files.

    Raises:
        InputError: where the folder cannot be written, or has a file that was edited.
    """
    head = f"# Made by `slip-vic arm {source.name}`; edit it as you like.\n"
    files = {URDF_NAME: arm.urdf}
    for name, content in tasks.items():
        text = yaml.safe_dump(content, sort_keys=False, default_flow_style=None, width=120, allow_unicode=True)
        files[f"{name}.yaml"] = head + text
    _write(folder, files)
    settings = driver.settings if driver else {}
    real = {}
    for name in tasks:
        path = str(folder.absolute() / f"{name}.yaml")
        loaded = load(path, law="governed", drive=drive, sensor=sensor)
        real[f"{name}_controller_realtime.yaml"] = real_parameters(loaded, driver)
    more = {
        name: f"{_REAL_HEAD}{commented_file(params, NODES['controller'][0], (*_ALWAYS, *settings))}"
        for name, params in real.items()
    }
    if driver is not None:
        more |= driver_files(driver, real, arm.hand.link)
    _write(folder, more)
    return [folder / name for name in (*files, *more)]


def _write(folder: Path, files: dict[str, str]) -> None:
    """Write files to a folder, unless one there was edited since; their digests are kept beside them.

    Raises:
        InputError: with the file that was edited.
    """
    record = folder / DIGESTS
    lines = record.read_text(encoding="utf-8").splitlines() if record.is_file() else []
    made = {name: digest for digest, _, name in (line.partition("  ") for line in lines)}
    for name in files:
        path = folder / name
        if path.exists() and hashlib.sha256(path.read_bytes()).hexdigest() != made.get(name):
            raise InputError(
                f"output {path}", got="a file that was edited", expected="one as `slip-vic arm` wrote it",
                fix="another --out, or move it away",
            )  # fmt: skip
    made |= {name: hashlib.sha256(text.encode()).hexdigest() for name, text in files.items()}
    write_files(folder, files | {DIGESTS: "".join(f"{digest}  {name}\n" for name, digest in made.items())})


def real_parameters(scenario: Scenario, driver: Driver | None = None) -> ControllerParams:
    """Return the controller's parameters for the first start on the real arm of a scenario.

    It holds the arm where it finds it, and does not leave HOLD by itself; the governor learns the friction instead of
    trusting the scenario's. Its period is that of the arm's joint states.
    """
    known = scenario.controller
    rate = known.joint_sensor.rate_hz
    values = {name: value for name, value in flatten(known).items() if not name.startswith("trajectory.")}
    values |= {
        "mode": "realtime",
        "control_period_s": 1.0 / rate if rate > 0.0 else known.control_period_s,
        "governor.friction": "unknown",
        "safety.auto_enable": False,
        "publish_effort_array": driver is not None and known.command.interface == "effort",
    }
    values |= driver.settings if driver else {}
    return build(ControllerParams, values, f"scenario {scenario.name}: the real arm")


def way_table(arm: Arm, name: str, start: Start) -> str:
    """Return the table of one start: a row per joint."""
    way, robot = start.way, arm.robot
    columns = {
        "start": start.posture, "lower": robot.position_lower, "upper": robot.position_upper, "to a limit": way.margin,
        "speed [%]": 100.0 * way.speed, "effort [%]": 100.0 * way.load,
    }  # fmt: skip
    shown = pd.DataFrame(columns, index=robot.joint_names).map(lambda x: np.nan if abs(x) > 0.5 * NO_LIMIT else x)
    text = shown.to_string(float_format="{:.3g}".format, na_rep="none")
    return f"{name}: start, and the path from it (singular value {way.sigma:.2f})\n{text}"
