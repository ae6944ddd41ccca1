"""Freeze a suite of the benchmark: worlds of both tracks, their grippers, and the fastest slip-free time of each.

python tools/freeze_suite.py WORLDS.jsonl.gz       # writes src/slip_vic/slip_vic/experiments/carry-....jsonl.gz
"""

from __future__ import annotations

import dataclasses
import gzip
import json
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np

from slip_core.arrays import Array, inertia_from_six, matrix_from_quat_xyzw
from slip_core.records import new, record
from slip_vic.experiments.suite import SUITE
from slip_vic.experiments.world import World
from slip_vic.presets.models import GripperPreset, load_preset
from slip_vic.run.versions import digest
from slip_vic.scenarios.scenario import NodeValues, apply_preset
from slip_vic_controller.config.controller import ArmController
from slip_vic_controller.governor.layouts import GOVERNOR_CONFIG
from slip_vic_controller.governor.plan import GRID_POINTS, at_rest, range_of_u, sample_time
from slip_vic_controller.path.paths import reference_at
from slip_vic_controller.path.retiming import MEMORY, plan_timing
from slip_vic_controller.state import CONFIG

OUT = Path(__file__).parents[1] / f"src/slip_vic/slip_vic/experiments/{SUITE}.jsonl.gz"
GRIPPERS = ("robotiq_2f140", "franka_hand", "wsg50", "servo")
CAP = {1: 10.0, 2: 24.0}
"""Largest squeeze of the free track by the number of arms [N]: of two it is twice what the scenarios have."""
FORCES = ("least_force", "quantum", "hysteresis", "error_force", "cap")
STEPS = 50
"""Of the bisection for what the path's rate may grow to between two points."""


def gripper_settings(name: str, cap: float) -> list[str]:
    """Return the settings of a gripper whose forces are scaled so that its largest is the cap [N]."""
    values: NodeValues = {"controller": {}, "bridge": {}}
    preset = load_preset(GripperPreset, name)
    apply_preset(values, preset)
    scale = cap / preset.controller["grip.cap"]
    return [
        f"{node}.{key}={value * (scale if key.removeprefix('grip.') in FORCES else 1.0)!r}"
        for node, own in values.items()
        for key, value in own.items()
    ]


def fastest(world: World, grip: float | None) -> float:
    """Return the fastest time in which the path, never faster than given, is carried without slip [s].

    By the governor's plan with the object and the least friction that the world has; infinite where that does not carry
    the weight. grip: squeeze [N]; None: that of the scenario.
    """
    scenario = world.load("governed", ("controller.governor.margin=1.0", "controller.governor.reserve=0.0"))
    params, bridge = scenario.controller, scenario.bridge
    one = next(iter(scenario.controllers.values())).trajectory
    lasts = one.start_s + one.duration_s
    if scenario.several:
        return lasts
    of, friction = bridge.friction, params.governor.model_copy(update={"friction": "known"})
    left = of.falls_to if of.falls_at_s > 0.0 else 1.0
    limit = left * (of.mu_k if of.model == "coulomb" else of.mu_s) * (grip or bridge.grip.force)
    known = params.model_copy(
        update={
            "governor": friction.model_copy(update={"friction_limit": limit, "torsional_radius": of.torsional_radius})
        }
    )
    arm = ArmController(known, scenario.urdf, lockstep=True)
    planned, path = record(arm.config, CONFIG).governor, record(arm.config, CONFIG).path
    config, memory = new(GOVERNOR_CONFIG), new(MEMORY)
    config.view(GOVERNOR_CONFIG)[0] = planned
    of_config: Any = record(config, GOVERNOR_CONFIG)
    of_config.path_margin, of_config.duration = 1.0, path.knot[int(path.segments)] if path.segments else path.duration
    held: Any = record(memory, MEMORY)
    R = matrix_from_quat_xyzw(bridge.contacts.orientation_xyzw[:4])
    held.mass = bridge.object.mass
    held.inertia[:] = R.T @ inertia_from_six(bridge.object.inertia, "inertia") @ R
    held.r[:] = R.T @ np.array(bridge.contacts.position[:3])
    position, rotation, _ = arm.robot.frame(np.array(bridge.initial_position))
    motion: list[Array] = []
    for i in range(GRID_POINTS):
        point = reference_at(path, sample_time(int(of_config.mode), i, float(of_config.duration)), position, rotation)
        _, turned, twist, acceleration = (np.array(part, dtype=float) for part in point)
        motion.append(np.concatenate((turned.ravel(), twist.ravel(), acceleration.ravel())))
    plan_timing(config, memory, np.array(motion))
    if held.governor.infeasible:
        return math.inf
    return lasts + forward(held.grid, limit, float(held.governor.rate)) - float(of_config.duration)


def forward(grid: Any, F: float, rate: float) -> float:
    """Return the time of the fastest motion below K under a load F [N], from sdot = rate."""
    x, time = rate * rate, 0.0
    for i in range(GRID_POINTS - 1):
        point, after = grid[i], grid[i + 1]
        way = after.s - point.s
        low, high = range_of_u(point.uu, point.ux * x + point.uc, (point.xx * x + 2.0 * point.xc) * x + point.cc, F)[:2]
        most = after.K if at_rest(point, F) else min(after.K, x + 2.0 * way * max(high, low))
        most = max(most, 0.0)
        if x + most <= 0.0:
            return math.inf
        time += 2.0 * way / (math.sqrt(x) + math.sqrt(most))
        x = most
    return time


def frozen(worlds: list[World]) -> list[dict[str, Any]]:
    """Return the rows of the suite."""
    rows = []
    for world in worlds:
        for track in ("capped", "free"):
            settings = [one for one in world.settings if not one.startswith("bridge.duration_s=")]
            cap = CAP[world.arms]
            if track == "free":
                settings.append(f"controller.grip.cap={cap}")
                if world.arms == 1 and world.number % 4 in (0, 3):
                    settings += gripper_settings(GRIPPERS[world.number // 4 % len(GRIPPERS)], cap)
            made = dataclasses.replace(world, set=SUITE, track=track, settings=tuple(settings), frozen="")
            seconds = fastest(made, cap if track == "free" else None)
            print(made.number, made.arms, track, seconds, file=sys.stderr)
            whole = dataclasses.replace(made, fastest_s=seconds)
            whole = dataclasses.replace(whole, frozen=digest([made.digest.encode(), repr(seconds).encode()]))
            rows.append(dataclasses.asdict(whole))
    return rows


if __name__ == "__main__":
    given = gzip.decompress(Path(sys.argv[1]).read_bytes()).splitlines()
    kept = [row for row in map(json.loads, given) if row["set"].startswith("carry")]
    worlds = [World(**row | {"settings": tuple(row["settings"])}) for row in kept]
    made = sorted(frozen(worlds), key=lambda row: (row["arms"], row["track"], row["number"]))
    text = "\n".join(json.dumps(row) for row in made) + "\n"
    OUT.write_bytes(gzip.compress(text.encode(), mtime=0))
    print(f"{len(made)} worlds, digest {digest(row['frozen'].encode() for row in made)}")
