"""The only module that calls numba: how kernels and parts, records, vectors and matrices are compiled.

numba optimises every function and generates its machine code before it links it into its callers, which are optimised
again. For a part, that work is wasted. Here a part is optimised only inside the kernels that it becomes part of: the
first start of controller and bridge compiles for 73 s instead of 117. Results are the same: arithmetic is strict.
"""

from __future__ import annotations

import functools
import hashlib
import operator
import os
import pickle
from collections.abc import Callable
from pathlib import Path
from types import BuiltinFunctionType
from typing import Any

import numba
from numba import carray, types
from numba.core.caching import NullCache
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, CompileResult, DefaultPassBuilder
from numba.core.compiler_machinery import PassManager, register_pass
from numba.core.registry import CPUDispatcher
from numba.core.serialize import dumps
from numba.core.typed_passes import NativeLowering
from numba.extending import intrinsic, overload, overload_method, register_jitable, typeof_impl

from slip_core.compiled import CARRIED, code_folder, package_of
from slip_core.records import record, records
from slip_core.vectors import ALGEBRAS

STRICT = {"error_model": "numpy", "fastmath": False}
"""Options that keep compiled results equal to those of Python, to the last bit."""


def keep(function: Callable[..., Any], *signatures: str) -> Callable[..., Any]:
    """Return a function compiled for these signatures now, else at each first call; its machine code is cached."""
    made: Any = numba.njit(**STRICT)(function)
    made._cache = _MachineCode(function)
    for signature in signatures:
        made.compile(signature)
        made.disable_compile()
    return made


@functools.cache  # numba's type refers to it weakly
def inlined(part: Callable[..., Any]) -> CPUDispatcher:
    """Return a part as its kernels compile it."""
    options = STRICT | {"nopython": True, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    return CPUDispatcher(part, targetoptions=options, pipeline_class=_PartCompiler)


@typeof_impl.register(BuiltinFunctionType)  # type: ignore[untyped-decorator]  # numba has no types
def _type_of_carried(function: Any, _purpose: object) -> types.Dispatcher | None:
    return types.Dispatcher(CARRIED[function]()) if function in CARRIED else None


class _MachineCode(NullCache):  # type: ignore[misc]
    """The machine code of a function on disk: one file per signature, written atomically.

    numba's own cache numbers the files of a function and lists them in an index. If two processes add to it at once,
    each may write its code to the file that the index lists for the other's signature.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        code, package = function.__code__, package_of(function)
        path = Path(code.co_filename).resolve(strict=True).relative_to(package)
        enclosed = dumps(tuple(cell.cell_contents for cell in function.__closure__ or ()))
        self._key = str(path), function.__qualname__, code.co_firstlineno, enclosed
        self._begin = code_folder(package) / function.__name__

    def load_overload(self, signature: object, target: Any) -> CompileResult | None:
        """Return the code of a signature, None if there is none."""
        target.refresh()
        try:
            kept = pickle.loads(self._path(signature, target.codegen()).read_bytes())
        except FileNotFoundError:
            return None
        return CompileResult._rebuild(target, *kept)

    def save_overload(self, signature: object, compiled: CompileResult) -> None:
        """Write the code of a signature."""
        if not compiled.library.has_dynamic_globals:
            path = self._path(signature, compiled.codegen)
            unfinished = path.with_suffix(f".{os.getpid()}")
            unfinished.write_bytes(dumps(compiled._reduce()))
            unfinished.replace(path)

    def _path(self, signature: object, codegen: Any) -> Path:
        key = repr((self._key, signature, codegen.magic_tuple()))
        return self._begin.with_name(f"{self._begin.name}-{hashlib.sha256(key.encode()).hexdigest()}.code")


class _PartLibrary(JITCodeLibrary):  # type: ignore[misc]
    """The code of a part and of all that it calls, linked, but neither optimised nor compiled to machine code."""

    def finalize(self) -> None:
        self._raise_if_finalized()
        for library in dict.fromkeys(self._linking_libraries):
            self._reload_init.update(library._reload_init)
            self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        self._finalize_dynamic_globals()
        self._finalized = True


@register_pass(mutates_CFG=True, analysis_only=False)
class _PartLowering(NativeLowering):  # type: ignore[misc]
    _name = "part_lowering"

    def run_pass(self, state: Any) -> bool:
        state.library = _PartLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.flags.no_compile = True
        super().run_pass(state)
        lowered = state["cr"]
        # numba finds the code of a callee by its Python entry point; a part has none: a unique C function replaces it
        key: Any = [].append
        state.targetctx.insert_user_function(key, lowered.fndesc, [state.library])
        state.reload_init.extend(state.library._reload_init)
        state["cr"] = lowered._replace(cfunc=key)
        return True


class _PartCompiler(CompilerBase):  # type: ignore[misc]
    """numba's pipeline, without the generation of machine code."""

    def define_pipelines(self) -> list[PassManager]:
        manager = DefaultPassBuilder.define_nopython_pipeline(self.state)
        manager.passes = [(_PartLowering if which is NativeLowering else which, why) for which, why in manager.passes]
        manager._finalized = False
        manager.finalize()
        return [manager]


@overload(record)
def _compiled_record(buffer, dtype):  # type: ignore[no-untyped-def]
    return lambda buffer, dtype: carray(_begin(buffer), 1, dtype)[0]


@overload(records)
def _compiled_records(matrix, dtype):  # type: ignore[no-untyped-def]
    size = dtype.dtype.size // 8
    return lambda matrix, dtype: carray(_begin(matrix), matrix.size // size, dtype)


@intrinsic
def _begin(_context, array):  # type: ignore[no-untyped-def]
    """Return the address of an array: numba's own view of another dtype costs 0.15 us.

    As with such a view, nothing keeps the buffer alive: it must be an argument of the kernel.
    """
    if array.layout != "C":
        raise TypeError("records lie in contiguous buffers")

    def address(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
        return builder.bitcast(data, context.get_value_type(types.voidptr))

    return types.voidptr(array), address


_OPERATORS = {f"__{name}__": getattr(operator, name) for name in ("add", "sub", "neg", "mul", "truediv", "matmul")}
_OPERATORS["__rmul__"] = operator.mul
_METHODS: dict[str, dict[type | None, Callable[..., Any]]] = {}


def _class_of(numba_type: object) -> type | None:
    """Return the named tuple class of a numba type, None for any other type."""
    return getattr(numba_type, "instance_class", None)


def _register(cls: type) -> None:
    """Register the operators and methods of a named tuple."""
    for name, method in vars(cls).items():
        if name in _OPERATORS and callable(method):
            _register_operator(cls, name, method)
        elif callable(method) and not name.startswith("_"):
            if name not in _METHODS:
                _METHODS[name] = {}
                _register_method(types.NamedTuple, name)
                _register_method(types.NamedUniTuple, name)
            _METHODS[name][cls] = method


def _register_operator(cls: type, name: str, method: Callable[..., Any]) -> None:
    if name == "__neg__":

        @overload(operator.neg, strict=False)
        def negative(a):  # type: ignore[no-untyped-def]
            return method if _class_of(a) is cls else None

    elif name == "__rmul__":
        scaled = register_jitable(method)

        @overload(operator.mul, strict=False)
        def product(k, a):  # type: ignore[no-untyped-def]
            return (lambda k, a: scaled(a, k)) if _class_of(a) is cls and isinstance(k, types.Number) else None

    else:

        @overload(_OPERATORS[name], strict=False)
        def binary(a, b):  # type: ignore[no-untyped-def]
            return method if _class_of(a) is cls and _class_of(b) is not None else None


def _register_method(kind: type, name: str) -> None:
    table = _METHODS[name]
    # numba calls the chooser with as many arguments as the method has.
    if name in ("norm", "T"):
        overload_method(kind, name, strict=False)(lambda a: table.get(_class_of(a)))
    else:
        overload_method(kind, name, strict=False)(lambda a, b: table.get(_class_of(a)))


for _algebra in ALGEBRAS:
    _register(_algebra)
