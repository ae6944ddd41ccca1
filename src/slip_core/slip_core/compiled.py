"""Compiled number crunching: formulas of a tick as machine code, made once and kept.

A file named `*_kernel.py` holds such formulas. Each kernel has a plain form elsewhere that documents it, and a test
that compares the two. Compilation is strict IEEE arithmetic (no fast-math, no fused operations, no linear algebra
library), so results do not depend on the instruction set of the machine.
"""

from __future__ import annotations

import functools
import hashlib
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from numba.core import config

F = TypeVar("F", bound=Callable[..., Any])

VOID, REAL, INT = numba.types.void, numba.types.float64, numba.types.int64
IN1, IN2 = (numba.types.Array(REAL, dimensions, "C", readonly=True) for dimensions in (1, 2))
"""Vector and matrix (by rows) that a kernel only reads; arrays that are read-only, and others too, fit."""
OUT1, OUT2 = (numba.types.Array(REAL, dimensions, "C") for dimensions in (1, 2))
WHOLE1 = numba.types.Array(INT, 1, "C", readonly=True)
BOOL, RNG = numba.types.boolean, numba.types.npy_rng
IN2_F = numba.types.Array(REAL, 2, "F", readonly=True)
"""Matrix by columns, as Eigen has them."""


def kernel(signature: Any) -> Callable[[F], F]:
    """Return a decorator that compiles a function for one signature when its module is imported.

    The machine code is kept beside the sources, or in the user's cache folder where those are read-only, under a name
    that changes with every `*_kernel.py` of the package: a stale one is never used.

    Args:
        signature: for instance VOID(IN1, IN2, INT, OUT1), or text in numba's notation.
    """

    def compile_now(function: F) -> F:
        config.CACHE_DIR = str(_folder(Path(function.__code__.co_filename).parent))
        return cast(F, numba.njit(signature, cache=True, error_model="numpy", fastmath=False)(function))

    return compile_now


def part(function: F) -> F:
    """Mark a function that only kernels call: it becomes part of them."""
    return cast(F, numba.njit(error_model="numpy", fastmath=False)(function))


@functools.lru_cache
def _folder(package: Path) -> Path:
    digest = hashlib.sha256(numba.__version__.encode())
    for path in sorted({*package.glob("*_kernel.py"), *Path(__file__).parent.glob("*_kernel.py")}):
        digest.update(path.read_bytes())
    base = package / "__pycache__" if os.access(package, os.W_OK) else _user_cache()
    folder = base / f"kernels-{digest.hexdigest()[:16]}"
    if not folder.exists():
        print(f"compiling {package.parent.name} for this machine, once: half a minute", file=sys.stderr, flush=True)
    return folder


def _user_cache() -> Path:
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "slip_vic"
