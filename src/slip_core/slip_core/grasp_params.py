"""The configuration of both nodes of arm, object and contacts, declared once: neither accepts what the other refuses.

A node that takes changes of a group in a run derives its own with `AT_RUNTIME`.
"""

from __future__ import annotations

import math
from typing import Self

import numpy as np
from pydantic import model_validator

from slip_core.arrays import inertia_from_six
from slip_core.params import ParameterModel, parameter

Six = tuple[float, float, float, float, float, float]
Three = tuple[float, float, float]

QUATERNION_TOLERANCE = 1e-3
"""How far a quaternion's norm may be from 1: typed with four digits it is still accepted, and normalised."""
LARGEST = 1.0
"""Of a contact's distance from the centre of mass, and of an object's radius of gyration [m]: beyond it a number is a
mistake of its unit."""


class ArmParams(ParameterModel):
    """The arm and where its hand is."""

    robot_description: str = parameter("", "URDF text of the arm; empty: robot_description_file is read")
    robot_description_file: str = parameter(
        "package://slip_description/urdf/arm.urdf",
        "URDF or xacro file of the arm: a path or package://<package>/<path>",
    )
    joint_names: tuple[str, ...] = parameter(
        tuple(f"arm_joint{i}" for i in range(1, 8)), "joints of the arm in the order of all joint vectors", min_length=1
    )
    ee_frame: str = parameter("ee", "link at the pad centre: x approach, z the pads' normal")
    gravity: Three = parameter((0.0, 0.0, -9.81), "gravitational acceleration in the world frame", unit="m/s2")

    @model_validator(mode="after")
    def _joints_differ(self) -> Self:
        if len(set(self.joint_names)) != len(self.joint_names):
            raise ValueError("joint_names must not repeat a name")
        return self


class BaseParams(ParameterModel):
    """Where the base of an arm stands."""

    position: Three = parameter((0.0, 0.0, 0.0), "base of the arm on world axes", unit="m")
    rotation: Three = parameter((0.0, 0.0, 0.0), "rotation vector of the base on world axes", unit="rad")


class ObjectParams(ParameterModel):
    """The grasped rigid body; the defaults are those of `paper_planar`."""

    mass: float = parameter(0.5, "mass of the object", unit="kg", gt=0.0)
    inertia: Six = parameter(
        (2.0e-3, 2.0e-3, 2.0e-3, 0.0, 0.0, 0.0),
        "inertia ixx, iyy, izz, ixy, ixz, iyz about the centre of mass on the object's axes",
        unit="kg m2",
    )

    @model_validator(mode="after")
    def _physical(self) -> Self:
        most = np.linalg.eigvalsh(inertia_from_six(self.inertia, "object.inertia"))[2]
        if most > self.mass * LARGEST**2:
            raise ValueError(f"inertia {most:g} kg m2 of {self.mass:g} kg, beyond that of a radius of {LARGEST:g} m")
        return self


class ContactParams(ParameterModel):
    """Contacts on the object, flat lists; contact 0 is that of this arm."""

    position: tuple[float, ...] = parameter(
        (0.02, 0.0, 0.0),
        "o_x_p: pad centre relative to the centre of mass at the grasp, on object axes; 3 numbers per contact",
        unit="m",
    )
    orientation_xyzw: tuple[float, ...] = parameter(
        (0.0, 0.0, 0.0, 1.0),
        "o_R_p: orientation of the pad at the grasp, on object axes: a unit quaternion per contact",
    )
    slip_axes: tuple[bool, ...] = parameter(
        (True,) * 6, "pad axes along, then about which the contact can slip, 6 per contact; all true = the printed law"
    )

    @property
    def count(self) -> int:
        """How many contacts the object has."""
        return len(self.position) // 3

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        count = self.count
        sizes = (len(self.position), len(self.orientation_xyzw), len(self.slip_axes))
        if count < 1 or sizes != (3 * count, 4 * count, 6 * count):
            raise ValueError(
                f"contacts.position, orientation_xyzw, slip_axes have {sizes[0]}, {sizes[1]}, {sizes[2]} values; "
                "n contacts need 3 n, 4 n, 6 n"
            )
        if max(map(abs, self.position)) > LARGEST:
            raise ValueError(
                f"contacts.position {list(self.position)}: no contact is {LARGEST:g} m from the centre of mass"
            )
        for i in range(count):
            quat = self.orientation_xyzw[4 * i : 4 * i + 4]
            if abs(math.hypot(*quat) - 1.0) > QUATERNION_TOLERANCE:
                raise ValueError(f"contacts.orientation_xyzw of contact {i} is {list(quat)}; its norm must be 1")
        return self
