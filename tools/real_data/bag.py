"""A recorded run as a bag of ours, so that `bag info`, `report`, rerun and Foxglove read it.

Topics: joint_states; slip_truth of the pad relative to the object from the marker, smoothed to both sides, where it was
seen, on pad axes (x approach, z closing direction); slip_velocity, the same as a sensor would give it, from the last
LATEST readings and stamped in their middle; tactile_1 and tactile_2, each a PointCloud2 of 16 taxels with their place
[m] and raw counts since the start (fx, fy along the pad, fz normal). The arm's URDF is attached.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Twist, TwistStamped, Vector3
from rclpy.serialization import serialize_message
from scipy.signal import savgol_filter
from sensor_msgs.msg import JointState, PointCloud2, PointField
from std_msgs.msg import Header

from slip_bags.format import QosProfile, TopicInfo
from slip_bags.typedefs import find_definition
from slip_bags.writer import BagWriter
from slip_core.arrays import Array
from slip_core.errors import InputError
from slip_description import urdf_text
from tools.real_data import calibrate
from tools.real_data.grasp import MARKER_UP, values
from tools.real_data.runs import RATE_HZ, columns, read_fields, read_object_motion, read_pad_motion, taxels

JOINTS = tuple(f"arm_joint{i}" for i in range(1, 8))
SLIP_AXES = ("x", "y", "z", "rx", "ry", "rz")
START_NS = 1_000_000_000
WINDOW = 9  # samples of the quadratic that gives velocities
LATEST = 4  # samples of the line that a sensor's velocity is the slope of
REST_S = 0.9
TOPICS = {
    "/joint_states": "sensor_msgs/msg/JointState",
    "/slip_truth": "sensor_msgs/msg/JointState",
    "/slip_velocity": "geometry_msgs/msg/TwistStamped",
    "/tactile_1": "sensor_msgs/msg/PointCloud2",
    "/tactile_2": "sensor_msgs/msg/PointCloud2",
}


class Slip(NamedTuple):
    """Slip of the pad relative to the object {ee}; each (n, 6), NaN where it is not known."""

    displacement: Array  # m, rad
    velocity: Array  # m/s, rad/s
    measured: Array  # m/s, rad/s; from the last LATEST rows alone


def slip(run: Path, time: Array) -> Slip:
    """Return the slip.

    NaN where the marker was not seen. The marker's way is taken to the pad centre by its calibrated place.
    """
    thing = read_object_motion(run)
    ahead = values(calibrate.read()[0].standard[0])["marker_ahead"]
    c, s = np.cos(thing.rotation) - 1.0, np.sin(thing.rotation)
    # A turn by +angle about z moves a point at (x down, y behind) = (-up, -ahead).
    x, y = -MARKER_UP, -ahead
    displacement = np.full((time.size, 6), np.nan)
    displacement[:, 0] = -(thing.down - (c * x - s * y))
    displacement[:, 1] = -(-thing.ahead - (s * x + c * y))
    displacement[:, 2:5] = np.where(np.isfinite(thing.rotation), 0.0, np.nan)[:, None]
    displacement[:, 5] = -thing.rotation
    velocity, measured = np.full_like(displacement, np.nan), np.full_like(displacement, np.nan)
    seen = np.flatnonzero(np.isfinite(displacement).all(axis=1))
    if seen.size > WINDOW:
        grid = np.arange(time[seen[0]], time[seen[-1]], 1.0 / RATE_HZ)
        for k in range(6):
            even = np.interp(grid, time[seen], displacement[seen, k])
            velocity[seen, k] = np.interp(time[seen], grid, savgol_filter(even, WINDOW, 2, deriv=1, delta=1 / RATE_HZ))
    for k in range(LATEST - 1, time.size):
        t, rows = time[k - LATEST + 1 : k + 1], displacement[k - LATEST + 1 : k + 1]
        if np.isfinite(rows).all() and t[-1] > t[0]:
            measured[k] = (t - t.mean()) @ rows / ((t - t.mean()) ** 2).sum()
    return Slip(displacement, velocity, measured)


def sensor(run: Path) -> dict[str, Any]:
    """Return a slip sensor with the rate, latency and noise of a run's marker, of the form that `--sensor` takes."""
    time = read_pad_motion(run).time
    measured = slip(run, time).measured[time < time[0] + REST_S]
    noise = np.nanstd(measured, axis=0)
    return {
        "description": f"Marker of {run.name} in a camera on the hand, velocity from {LATEST} readings.",
        "sources": "github.com/imanlab/proactive-slip-control 73c84b0, the first 0.9 s, at rest",
        "slip": {
            "rate_hz": RATE_HZ,
            "latency_s": round((LATEST - 1) / (2.0 * RATE_HZ), 4),
            "noise_linear": round(float(noise[:2].max()), 6),
            "noise_angular": round(float(noise[5]), 5),
        },
        "controller": {"slip_estimator": "observer", "gains.spin": "bounded"},
    }


def header_at(stamp_ns: int) -> Header:
    """Return a header on the pad's axes."""
    return Header(stamp=Time(sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9), frame_id="ee")


def cloud(header: Header, places: Array, counts: Array) -> PointCloud2:
    """Return a tactile field as a stock message; places (n, 2) [m], counts (n, 3)."""
    table = np.zeros((len(places), 6), dtype="<f4")
    table[:, :2], table[:, 3:] = places, counts
    fields = [
        PointField(name=name, offset=4 * i, datatype=PointField.FLOAT32, count=1)
        for i, name in enumerate(("x", "y", "z", "fx", "fy", "fz"))
    ]
    return PointCloud2(
        header=header, height=1, width=len(table), fields=fields, is_bigendian=False, point_step=24,
        row_step=24 * len(table), data=table.tobytes(), is_dense=True,
    )  # fmt: skip


def write_bag(run: Path, out: Path, urdf: Path | None = None) -> int:
    """Write the bag of a run; return its number of messages.

    Args:
        run: folder of the data set.
        out: the bag; must not exist.
        urdf: of the arm, whose joints are called as in JOINTS; None is the suite's own arm, whose joints are
            those of the data set's robot; its fingers end 0.1 m further down.

    Raises:
        InputError: a file is missing or damaged, or the bag exists.
    """
    if urdf is not None and not urdf.is_file():
        raise InputError(f"URDF {urdf}", got="no such file", expected="the arm's description")
    description = urdf_text().encode() if urdf is None else urdf.read_bytes()
    names = [f"{kind}_joint{i}" for kind in ("position", "velocity") for i in range(1, 8)]
    state = columns(run / "robot_state.csv", tuple(names))
    joints = np.stack([state[name] for name in names], axis=1)
    time, fields, places = read_pad_motion(run).time, read_fields(run), taxels()
    displacement, velocity, measured = slip(run, time)
    custom = {"source": "github.com/imanlab/proactive-slip-control 73c84b0, MIT", "run": run.name}
    writer = BagWriter(out, custom, {"arm.urdf": description})
    for name, type_name in TOPICS.items():
        definition = find_definition(type_name)
        writer.add_topic(TopicInfo(name, type_name, (QosProfile(),), definition.type_hash), definition.text)
    sequence = dict.fromkeys(TOPICS, 0)
    for k, t in enumerate(time):
        stamp_ns = START_NS + round(1e9 * (t - time[0]))
        header = header_at(stamp_ns)
        messages = {}
        if np.isfinite(joints[k]).all():
            messages["/joint_states"] = JointState(
                header=header, name=JOINTS, position=joints[k, :7].tolist(), velocity=joints[k, 7:].tolist()
            )
        if np.isfinite(velocity[k]).all():
            messages["/slip_truth"] = JointState(
                header=header, name=SLIP_AXES, position=displacement[k].tolist(), velocity=velocity[k].tolist()
            )
        if np.isfinite(measured[k]).all():
            middle_ns = START_NS + round(1e9 * (time[k - LATEST + 1 : k + 1].mean() - time[0]))
            linear, angular = (Vector3(x=v[0], y=v[1], z=v[2]) for v in (measured[k, :3], measured[k, 3:]))
            messages["/slip_velocity"] = TwistStamped(
                header=header_at(middle_ns), twist=Twist(linear=linear, angular=angular)
            )
        for finger in range(2):
            messages[f"/tactile_{finger + 1}"] = cloud(header, places, fields[finger, k])
        for topic, message in messages.items():
            sequence[topic] += 1
            writer.write(topic, stamp_ns, stamp_ns, sequence[topic], serialize_message(message))
    writer.close()
    return sum(sequence.values())
