# SPDX-License-Identifier: GPL-3.0-or-later
"""Plots of curves, which matplotlib draws into files."""


def pyplot():
    """matplotlib.pyplot, which opens no window. Loaded when it is asked for: most of what scripts do needs no plots."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot

    return matplotlib.pyplot
