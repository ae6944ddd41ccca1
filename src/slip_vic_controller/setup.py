"""Package description that works for `colcon build` and for pip alike."""

from setuptools import find_packages, setup

NAME = "slip_vic_controller"

setup(
    name=NAME,
    version="0.1.0",
    packages=find_packages(),
    package_data={NAME: ["py.typed", "kernels-*.so"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
    ],
    install_requires=["setuptools", "slip_core", "slip_msgs_py", "numpy", "pin", "pydantic", "scipy"],
    extras_require={"test": ["pytest"]},
    entry_points={"console_scripts": ["slip_vic_controller_node = slip_vic_controller.main:main"]},
)
