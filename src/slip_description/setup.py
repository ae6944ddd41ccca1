"""Package description that works for `colcon build` and for pip alike."""

from setuptools import find_packages, setup

NAME = "slip_description"

setup(
    name=NAME,
    version="0.1.0",
    packages=find_packages(),
    package_data={NAME: ["py.typed", "urdf/*.urdf"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/urdf", [f"{NAME}/urdf/arm.urdf"]),
        (f"share/{NAME}/launch", ["launch/view_arm.launch.py"]),
        (f"share/{NAME}/rviz", ["rviz/arm.rviz"]),
    ],
    install_requires=["setuptools"],
    extras_require={"test": ["pytest"]},
)
