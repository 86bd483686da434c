# SPDX-License-Identifier: GPL-3.0-or-later
"""Kernels are compiled in the background: by several processes, which share the work, can be ended, and go on later."""

import json
import os
import subprocess
import sys
import time
from types import SimpleNamespace

import pytest

bpy = pytest.importorskip("bpy")

import numpy as np  # noqa: E402
from numba.core import types  # noqa: E402
from numba.core.caching import IndexDataCacheFile  # noqa: E402

from addon.compiling import compilation, kernels  # noqa: E402
from addon.compiling.compilation import Compilation, is_complete  # noqa: E402
from addon.solver.geometry.textures import TextureTable  # noqa: E402
from addon.solver.geometry.triangles import Corners  # noqa: E402
from addon.solver.system import kernel_cache  # noqa: E402
from addon.ui import kernels as background  # noqa: E402
from tests.helpers.scenes import loose  # noqa: E402

pytestmark = pytest.mark.once  # of processes and files, the same on every Python

ROOT = compilation.FOLDER.parent
LONG = 120.0  # s, in which a few small kernels are compiled on any machine

CORNERS = types.NamedTuple((types.float64[:, ::1], types.int32[:, ::1]), Corners)
SMALL = (  # kernels that compile in about a second, with the types that renders have
    (".geometry.triangles", "areas", (CORNERS,)),
    (".geometry.triangles", "centroids", (CORNERS,)),
    (".geometry.triangles", "planes", (CORNERS,)),
    (".sampling.rng", "uniforms", (types.uint64, types.int64, types.int64)),
)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty folder for kernels, and a list of four small ones."""
    table = kernels.TypeTable()
    listed = [[module, name, [table.number(kind) for kind in given]] for module, name, given in SMALL]
    path = tmp_path / "kernels.json"
    path.write_text(json.dumps({"types": table.rows, "kernels": listed}))
    monkeypatch.setattr(compilation, "LIST", path)
    monkeypatch.setenv(kernel_cache.FOLDER_VARIABLE, str(tmp_path / "kernels"))
    kernel_cache.kernel_folder.cache_clear()
    yield tmp_path / "kernels"
    kernel_cache.kernel_folder.cache_clear()


def finish(work: Compilation) -> None:
    """Wait for it, but not for ever."""
    end = time.monotonic() + LONG
    while work.is_running() and time.monotonic() < end:
        time.sleep(0.05)
    assert not work.is_running()


def running(work: Compilation) -> int:
    return sum(process.poll() is None for process in work._processes)


# The list


def test_types_go_through_a_file_unchanged():
    kinds = [
        types.float32,
        types.boolean,
        types.literal(3),
        types.Array(types.uint64, 2, "A", readonly=True),
        types.Array(types.float32, 1, "C", readonly=False, aligned=False),
        types.UniTuple(types.float64, 3),
        types.Tuple((types.int64, types.UniTuple(types.float32[::1], 2))),
        types.BaseTuple.from_types([types.float32[::1]] * len(TextureTable._fields), TextureTable),
    ]
    table = kernels.TypeTable()
    numbers = [table.number(kind) for kind in [*kinds, *kinds]]
    assert numbers[: len(kinds)] == numbers[len(kinds) :]  # each is there once
    again = kernels.TypeTable(json.loads(json.dumps(table.rows)))
    assert [again.type(number) for number in numbers] == [*kinds, *kinds]
    assert again.type(numbers[7]).instance_class is TextureTable
    with pytest.raises(TypeError, match="unicode"):
        table.number(types.unicode_type)


def test_a_kernel_of_the_list_is_the_one_that_a_call_needs(folder):
    """With the types of the list nothing is left to compile for the call."""
    content = kernels.read_list(compilation.LIST)
    for index in range(len(SMALL)):
        kernels.compile_kernel(content, index)
    areas = kernels.find(".geometry.triangles", "areas")
    before = len(areas.signatures)
    np.testing.assert_allclose(areas(loose(np.array([[[0.0, 0, 0], [2, 0, 0], [0, 3, 0]]]))), [3.0])
    assert len(areas.signatures) == before


# The processes


def test_processes_share_the_kernels_and_leave_a_mark(folder):
    assert not is_complete()
    work = Compilation(processes=2, scenes=())
    work.start(bpy.app.python_args)
    finish(work)
    assert (work.done, work.total, work.problem, running(work)) == (len(SMALL), len(SMALL), "", 0)
    assert is_complete()
    kept = {path.name.split("-")[0] for path in folder.rglob("*.nbi")}
    assert {f"{module.rpartition('.')[2]}.{name}" for module, name, _ in SMALL} <= kept
    # another process takes them from there
    script = (
        "from addon.compiling import kernels; from pathlib import Path; "
        f"content = kernels.read_list(Path({str(compilation.LIST)!r})); "
        "[kernels.compile_kernel(content, i) for i in range(4)]; "
        "found = [kernels.find(m, n) for m, n, _ in content['kernels']]; "
        "print(sum(sum(k.stats.cache_hits.values()) for k in found), "
        "sum(sum(k.stats.cache_misses.values()) for k in found))"
    )
    done = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["4", "0"]


def test_cancelled_work_goes_on_at_the_next_start(folder, monkeypatch):
    work = Compilation(processes=1, scenes=())
    work.start()
    end = time.monotonic() + LONG
    while work.done == 0 and time.monotonic() < end:
        time.sleep(0.01)
    work.cancel()
    work.wait()
    assert 0 < work.done < len(SMALL) and running(work) == 0 and work.cancelled and not work.problem
    assert not is_complete()
    first = {path.name for path in folder.rglob("*.nbc")}
    assert first
    again = Compilation(processes=1, scenes=())
    again.start()
    finish(again)
    assert is_complete() and first <= {path.name for path in folder.rglob("*.nbc")}
    monkeypatch.setattr(compilation, "_stamp", lambda: "sources with other dates")
    assert not is_complete()  # the mark is of these sources alone


def test_a_process_that_dies_is_told(folder):
    work = Compilation(processes=1, scenes=())
    work.start()
    work._processes[0].kill()
    finish(work)
    assert "ended early" in work.problem and not is_complete()


def test_a_list_that_is_out_of_date_is_made_up_for_by_scenes_and_a_scene_that_fails_is_told(folder):
    content = json.loads(compilation.LIST.read_text())
    content["kernels"].append([".geometry.triangles", "no_such_kernel", []])
    compilation.LIST.write_text(json.dumps(content))
    work = Compilation(processes=2, scenes=())
    work.start()
    finish(work)
    assert work.problem == "" and is_complete()
    work = Compilation(processes=1, scenes=("no such scene",))
    work.start()
    finish(work)
    assert "no such scene" in work.problem


def test_without_a_list_the_first_scene_comes_before_the_others(monkeypatch, tmp_path):
    monkeypatch.setattr(compilation, "LIST", tmp_path / "none.json")
    work = Compilation(scenes=("room", "open", "gas"))
    assert work._take() == "room"
    work._end("room", "")
    assert {work._take(), work._take()} == {"open", "gas"} and work._take() is None


def test_workers_end_with_blender(folder):
    """Even if it is killed: they read what to do from it."""
    worker = subprocess.Popen(
        [sys.executable, compilation.FOLDER / "compiling" / "worker.py"], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    place = {"path": sys.path, "package": "addon", "folder": str(compilation.FOLDER), "listed": str(compilation.LIST)}
    worker.stdin.write(json.dumps(place).encode() + b"\n0\n")
    worker.stdin.flush()
    assert json.loads(worker.stdout.readline()) == ""
    worker.stdin.close()
    assert worker.wait(10.0) == 0
    worker.stdout.close()


SAVING = """
import sys
from types import SimpleNamespace
from numba.core.caching import IndexDataCacheFile
from addon.solver.system.kernel_cache import keep_apart
file = IndexDataCacheFile(sys.argv[1], "kernel", "stamp")
keep_apart(SimpleNamespace(_cache=SimpleNamespace(_cache_file=file)))
for number in range(100):
    file.save((sys.argv[2], number), (sys.argv[2], number))
"""


def test_processes_that_keep_one_kernel_at_the_same_time_lose_nothing(tmp_path):
    """Of a hundred types each, every entry is there in the end, and is what its process compiled."""
    folder = tmp_path / "kept"
    folder.mkdir()
    command = [sys.executable, "-c", SAVING, folder]
    working = [subprocess.Popen([*command, name], cwd=ROOT) for name in ("one", "other")]
    assert [each.wait(LONG) for each in working] == [0, 0]
    file = IndexDataCacheFile(str(folder), "kernel", "stamp")
    keys = [(name, number) for name in ("one", "other") for number in range(100)]
    assert [file.load(key) for key in keys] == keys
    assert len(list(folder.glob("*.nbc"))) == len(keys)


def test_kernels_that_nobody_can_keep_are_not_compiled_beforehand(folder, monkeypatch, tmp_path):
    assert compilation.are_kept()
    with monkeypatch.context() as patch:
        patch.setattr(kernel_cache, "kernel_folder", lambda: tmp_path / "elsewhere")
        assert not compilation.are_kept()


def starts(monkeypatch, **changed) -> bool:
    """Whether the timer at Blender's start begins to compile, with these in place of what the module uses."""
    begun = []
    preferences = SimpleNamespace(compile_at_start=changed.pop("wanted", True))
    addons = {background.EXTENSION: SimpleNamespace(preferences=preferences)}
    fake = SimpleNamespace(context=SimpleNamespace(preferences=SimpleNamespace(addons=addons)))
    usual = {"python": lambda: "python3", "are_kept": lambda: True, "is_complete": lambda: False}
    with monkeypatch.context() as patch:
        for name, value in (usual | changed | {"bpy": fake, "begin": lambda: begun.append(1)}).items():
            patch.setattr(background, name, value)
        background._begin_by_itself()
    return bool(begun)


def test_it_begins_by_itself_if_that_is_wanted_possible_and_needed(monkeypatch):
    assert starts(monkeypatch)
    assert not starts(monkeypatch, wanted=False)
    assert not starts(monkeypatch, is_complete=lambda: True)
    assert not starts(monkeypatch, are_kept=lambda: False)
    assert not starts(monkeypatch, python=lambda: "")
    assert not starts(monkeypatch, is_compiling=lambda: True)


# In Blender


def test_it_does_not_begin_by_itself_without_a_window():
    assert not bpy.app.timers.is_registered(background._begin_by_itself)


class Layout:
    """Notes what is drawn."""

    def __init__(self):
        self.drawn = []

    def row(self, **_):
        return self

    def label(self, text, **_):
        self.drawn.append(text)

    def progress(self, factor, text):
        self.drawn.append((factor, text))

    def operator(self, name, **_):
        self.drawn.append(name)


def test_preferences_and_status_bar_tell_how_far_it_is_and_end_it(folder, monkeypatch):
    monkeypatch.setattr(background, "Compilation", lambda: Compilation(processes=1, scenes=()))
    layout = Layout()
    background.draw_compiling(layout)
    assert layout.drawn == ["Kernels are compiled when a render needs them", "infrared.compile_kernels"]
    assert bpy.ops.infrared.compile_kernels() == {"FINISHED"}
    assert not bpy.ops.infrared.compile_kernels.poll() and bpy.app.timers.is_registered(background._look)
    layout = Layout()
    background.draw_compiling(layout)
    background.draw_status(SimpleNamespace(layout=layout), None)
    (_, text), cancel, status, also_cancel = layout.drawn
    assert text.startswith("Compiling kernels: ") and text.endswith(" of 4")
    assert status.startswith("Infrared Photons compiles its kernels: ")
    assert cancel == also_cancel == "infrared.cancel_compiling"
    assert bpy.ops.infrared.cancel_compiling() == {"FINISHED"}
    background._compilation.wait()
    layout = Layout()
    background.draw_status(SimpleNamespace(layout=layout), None)
    assert layout.drawn == [] and not background.is_compiling()


def test_disabling_the_extension_ends_it(folder, monkeypatch):
    import addon

    monkeypatch.setattr(background, "Compilation", lambda: Compilation(processes=2, scenes=()))
    bpy.ops.infrared.compile_kernels()
    assert running(background._compilation) == 2
    addon.unregister()
    try:
        assert running(background._compilation) == 0 and not bpy.app.timers.is_registered(background._look)
    finally:
        addon.register()


def test_without_a_python_of_its_own_nothing_begins(monkeypatch):
    for executable in ("", os.path.join(os.sep, "usr", "bin", "blender")):
        monkeypatch.setattr(sys, "executable", executable)
        assert compilation.python() == "" and not bpy.ops.infrared.compile_kernels.poll()
