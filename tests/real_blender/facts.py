# SPDX-License-Identifier: GPL-3.0-or-later
"""Run inside Blender: tell the test what was found out."""

import json


def fact(name: str, value) -> None:
    """Print a line of JSON, as `facts` in tests/helpers/real_blender.py reads it."""
    print("FACT", json.dumps([name, value]), flush=True)
