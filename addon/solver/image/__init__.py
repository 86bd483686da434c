# SPDX-License-Identifier: GPL-3.0-or-later
"""The image: the mean of the passes, its noise, and what is computed from both."""
