# SPDX-License-Identifier: GPL-3.0-or-later
"""Run inside Blender with a window: what is on the screen, by ImageMagick."""

import subprocess


def capture(output: str, *options: str) -> bytes:
    """Take a picture of the whole screen, changed by ImageMagick's options.

    output: a file, or a format and '-', such as 'png:-', of what is returned.
    """
    command = ["import", "-window", "root", *options, output]
    return subprocess.run(command, check=True, capture_output=True).stdout
