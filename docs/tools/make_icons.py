# SPDX-License-Identifier: GPL-3.0-or-later
"""Make the icons of the measuring tools, addon/ui/measuring/icons/*.dat, in Blender's format of triangles:

    python -m docs.tools.make_icons

A file is b"VCO", a zero, width, height and origin (a byte each), then x and y of the corners of all triangles (a byte
each, y upwards), then their colours (RGBA, a byte each).
"""

import math

from docs.tools.paths import ROOT

FOLDER = ROOT / "addon" / "ui" / "measuring" / "icons"
INK, POINT = (235, 235, 235, 255), (255, 150, 40, 255)
THICK = 12.0  # of lines; the whole is 255 wide


def stroke(start, end, width=THICK, colour=INK):
    """Two triangles along a line."""
    (x0, y0), (x1, y1) = start, end
    length = math.hypot(x1 - x0, y1 - y0)
    dx, dy = 0.5 * width * (x1 - x0) / length, 0.5 * width * (y1 - y0) / length
    a, b = (x0 - dx + dy, y0 - dy - dx), (x0 - dx - dy, y0 - dy + dx)
    c, d = (x1 + dx - dy, y1 + dy + dx), (x1 + dx + dy, y1 + dy - dx)
    return [((a, b, c), colour), ((a, c, d), colour)]


def dot(place, radius=20.0, colour=POINT):
    """A disk of triangles."""
    ring = [(place[0] + radius * math.cos(a), place[1] + radius * math.sin(a)) for a in angles(12)]
    return [((place, here, there), colour) for here, there in zip(ring, ring[1:] + ring[:1], strict=True)]


def angles(count):
    return [2.0 * math.pi * index / count for index in range(count)]


def outline(corners):
    """Strokes from corner to corner and back."""
    return [each for a, b in zip(corners, corners[1:] + corners[:1], strict=True) for each in stroke(a, b)]


def shapes():
    """The triangles of each icon by its name."""
    box = [(40, 60), (215, 60), (215, 195), (40, 195)]
    round_ = [(127 + 92 * math.cos(a), 127 + 70 * math.sin(a)) for a in angles(28)]
    corners = [(45, 95), (110, 205), (215, 165), (195, 60), (110, 50)]
    cross = [
        each
        for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1))
        for each in stroke((127 + 38 * dx, 127 + 38 * dy), (127 + 95 * dx, 127 + 95 * dy))
    ]
    return {
        "spot": [*cross, *dot((127, 127))],
        "line": [*stroke((50, 60), (205, 195)), *dot((50, 60)), *dot((205, 195))],
        "box": [*outline(box), *dot(box[0]), *dot(box[2])],
        "ellipse": [*outline(round_), *dot((35, 57)), *dot((219, 197))],
        "polygon": [*outline(corners), *(part for corner in corners for part in dot(corner))],
    }


def as_bytes(triangles):
    places = bytes(round(min(max(value, 0), 255)) for corners, _ in triangles for x, y in corners for value in (x, y))
    colours = bytes(value for corners, colour in triangles for _ in corners for value in colour)
    return b"VCO\0" + bytes((255, 255, 0, 0)) + places + colours


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    for name, triangles in shapes().items():
        (FOLDER / f"measure_{name}.dat").write_bytes(as_bytes(triangles))
