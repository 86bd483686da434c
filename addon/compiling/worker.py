# SPDX-License-Identifier: GPL-3.0-or-later
"""A process that compiles kernels. `compilation` starts it as a script, outside of Blender, and tells it what to do.

It reads lines of JSON: first where the add-on is, a `Place`, then one task after the other. To each it answers with a
line of JSON: an empty text, or what went wrong. It ends with its input, so no later than Blender.
"""

import importlib
import json
import os
import sys
import types
from pathlib import Path


def enter(path: list[str], package: str, folder: str) -> None:
    """Make the add-on importable by the name that it has in Blender: kernels are kept under the names of their modules.

    path: sys.path of Blender. package: the add-on's full name. folder: where it is.
    """
    sys.path[:] = path
    names = package.split(".")
    for depth in range(1, len(names)):  # Blender makes these, which are no folders
        parent = types.ModuleType(".".join(names[:depth]))
        parent.__path__ = [str(Path(folder).parent)] if depth == len(names) - 1 else []
        sys.modules[parent.__name__] = parent
    if len(names) == 1:
        sys.path.insert(0, str(Path(folder).parent))


def main() -> None:
    """Do what the lines of the input say until it ends."""
    answers, sys.stdout = sys.stdout, sys.stderr  # what libraries print is no answer
    if hasattr(os, "nice"):
        os.nice(10)  # Windows is told so when it starts the process
    place = json.loads(sys.stdin.readline())
    content = Path(place.pop("listed"))
    enter(**place)
    compiling = importlib.import_module(place["package"] + ".compiling.kernels")
    listed = compiling.read_list(content)
    for line in sys.stdin:
        task, problem = json.loads(line), ""
        try:
            if isinstance(task, str):
                compiling.render_tiny_scene(task)
            else:
                compiling.compile_kernel(listed, task)
        except Exception as error:  # told to the artist
            problem = f"{type(error).__name__}: {error}"
        print(json.dumps(problem), file=answers, flush=True)


if __name__ == "__main__":
    main()
