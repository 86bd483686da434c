# SPDX-License-Identifier: GPL-3.0-or-later
"""Which rays see an object, as its own settings and those of its collections say."""

from __future__ import annotations

from typing import NamedTuple

from ..solver.scene import Hidden

# Blender's kinds of rays (visible_...) that have one here. The others are named, see ignored_settings.
RAYS = {"camera": Hidden.CAMERA, "diffuse": Hidden.DIFFUSE, "glossy": Hidden.GLOSSY, "shadow": Hidden.LIGHTS}

# Of an object that other rays than the camera's should pass, in a scene where gas scatters light
HIDDEN_IN_FOG = "ray visibility is ignored but for the camera's, as gas scatters light in this scene"


class Visibility(NamedTuple):
    """Of an object or an instance. hidden: which rays pass it. holdout: it is a hole in the picture."""

    hidden: Hidden = Hidden(0)
    holdout: bool = False


SEEN = Visibility()


def read_visibility(obj, parent, layer) -> Visibility:
    """The Visibility of an evaluated object in a view layer.

    parent: the object that instances it, or itself. As in Cycles (sync_object in its blender/object.cpp) an instance is
    hidden if either of the two is, and is a holdout if the parent is; collections count by the parent, which lies in
    the layer. A holdout is not hidden by being indirect only.
    """
    holdout = parent.is_holdout or parent.holdout_get(view_layer=layer)
    indirect = parent.indirect_only_get(view_layer=layer) and not holdout
    hidden = Hidden.CAMERA if indirect else Hidden(0)
    for ray, flag in RAYS.items():
        if not (getattr(obj, f"visible_{ray}") and getattr(parent, f"visible_{ray}")):
            hidden |= flag
    return Visibility(hidden, bool(holdout))
