# SPDX-License-Identifier: GPL-3.0-or-later
"""Labels of a finished view layer."""

from __future__ import annotations

import logging
from pathlib import Path

import bpy
import numpy as np

from ..output.coco import amodal_boxes, annotations, camera_facts, write_coco
from ..reading.categories import numbered_categories
from ..solver import Scene

log = logging.getLogger(__name__)


def write_labels(
    path: Path, name: str, scene, surfaces, solver_scene: Scene, images: tuple[np.ndarray, np.ndarray]
) -> None:
    """Write the labels of what is seen of a Blender scene's instances.

    name: of the file of the picture. surfaces: the reader that has read the scene. images: (h, w) numbers of instances,
    and K. Raises OSError.
    """
    instance, temperature = images
    corners, owner = solver_scene.vertices[solver_scene.triangles], surfaces.labels("instance") - 1
    boxes = amodal_boxes(solver_scene.camera, corners, owner, len(surfaces.instances))
    categories = numbered_categories()
    found = annotations(surfaces.instances, instance, temperature, boxes, categories)
    height, width = instance.shape
    of_scene = Path(bpy.data.filepath).name or scene.name
    picture = {
        "file_name": name,
        "width": width,
        "height": height,
        "scene": of_scene,
        "frame": scene.frame_current,
        "camera": camera_facts(solver_scene.camera),
    }
    write_coco(path, picture, found, categories)
    log.info("%d instances of %d categories labelled in %s", len(found), len(categories), path)
