# SPDX-License-Identifier: GPL-3.0-or-later
"""Temperatures of a wall of black tiles, one for each pixel of a render, for both sides of a test in real Blender."""

import numpy as np

COLUMNS, ROWS = 59, 45
LOW, HIGH = 280.0, 340.0  # K

kelvin = np.random.default_rng(7).uniform(LOW, HIGH, (ROWS, COLUMNS))  # of the tiles, row 0 at the bottom
