# SPDX-License-Identifier: GPL-3.0-or-later
"""Compiling: the solver's kernels are made beforehand, by processes of their own, so that no render waits for them."""
