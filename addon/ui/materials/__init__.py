# SPDX-License-Identifier: GPL-3.0-or-later
"""Panels and operators of materials: the library, curves of emissivity, their pictures."""
