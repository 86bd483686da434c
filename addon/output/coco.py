# SPDX-License-Identifier: GPL-3.0-or-later
"""Labels of a picture in COCO's format: instances with masks, boxes and temperatures, and the camera.

The format is that of https://cocodataset.org/#format-data. Masks are run lengths, column by column from the top left;
boxes are [x, y, width, height] in pixels from there. What is not COCO's own is told by name: "amodal_bbox",
"temperature" of an instance, "frame" and "camera" of an image.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..solver.scene import Camera
from ..solver.system.files import replacing

_LEAST_DEPTH = 1e-6  # m before a camera, from which on something has a place in its picture


@dataclass(frozen=True)
class Labelled:
    """An instance of an object in a scene. category: an empty text for none."""

    name: str
    category: str


def run_lengths(pixels: np.ndarray, count: int) -> list[int]:
    """COCO's uncompressed run lengths: of pixels outside, inside and so on, beginning outside. pixels: (n,) ascending
    numbers of those inside, of `count`, column by column."""
    starts = pixels[np.diff(pixels, prepend=-2) > 1]
    stops = pixels[np.diff(pixels, append=count + 1) > 1] + 1
    *lengths, rest = np.diff([0, *np.column_stack((starts, stops)).ravel(), count]).tolist()
    return [*lengths, rest] if rest else lengths


def box_of(pixels: np.ndarray, height: int) -> list[int]:
    """[x, y, width, height] of at least one pixel of a picture of this height; pixels: see run_lengths."""
    columns, rows = np.divmod(pixels, height)
    x, y = int(columns.min()), int(rows.min())
    return [x, y, int(columns.max()) - x + 1, int(rows.max()) - y + 1]


def amodal_boxes(camera: Camera, corners: np.ndarray, instance: np.ndarray, count: int) -> np.ndarray | None:
    """(count, 4) float64 [x, y, width, height] of whole instances, hidden or not, in pixels from the top left of what
    is rendered, also beyond it; NaN of what is all behind the camera. None in a panorama, where no box need hold them.

    corners: (t, 3, 3) m, of triangles in the world. instance: (t,) which of count instances each belongs to.
    """
    if camera.kind == "PANORAMA":
        return None
    matrix = np.asarray(camera.matrix, np.float64)
    seen = (np.asarray(corners, np.float64) - matrix[:3, 3]) @ matrix[:3, :3]  # in the camera's axes
    points, owner = seen.reshape(-1, 3), np.repeat(instance, 3)
    if camera.kind == "PERSPECTIVE":
        points, owner = _before_the_camera(seen, instance)
    left, right, bottom, top = camera.frame
    depth = -points[:, 2] if camera.kind == "PERSPECTIVE" else 1.0
    x0, _, _, y1 = camera.pixels
    x = (points[:, 0] / depth - left) / (right - left) * camera.width - x0
    y = y1 - (points[:, 1] / depth - bottom) / (top - bottom) * camera.height
    low, high = np.full((count, 2), np.inf), np.full((count, 2), -np.inf)
    np.minimum.at(low, owner, np.column_stack((x, y)))
    np.maximum.at(high, owner, np.column_stack((x, y)))
    boxes = np.column_stack((low, high - low))
    boxes[~np.isfinite(boxes).all(axis=1)] = np.nan
    return boxes


def _before_the_camera(seen: np.ndarray, instance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Corners (n, 3) of the parts of triangles (t, 3, 3) that lie before a camera, and whose (n,) they are."""
    front = seen[:, :, 2] < -_LEAST_DEPTH
    points, owner = [seen[front]], [np.broadcast_to(instance[:, None], front.shape)[front]]
    for i, j in ((0, 1), (1, 2), (2, 0)):
        cut = front[:, i] != front[:, j]
        a, b = seen[cut, i], seen[cut, j]
        share = (-_LEAST_DEPTH - a[:, 2]) / (b[:, 2] - a[:, 2])
        points.append(a + share[:, None] * (b - a))
        owner.append(instance[cut])
    return np.concatenate(points), np.concatenate(owner)


def camera_facts(camera: Camera) -> dict[str, object]:
    """The pose of a camera, and of a perspective one its matrix of intrinsics, in pixels from the top left of what is
    rendered. "camera_to_world" is 4 x 4; a camera looks along -z, y is up."""
    facts = {"kind": camera.kind, "camera_to_world": np.asarray(camera.matrix, np.float64).tolist()}
    if camera.kind == "PERSPECTIVE":
        left, right, bottom, top = camera.frame
        x0, _, _, y1 = camera.pixels
        fx, fy = camera.width / (right - left), camera.height / (top - bottom)
        facts["intrinsics"] = [[fx, 0.0, -left * fx - x0], [0.0, fy, y1 + bottom * fy], [0.0, 0.0, 1.0]]
    return facts


def annotations(
    instances: Sequence[Labelled],
    image: np.ndarray,
    temperature: np.ndarray,
    boxes: np.ndarray | None,
    categories: Mapping[str, int],
) -> list[dict[str, object]]:
    """COCO's annotations of the instances with a category that are seen, numbered from 1.

    image: (h, w) number of the instance that each pixel sees, from 1, 0 for none; temperature: (h, w) K; row 0 at the
    bottom of both. boxes: see amodal_boxes. categories: numbers by name.
    """
    shape, found = image.shape, []
    seen, kelvins = (np.asarray(each)[::-1].ravel(order="F") for each in (image, temperature))
    order = np.argsort(seen, kind="stable")
    numbers, starts = np.unique(seen[order], return_index=True)
    for number, pixels in zip(numbers.astype(int).tolist(), np.split(order, starts[1:]), strict=True):
        instance = instances[number - 1] if number else None
        if instance is None or not instance.category:
            continue
        kelvin = kelvins[pixels]
        found.append(
            {
                "id": len(found) + 1,
                "image_id": 1,
                "category_id": categories[instance.category],
                "name": instance.name,
                "segmentation": {"size": list(shape), "counts": run_lengths(pixels, seen.size)},
                "area": len(pixels),
                "bbox": box_of(pixels, shape[0]),
                "amodal_bbox": None if boxes is None else [round(float(side), 3) for side in boxes[number - 1]],
                "temperature": {
                    "minimum": float(kelvin.min()), "mean": float(kelvin.mean(dtype=np.float64)),
                    "maximum": float(kelvin.max()),
                },
                "iscrowd": 0,
            }
        )  # fmt: skip
    return found


def write_coco(path: Path, picture: Mapping[str, object], found: list[dict], categories: Mapping[str, int]) -> None:
    """Write the labels of one picture. picture: the fields of its image in COCO's format, but for its id.

    An older file is replaced once the new one is complete. Raises OSError naming the path if it cannot be written.
    """
    content = {
        "info": {"description": "Infrared Photons; temperatures are apparent ones, in kelvin"},
        "images": [{"id": 1, **picture}],
        "categories": [{"id": number, "name": name} for name, number in categories.items()],
        "annotations": found,
    }
    write_content(path, content)


def write_content(path: Path, content: Mapping[str, object]) -> None:
    """Write what a file in COCO's format holds, as write_coco does. Raises OSError naming the path."""
    with replacing(path, "the labels") as unfinished:
        unfinished.write_text(json.dumps(content, allow_nan=False), encoding="utf-8")


def united(contents: Iterable[Mapping]) -> dict[str, object]:
    """The labels of many pictures as one, from those of each, whose categories are the same. Pictures keep their
    numbers, which have to differ; annotations get new ones."""
    images, found, first = [], [], {}
    for content in contents:
        first = first or content
        images += content["images"]
        for annotation in content["annotations"]:
            found.append({**annotation, "id": len(found) + 1, "image_id": content["images"][0]["id"]})
    return {
        "info": first.get("info", {}),
        "images": images,
        "categories": first.get("categories", []),
        "annotations": found,
    }
