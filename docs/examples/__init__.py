# SPDX-License-Identifier: GPL-3.0-or-later
"""Example scenes, each with the script that makes it: `python -m docs.examples.NAME` in the project's folder."""
