"""From the compiled cycle to a shared and a static library, without Python, numba or LLVM in them.

Arithmetic is strict IEEE without fused operations, so the bits depend neither on the instruction set nor on who calls.
"""

from __future__ import annotations

import inspect
import shutil
import subprocess
import tempfile
from collections.abc import Iterable, Sequence
from importlib import resources
from pathlib import Path
from typing import Any, Final

from llvmlite import binding
from numba import cfunc, types

from slip_core.compiler import STRICT
from slip_core.errors import InputError
from slip_native.files import SOURCES
from slip_native.functions import FUNCTIONS
from slip_native.header import header, words

BASELINES: Final = {"x86_64": "x86-64-v2"}
"""Oldest processor for which a library is made, by architecture; of others this machine's own."""
OPTIONS: Final = ("-std=c11", "-O2", "-fPIC", "-Wall", "-Wextra")
_REALS, _WHOLES = types.CPointer(types.float64), types.CPointer(types.int64)
_TYPES = {"In": _REALS, "Out": _REALS, "Whole": _WHOLES, "int": types.int64, "float": types.float64, "None": types.void}


def build(folder: Path, cpu: str = "") -> None:
    """Write libslip_vic.so, libslip_vic.a and their headers into a folder.

    Args:
        folder: exists.
        cpu: LLVM's name of the oldest processor that has to run it, "native" for this one's; default `BASELINES`.

    Raises:
        InputError: there is no C compiler, or LLVM knows no such processor.
    """
    for name, text in (("slip_vic.h", header()), ("slip_vic_words.h", words())):
        (folder / name).write_text(text, encoding="utf-8")
    with tempfile.TemporaryDirectory(prefix="slip_vic_export_") as temporary:
        names = [*(function.__name__ for function in FUNCTIONS), "slip_vic_faults", "slip_vic_room_used"]
        # A host process with Python or numba keeps its own symbols.
        whole = object_file(Path(temporary), map(assembly, FUNCTIONS), cpu, names)
        _call("ar", "rcs", folder / "libslip_vic.a", whole)
        library = folder / "libslip_vic.so"
        cc("-shared", whole, "-o", library, "-lm", "-Wl,--no-undefined", f"-Wl,-soname,{library.name}")


def cc(*arguments: str | Path) -> None:
    """Run the C compiler."""
    compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    if compiler is None or shutil.which("objcopy") is None:
        expected, fix = "a C compiler and binutils, which link the library", "apt install gcc binutils"
        raise InputError("slip-vic export", got="no cc or no objcopy", expected=expected, fix=fix)
    _call(compiler, *arguments)


def _call(*command: str | Path) -> None:
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise InputError(f"{command[0]}", got=done.stderr.strip().partition("\n")[0], expected="a library of the cycle")


def object_file(folder: Path, assemblies: Iterable[str], cpu: str, names: Sequence[str], *options: str) -> Path:
    """Return an object file of functions given as LLVM assembly, with their runtime; only `names` are exported."""
    code, runtime, whole = (folder / name for name in ("code.o", "runtime.o", "whole.o"))
    with resources.as_file(SOURCES / "c" / "runtime.c") as source:
        cc(*OPTIONS, *options, "-c", source, "-o", runtime)
    machine = _target(cpu)
    module = binding.parse_assembly("")
    for text in assemblies:
        module.link_in(binding.parse_assembly(text))
    module.verify()
    code.write_bytes(machine.emit_object(module))
    cc("-nostdlib", "-r", "-Wl,-d", code, runtime, "-o", whole)
    _call("objcopy", *(f"--keep-global-symbol={name}" for name in names), whole)
    return whole


def _target(cpu: str) -> Any:
    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    triple = binding.get_process_triple()
    name = cpu or BASELINES.get(triple.partition("-")[0], "native")
    features = binding.get_host_cpu_features().flatten() if name == "native" else ""
    name = binding.get_host_cpu_name() if name == "native" else name
    return binding.Target.from_triple(triple).create_target_machine(
        cpu=name, features=features, opt=3, reloc="pic", codemodel="small"
    )


def assembly(function: Any) -> str:
    """Return the LLVM assembly of a function under its own name; its annotations are keys of `_TYPES`."""
    found = inspect.signature(function)
    signature = _TYPES[found.return_annotation](*(_TYPES[p.annotation] for p in found.parameters.values()))
    compiled = cfunc(signature, **STRICT)(function)
    text: str = compiled._library.get_llvm_str()
    for name in (f'@"{compiled.native_name}"', f"@{compiled.native_name}"):
        text = text.replace(f"{name}(", f"@{function.__name__}(")
    return text
