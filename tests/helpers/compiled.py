# SPDX-License-Identifier: GPL-3.0-or-later
"""How Numba compiles the path tracer of the tests."""

# No function is handed on as a C function: without the wrapper for that all compile in three quarters of the time.
COMPILED = {"cache": True, "nogil": True, "no_cfunc_wrapper": True}
