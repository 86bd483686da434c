# SPDX-License-Identifier: GPL-3.0-or-later
"""What a task of a farm costs besides its passes, and what a merge costs for each film.

python -m docs.tools.measure_farm [--passes 16]

Renders the demo's scene by the command infrared_passes, in processes of their own, and merges films of it. Prints a
pass, the fixed cost of a task, and the merge of a film, in seconds, and for 10, 100 and 1000 machines the passes a task
should have and the share of the machines' time that then goes into passes.
"""

import argparse
import math
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from docs.tools.paths import ROOT

COMMAND = (sys.executable, "-m", "tests.helpers.blender_command", "-b")
TOTAL = 4000  # passes of the picture that the machines share


def main():
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--passes", type=int, default=16, help="of the longer task")
    count = parser.parse_args().passes
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        _task(folder, 0, 1)  # compiles kernels
        short, long = _task(folder, 1, 1), _task(folder, 2, count)
        a_pass = (long - short) / (count - 1)
        fixed = short - a_pass
        for i in range(8):
            _task(folder, 2 + count + i, 1)
        films = sorted(folder.glob("*.npz"), key=lambda path: int(path.stem))
        two, ten = _merge(folder, films[-2:]), _merge(folder, films[-8:])
    a_film = (ten - two) / 6
    print(
        f"a pass {a_pass:.2f} s, fixed cost of a task {fixed:.1f} s, "
        f"merge {two - 2 * a_film:.1f} s and {a_film:.2f} s a film"
    )
    print("| machines | passes a task | time in passes |\n|---|---|---|")
    for machines in (10, 100, 1000):
        tasks, share = _best(machines, a_pass, fixed, a_film)
        print(f"| {machines} | {math.ceil(TOTAL / tasks)} | {share:.0%} |")


def _task(folder, first, count):
    film = folder / f"{first}.npz"
    command = [*COMMAND, ROOT / "docs" / "demo" / "demo.blend", "--command", "infrared_passes",
               "--passes", f"{first}-{first + count - 1}", "--film", film]  # fmt: skip
    return _seconds(command)


def _merge(folder, films):
    return _seconds([*COMMAND, "--command", "infrared_merge", *films, "--partial", "--output", folder / "out.exr"])


def _seconds(command):
    began = time.monotonic()
    subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.DEVNULL)
    return time.monotonic() - began


def _best(machines, a_pass, fixed, a_film):
    """Number of tasks, a multiple of the machines or fewer, that is fastest, and the share of the machines' time that
    goes into passes until the merge is done."""
    found = []
    for tasks in range(1, 4 * machines + 1):
        rounds = math.ceil(tasks / machines)
        seconds = rounds * (fixed + math.ceil(TOTAL / tasks) * a_pass) + fixed + tasks * a_film
        found.append((seconds, tasks))
    seconds, tasks = min(found)
    return tasks, TOTAL * a_pass / (machines * seconds)


if __name__ == "__main__":
    main()
