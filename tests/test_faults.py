# SPDX-License-Identifier: GPL-3.0-or-later
"""What happens to a render when things go wrong: ended at any moment, run beside others, killed, short of memory."""

import copy
import dataclasses
import itertools
import json
import multiprocessing
import pickle
import resource
import subprocess
import sys
import threading
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from addon.solver import SceneError, checkpoint, memory, render
from addon.solver.checkpoint import CheckpointError, fingerprint, load, render_with_checkpoints, save, set_aside
from addon.solver.image.film import Film
from addon.solver.passes import prepare
from tests.helpers.faults import QUICK, plume, room
from tests.helpers.marks import long

ROOT = Path(__file__).resolve().parents[1]


def images(film):
    """All that a film shows, one array."""
    return np.concatenate((film.bands(), [film.noise()]))


# Ended ----------------------------------------------------------------------------------------------------------------


@cache
def uninterrupted():
    """The images after 0, 1, ... passes, and how often `cancelled` was asked until then (before the first 0 times)."""
    after, asked, ends = [None], itertools.count(), [0]

    def after_pass(film):
        after.append(images(film))
        ends.append(next(asked))

    render(room(), QUICK, after_pass, lambda: next(asked) < 0)
    return after, ends


@pytest.mark.parametrize("seed", range(16))
def test_cancelled_at_any_moment_the_film_is_that_of_the_finished_passes(seed):
    after, ends = uninterrupted()
    moment, calls = np.random.default_rng(seed).integers(ends[-1]), itertools.count()
    film = render(room(), QUICK, cancelled=lambda: next(calls) >= moment)
    # asked about as often until each pass ends; the last is not finished, as it is asked at its end too
    assert abs(film.passes - (np.searchsorted(ends, moment, side="right") - 1)) <= 1
    if film.passes:
        np.testing.assert_array_equal(images(film), after[film.passes])
    else:
        np.testing.assert_array_equal(film.bands(), Film.from_state(film.state()).bands())
        assert film.photons == 0


@pytest.mark.long
def test_cancelled_at_every_moment_of_a_pass():
    """One thread, so that the moments are the same in each render."""
    settings, calls = dataclasses.replace(QUICK, passes=1, threads=1), itertools.count()
    render(room(), settings, cancelled=lambda: next(calls) < 0)
    asked = next(calls)
    for moment in range(asked):
        calls = itertools.count()
        film = render(room(), settings, cancelled=lambda calls=calls, moment=moment: next(calls) >= moment)
        assert film.passes == 0, f"asked for the {moment}th time of {asked}"


def test_preparing_can_be_cancelled():
    """It looks at every pixel: with large pictures whoever ends a render should not wait for that."""
    assert prepare(room(), QUICK, cancelled=lambda: True) is None
    saved = render(room(), dataclasses.replace(QUICK, passes=1))
    assert render(room(), QUICK, cancelled=lambda: True).passes == 0
    assert render(room(), QUICK, cancelled=lambda: True, film=saved) is saved
    calls, late = itertools.count(), []
    render(room(width=400), QUICK, cancelled=lambda: next(calls) >= 20, on_pass=late.append)
    assert not late and next(calls) < 200  # pieces of looks that have not begun are left out


# Beside others --------------------------------------------------------------------------------------------------------


def test_two_renders_at_once_are_those_of_each_alone():
    scenes = [room(), room(380.0), room()]
    settings = [dataclasses.replace(QUICK, seed=seed) for seed in (1, 2, 3)]
    alone = [images(film) for film in map(render, scenes, settings)]
    start = threading.Barrier(len(scenes))
    with ThreadPoolExecutor(len(scenes)) as pool:
        together = list(pool.map(lambda *job: (start.wait(), images(render(*job)))[1], scenes, settings))
    for one, other in zip(alone, together, strict=True):
        np.testing.assert_array_equal(one, other)


def rendered(seed):
    return images(render(room(), dataclasses.replace(QUICK, seed=seed)))


def test_two_processes_at_once_give_what_this_one_gives():
    """They share the folder of compiled kernels."""
    with ProcessPoolExecutor(2, multiprocessing.get_context("spawn")) as pool:
        for seed, result in enumerate(pool.map(rendered, range(2))):
            np.testing.assert_array_equal(result, rendered(seed))


# Short of memory ------------------------------------------------------------------------------------------------------

PEAK = """
from addon.solver import Settings, memory, render
from addon.solver.passes import prepare
from tests.helpers.faults import QUICK, plume, room, wallpaper
from tests.helpers.process import forget_peak, resident
def images(film):
    return film.bands(), film.noise(), film.temperature()
scene, settings = room(**{options}, {more}), Settings(passes=2, photons_per_pass={photons}, threads=2)
images(render(room(bands=2), QUICK))  # loads the kernels; few bands, for freed memory is kept
images(render(room(bands=2, media=(plume(8), plume(8, soot=1e-7, CO2=0.01)), textures=wallpaper(8)), QUICK))
forget_peak()
before = resident("VmRSS")
images(render(scene, settings))
taken = resident("VmHWM") - before
model = prepare(scene, settings)
known = model.hits_per_photon, model.rays_per_pixel
needed = memory.memory_beforehand(scene, 1) | memory.memory_of_passes(scene, settings, 1, *known)
print(sum(needed.values()), taken)
"""


@pytest.mark.once
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="measured by Linux")
@pytest.mark.parametrize(
    "options, photons, more",
    [
        long({"width": 1000, "bands": 16, "lights": (), "radiator": 293.0}, 1000, ""),  # the film
        long({"width": 8, "bands": 16, "emissivity": 0.3, "lights": ()}, 400_000, ""),  # the photons
        # photons of lamps, of which few are stored
        long({"width": 8, "bands": 16, "emissivity": 0.95}, 2_000_000, ""),
        ({"width": 8, "bands": 4, "subdivisions": 7}, 1000, ""),  # the triangles
        long({"width": 64, "bands": 256, "emissivity": 0.5}, 1000, ""),  # the rays
        long({"width": 8}, 1000, "media=(plume(216),)"),  # the cells of a grid
        long({"width": 8}, 1000, "media=(plume(216, soot=1e-7, CO2=0.01),)"),  # and their components
        long({"width": 8}, 1000, "textures=wallpaper(6000)"),
    ],
    ids=["film", "photons", "lamps", "geometry", "rays", "grid", "components", "textures"],
)
def test_memory_that_is_foreseen_is_what_a_render_takes(options, photons, more):
    """Within a factor of two either way: allocators round, and stores grow in steps."""
    script = PEAK.format(options=options, photons=photons, more=more)
    command = [sys.executable, "-c", script]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    estimate, measured = map(float, done.stdout.split())
    print(f"estimated {estimate / 1e6:.0f} MB, measured {measured / 1e6:.0f} MB")
    assert measured > 40e6  # else the rest would be about trifles
    assert 0.5 * measured < estimate < 2.0 * measured


@pytest.mark.parametrize(
    "options, change, copies, message",
    [
        ({"width": 4000, "bands": 64}, {}, 0, "The sums for every pixel and band need most, .*lower the resolution"),
        ({"width": 4000, "bands": 64}, {}, 9, "The images of every band need most, .*view layers"),
        ({}, {"photons_per_pass": 10**8}, 0, "The photons of a pass need most, .*lower the photons per pass"),
        ({"subdivisions": 6}, {}, 0, "The triangles need most, .*lower the subdivision"),
        ({"media": (plume(8), plume(64))}, {}, 0, "The cells of volumes, 'Plume' above all, .*resolution of the vol"),
    ],
)
def test_a_render_that_needs_too_much_memory_is_refused(monkeypatch, options, change, copies, message):
    scene, settings = room(**options), dataclasses.replace(QUICK, **change)
    needed = memory.memory_beforehand(scene, copies)
    if change:
        model = prepare(scene, settings)
        needed = memory.memory_of_passes(scene, settings, copies, model.hits_per_photon, model.rays_per_pixel)
    total = sum(needed.values())
    monkeypatch.setattr(memory, "available_memory", lambda: 0.99 * total)
    numbers = f"needs about {total / 1e9:.1f} GB of memory, {0.99 * total / 1e9:.1f} GB are available. "
    with pytest.raises(SceneError, match=numbers + message):
        render(scene, settings, pytest.fail, image_copies=copies)
    monkeypatch.setattr(memory, "available_memory", lambda: total)
    memory.check_memory(needed)
    monkeypatch.setattr(memory, "available_memory", lambda: None)  # no telling: no guard
    memory.check_memory({"film": 1e30})


def test_a_render_that_fits_is_not_refused(monkeypatch):
    """Where nothing differs from the reference no photon is traced, whatever the settings say."""
    scene, settings = room(293.0, lights=()), dataclasses.replace(QUICK, photons_per_pass=10**12)
    rays = prepare(scene, settings).rays_per_pixel
    needed = memory.memory_beforehand(scene) | memory.memory_of_passes(scene, settings, 0, 0.0, rays)
    monkeypatch.setattr(memory, "available_memory", lambda: sum(needed.values()))
    assert render(scene, settings).photons == 0


def system(root, group="", limits=()):
    """A file system that tells of 3 GB of memory and 1 GB of swap, and of control groups: (folder, limit, used)."""
    proc = root / "proc"
    (proc / "self").mkdir(parents=True)
    (proc / "meminfo").write_text(
        "MemTotal: 9000000 kB\nMemAvailable: 3000000 kB\nHugePages: 0\nSwapFree: 1000000 kB\n"
    )
    (proc / "self" / "cgroup").write_text(f"0::/{group}\n")
    for name, limit, used in limits:
        folder = root / "sys/fs/cgroup" / name
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "memory.max").write_text(f"{limit}\n")
        (folder / "memory.current").write_text(f"{used}\n")
        (folder / "memory.stat").write_text("anon 5\nfile 100\n")
    return root


def test_available_memory(tmp_path):
    assert memory.available_memory(system(tmp_path / "free")) == 4_000_000 * 1024
    inside = system(tmp_path / "inside", "a/b", [("a", 10**9, 4 * 10**8), ("a/b", "max", 0)])
    assert memory.available_memory(inside) == 6 * 10**8 + 100  # cached files make room
    wide = system(tmp_path / "wide", "a", [("a", 10**13, 0)])
    assert memory.available_memory(wide) == 4_000_000 * 1024
    assert memory.available_memory(tmp_path / "no Linux") is None
    if sys.platform.startswith("linux"):
        assert 10**7 < memory.available_memory() < 10**14


# Killed ---------------------------------------------------------------------------------------------------------------


def cancel_after(passes):
    """on_pass and cancelled of a render that is ended after so many passes."""
    stop = threading.Event()
    return (lambda film: film.passes >= passes and stop.set()), stop.is_set


def assert_same_render(film, whole):
    """To the last bit of the sums in float64."""
    for name, value in whole.state().items():
        np.testing.assert_array_equal(film.state()[name], value)


def test_a_render_goes_on_where_it_ended(tmp_path):
    """Twice; the film is that of the render without a break, and the checkpoint is gone at the end."""
    path, settings = tmp_path / "room.npz", dataclasses.replace(QUICK, passes=6, pass_offset=2)
    whole = render(room(), settings)
    saved = None
    for ended in (2, 3):
        render_with_checkpoints(room(), settings, *cancel_after(ended), path=path, interval=1e9, saved=saved)
        saved = load(path, room(), settings)
        assert saved.passes == ended
    seen = []
    film = render_with_checkpoints(
        room(), settings, lambda film: seen.append(film.passes), path=path, interval=1e9, saved=saved
    )
    assert seen == [3, 4, 5, 6]
    assert_same_render(film, whole)
    assert list(tmp_path.iterdir()) == []


def test_target_noise_counts_all_passes():
    """A render with a break, wherever it was, ends after the same pass: not before the noise is reached, not later."""
    after = []
    render(room(), dataclasses.replace(QUICK, passes=14), lambda film: after.append(copy.deepcopy(film)))
    noise = [np.percentile(film.noise(), 95) for film in after]
    target = dataclasses.replace(QUICK, passes=0, target_noise=float(1.01 * noise[12]))
    whole = render(room(), target)
    assert whole.passes > 8  # what was there before the break counts
    assert noise[whole.passes - 1] < target.target_noise
    for broken in (1, whole.passes - 1, whole.passes):
        film = render(room(), target, film=after[broken - 1])
        assert_same_render(film, whole)


def test_a_film_of_another_render_is_refused():
    for other in (Film(24, 17, room().band_edges, 293.0), Film(24, 18, [8.0, 14.0], 293.0)):
        with pytest.raises(ValueError, match="same size and bands"):
            render(room(), QUICK, pytest.fail, film=other)
    with pytest.raises(ValueError, match="different reference temperatures"):
        render(room(), QUICK, pytest.fail, film=Film(24, 18, room().band_edges, 1.0))
    film = render(room(), dataclasses.replace(QUICK, passes=1))
    for change in ({"seed": QUICK.seed + 1}, {"pass_offset": 1}):
        with pytest.raises(ValueError, match="not hold the first passes"):
            render(room(), dataclasses.replace(QUICK, **change), pytest.fail, film=film)


def test_checkpoints_are_saved_during_the_render(tmp_path):
    path, saved = tmp_path / "room.npz", []
    render_with_checkpoints(
        room(), QUICK, lambda film: saved.append((load(path, room(), QUICK), images(film))), path=path, interval=0.0
    )
    assert [film.passes for film, _ in saved] == [1, 2, 3, 4]
    for film, shown in saved:
        np.testing.assert_array_equal(images(film), shown)


def test_a_checkpoint_of_all_passes_needs_no_more(tmp_path):
    path, shown = tmp_path / "room.npz", []
    whole = render(room(), QUICK)
    save(path, whole, fingerprint(room(), QUICK))
    longer = dataclasses.replace(QUICK, passes=5)
    assert_same_render(
        render_with_checkpoints(room(), longer, path=path, interval=1e9, saved=load(path, room(), longer)),
        render(room(), longer),
    )  # the number of passes may be raised
    save(path, whole, fingerprint(room(), QUICK))
    film = render_with_checkpoints(
        room(), QUICK, shown.append, path=path, interval=1e9, saved=load(path, room(), QUICK)
    )
    assert shown == [film] and not path.exists()
    assert_same_render(film, whole)


def test_a_correction_may_change_and_counts_before_the_next_pass(tmp_path):
    path, corrected = tmp_path / "room.npz", dataclasses.replace(QUICK, assumed_emissivity=0.8)
    save(path, render(room(), QUICK), fingerprint(room(), QUICK))
    np.testing.assert_array_equal(images(load(path, room(), corrected)), images(render(room(), corrected)))


CHANGES = {
    "temperature": lambda: (room(341.0), QUICK),
    "materials": lambda: (room(emissivity=0.61), QUICK),
    "camera": lambda: (room(width=28), QUICK),
    "band_edges": lambda: (room(bands=4), QUICK),
    "lights": lambda: (room(lights=()), QUICK),
    "world_temperature": lambda: (room(world_temperature=290.0), QUICK),
    "seed": lambda: (room(), dataclasses.replace(QUICK, seed=1)),
    "photons_per_pass": lambda: (room(), dataclasses.replace(QUICK, photons_per_pass=20_001)),
    "roulette": lambda: (room(), dataclasses.replace(QUICK, roulette="BAND_AVERAGE")),
}


@pytest.mark.parametrize("part", CHANGES)
def test_a_checkpoint_of_another_render_is_refused_and_says_what_differs(tmp_path, part):
    path = tmp_path / "room.npz"
    save(path, Film(24, 18, room().band_edges), fingerprint(room(), QUICK))
    with pytest.raises(CheckpointError) as error:
        load(path, *CHANGES[part]())
    assert str(error.value) == f"The checkpoint '{path}' is of another render: {part} differ"


def test_a_checkpoint_of_other_passes_is_refused(tmp_path):
    path = tmp_path / "room.npz"
    film = Film(24, 18, room().band_edges)
    film.ranges, film.passes = [(0, 0, 2)], 2
    save(path, film, fingerprint(room(), QUICK))
    with pytest.raises(CheckpointError, match="does not hold the first passes of this render, but passes 0 to 1"):
        load(path, room(), dataclasses.replace(QUICK, pass_offset=1))


def test_a_checkpoint_of_another_geometry_or_version_is_refused(tmp_path, monkeypatch):
    path = tmp_path / "room.npz"
    save(path, Film(24, 18, room().band_edges), fingerprint(room(), QUICK))
    with pytest.raises(CheckpointError, match="material, temperature, triangles, vertices differ"):
        load(path, room(subdivisions=2), QUICK)
    monkeypatch.setattr(checkpoint, "source_digest", lambda: "another version")
    with pytest.raises(CheckpointError, match="another render: engine differ"):
        load(path, room(), QUICK)


def test_what_changes_no_pass_changes_no_fingerprint():
    scene, marks = room(), fingerprint(room(), QUICK)
    ends = dataclasses.replace(QUICK, passes=0, pass_offset=9, threads=7, time_limit=9.0, target_noise=0.1)
    assert fingerprint(scene, ends) == marks
    renamed = tuple(dataclasses.replace(material, name="Another") for material in scene.materials)
    assert fingerprint(dataclasses.replace(scene, materials=renamed), QUICK) == marks


# Damaged checkpoints --------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def whole_checkpoint(tmp_path_factory):
    """The bytes of a checkpoint."""
    path = tmp_path_factory.mktemp("checkpoint") / "room.npz"
    save(path, render(room(), QUICK), fingerprint(room(), QUICK))
    return path.read_bytes()


def archive(path, **changes):
    """A checkpoint with some of its arrays changed, or removed where they are None."""
    state = render(room(), dataclasses.replace(QUICK, passes=1)).state() | changes
    state["fingerprint"] = np.array(json.dumps(fingerprint(room(), QUICK)))
    np.savez(path, **{name: value for name, value in state.items() if value is not None})


def assert_refused(path, message=""):
    with pytest.raises(CheckpointError, match=message) as error:
        load(path, room(), QUICK)
    assert str(path) in str(error.value)


@pytest.mark.parametrize("share", [0.0, 0.001, 0.3, 0.9, 0.999])
def test_a_truncated_checkpoint_is_refused(tmp_path, whole_checkpoint, share):
    path = tmp_path / "room.npz"
    path.write_bytes(whole_checkpoint[: int(share * len(whole_checkpoint))])
    assert_refused(path, "no checkpoint, or a damaged one")


def test_what_is_no_checkpoint_is_refused(tmp_path):
    path, rng = tmp_path / "room.npz", np.random.default_rng(5)
    for content in (rng.bytes(5000), b"PK\x03\x04" + rng.bytes(5000), pickle.dumps({"width": 3}), b"text\n"):
        path.write_bytes(content)
        assert_refused(path, "no checkpoint, or a damaged one")
    for store in (lambda file: np.save(file, np.zeros(3)), lambda file: np.savez(file, picture=np.zeros(3))):
        with path.open("wb") as file:
            store(file)
        assert_refused(path, "no checkpoint, or a damaged one")


def test_no_damaged_byte_goes_unnoticed(tmp_path, whole_checkpoint):
    """Any changed byte is refused, or lies where the archive keeps what nobody reads, such as a date."""
    path, rng = tmp_path / "room.npz", np.random.default_rng(6)
    path.write_bytes(whole_checkpoint)
    whole, refused = images(load(path, room(), QUICK)), 0
    for place in rng.integers(len(whole_checkpoint), size=300):
        damaged = bytearray(whole_checkpoint)
        damaged[place] ^= 1 << rng.integers(8)
        path.write_bytes(damaged)
        try:
            film = load(path, room(), QUICK)
        except CheckpointError as error:
            assert str(path) in str(error)
            refused += 1
        else:
            np.testing.assert_array_equal(images(film), whole)
    assert refused > 200


@pytest.mark.parametrize(
    "changes, message",
    [
        ({"_mean": None}, "_mean missing"),
        ({"_mean": np.zeros((432, 4))}, r"_mean is float64 \(432, 4\), expected float64 \(432, 3\)"),
        ({"_mean": np.zeros((432, 3), np.float32)}, "_mean is float32"),
        ({"_squares": np.full(432, np.nan)}, "_squares holds values that are not finite"),
        ({"_seen": np.zeros(431)}, "_seen is float64"),
        ({"width": np.array(10**9)}, "_mean is float64"),
        ({"band_edges": np.array([8.0, 7.0])}, "ascend"),
    ],
)
def test_a_checkpoint_with_impossible_content_is_refused(tmp_path, changes, message):
    archive(tmp_path / "room.npz", **changes)
    assert_refused(tmp_path / "room.npz", message)


def test_a_file_in_the_way_gets_a_name_of_its_own(tmp_path):
    path = tmp_path / "room.npz"
    kept = []
    for content in ("a", "b"):
        path.write_text(content)
        kept.append(set_aside(path))
    assert [(file.name, file.read_text()) for file in kept] == [("room.old1.npz", "a"), ("room.old2.npz", "b")]
    assert not path.exists()


# A checkpoint that cannot be written ----------------------------------------------------------------------------------


@pytest.mark.parametrize("place", ["missing/room.npz", "file/room.npz", "/proc/room.npz"])
def test_a_checkpoint_that_could_never_be_written_ends_the_render_before_it_starts(tmp_path, place):
    (tmp_path / "file").write_text("a file, not a folder")
    with pytest.raises(OSError) as error:
        render_with_checkpoints(room(), QUICK, pytest.fail, path=tmp_path / place, interval=0.0)
    assert str((tmp_path / place).parent) in str(error.value)


def test_a_full_disk_does_not_end_the_render(tmp_path, caplog):
    """A limit on the size of files stands in for the full disk. The older checkpoint stays whole."""
    path = tmp_path / "room.npz"
    whole = render(room(), QUICK)
    save(path, whole, fingerprint(room(), QUICK))
    old = path.read_bytes()
    before, kept = resource.getrlimit(resource.RLIMIT_FSIZE), []

    def on_pass(_film):
        kept.append(path.read_bytes())

    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, before[1]))
    try:
        film = render_with_checkpoints(room(), QUICK, on_pass, path=path, interval=0.0)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    np.testing.assert_array_equal(images(film), images(whole))
    assert kept == [old] * QUICK.passes
    assert caplog.text.count(f"Cannot write the checkpoint to '{path}'") == QUICK.passes
    assert list(tmp_path.iterdir()) == []  # the render is complete, and nothing unfinished is left
