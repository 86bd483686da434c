# SPDX-License-Identifier: GPL-3.0-or-later
"""The base of operators that export files of a render."""

from __future__ import annotations

import os
from collections.abc import Collection

from bpy_extras.io_utils import ExportHelper

from ..output.formats import EXTENSIONS, without_extension


class Exporter(ExportHelper):
    """An ExportHelper that replaces known extensions alone: Blender's makes run_293.exr of run_293.2 and of run_293.7.

    extensions: those that it replaces.
    """

    extensions: Collection[str] = EXTENSIONS

    def target(self, suffix: str = "") -> str:
        """Path of a file: what was chosen, a view layer's suffix, the extension."""
        return f"{without_extension(self.filepath, self.extensions)}{suffix}{self.filename_ext}"

    def check(self, _context):
        chosen = self.filepath
        if os.path.basename(chosen):
            self.filepath = self.target()
        return self.filepath != chosen
