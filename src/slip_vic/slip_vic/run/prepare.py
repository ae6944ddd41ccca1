"""Compile the formulas once per machine, before several processes start to do so together."""

from __future__ import annotations

import contextlib
import functools
import importlib
import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from rich.console import Console

import slip_vic_controller
from slip_core.compiled import code_folder, library_path, make_folder, user_cache
from slip_core.errors import InputError
from slip_msgs_py.stop_flag import end_with, ending
from slip_vic.run.lock import locked
from slip_vic.run.progress import Report, progress
from slip_vic.run.versions import digest, versions

MODULES: Final = ("slip_core.poses", "slip_vic_controller.session.session", "slip_sim_bridge.session")
"""These import all modules with compiled formulas."""
FOLDER: Final = Path(slip_vic_controller.__path__[0])
LONGEST: Final = "slip_vic_controller.cycle.cycle"
CYCLE_S: Final = 56.0
"""Duration of that on a core of 2.1 GHz [s]; the remaining time is estimated from it."""
BESIDE: Final = ("slip_sim_bridge.session", "slip_vic_controller.session.arrival")
"""What a second process compiles while this one compiles the longest: 66 s instead of 86 on two cores."""


@functools.cache
def prepare() -> None:
    """Import everything that a run needs, and compile it if the installation contains no machine code.

    One process compiles while the others wait. A note in the user's cache names the folder of the machine code, so that
    later processes do not wait for each other; it is ignored if that folder is gone.
    """
    cache = user_cache()
    make_folder(cache)
    if os.environ.get("NUMBA_DISABLE_JIT") == "1":
        return
    with ending(_interrupted):  # no handler of Python runs inside the compiler
        if not library_path(FOLDER).exists():
            note = cache / f"compiled-{digest([repr((sorted(versions().items()), _processor())).encode()])}"
            with locked(note.with_suffix(".lock"), _waits):
                if not (note.exists() and Path(note.read_text(encoding="utf-8")).is_dir()):
                    note.write_text(_compile_in_two(), encoding="utf-8")
        _compile(MODULES)


def _interrupted(_number: int) -> None:
    os.write(sys.stderr.fileno(), b"error: interrupted\n")
    os._exit(InputError.exit_code)


def compile_beside(parent: int) -> None:
    """Compile what a second process does, and end with its parent, whose process id this is."""
    end_with(parent)
    _compile(BESIDE)


def _compile_in_two() -> str:
    """Compile everything; return the folder of the longest module's machine code."""
    program = f"from {__name__} import compile_beside; compile_beside({os.getpid()})"
    # A session of its own: Ctrl-C reaches this process alone.
    with subprocess.Popen([sys.executable, "-c", program], stdin=subprocess.DEVNULL, start_new_session=True), _shown():
        importlib.import_module(LONGEST)
    _compile(MODULES)  # what the other process has not compiled
    return str(code_folder(FOLDER))


@contextlib.contextmanager
def _shown() -> Iterator[None]:
    """Show, while the block compiles the control cycle, how far it is by the time of a processor that it has had."""
    done, begun_s = threading.Event(), time.process_time()

    def watch(report: Report) -> None:
        while not done.wait(1.0):
            report(min(round(time.process_time() - begun_s), CYCLE_S))

    with progress(Console(stderr=True), unit=" s of processor time") as add_bar:
        thread = threading.Thread(target=watch, args=(add_bar(LONGEST.partition(".")[0], CYCLE_S),), daemon=True)
        thread.start()
        try:
            yield
        finally:
            done.set()
            thread.join()


def _waits(owner: str) -> None:
    print(f"{owner} compiles the control cycle: waiting for it", file=sys.stderr, flush=True)


def _compile(modules: tuple[str, ...]) -> None:
    for module in modules:
        importlib.import_module(module)
    importlib.import_module("slip_sim_bridge.plant.rigid").compile_laws()


def _processor() -> str:
    """Machine code is for one kind of processor; a home folder may be shared by several."""
    return str(importlib.import_module("llvmlite.binding").get_host_cpu_name())
