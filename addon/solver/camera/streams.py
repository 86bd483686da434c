# SPDX-License-Identifier: GPL-3.0-or-later
"""Which dimensions of a camera path's random numbers each decision uses.

Each bounce has DIMENSIONS numbers, from DIMENSIONS * bounce on, for the choices that most bounces make. Each rarer
choice has a first dimension of its own, and one number or more for each bounce from there on.
"""

DIMENSIONS = 4
LOBE, SURVIVAL, GROUPING = 0, 2, 3  # first among the numbers of a bounce: two numbers, one, one
RECALLING, GATHERING, FEELING, LAMPS, SPLITTING, CONTINUING, PARTING, DOUBTING = (1 << k for k in range(17, 25))
WALKING, WALK_NUMBERS = 1 << 25, 16  # in media, first number and how many for each bounce
PASSING = 1 << 16  # through a thin sheet
LAMP_NUMBERS = 16  # numbers from LAMPS on, for each bounce
SEEING = 1 << 26  # further than the first number of a shadow ray: by which lobe it is seen
