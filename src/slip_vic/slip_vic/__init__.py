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
    from slip_core.errors import InputError
    from slip_vic.api import load, read_bag
    from slip_vic.experiments.law import Effort, Law, Pad, Seen, Setup
    from slip_vic.law import Evaluation, evaluate_law
    from slip_vic.presets import preset_names
    from slip_vic.run.in_process import Tick
    from slip_vic.run.run import Run
    from slip_vic.scenarios import scenario_names
    from slip_vic.scenarios.scenario import Scenario

__version__ = "0.1.0"
__all__ = [
    "Effort",
    "Evaluation",
    "InputError",
    "Law",
    "Pad",
    "Run",
    "Scenario",
    "Seen",
    "Setup",
    "Tick",
    "evaluate_law",
    "load",
    "preset_names",
    "read_bag",
    "scenario_names",
]

_MODULES = {
    "slip_core.errors": ("InputError",),
    "slip_vic.api": ("load", "read_bag"),
    "slip_vic.experiments.law": ("Effort", "Law", "Pad", "Seen", "Setup"),
    "slip_vic.law": ("Evaluation", "evaluate_law"),
    "slip_vic.presets": ("preset_names",),
    "slip_vic.run.in_process": ("Tick",),
    "slip_vic.run.run": ("Run",),
    "slip_vic.scenarios": ("scenario_names",),
    "slip_vic.scenarios.scenario": ("Scenario",),
}
_HOME = {name: module for module, names in _MODULES.items() for name in names}


def __getattr__(name: str) -> Any:
    """Load a public name when it is first used."""
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
