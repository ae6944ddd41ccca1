"""Package description that works for `colcon build` and for pip alike."""

from setuptools import find_packages, setup

NAME = "slip_native"

setup(
    name=NAME,
    version="0.1.0",
    packages=find_packages(),
    package_data={NAME: ["py.typed", "built/*", "c/*", "node/*"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
    ],
    install_requires=["setuptools", "slip_core", "slip_vic_controller", "llvmlite", "numba"],
    extras_require={"test": ["pytest"]},
)
