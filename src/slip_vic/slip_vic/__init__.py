"""Slip-aware variable impedance control, from Python.

    import slip_vic

    run = slip_vic.load("paper_planar", law="governed", sensor="vision_60", seed=3, set=["object.mass=0.6"]).run()
    print(run.slip_mm, run.outcome)
    run.frame()                 # pandas: a row per tick, every symbol of the law
    run.page("out/run.html")    # 3D replay and linked plots, one file

Works without ROS. Names are loaded when they are first used.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from slip_vic.api import *  # noqa: F403

__version__ = "0.1.0"


def __getattr__(name: str) -> Any:
    """Load the public names when one is first used."""
    api = importlib.import_module("slip_vic.api")
    if name not in ("__all__", *api.__all__):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(api, name)


def __dir__() -> list[str]:
    return [*__getattr__("__all__"), "__version__"]
