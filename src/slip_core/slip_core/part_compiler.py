"""How a part is compiled: typed and lowered alone, optimised only inside of the kernels that it becomes part of.

numba optimises every function, and makes machine code of it, before it is linked into its callers, which optimise it
again. For a part both are lost work: in numba's own way a first start of controller and bridge compiles for 117 s, in
this one for 73. The results of a kernel are the same, for its arithmetic is strict.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import PassManager, register_pass
from numba.core.registry import CPUDispatcher
from numba.core.typed_passes import NativeLowering

STRICT = {"error_model": "numpy", "fastmath": False}
"""What keeps compiled results equal to those of Python, to the last bit."""


class Part(CPUDispatcher):  # type: ignore[misc]  # numba has no types
    """A function that kernels take in. Called from Python it works too, as a compiled function of its own.

    Args:
        function: what is compiled.
        alone: makes that function of its own, when it is called first.
    """

    def __init__(self, function: Callable[..., Any], alone: Callable[..., Any]) -> None:
        options = STRICT | {"nopython": True, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
        super().__init__(function, targetoptions=options, pipeline_class=_PartCompiler)
        self._alone = alone
        self._whole: Callable[..., Any] | None = None

    def __call__(self, *arguments: Any) -> Any:
        """Return what the function returns."""
        if self._whole is None:
            self._whole = self._alone(self.py_func)
        return self._whole(*arguments)


class _PartLibrary(JITCodeLibrary):  # type: ignore[misc]
    """The code of a part and of all that it calls, linked, but neither optimised nor made machine code."""

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
        # numba finds the code of a callee by its entry for Python; a part has none: any function of C stands for it
        key: Any = [].append
        state.targetctx.insert_user_function(key, lowered.fndesc, [state.library])
        state.reload_init.extend(state.library._reload_init)
        state["cr"] = lowered._replace(cfunc=key)
        return True


class _PartCompiler(CompilerBase):  # type: ignore[misc]
    """numba's own way to compile a function, up to its machine code."""

    def define_pipelines(self) -> list[PassManager]:
        manager = DefaultPassBuilder.define_nopython_pipeline(self.state)
        manager.passes = [(_PartLowering if which is NativeLowering else which, why) for which, why in manager.passes]
        manager._finalized = False
        manager.finalize()
        return [manager]
