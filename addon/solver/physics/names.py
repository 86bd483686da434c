# SPDX-License-Identifier: GPL-3.0-or-later
"""Names of a library, as users write them."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


def find_name(name: str, known: Iterable[str]) -> str | None:
    """The one of the known names that is name, letter case ignored; None if there is none."""
    folded = name.strip().casefold()
    return next((each for each in known if each.casefold() == folded), None)


def close_names(name: str, known: Iterable[str]) -> str:
    """Which known names are like a name that is not among them, as the end of a message; empty if none is."""
    by_folded_name = {each.casefold(): each for each in known}
    close = difflib.get_close_matches(name.strip().casefold(), by_folded_name, n=3, cutoff=0.4)
    return "; close names: " + ", ".join(f"'{by_folded_name[match]}'" for match in close) if close else ""
