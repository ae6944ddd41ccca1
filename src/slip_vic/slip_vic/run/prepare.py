"""Compile the formulas once on a machine, before processes that start together all begin to."""

from __future__ import annotations

import fcntl
import functools
import importlib
import os
from pathlib import Path

from slip_core.errors import InputError
from slip_msgs_py.stop_flag import ending_at_once
from slip_vic.run.versions import digest, versions

MODULES = ("slip_core.poses", "slip_vic_controller.session", "slip_sim_bridge.session")
"""These import all modules with compiled formulas."""


@functools.cache
def prepare() -> None:
    """Import and compile everything that a case runs; one process of a machine compiles while the others wait.

    What was compiled is noted beside the user's other caches, so that workers that come later do not wait for each
    other. The note names the folder of the machine code, and counts for nothing where that is gone.
    """
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "slip_vic"
    cache.mkdir(parents=True, exist_ok=True)
    here = importlib.import_module("slip_core").__path__[0]
    note = cache / f"compiled-{digest([repr((sorted(versions().items()), here, _processor())).encode()])}"
    with ending_at_once(InputError.exit_code, "error: interrupted"):  # no handler of Python runs inside the compiler
        with note.with_suffix(".lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not (note.exists() and Path(note.read_text(encoding="utf-8")).is_dir()):
                note.write_text(_compile(), encoding="utf-8")
        _compile()


def _compile() -> str:
    """Import the compiled modules; return the folder in which the last of them keeps its machine code."""
    for module in MODULES:
        importlib.import_module(module)
    importlib.import_module("slip_sim_bridge.plant.rigid").compile_laws()
    return str(importlib.import_module("numba.core.config").CACHE_DIR)


def _processor() -> str:
    """Machine code is for one kind of processor; a home folder may be shared by several."""
    return str(importlib.import_module("llvmlite.binding").get_host_cpu_name())
