"""Referee: arm, grasp and object a second time, in Pinocchio, from the URDF with the object written into it as links.

Shares no formula with the simulation: frames are composed by Pinocchio, rotations of the object come from its poses.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from slip_core.arrays import inertia_from_six, matrix_from_quat_xyzw

LWA = pin.LOCAL_WORLD_ALIGNED


def with_object(urdf: str, ee_frame: str, mass: float, x_o, inertia) -> str:
    """Append the object on slide x, slide y, hinge z of `ee_frame`; x_o (3,) and inertia (3, 3) on {p} axes."""
    x, y, z = (f"{v:.17g}" for v in x_o)
    J = inertia
    numbers = {"ixx": J[0, 0], "iyy": J[1, 1], "izz": J[2, 2], "ixy": J[0, 1], "ixz": J[0, 2], "iyz": J[1, 2]}
    tensor = " ".join(f'{name}="{value:.17g}"' for name, value in numbers.items())
    limit = '<limit lower="-100" upper="100" effort="0" velocity="100"/>'
    parts = []
    chain = [(ee_frame, "twin_x", "prismatic", "1 0 0"), ("twin_x", "twin_y", "prismatic", "0 1 0")]
    for parent, child, kind, axis in [*chain, ("twin_y", "twin_object", "revolute", "0 0 1")]:
        parts.append(
            f'<joint name="{child}_joint" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
            f'<axis xyz="{axis}"/>{limit}</joint>'
        )
    parts.append('<link name="twin_x"/><link name="twin_y"/><link name="twin_object"><inertial>')
    parts.append(f'<origin xyz="{x} {y} {z}"/><mass value="{mass:.17g}"/><inertia {tensor}/></inertial></link></robot>')
    return urdf.replace("</robot>", "".join(parts))


class GraspTwin:
    """The simulated scene of `params` in Pinocchio; states are (7 arm joints, x, y, theta)."""

    def __init__(self, params, urdf: str) -> None:
        self.o_R_p = matrix_from_quat_xyzw(params.contacts.orientation_xyzw[:4])
        self.o_x_p = np.array(params.contacts.position[:3])
        self.mass, self.J_o = params.object.mass, inertia_from_six(params.object.inertia)
        p_x_o, p_J = -self.o_R_p.T @ self.o_x_p, self.o_R_p.T @ self.J_o @ self.o_R_p
        self.model = pin.buildModelFromXML(with_object(urdf, params.ee_frame, self.mass, p_x_o, p_J))
        self.model.gravity.linear = np.array(params.gravity)
        self.data = self.model.createData()
        self.ee, self.p = self.model.getFrameId(params.ee_frame), self.model.getFrameId("twin_object")
        self.gravity = np.array(params.gravity)

    def ee_pose_and_twist(self, q, v):
        """Position (3,), rotation (3, 3), twist (6,) of {ee}, all {w}; arm joints are enough."""
        return self._frame(self.ee, q, v)

    def p_pose_and_twist(self, q, v):
        """Position, rotation, twist of the grasp frame {p} in the object, {w}."""
        return self._frame(self.p, q, v)

    def _frame(self, frame, q, v):
        q, v = (np.concatenate((x, np.zeros(self.model.nv - len(x)))) for x in (q, v))
        pin.forwardKinematics(self.model, self.data, q, v)
        pin.updateFramePlacement(self.model, self.data, frame)
        placement = self.data.oMf[frame]
        twist = pin.getFrameVelocity(self.model, self.data, frame, LWA).vector
        return placement.translation.copy(), placement.rotation.copy(), twist.copy()
