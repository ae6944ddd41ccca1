"""Physics of N arms that hold one object, behind the same methods; `Simulation` adds clock, holding, limits and loss.

`rigid`: one pad that sticks exactly. `elastic`: any number of pads with stiffness. `loose`: nothing is held.
Joint vectors are in the order of `joint_names`, those of all arms one after the other.
"""

from __future__ import annotations

import functools
import os

import numpy as np

from slip_core.errors import SlipVicError
from slip_core.records import REAL, Mat3, Record, Vec3, Vec6, dtype_of, layout

# No picture is drawn here. Without this, `import mujoco` looks for a window library in a process of its own.
os.environ.setdefault("MUJOCO_GL", "disable")


class Grasp(Record):
    """What can be read of one grasp at one stamp."""

    wrench: Vec6
    """h_ee of the object on the robot at the pad centre in the step that just ended [N, N m] {ee} (Eq. 1)."""
    slip_displacement: Vec6
    """Pose of {ee} relative to {p}: translation, rotation vector [m, rad] {p}."""
    slip_velocity: Vec6
    """v_s of the pad relative to the object's material under it [m/s, rad/s] {ee} (Eq. 14)."""
    object_position: Vec3
    """Of the centre of mass [m] {w}."""
    object_rotation: Mat3
    """{o} to {w}."""
    object_twist: Vec6
    """At the centre of mass [m/s, rad/s] {w}."""
    pad_position: Vec3
    """Of the pad centre [m] {w}."""
    pad_rotation: Mat3
    """{ee} to {w}."""
    pad_yield: Vec6
    """Shear rate of the pad's surface, signed as slip_velocity [m/s, rad/s] {ee}; rigid: 0."""


GRASP = dtype_of(Grasp)
GRASP_SIZE = GRASP.itemsize // 8


class DivergenceError(SlipVicError):
    """The simulated state is no longer finite or physical; only a reset helps."""


@functools.cache
def read_out(joints: int) -> np.dtype[np.void]:
    """Return the layout of one arm's read-out: the fields of `Grasp`, then positions and velocities of its joints."""
    joint_fields = [("position", REAL, (joints,)), ("velocity", REAL, (joints,))]
    return layout([*((name, GRASP[name]) for name in GRASP.names or ()), *joint_fields])
