# SPDX-License-Identifier: GPL-3.0-or-later
"""Scripts that make what is in docs/: pages' figures, pictures, the library of materials, the demo, the template.

Each runs in the project's folder as `python -m docs.tools.NAME`, and what makes pictures of Blender's window inside
Blender, see shoot_panels.py. They share where files are (paths), what is written into pages (pages), curves (plots),
thermal images (pictures), Blender as a Python module (blender) and its window (screenshots).
"""
