# SPDX-License-Identifier: GPL-3.0-or-later
"""How Numba compiles the kernels.

Kernels and what is inlined into them allocate nothing: who calls them brings the room. So they need not count
references to arrays, which Numba would do with locked instructions at every use of an array out of a tuple and at every
row of one: without, opening a node of a tree takes a third of the time. `_nrt` stands for Numba's runtime, which counts
them; it refuses to compile what allocates after all, and what returns a row of an array: the few small functions that
do are inlined by Numba itself, `inline="always"`. Functions that make arrays, in which little time is spent, are
compiled with Numba's own settings.

A kernel is compiled for each set of types that it is called with, and to Numba a number written in the code is a type
of its own: where a kernel is called with a count that starts at 0, that is np.int64(0).
"""

from collections.abc import Callable

import numba

from .kernel_cache import kept_kernels


def njit(**options) -> Callable:
    """Numba's, for all kernels here: what it compiles is kept where kernel_cache says."""

    def decorate(function: Callable) -> Callable:
        with kept_kernels():
            return numba.njit(**options)(function)

    return decorate


# Lets LLVM vectorise sums over bands. Unlike full fast-math it keeps NaN and infinity, and the compiled code, so the
# order of every sum, is the same in every thread.
FAST = {"reassoc", "contract", "arcp", "nsz"}

# No kernel is handed on as a C function, so none gets the wrapper for that, which takes time to compile and to load.
KERNEL = {"cache": True, "nogil": True, "no_cfunc_wrapper": True, "_nrt": False}
FAST_KERNEL = KERNEL | {"fastmath": FAST}

# Of small functions that many kernels call: LLVM puts them into each. Numba's own inlining would infer their types anew
# at every call, which made up a quarter of the time that the first render compiles. Without a word on fastmath they
# would inherit that of whichever kernel happens to be compiled first.
INLINED = {"forceinline": True, "fastmath": False, "no_cfunc_wrapper": True, "_nrt": False}
FAST_INLINED = INLINED | {"fastmath": FAST}
