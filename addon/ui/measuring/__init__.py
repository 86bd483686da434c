# SPDX-License-Identifier: GPL-3.0-or-later
"""Measuring tools as the artist sees them: over the picture, in the toolbar, in the sidebar."""
