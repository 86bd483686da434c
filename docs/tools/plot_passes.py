# SPDX-License-Identifier: GPL-3.0-or-later
"""Draw images/passes.png: two bands and the noise of the demo, which has to be rendered first.

python run.py demo
python -m docs.tools.plot_passes [render/demo-bands.exr]
"""

from __future__ import annotations

import sys
from pathlib import Path

import OpenEXR

from addon.output.exr import channel_name
from docs.tools.paths import DEMO_BANDS, IMAGES
from docs.tools.pictures import labelled, tiled

SHOWN = (("7.50-7.90um", "W/(m2 sr um)"), ("13.10-13.50um", "W/(m2 sr um)"), ("Noise", "K"))


def main() -> None:
    path = Path(sys.argv[1]) if len(sys.argv) > 1 else DEMO_BANDS
    with OpenEXR.File(str(path)) as file:
        parts = [labelled(file.channels()[channel_name(name)].pixels, f"{name}, {unit}") for name, unit in SHOWN]
    tiled(parts, len(parts)).save(IMAGES / "passes.png", optimize=True)


if __name__ == "__main__":
    main()
