# SPDX-License-Identifier: GPL-3.0-or-later
"""Draw docs/images/materials.png and write the table of docs/materials.md from the material library.

python -m docs.tools.plot_materials        (needs matplotlib)
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from addon.solver.physics import library
from docs.tools.pages import table, write_blocks
from docs.tools.paths import DOCS, IMAGES
from docs.tools.plots import pyplot

SCRIPT = "docs/tools/plot_materials.py"
PANELS = {
    "Metals": [
        "Gold, polished", "Copper, polished", "Aluminium, polished", "Iron, polished", "Titanium, polished",
        "Steel, cold rolled", "Aluminium, anodised black",
    ],
    "Water, skin, coatings": [
        "Water", "Ice", "Snow, coarse-grained", "Skin, human", "Paint, ultra-flat black",
        "Paint, lacquer on aluminium", "Soot",
    ],
    "Glass, ceramics, minerals": [
        "Glass, window", "Fused silica", "Alumina", "Silicon carbide", "Hematite", "Dolomite", "Kaolinite",
    ],
    "Plastics": [
        "Plastic, PET", "Plastic, PMMA (acrylic)", "Plastic, polycarbonate", "Plastic, polystyrene", "Plastic, PVC",
        "Silicone rubber (PDMS)",
    ],
    "Building materials (measured, 8-14 um)": [
        "Asphalt, road", "Brick, weathered", "Concrete, new", "Granite", "Limestone", "Sandstone",
    ],
    "Metal surfaces (measured, 8-14 um)": [
        "Aluminium, stucco sheet", "Aluminium, weathered", "Iron, weathered", "Lead, weathered",
        "Paint, dark green on metal",
    ],
}  # fmt: skip


def band_mean(points: np.ndarray, low: float, high: float) -> str:
    """Plain mean over wavelength of the part of low..high um that the points cover, as text; '-' if they cover none."""
    low, high = max(low, points[0, 0]), min(high, points[-1, 0])
    if low >= high:
        return "-"
    wavelength = np.unique(np.concatenate([[low, high], points[(points[:, 0] > low) & (points[:, 0] < high), 0]]))
    emissivity = np.interp(wavelength, points[:, 0], points[:, 1])
    area = np.sum(np.diff(wavelength) * (emissivity[1:] + emissivity[:-1]) / 2)
    return f"{area / (high - low):.3f}"


def table_of_materials() -> str:
    """One Markdown row for each material."""
    head, rows = ("material", "category", "kind", "range, um", "3-5 um", "8-14 um", "note", "source"), []
    for material in library.load().values():
        points = material.points
        row = (
            material.name,
            material.category,
            material.kind,
            f"{points[0, 0]:.3g}-{points[-1, 0]:.3g}",
            band_mean(points, 3.0, 5.0),
            band_mean(points, 8.0, 14.0),
            material.note,
            material.source,
        )
        rows.append(row)
    return table(head, *rows)


def draw(image: Path) -> None:
    """A panel for each group of PANELS."""
    figure, axes = pyplot().subplots(3, 2, figsize=(13, 13), sharex=True, layout="constrained")
    for axis, (title, names) in zip(axes.flat, PANELS.items(), strict=True):
        for low, high in ((3, 5), (8, 14)):
            axis.axvspan(low, high, color="0.93", zorder=0)
        for name in names:
            axis.plot(*library.find(name).T, label=name, linewidth=1.4)
        axis.set(title=title, xlim=(1, 20))
        axis.legend(fontsize=8)
    figure.supxlabel("wavelength, um (grey: 3-5 and 8-14 um)")
    figure.supylabel("spectral normal emissivity")
    figure.savefig(image, dpi=80)


if __name__ == "__main__":
    # no line about the code: a test holds that the table is that of the library as it is
    write_blocks(DOCS / "materials.md", SCRIPT, {"table": table_of_materials()}, last="")
    draw(IMAGES / "materials.png")
