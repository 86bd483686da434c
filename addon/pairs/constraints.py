# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether constraints of objects leave anything of what is drawn for their poses."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ..kept import Kept
from ..solver.scene import SceneError
from .changes import Change
from .ranges import POSES


def check_constraints(changes: Iterable[Change], scene, layer) -> None:
    """Raise SceneError, naming rule, key and object, if its constraints leave nothing of what is drawn."""
    for change in changes:
        for obj in change.blocks if change.key in (*POSES, "scale") else ():
            names = ", ".join(each.name for each in obj.constraints if not each.mute)
            for part in change.ranges if names else ():
                if _is_lost(change, part, obj, scene, layer):
                    where = change.where + f".{part}" * bool(part)
                    raise SceneError(
                        f"{where}: the constraints of '{obj.name_full}' ({names}) leave nothing of it; draw for what "
                        "they follow, or disable them"
                    )


def _is_lost(change: Change, part: str, obj, scene, layer) -> bool:
    """Whether a part that is drawn makes a difference to an object's place in the world only without constraints.

    The ends of the range are compared, or, where they say the same, that of the file with them.
    """
    free, held = (_places(change, part, obj, scene, layer, mute) for mute in (True, False))
    for one, other in ((1, 2), (0, 1)):
        if not np.allclose(free[one], free[other], rtol=1e-6, atol=1e-6):
            return np.allclose(held[one], held[other], rtol=1e-6, atol=1e-6)
    return False


def _places(change: Change, part: str, obj, scene, layer, mute: bool) -> list[np.ndarray]:
    """An object's matrices to the world: that of the file, and those at the low and the high end of a part."""
    found = []
    for value in (None, *change.ranges[part]):
        with Kept() as kept:
            if obj.type == "CAMERA":  # which of several is the scene's, and moves, depends on the frame
                kept.set(scene, camera=obj)
            for each in obj.constraints if mute else ():
                kept.set(each, mute=True)
            if value is not None:
                change.apply(kept, {part: value})
            layer.update()
            found.append(np.array(obj.evaluated_get(layer.depsgraph).matrix_world))
    return found
