# SPDX-License-Identifier: GPL-3.0-or-later
"""How Numba compiles the kernels.

Kernels, and the functions that are inlined into them, allocate no memory: callers pass in room for all results. So
kernels need not count references to arrays. Numba would count with locked instructions at every use of an array in a
tuple and at every row of an array; without counting, opening a node of a tree takes a third of the time. Reference
counting is part of Numba's runtime, which the option `_nrt` turns off. Numba then refuses to compile a function that
allocates, or that returns a row of an array: the few small functions that return rows are inlined by Numba itself,
`inline="always"`. Functions that make arrays take little time and are compiled with Numba's own settings.

A kernel is compiled for each combination of types of its arguments, which takes up to 20 s. To Numba a literal number
is a type of its own, so a count that starts at 0 and is passed to a kernel starts as np.int64(0). And so are an array
whose rows do not lie side by side, see `thinned`, or one that cannot be written.
"""

from collections.abc import Callable, Iterable, Iterator
from functools import cache

import numba
import numpy as np

from .compiler import KernelCompiler
from .kernel_cache import keep_apart, kept_kernels


def njit(**options) -> Callable:
    """Numba's njit, for all kernels of the solver: compiled kernels are kept where kernel_cache says."""

    def decorate(function: Callable) -> Callable:
        with kept_kernels():
            kernel = numba.njit(**options)(function)
            keep_apart(kernel)
        if options.get("no_cpython_wrapper"):
            _wrap_on_demand(kernel, options)
        return kernel

    return decorate


def thinned(columns: Iterable[np.ndarray], step: int) -> Iterator[np.ndarray]:
    """Every step-th row of columns, for kernels: side by side whatever the step is."""
    return (np.ascontiguousarray(column[::step]) for column in columns)


def _wrap_on_demand(inlined, options: dict) -> None:
    """Let Python call a function that has no wrapper: it is compiled once more then, with a wrapper."""

    @cache
    def wrapped():
        return numba.njit(**options | {"no_cpython_wrapper": False})(inlined.py_func)

    # Numba's two doors: what a call from Python finds compiled, and where it turns to if nothing fits its arguments.
    inlined.add_overload = lambda compiled: inlined.overloads.__setitem__(tuple(compiled.signature.args), compiled)
    inlined._compile_for_args = lambda *_, **__: wrapped()


# Lets LLVM vectorise sums over bands. Unlike full fast-math this keeps NaN and infinity. All threads run the same
# compiled code, so the order of every sum is the same in each.
FAST = {"reassoc", "contract", "arcp", "nsz"}

# No function is handed on as a C function, so none gets the wrapper for that, which takes time to compile and to load.
_COMMON = {"no_cfunc_wrapper": True, "_nrt": False, "pipeline_class": KernelCompiler}
KERNEL = _COMMON | {"cache": True, "nogil": True}
FAST_KERNEL = KERNEL | {"fastmath": FAST}

# For small functions that many kernels call: LLVM inlines them. Numba's own inlining would infer their types anew at
# every call, which took a quarter of the compile time of the first render. Without an explicit fastmath such a function
# would inherit the setting of whichever kernel is compiled first.
# Nearly all are called by kernels alone. A wrapper for Python, which takes tables of dozens of arrays apart, took a
# tenth to a fifth of the compile time.
INLINED = _COMMON | {"forceinline": True, "fastmath": False, "no_cpython_wrapper": True}
FAST_INLINED = INLINED | {"fastmath": FAST}
