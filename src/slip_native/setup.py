"""Package description that works for `colcon build` and for pip alike."""

from setuptools import find_packages, setup

NAME = "slip_native"

setup(
    name=NAME,
    version="0.1.0",
    packages=find_packages(),
    package_data={NAME: ["py.typed", "c/*", "node/*"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
    ],
    install_requires=["setuptools", "slip_core", "slip_vic_controller", "llvmlite", "numba"],
    extras_require={"test": ["pytest"]},
    zip_safe=False,
    author="slip-vic contributors",
    maintainer="slip-vic maintainers",
    maintainer_email="maintainers@slip-vic.example",
    description="The control cycle as a C library, for real-time processes without Python.",
    license="Apache-2.0",
    entry_points={"console_scripts": []},
)
