"""Package description that works for `colcon build` and for pip alike."""

from setuptools import find_packages, setup

NAME = "slip_vic"

setup(
    name=NAME,
    version="0.1.0",
    packages=find_packages(),
    package_data={NAME: ["py.typed", "presets/*/*.yaml", "scenarios/*.yaml", "page/static/*", "experiments/*.gz"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
    ],
    install_requires=[
        "setuptools",
        "slip_bags",
        "slip_core",
        "slip_description",
        "slip_msgs_py",
        "slip_native",
        "slip_sim_bridge",
        "slip_vic_controller",
        "click",
        "matplotlib",
        "numpy",
        "pandas",
        "pydantic",
        "pyyaml",
        "rich",
        "scipy",
    ],
    extras_require={"test": ["pytest"]},
    entry_points={"console_scripts": ["slip-vic = slip_vic.cli:process"]},
)
