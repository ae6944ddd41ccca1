"""What a recorded run with two arms is judged by: the numbers of `measures`, from its bag."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from slip_bags.reader import Bag
from slip_bags.series import Series
from slip_core.arrays import Array
from slip_core.errors import InputError
from slip_core.incidents import Incident
from slip_vic.pair.measures import LOST_PATH_M, LOST_SLIP_M, SETTLE_S, Judged
from slip_vic.pair.scenario import SIDES, PairScenario


def judge_bag(
    path: Path, scenario: PairScenario, incidents: Sequence[Incident] = ()
) -> tuple[Judged, list[tuple[float, ...]]]:
    """Return the verdict on a run of a scenario, and its rows of `COLUMNS`.

    The path is looked at where the controller has published its reference, which it does not in every cycle.

    Raises:
        InputError: the bag lacks a topic that such a run has.
    """
    with Bag(path) as bag:
        state = _series(bag, "object_state")
        slips = [_series(bag, f"{side}/slip_truth")["position"] for side in SIDES]
        parts = [_six(_series(bag, f"{side}/internal_wrench"), "wrench.force", "wrench.torque") for side in SIDES]
        wrenches = [_six(_series(bag, f"{side}/wrench"), "wrench.force", "wrench.torque") for side in SIDES]
        loads = [_load(scenario, k, wrench, len(slips[k])) for k, wrench in enumerate(wrenches)]
        off = _off_path(scenario, state, _series(bag, "left/controller/reference_pose"))
    times = _seconds(state)
    slip = np.stack([np.linalg.norm(each[:, :3], axis=1) for each in slips], axis=1)
    internal = np.max([np.linalg.norm(part[:, :2], axis=1) for part in parts], axis=0)
    moment = np.max([np.abs(part[:, 5]) for part in parts], axis=0)
    load = np.stack(loads, axis=1)
    ends = [incident for incident in incidents if incident.kind in ("fault", "lost")]
    lost = slip.max() >= LOST_SLIP_M or np.nanmax(off) >= LOST_PATH_M
    outcome = ends[0].kind if ends else "lost" if lost else "ok"
    steady = internal[times >= times[-1] - SETTLE_S].max()
    judged = Judged(
        outcome, str(ends[0]) if ends else "", (float(slip[:, 0].max()), float(slip[:, 1].max())),
        float(internal.max()), float(steady), (float(load[:, 0].max()), float(load[:, 1].max())),
        float(np.nanmax(off)),
    )  # fmt: skip
    columns = (times, slip[:, 0], slip[:, 1], internal, moment, load[:, 0], load[:, 1], off)
    return judged, list(zip(*(column.tolist() for column in columns), strict=True))


def _load(scenario: PairScenario, side: int, wrench: Array, count: int) -> Array:
    """Return the share of the friction limit that a pad carries; the newest wrench at each tick, (count,)."""
    arm = list(scenario.bridges.values())[side]
    h = wrench[np.minimum(np.arange(count), len(wrench) - 1)]
    size = np.sqrt(h[:, 0] ** 2 + h[:, 1] ** 2 + (h[:, 5] / arm.friction.torsional_radius) ** 2)
    return np.array(size / (arm.friction.mu_s * arm.grip.force))


def _off_path(scenario: PairScenario, state: Series, reference: Series) -> Array:
    """Return how far the object is from its reference, but for where it hangs at first; (N,) [m], NaN without one."""
    grasp = scenario.controllers[0].contacts
    lever = Rotation.from_quat(grasp.orientation_xyzw[:4]).inv().apply(grasp.position[:3])
    wanted = _columns(reference, "pose.position.", "xyz") - Rotation.from_quat(
        _columns(reference, "pose.orientation.", "xyzw")
    ).apply(lever)
    position, own, at = _columns(state, "pose.pose.position.", "xyz"), _stamps(state), _stamps(reference)
    found = np.clip(np.searchsorted(own, at), 0, len(own) - 1)
    apart = position[found] - wanted
    distance = np.linalg.norm(apart - apart[0], axis=1)
    longest = int(np.diff(at).max(initial=0))  # a controller that gives up has no reference any more
    return np.where((own < at[0]) | (own > at[-1] + longest), np.nan, np.interp(own, at, distance))


def _series(bag: Bag, topic: str) -> Series:
    full = next((name for name in bag.topics if name.endswith(f"/{topic}")), None)
    found = bag.series(full) if full else None
    if found is None or not found.count:
        raise InputError(f"bag {bag.path}", got=f"no message on {topic}", expected="a recorded run of two arms")
    return found


def _stamps(series: Series) -> Any:
    assert series.stamp_ns is not None, "every topic here has a header"
    return series.stamp_ns


def _seconds(series: Series) -> Array:
    stamps = _stamps(series)
    return np.array((stamps - stamps[0]) * 1e-9)


def _columns(series: Series, prefix: str, parts: str) -> Array:
    return np.stack([series[prefix + part] for part in parts], axis=1)


def _six(series: Series, linear: str, angular: str) -> Array:
    return np.hstack([_columns(series, f"{linear}.", "xyz"), _columns(series, f"{angular}.", "xyz")])
