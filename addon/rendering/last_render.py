# SPDX-License-Identifier: GPL-3.0-or-later
"""What the last render left, for those who must not load the solver: panels and handlers of a window that is drawn."""

import sys

TABLES = ("finished_layers", "finished_frames", "finished_groups")  # of final_render


def last_render(table: str) -> dict:
    """A table of final_render by its name, such as "finished_layers"; empty if nothing was rendered yet.

    The thread of a first render may be loading final_render just now, which then does not have its tables yet.
    """
    return getattr(sys.modules.get(f"{__package__}.final_render"), table, {})


def forget_last_render() -> None:
    """Empty all tables: a new render begins, or another file is open."""
    for table in TABLES:
        last_render(table).clear()
