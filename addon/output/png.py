# SPDX-License-Identifier: GPL-3.0-or-later
"""PNG files with 16 bits of temperature, K = offset + value * step, and with the scale as text (ISO/IEC 15948)."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..solver.system.files import replacing

LARGEST = np.iinfo(np.uint16).max
_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_GREY, _BITS = 0, 16


@dataclass(frozen=True)
class KelvinScale:
    """What the numbers of a 16-bit picture mean: K = offset + value * step. Both in K, step > 0."""

    offset: float = 0.0
    step: float = 0.01

    @property
    def hottest(self) -> float:
        """K of the largest number."""
        return self.offset + LARGEST * self.step

    def values(self, kelvin: np.ndarray) -> tuple[np.ndarray, int]:
        """(h, w) uint16 of temperatures (h, w), K, rounded, and how many pixels lie beyond the ends of the scale, which
        they get."""
        exact = np.rint((np.asarray(kelvin, np.float64) - self.offset) / self.step)
        inside = np.clip(exact, 0, LARGEST)
        return inside.astype(np.uint16), int(np.count_nonzero(inside != exact))


def write_png16(path: Path, values: np.ndarray, texts: Mapping[str, str]) -> None:
    """Write a grey picture. values: (h, w) uint16, row 0 at the bottom. texts: Latin-1, by keyword.

    An older file is replaced once the new one is complete. Raises OSError naming the path if it cannot be written.
    """
    height, width = values.shape
    rows = np.zeros((height, 1 + 2 * width), np.uint8)  # each begins with the number of its filter, 0 for none
    rows[:, 1:] = np.ascontiguousarray(values[::-1].astype(">u2")).view(np.uint8)
    chunks = [(b"IHDR", struct.pack(">IIBBBBB", width, height, _BITS, _GREY, 0, 0, 0))]
    chunks += [(b"tEXt", f"{name}\0{text}".encode("latin-1")) for name, text in texts.items()]
    chunks += [(b"IDAT", zlib.compress(rows.tobytes())), (b"IEND", b"")]
    with replacing(path, "the picture") as unfinished, open(unfinished, "wb") as file:
        file.write(_SIGNATURE)
        for kind, data in chunks:
            file.write(struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data)))
