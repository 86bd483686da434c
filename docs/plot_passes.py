# SPDX-License-Identifier: GPL-3.0-or-later
"""Draw images/passes.png: two bands and the noise of the demo, which has to be rendered first.

python run.py demo
python docs/plot_passes.py [render/demo-bands.exr]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import OpenEXR
from PIL import Image, ImageDraw, ImageFont

FOLDER = Path(__file__).resolve().parent
sys.path.insert(0, str(FOLDER.parent))

from addon.output.exr import channel_name  # noqa: E402
from addon.output.palette import display, robust_range, thermal  # noqa: E402
from addon.output.temperature_scale import ticks  # noqa: E402

SHOWN = (("7.50-7.90um", "W/(m2 sr um)"), ("13.10-13.50um", "W/(m2 sr um)"), ("Noise", "K"))
BACKGROUND, INK = (24, 24, 28), (225, 225, 225)
WIDTH, TITLE, MARGIN, BAR, GAP = 320, 24, 70, 14, 8  # pixels: of a picture, above and beside it, of the bar, between


def labelled(image: np.ndarray, title: str) -> Image.Image:
    """A (height, width) image whose row 0 is the top, with a title and a colour bar."""
    low, high = robust_range(image)
    size = (WIDTH, WIDTH * image.shape[0] // image.shape[1])
    colours = Image.fromarray(display(thermal(image, low, high))).resize(size, Image.Resampling.LANCZOS)
    result = Image.new("RGB", (WIDTH + MARGIN, TITLE + size[1]), BACKGROUND)
    result.paste(colours, (0, TITLE))
    draw, font = ImageDraw.Draw(result), ImageFont.load_default(13)
    draw.text((GAP, TITLE / 2), title, INK, font, "lm")
    left, top, bottom = WIDTH + GAP, TITLE + GAP, TITLE + size[1] - GAP
    scale = display(thermal(np.linspace(high, low, bottom - top), low, high))
    result.paste(Image.fromarray(np.repeat(scale[:, None], BAR, axis=1)), (left, top))
    for value in ticks(low, high):
        y = bottom - (value - low) / (high - low) * (bottom - top)
        draw.line((left + BAR, y, left + BAR + 4, y), INK)
        draw.text((left + BAR + 7, y), f"{value:g}", INK, font, "lm")
    return result


def main() -> None:
    path = Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER.parent / "render" / "demo-bands.exr"
    with OpenEXR.File(str(path)) as file:
        parts = [labelled(file.channels()[channel_name(name)].pixels, f"{name}, {unit}") for name, unit in SHOWN]
    picture = Image.new("RGB", (sum(part.width for part in parts) + GAP * (len(parts) - 1), parts[0].height), "white")
    x = 0
    for part in parts:
        picture.paste(part, (x, 0))
        x += part.width + GAP
    picture.save(FOLDER / "images" / "passes.png", optimize=True)


if __name__ == "__main__":
    main()
