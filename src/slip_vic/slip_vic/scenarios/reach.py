"""How far an arm can follow a scenario's path: inverse kinematics, before anything is started."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from slip_core.arrays import Array
from slip_core.compiled import interpreted
from slip_core.errors import InputError
from slip_sim_bridge.params import BridgeParams
from slip_vic_controller.law.torque import given_axes
from slip_vic_controller.params.controller_params import ControllerParams, SingularityParams, TrajectoryParams
from slip_vic_controller.path.paths import make_path, sample_path
from slip_vic_controller.robot import Robot

SIGMA_MIN: Final = SingularityParams().sigma_min
"""Singular value of the Jacobian below which torques are damped, where nothing else is configured."""
REACHED = 1e-4
"""[m, rad] Pose error below which a point counts as reached: a tenth of what counts as arriving."""
POINTS = 60
_ITERATIONS = 40
_LONGEST_STEP = 0.3
"""[rad, m] of a joint in one iteration: longer ones jump to another branch of solutions."""
_DAMPING = 1e-8
"""Square of a singular value: keeps steps finite in singular postures."""
_PULL = 0.3
"""Share of the way back to the first posture per iteration, in the null space: what the controller's spring does."""


class Way(NamedTuple):
    """What the path of a scenario requires of an arm.

    joints (k, n): positions at the points reached; share: reached part of the time, 1 = all;
    blocked: why it ends there, empty where it does not; margin (n,) [rad, m]: least distance to a limit;
    sigma: least singular value of the Jacobian; speed (n,): largest share of the velocity limit; load (n,): largest
    share of the effort limit that arm and object at rest take; given (6,): axes that the arm gives in every posture.
    """

    joints: Array
    share: float
    blocked: str
    margin: Array
    sigma: float
    speed: Array
    load: Array
    given: Array


def axes_of(J: Array, least: float) -> Array:
    """Return which axes of the pad (6,) an arm with the Jacobian J (6, n) gives; least: as in `given_axes`."""
    given = np.ones(6, np.int64)
    interpreted(given_axes)(np.ascontiguousarray(J), least, given)
    return given == 1


def posture_for(
    robot: Robot, q: Array, position: Array, rotation: Array, home: Array, least: float = SIGMA_MIN
) -> Array | None:
    """Return joint positions with {ee} at a pose, by damped Gauss-Newton from `q` (n,); None where it fails.

    Of an arm with fewer than six joints it is at the pose on the axes that the arm gives.

    position (3,) [m], rotation (3, 3) {w}; home (n,): posture that other joints are pulled to; least: as in `axes_of`.
    """
    for _ in range(_ITERATIONS):
        error, J = robot.way_to(q, position, rotation)
        given = axes_of(J, least)
        if not given[5]:  # any attitude about the vertical will do, and large errors about it mix with tilts
            rotation = Rotation.from_rotvec([0.0, 0.0, -error[5]]).as_matrix() @ rotation
        error, J = error[given], J[given]
        if np.abs(error).max() < REACHED:
            return q
        back = _PULL * (home - q)
        step = back + J.T @ np.linalg.solve(J @ J.T + _DAMPING * np.eye(len(J)), error - J @ back)
        q = q + step * min(1.0, _LONGEST_STEP / max(float(np.abs(step).max()), 1e-12))
    return None


def pad_path(trajectory: TrajectoryParams, points: int = POINTS) -> tuple[Array, Array]:
    """Return times (k,) [s] and displacement with rotation vector (k, 6) [m, rad] {w} of a built-in trajectory."""
    times = np.linspace(0.0, trajectory.duration_s, points)
    values = np.zeros((points, 6))
    sample_path(make_path(trajectory), times, values)
    return times, values


def follow(robot: Robot, start: Array, times: Array, path: Array, payload: Array, least: float = SIGMA_MIN) -> Way:
    """Follow a path, as `pad_path` gives it, from joint positions `start` (n,); payload (3,) [N] {w} hangs at {ee}."""
    position, rotation, _ = robot.frame(start)
    joints: list[Array] = []
    sigma, load, blocked, given = math.inf, np.zeros(len(start)), "", np.ones(6, bool)
    q = start
    for point in path:
        found = posture_for(
            robot, q, position + point[:3], Rotation.from_rotvec(point[3:]).as_matrix() @ rotation, start, least
        )
        if found is None:
            blocked = "no posture of the arm gets the pad there"
            break
        outside = (found < robot.position_lower) | (found > robot.position_upper)
        if outside.any():
            j = int(outside.argmax())
            low, high = robot.position_lower[j], robot.position_upper[j]
            blocked = (
                f"{robot.joint_names[j]} would have to go to {found[j]:.4g}, beyond its limits {low:.4g}..{high:.4g}"
            )
            break
        q = found
        joints.append(q)
        J = robot.frame(q)[2]
        axes = axes_of(J, least)
        given &= axes
        sigma = min(sigma, smallest(J[axes]))
        load = np.maximum(load, np.abs(robot.gravity(q) - J[:3].T @ payload) / robot.effort_limit)
    way = np.array(joints).reshape(-1, len(start))
    steps = np.diff(way, axis=0) / np.diff(times[: max(len(way), 1)])[:, None]
    return Way(
        way,
        len(way) / len(path),
        blocked,
        np.minimum(way - robot.position_lower, robot.position_upper - way).min(axis=0, initial=math.inf),
        sigma,
        (np.abs(steps) / robot.velocity_limit).max(axis=0, initial=0.0),
        load,
        given,
    )


def smallest(J: Array) -> float:
    """Return the smallest singular value of a matrix."""
    return float(np.linalg.svd(J, compute_uv=False)[-1])


def check_start(robot: Robot, controller: ControllerParams, bridge: BridgeParams) -> None:
    """Check that the arm can follow a scenario's path from its start.

    Raises:
        InputError: a start beyond a limit or in a singular posture, a path that leaves the arm's reach.
    """
    start, least = np.array(bridge.initial_position), controller.singularity.sigma_min
    J = robot.frame(start)[2]
    sigma, name, got = smallest(J[axes_of(J, least)]), "", ""
    if sigma < least:
        name, got = "initial_position", f"a singular posture (least singular value of the Jacobian {sigma:.2g})"
    times, path = pad_path(controller.trajectory)
    way = follow(robot, start, times, path, np.zeros(3), least)
    if way.blocked:
        name = "trajectory" if len(way.joints) else "initial_position"
        got = f"a path that ends after {100.0 * way.share:.0f} % of its time: {way.blocked}"
    if got:
        expected = f"a start and a path within the arm's limits, above singularity.sigma_min = {least:g}"
        fix = "`slip-vic arm FILE` finds a start and shows what the arm reaches"
        raise InputError(f"parameter {name}", got=got, expected=expected, fix=fix)
