# SPDX-License-Identifier: GPL-3.0-or-later
"""Planning: all that is learnt about a scene before the first pass, the same in every run."""
