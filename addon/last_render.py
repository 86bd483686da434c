# SPDX-License-Identifier: GPL-3.0-or-later
"""What the last render left, for those who must not load the solver: panels and handlers of a window that is drawn."""

import sys


def last_render(table: str) -> dict:
    """A table of final_render by its name, such as "finished_layers"; empty if nothing was rendered yet.

    The thread of a first render may be loading final_render just now, which then does not have its tables yet.
    """
    return getattr(sys.modules.get(f"{__package__}.final_render"), table, {})
