# SPDX-License-Identifier: GPL-3.0-or-later
"""Jobs: final renders, the viewport, which passes there are and where files go."""
