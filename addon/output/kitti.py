# SPDX-License-Identifier: GPL-3.0-or-later
"""Labels as lines of text in the order of KITTI's object data set: http://www.cvlibs.net/datasets/kitti.

type truncated occluded alpha left top right bottom height width length x y z rotation_y

Boxes are in pixels from 0, right and bottom included. Sizes and places in space are not known here and hold what KITTI
writes for that: -1, -1000 and -10; occluded is 3, "unknown".
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

_UNKNOWN = "-1 -1 -1 -1000 -1000 -1000 -10"  # sizes, place and turn


def kitti_lines(content: Mapping) -> list[str]:
    """A line for each annotation of a picture in COCO's format, see coco.write_coco."""
    (picture,) = content["images"]
    names = {each["id"]: each["name"] for each in content["categories"]}
    return [_line(names[each["category_id"]], each, picture) for each in content["annotations"]]


def truncation(box: Sequence[float] | None, width: int, height: int) -> float:
    """Share of a box [x, y, width, height] that is beyond the picture; -1 of none, which is unknown."""
    if box is None or box[2] * box[3] <= 0.0:
        return -1.0
    x, y, w, h = box
    inside = max(0.0, min(x + w, width) - max(x, 0.0)) * max(0.0, min(y + h, height) - max(y, 0.0))
    return max(0.0, 1.0 - inside / (w * h))


def _line(name: str, annotation: Mapping, picture: Mapping) -> str:
    x, y, w, h = annotation["bbox"]
    cut = truncation(annotation["amodal_bbox"], picture["width"], picture["height"])
    kind = "_".join(name.split())  # a space would begin the next field
    return f"{kind} {cut:.2f} 3 -10 {x:.2f} {y:.2f} {x + w - 1:.2f} {y + h - 1:.2f} {_UNKNOWN}"
