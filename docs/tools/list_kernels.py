# SPDX-License-Identifier: GPL-3.0-or-later
"""List the solver's kernels in a file, for the extension: from it processes compile them side by side.

python -m docs.tools.list_kernels FILE

Takes minutes where the kernels are not compiled yet. A list of the same sources stays, as no Python has other types,
and its kernels are compiled side by side, if they are not yet.
"""

from __future__ import annotations

import argparse
import multiprocessing
import subprocess
import sys
from functools import partial
from pathlib import Path

from addon.compiling.kernels import compile_kernel, read_list, write_list
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
        compile_listed(options.file, len(known["kernels"]))
        print(f"{len(known['kernels'])} kernels are listed in {options.file}")
        return
    subprocess.run([sys.executable, "-m", "docs.tools.list_kernels"], check=True)  # see write_list
    print(f"{write_list(options.file)} kernels listed in {options.file}")


def compile_listed(path: Path, count: int) -> None:
    """Compile the kernels of a list, in a process for each core."""
    with multiprocessing.get_context("spawn").Pool() as pool:
        pool.map(partial(compile_one, path), range(count), chunksize=1)


def compile_one(path: Path, index: int) -> None:
    """Compile one kernel of a list."""
    compile_kernel(read_list(path), index)


if __name__ == "__main__":
    main()
