# SPDX-License-Identifier: GPL-3.0-or-later
"""How Numba compiles the kernels.

Kernels, and the functions that are inlined into them, allocate no memory: callers pass in room for all results. So
kernels need not count references to arrays. Numba would count with locked instructions at every use of an array in a
tuple and at every row of an array; without counting, opening a node of a tree takes a third of the time. Reference
counting is part of Numba's runtime, which the option `_nrt` turns off. Numba then refuses to compile a function that
allocates, or that returns a row of an array: the few small functions that return rows are inlined by Numba itself,
`inline="always"`. Functions that make arrays take little time and are compiled with Numba's own settings.

A kernel is compiled for each combination of types of its arguments, and to Numba a literal number is a type of its own.
So a count that starts at 0 and is passed to a kernel starts as np.int64(0).
"""

from collections.abc import Callable

import numba

from .kernel_cache import keep_apart, kept_kernels


def njit(**options) -> Callable:
    """Numba's njit, for all kernels of the solver: compiled kernels are kept where kernel_cache says."""

    def decorate(function: Callable) -> Callable:
        with kept_kernels():
            kernel = numba.njit(**options)(function)
            keep_apart(kernel)
            return kernel

    return decorate


# Lets LLVM vectorise sums over bands. Unlike full fast-math this keeps NaN and infinity. All threads run the same
# compiled code, so the order of every sum is the same in each.
FAST = {"reassoc", "contract", "arcp", "nsz"}

# No kernel is handed on as a C function, so none gets the wrapper for that, which takes time to compile and to load.
KERNEL = {"cache": True, "nogil": True, "no_cfunc_wrapper": True, "_nrt": False}
FAST_KERNEL = KERNEL | {"fastmath": FAST}

# For small functions that many kernels call: LLVM inlines them. Numba's own inlining would infer their types anew at
# every call, which took a quarter of the compile time of the first render. Without an explicit fastmath such a function
# would inherit the setting of whichever kernel is compiled first.
INLINED = {"forceinline": True, "fastmath": False, "no_cfunc_wrapper": True, "_nrt": False}
FAST_INLINED = INLINED | {"fastmath": FAST}
