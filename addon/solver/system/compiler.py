# SPDX-License-Identifier: GPL-3.0-or-later
"""Numba's compiler, without the steps that gain kernels nothing.

Numba optimises each function by itself, then all that is linked together twice: the first time for its pruning of
reference counts, of which kernels have none. Kernels are optimised once. And Python's collector of garbage, which goes
through the compiler's millions of objects again and again and finds little, waits until a kernel is done.
"""

import gc

from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder


class KernelLibrary(JITCodeLibrary):
    """The code of a kernel, with all that it calls."""

    def _optimize_functions(self, module) -> None:
        pass

    def _optimize_final_module(self) -> None:
        passes, builder = self._codegen._module_pass_manager()
        passes.run(self._final_module, builder)


class KernelCompiler(CompilerBase):
    """Numba's stages, with a KernelLibrary."""

    def define_pipelines(self) -> list:
        """Numba's own stages for code without Python objects."""
        state = self.state
        state.library = KernelLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()  # as Numba does for a library of its own
        return [DefaultPassBuilder.define_nopython_pipeline(state)]

    def compile_extra(self, function):
        """What Numba makes of a function of Python."""
        collects = gc.isenabled()
        gc.disable()
        try:
            return super().compile_extra(function)
        finally:
            if collects:
                gc.enable()
