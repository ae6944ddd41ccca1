"""What `slip-vic retime` does: read, time, certify, write."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from slip_core.arrays import Array
from slip_core.errors import InputError
from slip_core.records import new, record
from slip_vic.options import Choice
from slip_vic.retime import output
from slip_vic.retime.certificate import arm_shares, certified
from slip_vic.retime.path import GivenPath, PadPath, read_points
from slip_vic.retime.timing import held_object
from slip_vic.scenarios.scenario import Scenario
from slip_vic_controller.governor.layouts import GOVERNOR_CONFIG
from slip_vic_controller.params.controller_params import ControllerParams
from slip_vic_controller.path.joint_path import JointPath
from slip_vic_controller.session.controller import ArmController
from slip_vic_controller.state import CONFIG


def run_retime(source: Path, choice: Choice, out: Path, *, timing: str = "slow_down", topic: str = "") -> Iterator[str]:
    """Retime a path and write the results below `out`; yield what there is to say, a line each.

    Args:
        source: CSV file or bag.
        choice: the scenario whose arm, object, grip and friction count.
        out: folder.
        timing: slow_down or time_optimal.
        topic: of the trajectory in a bag with several.

    Raises:
        InputError: a path that is none, or that friction cannot carry.
    """
    given = read_points(source, topic)
    params, controller = governed(choice.load(), timing)
    path: GivenPath = PadPath(given) if given.of_pad else JointPath(given, controller.robot)
    motion, certificate = certified(path, params, governor_config(controller))
    data = output.certificate_data(certificate, motion, path.duration)
    out.mkdir(parents=True, exist_ok=True)
    output.write_csv(out / "trajectory.csv", path.names, motion)
    if not given.of_pad:
        output.write_goal(out / "follow_joint_trajectory.yaml", path.names, motion)
        output.write_bag(out / "trajectory.mcap", path.names, motion)
        speeds, efforts = arm_shares(controller.robot, held_object(params), np.array(params.gravity), motion)
        data |= {"peak_velocity_share": float(speeds.max()), "peak_effort_share": float(efforts.max())}
    (out / "certificate.json").write_text(json.dumps(data, indent=2) + "\n", encoding="utf-8")
    output.write_page(out / "retime.html", f"{source.name} retimed", data, output.draw(certificate, motion))
    yield f"arrival {data['arrival_s']:.3f} s; the path as given takes {path.duration:.3f} s"
    yield f"load at most {100.0 * certificate.peak_share:.2f} % of the friction, at {data['peak_at_s']:.3f} s"
    for what in ("velocity", "effort"):
        share = data.get(f"peak_{what}_share", 0.0)
        if share > 1.0:
            joints = speeds if what == "velocity" else efforts
            name = controller.robot.joint_names[int(joints.argmax())]
            yield f"warning: {name} would need {100.0 * share:.0f} % of its {what} limit"
    yield f"written: {out}"


def governed(loaded: Scenario, timing: str) -> tuple[ControllerParams, ArmController]:
    """Return the parameters with a governor of this kind, and their controller.

    Raises:
        InputError: more than one arm holds the object.
    """
    if loaded.several:
        raise InputError(
            "scenario", got=f"{loaded.name}, in which several arms hold the object", expected="one arm",
            fix="how arms share a load depends on their controllers; run the scenario governed instead",
        )  # fmt: skip
    params = loaded.controller.model_copy(
        update={
            "governor": loaded.controller.governor.model_copy(update={"mode": timing, "friction": "known"}),
            "trajectory": loaded.controller.trajectory.model_copy(update={"kind": "goal"}),
        }
    )
    return params, ArmController(params, loaded.urdf, lockstep=True)


def governor_config(controller: ArmController) -> Array:
    """Return the GOVERNOR_CONFIG of a controller."""
    buffer = new(GOVERNOR_CONFIG)
    buffer.view(GOVERNOR_CONFIG)[0] = record(controller.config, CONFIG).governor
    return buffer
