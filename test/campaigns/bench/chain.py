"""Arms of any number of joints, to see how the control step grows: a chain of equal links, invented."""

from __future__ import annotations

LINK_LENGTH_M = 0.15
LINK_MASS_KG = 1.0
EFFORT_NM = 100.0
_AXES = ("0 0 1", "0 1 0")


def chain_urdf(joints: int) -> str:
    """Return the URDF text of a chain of revolute joints ``joint1`` ... with the frame ``ee`` at its end."""
    parts = ['<robot name="chain">', '<link name="link0"/>']
    for i in range(1, joints + 1):
        parts.append(
            f'<link name="link{i}"><inertial><origin xyz="0 0 {LINK_LENGTH_M / 2}"/><mass value="{LINK_MASS_KG}"/>'
            '<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>'
            f'<joint name="joint{i}" type="revolute"><parent link="link{i - 1}"/><child link="link{i}"/>'
            f'<origin xyz="0 0 {LINK_LENGTH_M if i > 1 else 0}"/><axis xyz="{_AXES[i % 2]}"/>'
            f'<limit lower="-3.1" upper="3.1" velocity="5" effort="{EFFORT_NM}"/></joint>'
        )
    parts.append(
        f'<link name="ee"/><joint name="ee_joint" type="fixed"><parent link="link{joints}"/><child link="ee"/>'
        f'<origin xyz="0 0 {LINK_LENGTH_M}"/></joint></robot>'
    )
    return "".join(parts)
