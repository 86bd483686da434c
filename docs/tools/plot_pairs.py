# SPDX-License-Identifier: GPL-3.0-or-later
"""Draw pairs of a folder that infrared_pairs has made, with the boxes of their labels: images/pairs.png.

python -m docs.tools.plot_pairs FOLDER
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from docs.tools.paths import IMAGES

FRAMES = 1, 2, 3
LOW, HIGH = 262.15, 305.15  # K: black and white
COLOURS = {"car": (255, 80, 60), "person": (80, 255, 80)}


def draw(folder: Path) -> Image.Image:
    """The pictures of FRAMES: RGB to the left, thermal to the right."""
    scale = json.loads((folder / "pairs.json").read_text(encoding="utf-8"))["scale"]
    labels = json.loads((folder / "labels.json").read_text(encoding="utf-8"))
    names = {each["id"]: each["name"] for each in labels["categories"]}
    rows = []
    for frame in FRAMES:
        name = f"frame_{frame:04d}.png"
        with Image.open(folder / "rgb" / name) as rgb, Image.open(folder / "thermal" / name) as thermal:
            kelvin = scale["offset"] + scale["step"] * np.array(thermal, float)
            grey = np.clip((kelvin - LOW) / (HIGH - LOW), 0.0, 1.0) * 255.0
            pair = [rgb.convert("RGB"), Image.fromarray(grey.astype(np.uint8)).convert("RGB")]
        for annotation in (each for each in labels["annotations"] if each["image_id"] == frame):
            x, y, width, height = annotation["bbox"]
            for picture in pair:
                corners = (x, y, x + width - 1, y + height - 1)
                ImageDraw.Draw(picture).rectangle(corners, outline=COLOURS.get(names[annotation["category_id"]]))
        rows.append(np.hstack([np.array(picture) for picture in pair]))
    return Image.fromarray(np.vstack(rows))


def main() -> None:
    draw(Path(sys.argv[1])).save(IMAGES / "pairs.png", optimize=True)


if __name__ == "__main__":
    main()
