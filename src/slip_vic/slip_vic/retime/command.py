"""What `slip-vic retime` does: read, time, certify, write."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

from slip_core.arrays import Array
from slip_core.errors import InputError
from slip_core.records import new, record
from slip_vic.options import Choice
from slip_vic.retime import output
from slip_vic.retime.certificate import arm_shares, certified, certify, joined
from slip_vic.retime.path import GivenPath, PadPath, deviation, in_order, read_points, sections
from slip_vic.retime.timing import held_object
from slip_vic.scenarios.scenario import Scenario, load_scenario
from slip_vic_controller.governor.layouts import GOVERNOR_CONFIG
from slip_vic_controller.params.controller_params import ControllerParams
from slip_vic_controller.path.joint_path import JointPath
from slip_vic_controller.session.controller import ArmController
from slip_vic_controller.state import CONFIG


def run_retime(source: Path, choice: Choice, out: Path) -> Iterator[str]:
    """Retime a path and write the results below `out`; yield what there is to say, a line each.

    Args:
        source: CSV file.
        choice: the scenario whose arm, object, grip and friction count.
        out: folder.

    Raises:
        InputError: a path that is none, or that friction cannot carry.
    """
    given = read_points(source)
    timed = len(given.times) > 0
    params, controller = governed(load_scenario(**choice), "slow_down" if timed else "time_optimal")
    parts, config = sections(given, params.governor.torsional_radius), governor_config(controller)
    paths: list[GivenPath] = [
        PadPath(part.points) if given.of_pad else JointPath(part.points, controller.robot) for part in parts
    ]
    motions = [certified(path, params, config)[0] for path in paths]
    motion = joined(motions, [part.wait_s for part in parts], params.control_period_s)
    certificate = certify(params, held_object(params), motion)
    ordered = given if given.of_pad else in_order(given, controller.robot.joint_names)
    data = output.certificate_data(
        certificate, motion, float(given.times[-1]) if timed else None, deviation(ordered, motion.position)
    )
    shares: dict[str, Array] = {}
    out.mkdir(parents=True, exist_ok=True)
    output.write_csv(out / "trajectory.csv", paths[0].names, motion)
    if not given.of_pad:
        output.write_goal(out / "follow_joint_trajectory.yaml", paths[0].names, motion)
        shares = arm_shares(controller.robot, params, motion)
        data |= {f"peak_{what}_share": float(share.max()) for what, share in shares.items()}
    (out / "certificate.json").write_text(json.dumps(data, indent=2) + "\n", encoding="utf-8")
    as_given = f"; the path as given takes {given.times[-1]:.3f} s" if timed else ""
    yield f"arrival {data['arrival_s']:.3f} s{as_given}"
    unit, scale = ("mm", 1e3) if given.of_pad else ("rad", 1.0)
    yield f"at most {scale * data['deviation']:.3g} {unit} from the straight lines between the points"
    yield f"load at most {100.0 * certificate.peak_share:.2f} % of the friction, at {data['peak_at_s']:.3f} s"
    for what, share in shares.items():
        if share.max() > 1.0:
            name = controller.robot.joint_names[int(share.argmax())]
            yield f"warning: {name} would need {100.0 * share.max():.0f} % of its {what} limit"
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
