"""A small test arm: a 7-joint chain written from a table, with a pad frame `ee`; unlike the real one on purpose."""

from __future__ import annotations

# origin xyz, origin rpy, mass, com, principal inertia, effort limit
_ROWS = [
    ((0.0, 0.0, 0.30), (0.0, 0.0, 0.0), 3.0, (0.00, -0.03, -0.05), (0.03, 0.02, 0.02), 90.0),
    ((0.0, 0.0, 0.00), (-1.5708, 0.0, 0.0), 2.5, (0.01, -0.08, 0.03), (0.02, 0.01, 0.02), 90.0),
    ((0.0, -0.30, 0.0), (1.5708, 0.0, 0.0), 2.2, (0.04, 0.03, -0.05), (0.02, 0.02, 0.01), 90.0),
    ((0.08, 0.0, 0.00), (1.5708, 0.0, 0.0), 2.0, (-0.04, 0.09, 0.03), (0.02, 0.01, 0.02), 90.0),
    ((-0.08, 0.35, 0.0), (-1.5708, 0.0, 0.0), 1.8, (0.00, 0.03, -0.08), (0.02, 0.02, 0.01), 30.0),
    ((0.0, 0.0, 0.00), (1.5708, 0.0, 0.0), 1.2, (0.05, -0.02, -0.01), (0.005, 0.004, 0.005), 30.0),
    ((0.09, 0.0, 0.00), (1.5708, 0.0, 0.0), 0.7, (0.01, 0.01, 0.06), (0.003, 0.003, 0.002), 30.0),
]
JOINT_NAMES = tuple(f"arm_joint{i}" for i in range(1, 8))
HOME = (0.1, -0.5, 0.2, -2.0, 0.1, 1.6, 0.7)


def small_arm_urdf(*, extra_joint: bool = False, effort: float | None = None) -> str:
    """Return the URDF; options make it odd for the tests of bad input."""
    parts = ['<robot name="small"><link name="link0"/>']
    for i, (xyz, rpy, mass, com, inertia, limit) in enumerate(_ROWS, start=1):
        parts.append(
            f'<link name="link{i}"><inertial><origin xyz="{_text(com)}"/><mass value="{mass}"/>'
            f'<inertia ixx="{inertia[0]}" iyy="{inertia[1]}" izz="{inertia[2]}" ixy="0" ixz="0" iyz="0"/>'
            "</inertial></link>"
            f'<joint name="arm_joint{i}" type="revolute"><parent link="link{i - 1}"/><child link="link{i}"/>'
            f'<origin xyz="{_text(xyz)}" rpy="{_text(rpy)}"/><axis xyz="0 0 1"/>'
            f'<limit lower="-2.9" upper="2.9" effort="{limit if effort is None else effort}" velocity="2.5"/></joint>'
        )
    parts.append(
        '<link name="ee"/><joint name="ee_fixed" type="fixed"><parent link="link7"/><child link="ee"/>'
        '<origin xyz="0.0 0.01 0.18" rpy="0.1 1.5 0.2"/></joint>'
    )
    if extra_joint:
        parts.append(
            '<link name="finger"><inertial><mass value="0.05"/>'
            '<inertia ixx="1e-5" iyy="1e-5" izz="1e-5" ixy="0" ixz="0" iyz="0"/></inertial></link>'
            '<joint name="finger_joint" type="prismatic"><parent link="link7"/><child link="finger"/>'
            '<axis xyz="1 0 0"/><limit lower="0" upper="0.04" effort="20" velocity="0.1"/></joint>'
        )
    return "".join([*parts, "</robot>"])


def _text(values: tuple[float, ...]) -> str:
    return " ".join(str(v) for v in values)
