"""From the compiled cycle to a shared and a static library, without Python, numba or LLVM in them.

Arithmetic is strict IEEE without fused operations, so the bits depend neither on the instruction set nor on who calls.
"""

from __future__ import annotations

import inspect
import shutil
import subprocess
import tempfile
from importlib import resources
from pathlib import Path
from typing import Any, Final

from llvmlite import binding
from numba import cfunc, types

from slip_core.compiled import INT, VOID
from slip_core.errors import InputError
from slip_core.part_compiler import STRICT
from slip_native.functions import FUNCTIONS

BASELINES: Final = {"x86_64": "x86-64-v2"}
"""Oldest processor for which a library is made, by architecture; of others this machine's own."""
SOURCES = resources.files("slip_native")
_TYPES = {"In": types.CPointer(types.float64), "Out": types.CPointer(types.float64), "int": INT, "None": VOID}


def build(folder: Path, cpu: str = "") -> None:
    """Write libslip_vic.so and libslip_vic.a into a folder.

    Args:
        folder: exists.
        cpu: LLVM's name of the oldest processor that has to run it, "native" for this one's; default `BASELINES`.

    Raises:
        InputError: there is no C compiler, or LLVM knows no such processor.
    """
    compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    if compiler is None or shutil.which("objcopy") is None:
        expected = "a C compiler and binutils, which link the library"
        raise InputError(
            "slip-vic export", got="no cc or no objcopy", expected=expected, fix="apt install gcc binutils"
        )
    with tempfile.TemporaryDirectory(prefix="slip_vic_export_") as temporary:
        code, whole = Path(temporary) / "cycle.o", Path(temporary) / "slip_vic.o"
        code.write_bytes(object_code(cpu))
        with resources.as_file(SOURCES / "c" / "runtime.c") as runtime:
            flags = ("-std=c11", "-O2", "-fPIC", "-Wall", "-Wextra")
            _call(compiler, *flags, "-c", runtime, "-o", Path(temporary) / "runtime.o")
        # One object whose only names are those of the header: a host that has Python or numba in it keeps its own.
        _call(compiler, "-nostdlib", "-r", "-Wl,-d", code, Path(temporary) / "runtime.o", "-o", whole)
        names = [
            f"--keep-global-symbol={name}"
            for name in (*(one.__name__ for one in FUNCTIONS), "slip_vic_faults", "slip_vic_room_used")
        ]
        _call("objcopy", *names, whole)
        _call("ar", "rcs", folder / "libslip_vic.a", whole)
        link = ("-lm", "-Wl,--no-undefined", "-Wl,-soname,libslip_vic.so")
        _call(compiler, "-shared", whole, "-o", folder / "libslip_vic.so", *link)


def sources() -> dict[str, str]:
    """Return what is compiled beside the library, by its path in the folder: the example, and the node."""
    found = {name: SOURCES / "c" / name for name in ("example.c", "CMakeLists.txt")}
    found |= {f"node/{file.name}": file for file in (SOURCES / "node").iterdir()}
    return {name: file.read_text(encoding="utf-8") for name, file in found.items()}


def _call(*command: str | Path) -> None:
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise InputError(f"{command[0]}", got=done.stderr.strip().partition("\n")[0], expected="a library of the cycle")


def object_code(cpu: str) -> bytes:
    """Return the functions as one object file for a processor; see `build`."""
    machine = _target(cpu)
    module = binding.parse_assembly("")
    for function in FUNCTIONS:
        module.link_in(binding.parse_assembly(_assembly(function)))
    module.verify()
    return bytes(machine.emit_object(module))


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


def _assembly(function: Any) -> str:
    """Return LLVM's text of a function under its own name."""
    found = inspect.signature(function)
    signature = _TYPES[found.return_annotation](*(_TYPES[p.annotation] for p in found.parameters.values()))
    compiled = cfunc(signature, **STRICT)(function)
    text: str = compiled._library.get_llvm_str()
    for name in (f'@"{compiled.native_name}"', f"@{compiled.native_name}"):
        text = text.replace(f"{name}(", f"@{function.__name__}(")
    return text
