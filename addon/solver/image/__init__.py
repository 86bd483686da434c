# SPDX-License-Identifier: GPL-3.0-or-later
"""The mean of the passes, its noise, and what is made of both."""
