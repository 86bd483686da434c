# SPDX-License-Identifier: GPL-3.0-or-later
"""Run inside Blender with `--enable-event-simulate`: an artist's mouse and keyboard, by simulated events.

Blender handles events only after a script gave way, so everything here is a generator of pauses (s), see story.py.
"""

import subprocess
from collections.abc import Callable, Iterator

import bpy

PAUSE = 0.05  # s that Blender is left to handle an event and to draw
STEP = 10  # pixels between two looks; a button is 20 high
DIGITS = ("ZERO", "ONE", "TWO", "THREE", "FOUR", "FIVE", "SIX", "SEVEN", "EIGHT", "NINE")
KEYS = {" ": "SPACE", ".": "PERIOD"} | {str(number): name for number, name in enumerate(DIGITS)}

_place = [0, 0]  # of the mouse in the window, pixels


def newest_window() -> bpy.types.Window:
    """The one that an artist has in front: a render or a file browser opens a window of its own."""
    return bpy.context.window_manager.windows[-1]


def area_of(kind: str) -> bpy.types.Area:
    """The first editor of a kind (an area's type), in the main window."""
    screen = bpy.context.window_manager.windows[0].screen
    return next(area for area in screen.areas if area.type == kind)


def region_of(area, kind: str = "WINDOW") -> bpy.types.Region:
    return next(region for region in area.regions if region.type == kind)


def _event(key: str, value: str, **more) -> None:
    newest_window().event_simulate(type=key, value=value, x=_place[0], y=_place[1], **more)


def move(x: int, y: int) -> Iterator[float]:
    _place[:] = int(x), int(y)
    _event("MOUSEMOVE", "NOTHING")
    yield PAUSE


def hover_middle(area) -> Iterator[float]:
    """Move the mouse into an editor, which gets the keys from then on."""
    yield from move(area.x + area.width // 2, area.y + area.height // 2)


def press(key: str, **modifiers: bool) -> Iterator[float]:
    """A key or a button of the mouse (an event's type), pressed and released."""
    _event(key, "PRESS", **modifiers)
    yield PAUSE
    _event(key, "RELEASE", **modifiers)
    yield PAUSE


def button_down() -> None:
    """Press the left button of the mouse."""
    _event("LEFTMOUSE", "PRESS")


def button_up() -> None:
    """Release it."""
    _event("LEFTMOUSE", "RELEASE")


def press_real_esc() -> None:
    """On the keyboard: an event that Blender simulates for itself does not break a render."""
    subprocess.run(["xdotool", "mousemove", "800", "450", "key", "Escape"], check=True)


def move_real_mouse(x: int, y: int) -> None:
    """To a pixel of the screen, from its upper left corner, where Blender does not simulate events."""
    subprocess.run(["xdotool", "mousemove", str(x), str(y)], check=True)


def write(text: str) -> Iterator[float]:
    """Letters, digits, spaces and full stops, on the keyboard."""
    for character in text:
        key = KEYS.get(character, character.upper())
        _event(key, "PRESS", unicode=character)
        _event(key, "RELEASE")
        yield PAUSE


def hover(area, region, wanted: Callable[[], bool], share: float) -> Iterator[float]:
    """Move down a region, at a share of its width, until the mouse is over what is wanted.

    Raises LookupError if it is nowhere.
    """
    x = region.x + int(share * region.width)
    for y in range(region.y + region.height - STEP, region.y, -STEP):
        yield from move(x, y)
        with bpy.context.temp_override(window=newest_window(), area=area, region=region):
            if wanted():
                return
    raise LookupError("The mouse found nothing that is wanted")


def field(owner, path: str) -> Callable[[], bool]:
    """Is this property of `owner` under the mouse? For `hover`."""
    return lambda: bpy.context.property is not None and bpy.context.property[:2] == (owner, path)


def button(operator: str) -> Callable[[], bool]:
    """Is a button of this operator under the mouse? For `hover`. Asks by Blender's Copy Python Command."""

    def under_the_mouse() -> bool:
        if not bpy.ops.ui.copy_python_command_button.poll():
            return False
        bpy.ops.ui.copy_python_command_button()
        return bpy.context.window_manager.clipboard.startswith(f"bpy.ops.{operator}(")

    return under_the_mouse


def open_tab(tab: str) -> Iterator[float]:
    """Click on the tabs of the Properties editor until it shows this one (a context of it)."""
    area = area_of("PROPERTIES")
    region, space = region_of(area, "NAVIGATION_BAR"), area.spaces.active
    for y in range(region.y + region.height - STEP, region.y, -2 * STEP):
        if space.context == tab:
            return
        yield from move(region.x + region.width // 2, y)
        yield from press("LEFTMOUSE")
    raise LookupError(f"There is no tab {tab}")


def change(owner, path: str, text: str) -> Iterator[float]:
    """Type a value into the field of a property in the Properties editor."""
    area = area_of("PROPERTIES")
    yield from hover(area, region_of(area), field(owner, path), 0.6)  # values stand to the right of names
    yield from press("RET")  # edits the field under the mouse, its text selected
    yield from press("A", ctrl=True)
    yield from write(text)
    yield from press("RET")


def push(operator: str) -> Iterator[float]:
    """Click on an operator's button in the Properties editor."""
    area = area_of("PROPERTIES")
    yield from hover(area, region_of(area), button(operator), 0.3)
    yield from press("LEFTMOUSE")
