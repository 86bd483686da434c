# SPDX-License-Identifier: GPL-3.0-or-later
"""The render engine as Blender knows it. The work is in final_render and viewport, which are loaded when they are first
needed, because they bring the solver with its large libraries.
"""

from __future__ import annotations

import logging

import bpy

from .interface import ENGINE
from .rendering.last_render import last_failures
from .rendering.live_pictures import viewports
from .rendering.render_passes import register_passes
from .solver.physics.spectrum import LIBRARY_MISSING
from .solver.scene import SceneError

log = logging.getLogger(__name__)


class InfraredPhotonsEngine(bpy.types.RenderEngine):
    """Multi-pass spectral photon mapping of thermal infrared."""

    bl_idname = ENGINE
    bl_label = "Infrared Photons"
    bl_use_postprocess = True
    bl_use_eevee_viewport = True  # for the Material Preview
    bl_use_shading_nodes_custom = False

    def __init__(self, *args, **kwargs):
        super().__init__(*args, **kwargs)
        self._viewport = None
        self.geometries = {}  # kept between final renders, see render_view_layer; they end with the engine

    def __del__(self):
        # Blender may delete an engine whose __init__ never ran; and once Blender's own part of the object is gone, to
        # read an attribute in the ordinary way raises
        viewport = object.__getattribute__(self, "__dict__").get("_viewport")
        if viewport is not None:
            viewport.stop()

    def update_render_passes(self, scene=None, renderlayer=None):
        """Tell Blender, and so the compositor's sockets, which passes this engine fills."""
        register_passes(self, scene, renderlayer)

    def render(self, depsgraph):
        """Render one view layer; Blender calls this for each."""
        try:
            from .rendering.final_render import render_view_layer
        except ImportError as error:
            self._fail(depsgraph.scene.name, LIBRARY_MISSING.format(error))
            return
        try:
            render_view_layer(self, depsgraph)
        except (SceneError, OSError) as error:
            self._fail(depsgraph.scene.name, str(error))
        except MemoryError as error:
            self._fail(
                depsgraph.scene.name,
                f"Out of memory: {error}. Lower the resolution, the number of bands or the photons per pass",
            )
        except Exception as error:  # a mistake of ours: Blender alone would end with an empty image and no message
            self._fail(
                depsgraph.scene.name, f"The solver failed: {error!r}; the system console has the details", details=True
            )

    def view_update(self, context, depsgraph):
        """Something in the scene of a viewport in Rendered mode changed: read it."""
        try:
            from .rendering.viewport import Viewport
        except ImportError as error:
            self.update_stats("", LIBRARY_MISSING.format(error))
            return
        if self._viewport is None:
            self._viewport = Viewport(self)
        self._viewport.read(depsgraph, context.space_data)
        self.tag_redraw()

    def view_draw(self, context, depsgraph):
        """Draw a viewport in Rendered mode; Blender calls this whenever the view moved, too."""
        if self._viewport is not None:
            self._viewport.draw(self, context, depsgraph)

    def _fail(self, scene: str, message: str, details: bool = False) -> None:
        """Show the error: in the log, as a report, which a script that asked to render gets as an exception, and in the
        header.

        Blender's own error_set would add the same text to the report. scene: its name. details: whether the log tells
        of the exception.
        """
        log.error(message, exc_info=details)
        last_failures[scene] = message
        self.report({"ERROR"}, message)


def register():
    bpy.utils.register_class(InfraredPhotonsEngine)


def unregister():
    for viewport in list(viewports.values()):
        viewport.stop()
    bpy.utils.unregister_class(InfraredPhotonsEngine)
