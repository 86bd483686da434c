# SPDX-License-Identifier: GPL-3.0-or-later
"""What several tests and the scripts in docs/tools share: scenes, cases with exact solutions, Blender's files."""
