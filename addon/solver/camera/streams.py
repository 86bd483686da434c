# SPDX-License-Identifier: GPL-3.0-or-later
"""Dimensions of a camera path's random numbers: which decision takes which.

A bounce has DIMENSIONS numbers at DIMENSIONS * bounce, for the choices that most bounces make; rarer ones start at
numbers of their own, one or more for each bounce.
"""

DIMENSIONS = 4
LOBE, SURVIVAL, GROUPING = 0, 2, 3  # of those of a bounce: two numbers, one, one
RECALLING, GATHERING, FEELING, LAMPS, SPLITTING, CONTINUING = (1 << k for k in range(17, 23))
LAMP_NUMBERS = 16  # of LAMPS, for each bounce
