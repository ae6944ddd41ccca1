"""Package description that works for `colcon build` and for pip alike."""

from setuptools import find_packages, setup

NAME = "slip_msgs_py"

setup(
    name=NAME,
    version="0.1.0",
    packages=find_packages(),
    package_data={NAME: ["py.typed", "localhost.xml"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
    ],
    install_requires=["setuptools", "slip_core", "numpy"],
    extras_require={"test": ["pytest"]},
    zip_safe=False,
    author="slip-vic contributors",
    maintainer="slip-vic maintainers",
    maintainer_email="maintainers@slip-vic.example",
    description="What the nodes share with ROS: QoS, message conversion, CDR codec, executor, node start.",
    license="Apache-2.0",
    entry_points={"console_scripts": []},
)
