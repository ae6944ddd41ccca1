"""Where an arm gets on the way of a scenario: by inverse kinematics, before anything is started."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from slip_core.arrays import Array
from slip_core.errors import InputError
from slip_core.records import new, record
from slip_sim_bridge.params import BridgeParams
from slip_vic_controller.law.arm import ARM
from slip_vic_controller.law.bounds import Condition
from slip_vic_controller.law.torque import given_axes
from slip_vic_controller.params.controller_params import ControllerParams, SingularityParams, TrajectoryParams
from slip_vic_controller.path.paths import make_path, sample_path
from slip_vic_controller.robot import Robot

SIGMA_MIN: Final = SingularityParams().sigma_min
"""Singular value of the Jacobian below which torques are damped, where nothing else is configured."""
REACHED = 1e-4
"""[m, rad] Pose error below which a point counts as reached: a tenth of what counts as arriving."""
WRIST_SHARE = 0.1
"""Share of the object's inertia below which that of a joint is too small to be all there is: a URDF leaves out its
rotor."""
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
    given_axes(np.ascontiguousarray(J), least, given)
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
            blocked = f"{robot.joint_names[j]} would have to go to {found[j]:.3g}, beyond its limit"
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
        1.0 if not blocked else len(way) / len(path),
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


def judge_inertia(robot: Robot, q: Array, params: ControllerParams) -> Condition:
    """Judge the inertia that the lightest joint moves in a posture (n,), as seen from M_D.

    The law cancels what is there to put M_D in its place: of next to nothing every error of a torque is a large
    acceleration.
    """
    buffer = new(ARM)
    robot.terms(q, np.zeros(len(q)), buffer)
    inertia = np.diag(record(buffer, ARM).M)[: len(q)]
    light, most = int(inertia.argmin()), max(params.gains.inertia[3:])
    least = WRIST_SHARE * min(params.object.inertia[:3])
    reason = (
        f"{robot.joint_names[light]} moves {inertia[light]:.2g} kg m2 beside the object's {least / WRIST_SHARE:.2g}; a "
        "URDF leaves out rotors, which drive.armature adds"
    )
    name = f"M_D over the inertia of {robot.joint_names[light]}"
    return Condition(name, most / max(float(inertia[light]), 1e-12), most / least, reason, "drive.armature")


def check_start(robot: Robot, controller: ControllerParams, bridge: BridgeParams) -> None:
    """Check that the arm can start where a scenario says, and follow its path.

    Raises:
        InputError: a start beyond a limit or in a singular posture, a path that leaves the arm's reach.
    """
    fix = "`slip-vic arm FILE` finds a start and shows what the arm reaches"
    start = np.array(bridge.initial_position)
    for j, name in enumerate(robot.joint_names):
        low, high = robot.position_lower[j], robot.position_upper[j]
        if not low <= start[j] <= high:
            raise InputError(
                "parameter initial_position", got=f"{name} at {start[j]:.4g}",
                expected=f"within its limits {low:.4g}..{high:.4g}", fix=fix,
            )  # fmt: skip
    J, least = robot.frame(start)[2], controller.singularity.sigma_min
    sigma = smallest(J[axes_of(J, least)])
    if sigma < least:
        raise InputError(
            "parameter initial_position", got=f"a singular posture (least singular value of the Jacobian {sigma:.2g})",
            expected=f"at least singularity.sigma_min = {least:g}", fix=fix,
        )  # fmt: skip
    times, path = pad_path(controller.trajectory)
    way = follow(robot, start, times, path, np.zeros(3), least)
    if way.blocked:
        raise InputError(
            "parameter trajectory",
            got=f"a path that the arm leaves after {100.0 * way.share:.0f} % of its time: {way.blocked}",
            expected="a path within its reach",
            fix=fix,
        )
