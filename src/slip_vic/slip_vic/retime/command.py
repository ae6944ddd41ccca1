"""What `slip-vic retime` does: read, time, certify, write."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from slip_core.arrays import Array
from slip_core.errors import InputError
from slip_vic.options import Choice
from slip_vic.retime.certificate import arm_shares, certified, load_shares, motion_of
from slip_vic.retime.output import csv_text, goal_text
from slip_vic.retime.path import PadPath, deviation, read_points, sections
from slip_vic.retime.timing import Sample
from slip_vic.scenarios.parameter_files import write_files
from slip_vic.scenarios.scenario import Scenario, load_scenario
from slip_vic_controller.path.joint_path import JointPath
from slip_vic_controller.session.controller import ArmController


def run_retime(source: Path, choice: Choice, out: Path) -> Iterator[str]:
    """Retime a path and write the results below `out`; yield what there is to say, a line each.

    Args:
        source: CSV file.
        choice: the scenario whose arm, object, grip and friction count.
        out: folder.

    Raises:
        InputError: a path that is none, or that friction cannot carry; a folder that cannot be written.
    """
    loaded = load_scenario(**choice)
    given = read_points(source, loaded.controller.joint_names)
    timed = len(given.times) > 0
    controller = governed(loaded, "slow_down" if timed else "time_optimal")
    params, samples = controller.params, list[Sample]()
    for part, wait_s in sections(given, controller.params.governor.torsional_radius):
        path = PadPath(part) if given.of_pad else JointPath(part, controller.robot)
        samples += certified(path, controller)[len(samples) > 0 :]  # one begins where the one before has ended
        samples += [Sample(path, samples[-1].time, 0.0, 0.0)] * round(wait_s / params.control_period_s)
    motion = motion_of(samples, params.control_period_s)
    loads, margin = load_shares(params, motion), params.governor.margin
    peak, at_s, away = float(loads.max()), float(motion.times[loads.argmax()]), deviation(given, motion.position)
    data: dict[str, Any] = {
        "holds": peak <= margin,
        "arrival_s": float(motion.times[-1]),
        "duration_given_s": float(given.times[-1]) if timed else None,
        "friction_limit_n": params.governor.friction_limit,
        "margin": margin,
        "peak_share": peak,
        "peak_at_s": at_s,
        "deviation": away,
        "samples": len(samples),
    }
    shares: dict[str, Array] = {}
    files = {"trajectory.csv": csv_text(given.names, motion)}
    if not given.of_pad:
        files["follow_joint_trajectory.yaml"] = goal_text(given.names, motion)
        shares = arm_shares(controller, motion)
        data |= {f"peak_{what}_share": float(share.max()) for what, share in shares.items()}
    write_files(out, files | {"certificate.json": json.dumps(data, indent=2) + "\n"})
    as_given = f"; the path as given takes {given.times[-1]:.3f} s" if timed else ""
    yield f"arrival {motion.times[-1]:.3f} s{as_given}"
    unit, scale = ("mm", 1e3) if given.of_pad else ("rad", 1.0)
    yield f"at most {scale * away:.3g} {unit} from the straight lines between the points"
    yield f"load at most {100.0 * peak:.2f} % of the friction, at {at_s:.3f} s"
    for what, share in shares.items():
        if share.max() > 1.0:
            name = controller.robot.joint_names[int(share.argmax())]
            yield f"warning: {name} would need {100.0 * share.max():.0f} % of its {what} limit"
    yield f"written: {out}"


def governed(loaded: Scenario, timing: str) -> ArmController:
    """Return the controller of a scenario with a governor of this kind.

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
    return ArmController(params, loaded.urdf, lockstep=True)
