# SPDX-License-Identifier: GPL-3.0-or-later
"""Scripts that make what is in docs/: pages' figures, pictures, the library of materials, the template.

Each runs in the project's folder as `python -m docs.tools.NAME`.
"""
