# SPDX-License-Identifier: GPL-3.0-or-later
"""Ranges of passes as commands are given them."""

from __future__ import annotations

import argparse
import re


def read_passes(text: str) -> range:
    """Passes such as '10-19', or '7'. Raises argparse.ArgumentTypeError."""
    match = re.fullmatch(r"(\d+)(?:-(\d+))?", text.strip())
    first, last = (int(match[1]), int(match[2] or match[1])) if match else (1, 0)
    if last < first:
        raise argparse.ArgumentTypeError(f"'{text}' are no passes, expected a first and a last one, such as 10-19")
    return range(first, last + 1)
