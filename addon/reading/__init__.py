# SPDX-License-Identifier: GPL-3.0-or-later
"""From Blender's data to what the solver takes, and the judgements about it."""
