"""Package description that works for `colcon build` and for pip alike."""

from setuptools import find_packages, setup

NAME = "slip_adapters"

setup(
    name=NAME,
    version="0.1.0",
    packages=find_packages(),
    package_data={NAME: ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
    ],
    install_requires=["setuptools", "numpy", "slip_core", "slip_msgs_py"],
    extras_require={"test": ["pytest"]},
    zip_safe=False,
    maintainer="slip-vic maintainers",
    maintainer_email="maintainers@slip-vic.example",
    description="Small nodes that turn vendors' tactile messages into the stock messages of the controller.",
    license="Apache-2.0",
    entry_points={
        "console_scripts": [
            "slip_adapter_papillarray = slip_adapters.main:papillarray",
            "slip_adapter_xela = slip_adapters.main:xela",
            "slip_adapter_bool = slip_adapters.main:boolean",
        ]
    },
)
