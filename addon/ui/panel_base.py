# SPDX-License-Identifier: GPL-3.0-or-later
"""Base classes of the panels in Blender's Properties editor."""

from __future__ import annotations

from ..interface import ENGINE


class InfraredPanel:
    """Base of all panels: a tab of the Properties editor while this engine is chosen."""

    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "render"
    COMPAT_ENGINES = {ENGINE}

    @classmethod
    def poll(cls, context):
        return context.engine in cls.COMPAT_ENGINES

    def column(self, **options):
        """A column in Blender's usual style: names to the left, values to the right. options: of UILayout.column."""
        self.layout.use_property_split = True
        return self.layout.column(**options)


class RenderSettingsPanel(InfraredPanel):
    """Base of panels on scene.infrared: settings are not keyed as a rule."""

    def draw(self, context):
        self.layout.use_property_decorate = False
        self.draw_settings(self.column(), context.scene.infrared)
