# SPDX-License-Identifier: GPL-3.0-or-later
"""Stands for Blender's program where there is only its module: `-b [FILE] --command NAME ...`, of the add-on's
commands."""

import sys

import bpy

import addon
from addon import commands


def main(arguments):
    """Load the file and run the command; returns its exit code."""
    split = arguments.index("--command")
    blender, (name, *own) = arguments[:split], arguments[split + 1 :]
    bpy.ops.wm.read_factory_settings(use_empty=True)
    addon.register()
    files = [each for each in blender if each != "-b"]
    if files:
        bpy.ops.wm.open_mainfile(filepath=files[0])
    return commands.COMMANDS[name](own)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
