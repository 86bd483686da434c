# SPDX-License-Identifier: GPL-3.0-or-later
"""Export what was measured by the buttons in the sidebar and Blender's file browser, as part of a story."""

import time
from collections.abc import Iterator
from pathlib import Path

from tests.real_blender import hands

FILES = {
    "infrared.export_picture": "wall.png",
    "infrared.export_table": "wall.csv",
    "infrared.export_report": "wall.html",
}
TURNS = 20  # of the wheel, more than the sidebar is long
BROWSING, WRITING = 1.0, 30.0  # s: until the file browser is there, and most until a file is


def scroll(key: str) -> Iterator[float]:
    """To one end of the sidebar, by the wheel of the mouse."""
    sidebar = hands.region_of(hands.area_of("IMAGE_EDITOR"), "UI")
    yield from hands.move(sidebar.x + sidebar.width // 2, sidebar.y + sidebar.height // 2)
    for _ in range(TURNS):
        yield from hands.press(key)


def export_all(folder: str) -> Iterator[float]:
    """Write all three files into a folder. Raises TimeoutError if one of them does not come."""
    results = Path(folder).resolve()
    yield from scroll("WHEELDOWNMOUSE")
    for operator, name in FILES.items():
        sidebar = hands.region_of(hands.area_of("IMAGE_EDITOR"), "UI")
        yield from hands.hover(hands.area_of("IMAGE_EDITOR"), sidebar, hands.button(operator), 0.5)
        yield from hands.press("LEFTMOUSE")
        yield BROWSING
        browser = next(area for area in hands.newest_window().screen.areas if area.type == "FILE_BROWSER")
        params = browser.spaces.active.params
        params.directory, params.filename = str(results).encode(), name
        yield 0.5
        yield from hands.hover_middle(browser)
        yield from hands.press("RET")
        begin, path = time.monotonic(), results / name
        while not path.exists():
            if time.monotonic() > begin + WRITING:
                raise TimeoutError(f"No {path}")
            yield 0.2
        yield 0.5
    yield from scroll("WHEELUPMOUSE")
