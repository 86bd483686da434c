# SPDX-License-Identifier: GPL-3.0-or-later
"""Ranges of passes and of frames as commands are given them."""

from __future__ import annotations

import argparse
import re

_LAST = 2**31 - 2  # Blender's settings count passes, from 0, in 32 bits


def read_passes(text: str) -> range:
    """Passes such as '10-19', or '7'. Raises argparse.ArgumentTypeError."""
    return _read_range(text, "passes", "10-19")


def read_frames(text: str) -> range:
    """Frames such as '1-100', or '7'. Raises argparse.ArgumentTypeError."""
    return _read_range(text, "frames", "1-100")


def _read_range(text: str, what: str, example: str) -> range:
    match = re.fullmatch(r"(\d+)(?:-(\d+))?", text.strip())
    first, last = (int(match[1]), int(match[2] or match[1])) if match else (1, 0)
    if last < first:
        raise argparse.ArgumentTypeError(f"'{text}' are no {what}, expected a first and a last one, such as {example}")
    if last > _LAST:
        raise argparse.ArgumentTypeError(f"'{text}' are no {what}: the last one is {last}, expected at most {_LAST}")
    return range(first, last + 1)
