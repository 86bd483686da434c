# SPDX-License-Identifier: GPL-3.0-or-later
"""List the solver's kernels in a file, for the extension: from it processes compile them side by side.

python -m docs.tools.list_kernels FILE

Takes minutes where the kernels are not compiled yet. A list of the same sources stays: no Python has other types.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from pathlib import Path

from addon.compiling.kernels import read_list, write_list
from addon.compiling.scenes import TINY_SCENES, render_tiny_scene
from addon.solver.system.kernel_cache import source_digest


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file", type=Path, nargs="?", help="what to write; without it kernels are compiled, no more")
    options = parser.parse_args()
    if options.file is None:
        for name in TINY_SCENES:
            render_tiny_scene(name)
        return
    known = read_list(options.file)
    if known.get("sources") == source_digest():
        print(f"{len(known['kernels'])} kernels are listed in {options.file}")
        return
    subprocess.run([sys.executable, "-m", "docs.tools.list_kernels"], check=True)  # see write_list
    print(f"{write_list(options.file)} kernels listed in {options.file}")


if __name__ == "__main__":
    main()
