# SPDX-License-Identifier: GPL-3.0-or-later
"""What of an object the camera sees, as its own settings and those of its collections say."""

from __future__ import annotations

from typing import NamedTuple


class Visibility(NamedTuple):
    """Of an object or an instance. hidden: the camera looks through it. holdout: it is a hole in the picture."""

    hidden: bool = False
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
    return Visibility(bool(indirect or not (obj.visible_camera and parent.visible_camera)), bool(holdout))
