# SPDX-License-Identifier: GPL-3.0-or-later
"""Run inside Blender with a window, with the extension installed and no kernel compiled: wait a minute while it
compiles them by itself, take the first picture, wait for the rest, render with air, and remove the extension while it
compiles again.

Argument: a folder for pictures of the screen. Prints facts, a line of JSON for each.
"""

import importlib
import os
import shutil
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import bpy

from tests.real_blender.facts import fact
from tests.real_blender.screen import capture
from tests.real_blender.story import tell

PICTURES = Path(sys.argv[1])
ADDONS = (each.module for each in bpy.context.preferences.addons)
MODULE = next(name for name in ADDONS if name.endswith(".infrared_photons"))
LONGEST = 800.0  # s
PATIENCE = 60.0  # s that a user waits before the first picture
SHOWN = 2.0  # s after which the window is drawn anew for certain


def module(name: str):
    """A module of the extension; None if it is not loaded."""
    return sys.modules.get(f"{MODULE}.{name}")


def waited(condition, seconds: float = LONGEST) -> Iterator[float]:
    """Pause until a condition holds."""
    end = time.monotonic() + seconds
    while not condition() and time.monotonic() < end:
        yield 0.02
    assert condition()


def kernels() -> int:
    """How many compiled kernels there are."""
    return len(list(Path(os.environ["INFRARED_PHOTONS_KERNELS"]).rglob("*.nbc")))


def misses() -> int:
    """How many kernels this process has compiled, as it did not find them."""
    kernels_module = importlib.import_module(f"{MODULE}.compiling.kernels")
    kept = {kernel for kernel, _ in kernels_module._loaded()}
    return sum(sum(kernel.stats.cache_misses.values()) for kernel in kept)


def compiling() -> bool:
    return module("ui.kernels").is_compiling()


def show_preferences() -> None:
    bpy.ops.screen.userpref_show("INVOKE_DEFAULT")
    bpy.context.preferences.active_section = "ADDONS"
    bpy.context.window_manager.addon_search = "Infrared"
    bpy.ops.preferences.addon_expand(module=MODULE)


def story() -> Iterator[float]:
    begin = time.monotonic()
    assert kernels() == 0
    yield from waited(compiling, 30.0)
    fact("begins after", time.monotonic() - begin)
    fact("processes", len(module("ui.kernels")._compilation._processes))
    show_preferences()
    yield from waited(lambda: module("ui.kernels")._compilation.done > 0)
    yield SHOWN
    capture(str(PICTURES / "compiling.png"))
    yield from waited(lambda: not compiling() or time.monotonic() - begin > PATIENCE)
    fact("loads", [name for name in ("numba", "embreex", "OpenEXR") if name in sys.modules])  # by Blender itself
    scene = bpy.context.scene
    scene.render.engine = "INFRARED_PHOTONS"
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 640, 480, 100
    scene.world["temperature"], bpy.data.objects["Cube"]["temperature"] = 280.0, 320.0
    scene.infrared.passes = 2  # the first picture does not wait for more
    pressed, ended, shown = time.monotonic(), [], []
    bpy.app.handlers.render_complete.append(lambda *_: ended.append(time.monotonic()))
    bpy.ops.render.render("INVOKE_DEFAULT")
    yield from waited(lambda: hasattr(module("rendering.final_render"), "write_groups"))  # its last name
    final = module("rendering.final_render")
    write = final.write_images

    def write_images(result, images):
        write(result, images)
        shown.append(time.monotonic())

    final.write_images = write_images
    yield from waited(lambda: bool(ended))
    final.write_images = write
    fact("first picture after", shown[0] - pressed)
    fact("complete after", ended[0] - pressed)
    fact("kernels compiled by the first picture", misses())
    yield SHOWN
    capture(str(PICTURES / "rendered.png"))

    yield from waited(lambda: not compiling())
    fact("compiled in", time.monotonic() - begin)
    fact("problem", module("ui.kernels")._compilation.problem)
    fact("complete", module("compiling.compilation").is_complete())
    fact("kernels", kernels())
    yield SHOWN
    capture(str(PICTURES / "compiled.png"))

    before = misses()
    scene.world["absorption"], scene.world["depth"] = 0.01, 10.0  # kernels that the first picture had no use for
    ended.clear()
    bpy.ops.render.render("INVOKE_DEFAULT")
    yield from waited(lambda: bool(ended))
    fact("kernels compiled by the render", misses() - before)

    shutil.rmtree(module("solver.system.kernel_cache").kernel_folder())
    module("solver.system.kernel_cache").kernel_folder.cache_clear()
    bpy.ops.infrared.compile_kernels()
    processes = module("ui.kernels")._compilation._processes
    yield from waited(lambda: kernels() > 0)
    bpy.ops.render.render("INVOKE_DEFAULT")  # this compiles, too, until Esc, and then goes on alone
    bpy.ops.extensions.package_uninstall(repo_index=index_of_repository(), pkg_id="infrared_photons")
    fact("processes when removed", sum(process.poll() is None for process in processes))
    yield SHOWN
    fact("modules when removed", [name for name in sys.modules if name.startswith(MODULE)])
    fact("end", True)


def index_of_repository() -> int:
    """Of the repository that the extension came from."""
    repositories = bpy.context.preferences.extensions.repos
    return next(i for i, each in enumerate(repositories) if each.module == MODULE.split(".")[1])


tell(story())
