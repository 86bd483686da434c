# SPDX-License-Identifier: GPL-3.0-or-later
"""The kernel cache: a change in any room is noticed, and without one nothing is compiled again."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from addon.solver.system import kernel_cache

SOLVER = Path(kernel_cache.__file__).parents[1]

# What a kernel in physics makes of one in sampling; what numba's cache says of it; where it was kept.
SCRIPT = """
from solver.physics import lobes
from solver.system.kernel_cache import kernel_folder
kernel = lobes._ggx_albedo
print(kernel(0.4, 4)[40], sum(kernel.stats.cache_hits.values()), sum(kernel.stats.cache_misses.values()))
print(kernel_folder())
"""


@pytest.fixture
def copy(tmp_path):
    """A copy of the solver's sources in a folder."""
    shutil.copytree(SOLVER, tmp_path / "solver", ignore=shutil.ignore_patterns("__pycache__"))
    return tmp_path / "solver"


def edit(path, old, new):
    text = path.read_text(encoding="utf-8")
    assert text.count(old) == 1
    path.write_text(text.replace(old, new), encoding="utf-8")


def test_kernels_are_compiled_anew_where_a_kernel_of_another_room_changes(copy, tmp_path):
    """In one process after the other, as a user's new version of the add-on would."""

    def run():
        environment = os.environ | {kernel_cache.FOLDER_VARIABLE: str(tmp_path / "kernels")}
        done = subprocess.run(
            [sys.executable, "-c", SCRIPT], cwd=tmp_path, env=environment, capture_output=True, text=True, check=True
        )
        numbers, folder = done.stdout.splitlines()
        value, hits, misses = numbers.split()
        assert Path(folder).parent == tmp_path / "kernels"
        return float(value), int(hits), int(misses), folder

    value, hits, misses, folder = run()
    assert (hits, misses) == (0, 1)
    assert run() == (value, 1, 0, folder)  # from the cache
    edit(copy / "sampling" / "warps.py", "_HALF_SQRT2 = 0.7071067811865476", "_HALF_SQRT2 = 0.65")
    edited, hits, misses, other = run()
    assert (hits, misses) == (0, 1)
    assert abs(edited - value) > 1e-3 and other != folder
    edit(copy / "sampling" / "warps.py", "_HALF_SQRT2 = 0.65", "_HALF_SQRT2 = 0.7071067811865476")
    assert run()[::3] == (value, folder)


def test_the_folder_of_kernels_is_another_after_a_change_of_any_file(copy, monkeypatch):
    monkeypatch.setattr(kernel_cache, "_SOLVER", copy)
    digest, before = kernel_cache.source_digest.__wrapped__, kernel_cache.source_digest()
    sources = sorted(copy.rglob("*.py"))
    assert len({path.parent for path in sources}) > 8 and digest() == before  # rooms, and the root
    for path in sources:
        text = path.read_bytes()
        path.write_bytes(text + b"# another version\n")
        assert digest() != before, path
        path.write_bytes(text)
