"""Build the wheel, with machine code on x86-64: its nodes start without numba and without compiling.

python tools/wheel.py FOLDER
"""

from __future__ import annotations

import platform
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from numba import carray, farray, types

from slip_core.compiled import KERNELS, library_path
from slip_native.files import CARRIED
from slip_native.library import BASELINES, OPTIONS, assembly, build, cc, object_file
from slip_sim_bridge.friction import LAWS, friction_law
from slip_sim_bridge.friction.params import FrictionParams
from slip_sim_bridge.plant.elastic_step import elastic_step
from slip_sim_bridge.plant.rigid_step import rigid_step
from slip_vic.retime import timing as _timing  # noqa: F401  # for its kernels, beside those that `prepare` imports
from slip_vic.run.prepare import prepare

ROOT = Path(__file__).resolve().parents[1]


def build_kernels(path: Path, kernels: Mapping[str, Any]) -> None:
    """Write the library of a package's kernels, for every Python from 3.11 on.

    Args:
        path: `compiled.library_path` of the package.
        kernels: of the package, by name: `compiled.KERNELS`.

    Raises:
        InputError: there is no C compiler, or no Python.h.
    """
    entries = [_entry(f"kernel_{k}", name, kernels[name]) for k, name in enumerate(sorted(kernels))]
    with tempfile.TemporaryDirectory(prefix="slip_vic_kernels_") as temporary:
        (Path(temporary) / "kernels.h").write_text("".join(line for _, line in entries), encoding="utf-8")
        names = [f"kernel_{k}" for k in range(len(entries))]
        whole = object_file(Path(temporary), (text for text, _ in entries), "", [*names, "slip_vic_faults"], "-DHEAP")
        headers = ("-I", temporary, "-I", sysconfig.get_path("include"))
        cc(*OPTIONS, "-shared", *headers, ROOT / "tools" / "wheel.c", whole, "-o", path, "-lm", "-Wl,-Bsymbolic,-s")


def _entry(symbol: str, name: str, kernel: Any) -> tuple[str, str]:
    """Return the LLVM assembly of a kernel with a C signature, and its line of kernels.h for wheel.c."""
    (signature,) = kernel.nopython_signatures
    kinds, passed, given = "", [], dict[str, str]()
    for k, kind in enumerate(signature.args):
        if isinstance(kind, types.Array):
            sizes = [f"n{k}", f"m{k}"][: kind.ndim]
            given |= {f"p{k}": "Whole" if kind.dtype == types.int64 else "Out", **dict.fromkeys(sizes, "int")}
            passed.append(f"{'farray' if kind.layout == 'F' else 'carray'}(p{k}, ({', '.join(sizes)},))")
            kinds += f"{kind.dtype.name[0]}{kind.ndim}{kind.layout}{'w' if kind.mutable else 'r'}"
        else:
            number = f"r{k}" if kind == types.float64 else f"i{k}"
            given[number] = "float" if kind == types.float64 else "int"
            passed.append(f"{number} != 0" if kind == types.boolean else number)
            kinds += {types.float64: "REAL", types.int64: "INT_", types.boolean: "BOOL"}[kind]
    call, result = f"kernel({', '.join(passed)})", signature.return_type
    words = f"lambda {', '.join(given)}: {f'int({call})' if result == types.boolean else call}"
    function = eval(words, {"kernel": kernel, "carray": carray, "farray": farray})
    function.__name__ = symbol
    function.__annotations__ = given | {"return": {types.void: "None", types.float64: "float"}.get(result, "int")}
    in_c = ", ".join({"int": "int64_t", "float": "double"}.get(kind, "void *") for kind in given.values())
    values = ", ".join(f"a[{at[1:]}].{at[0]}" for at in given)
    line = f'KERNEL({symbol[7:]}, "{name}", "{kinds}", {result.name}, ({in_c}), ({values}))\n'
    return assembly(function), line


def carry(source: Path) -> None:
    """Write the libraries of all packages, and the one of `slip-vic export`, into a copy of this checkout."""
    prepare()
    for name in sorted({*LAWS.values()}):
        law, _ = friction_law(FrictionParams.model_validate({"model": name}))
        rigid_step(law)
        elastic_step(law)
    for package, kernels in KERNELS.items():
        build_kernels(source / library_path(package).relative_to(ROOT), kernels)
    exported = source / "src" / "slip_native" / "slip_native" / CARRIED
    exported.mkdir()
    build(exported)


def main(folder: str) -> None:
    """Write the wheel to a folder."""
    with tempfile.TemporaryDirectory(prefix="slip_vic_wheel_") as temporary:
        source, options = Path(temporary), []
        listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
        for name in filter(None, listed.split("\0")):
            if name.startswith(("src/", "examples/")) or "/" not in name:
                (source / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(ROOT / name, source / name)
        if platform.machine() in BASELINES:
            carry(source)
            options = [f"--config-settings=--build-option=--plat-name=linux_{platform.machine()}"]
        pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "-q", "wheel", "--no-deps"]
        subprocess.run([*pip, "-w", folder, *options, temporary], check=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
