# SPDX-License-Identifier: GPL-3.0-or-later
"""Run a module of the project inside Blender:

    blender [OPTIONS] --python tests/real_blender/launch.py -- MODULE [ARGUMENT ...]

The module finds its arguments in sys.argv[1:], as in Python.
"""

import runpy
import sys
from pathlib import Path

sys.argv[:] = sys.argv[sys.argv.index("--") + 1 :]
# Blender runs scripts by their paths and knows nothing of the folder that their package is in; nor does it look at
# PYTHONPATH. This is the one place of the project that changes where Python looks for modules.
sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
runpy.run_module(sys.argv[0], run_name="__main__")
