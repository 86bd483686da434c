# SPDX-License-Identifier: GPL-3.0-or-later
"""The scripts that measure for docs/accuracy.md, benchmarks.md and estimators.md run, small, and say on which code.

docs/tools/measure_paper.py: see test_paper.py.
"""

import shutil
import subprocess
import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from addon.solver import Settings, render
from addon.solver.physics.radiometry import reference_radiance
from addon.solver.physics.spectrum import apparent_temperature
from docs.tools import measure_accuracy, pages
from docs.tools.paths import DOCS
from tests.benchmarks import (
    disk_blur,
    estimators,
    guided_directions,
    photon_index,
    scaling,
    speed_vs_error,
    throughput,
)
from tests.helpers.paper_estimator import PAPER, PAPERS_ESTIMATOR, PHOTONS_ALONE, changed, photons_alone

on_linux = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")


def small(scene):
    """A scene with a picture of few pixels."""
    return replace(scene, camera=replace(scene.camera, width=16, height=12))


@pytest.fixture
def small_scenes(monkeypatch):
    """The scenes of the benchmarks, with small pictures; references that we render ourselves."""
    for name, build in list(speed_vs_error.SCENES.items()):
        monkeypatch.setitem(speed_vs_error.SCENES, name, lambda build=build: small(build()))

    def load_reference(name, scene, folder, threads):
        return speed_vs_error.Reference(scene, np.array([image(scene, seed) for seed in (1, 2)]))

    for module in (speed_vs_error, estimators):
        monkeypatch.setattr(module, "load_reference", load_reference)


def image(scene, seed):
    """Image (height, width, bands), W m-2 sr-1 per band, of few photons."""
    return speed_vs_error.film_image(render(scene, Settings(passes=2, photons_per_pass=2000, seed=seed)))


# The line that says which code it was ---------------------------------------------------------------------------------


def git(folder, *arguments):
    identity = ("-c", "user.name=a", "-c", "user.email=a@b", "-c", "commit.gpgsign=false")
    subprocess.run(["git", *identity, *arguments], cwd=folder, check=True, capture_output=True)


@pytest.fixture
def repository(tmp_path):
    """A project with a commit."""
    (tmp_path / "pyproject.toml").write_text('[project]\nversion = "1.2.3"\n')
    (tmp_path / "code.py").write_text("a = 1\n")
    if not shutil.which("git"):
        pytest.skip("needs git")
    git(tmp_path, "init")
    git(tmp_path, "add", ".")
    git(tmp_path, "commit", "-m", "first", "--date", "2026-01-02T03:04:05")
    return tmp_path


def test_commit_is_told(repository):
    assert pages.made_at(repository) == f"Made at commit {log(repository)}."
    (repository / "code.py").write_text("a = 2\n")
    assert pages.made_at(repository) == f"Made at commit {log(repository)} and changes since."


def log(folder):
    done = subprocess.run(["git", "log", "--format=%h of %cs"], cwd=folder, capture_output=True, text=True, check=True)
    return done.stdout.strip()


def test_without_a_repository_the_version_is_told(repository):
    inner = repository / "unpacked"  # a repository around it says nothing about it
    inner.mkdir()
    shutil.copy(repository / "pyproject.toml", inner)
    assert pages.made_at(inner) == "Made with version 1.2.3."


def test_blocks_replace_what_was_there(tmp_path):
    page = tmp_path / "page.md"
    start, end = "<!-- {}: written by docs/tools/script.py -->", "<!-- end of {} -->"
    page.write_text(
        "\n".join(["before", start.format("a"), "old", end.format("a"), start.format("b"), end.format("b")])
    )
    pages.write_blocks(page, "docs/tools/script.py", {"a": "new"})
    pages.write_blocks(page, "docs/tools/script.py", {"a": "newer", "b": "other"})
    written = [line for line in page.read_text().splitlines() if line]
    stamp = pages.MADE_AT
    assert written == [
        "before", start.format("a"), "newer", stamp, end.format("a"), start.format("b"), "other", stamp, end.format("b")
    ]  # fmt: skip


# Accuracy -------------------------------------------------------------------------------------------------------------


@pytest.fixture
def accuracy(monkeypatch, tmp_path):
    """The script with few passes and photons, and two cases, one of them plotted; in a folder of its own."""
    cases = [
        next(case for case in measure_accuracy.CASES if case.title == title and fits(case))
        for title, fits in (
            ("Parallel rectangles", lambda case: case.name == measure_accuracy.PLOTTED[case.title]),
            ("Enclosures at one temperature", lambda case: not case.settings),
        )
    ]
    few = {
        "PAGE": tmp_path / "accuracy.md",
        "PLOT": tmp_path / "accuracy.png",
        "CASES": [replace(case, settings={"photons_per_pass": 1000}) for case in cases],
        "CURVE_SEEDS": (1, 2),
        "CURVE_PASSES": 16,
        "FEWEST": 4,
        "MOST": 8,
        "PILOT": 4,
        "MODEL_PASSES": 2,
        "PHOTONS": 1000,
    }
    for name, value in few.items():
        monkeypatch.setattr(measure_accuracy, name, value)
    shutil.copy(DOCS / "accuracy.md", tmp_path)
    return measure_accuracy


@pytest.mark.long
def test_accuracy_writes_its_page(accuracy, monkeypatch):
    monkeypatch.setattr(accuracy, "NOISE", 6.0)  # so few passes know their noise badly
    monkeypatch.setattr(accuracy, "DEVIATION", 0.1)
    assert accuracy.main(["--processes", "1"]) == 0
    page = accuracy.PAGE.read_text(encoding="utf-8")
    assert page.count(pages.MADE_AT) == 5
    assert "2 cases, " in page and "Verdict *NO*: none." in page and "| yes |" in page
    assert accuracy.PLOT.stat().st_size > 10_000


def test_accuracy_of_one_case_writes_nothing(accuracy):
    before = accuracy.PAGE.read_bytes()
    assert accuracy.main(["--only", "Enclosures", "--processes", "1"]) == 0
    assert accuracy.PAGE.read_bytes() == before and not accuracy.PLOT.exists()


def rows_with(accuracy, deviations, monkeypatch):
    """Rows of a case in one band whose first and second render deviate so many standard errors of 0.01 %."""
    case = accuracy.CASES[0]
    _, truth = case.build(**case.arguments)
    asked = []

    def passes_of(case, seeds, passes):
        asked.append((seeds, passes))
        spread = 1e-4 * np.sqrt(64) * np.tile([1.0, -1.0], 32) * np.sqrt(63 / 64)
        return (truth * (1.0 + 1e-4 * deviations[len(asked) - 1] + spread[:, None]))[None]

    monkeypatch.setattr(accuracy, "passes_of", passes_of)
    monkeypatch.setattr(accuracy, "PLOTTED", {case.title: case.name})
    rows, _ = accuracy.measure(case)
    return rows, asked


def test_a_row_that_chance_explains_stays_alone(accuracy, monkeypatch):
    rows, asked = rows_with(accuracy, [2.9], monkeypatch)
    assert [row.verdict for row in rows] == ["yes"] and len(asked) == 1
    assert not accuracy.wrong(rows)


def test_a_row_that_is_beyond_chance_once_is_not_wrong(accuracy, monkeypatch):
    rows, asked = rows_with(accuracy, [3.1, 2.9], monkeypatch)
    assert [row.verdict for row in rows] == ["NO: beyond chance", "yes"]
    assert asked == [(accuracy.CURVE_SEEDS, 16), (accuracy.AGAIN, 64)]  # other seeds, four times the passes
    assert not accuracy.wrong(rows)
    assert "Verdict *NO*: 1, of which 1 are *yes* with new seeds" in accuracy.summary(rows)


def test_a_row_that_is_beyond_chance_twice_is_wrong(accuracy, monkeypatch):
    rows, _ = rows_with(accuracy, [3.1, -3.2], monkeypatch)
    assert accuracy.wrong(rows) == rows[1:]


@pytest.mark.long
def test_accuracy_fails_where_an_image_is_wrong_and_writes_its_page(accuracy, monkeypatch, capsys):
    case = accuracy.CASES[0]

    def off(**arguments):
        scene, truth = case.build(**arguments)
        return scene, 1.1 * truth

    off.__doc__ = case.build.__doc__
    monkeypatch.setattr(accuracy, "CASES", [replace(case, build=off)])
    monkeypatch.setattr(accuracy, "write_page", lambda rows, *_: accuracy.PAGE.write_text(accuracy.tables(rows)))
    assert accuracy.main(["--processes", "1"]) == 1
    assert accuracy.PAGE.read_text().count("NO: beyond") == 2
    assert "Wrong: " + case.title in capsys.readouterr().err


# Benchmarks -----------------------------------------------------------------------------------------------------------


@on_linux
@pytest.mark.long
@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # where no memory is added, its logarithm is infinite,
@pytest.mark.filterwarnings("ignore:Data has no positive values")  # and there is none to draw
def test_scaling_prints_and_draws(monkeypatch, tmp_path, capsys):
    """All series, in this process."""
    tiny = scaling.Size(1, 16, 2, 1000, 1)
    series = {
        name: (field, (getattr(tiny, field), 2 * getattr(tiny, field)), count)
        for name, (field, _, count) in scaling.SERIES.items()
    }
    for name, value in {
        "BASE": tiny,
        "SMALL": tiny,
        "SERIES": series,
        "IMAGES": tmp_path,
        "in_own_process": lambda function, *arguments: function(*arguments),
    }.items():
        monkeypatch.setattr(scaling, name, value)
    run(scaling, monkeypatch, "--passes", "2")
    printed = capsys.readouterr().out
    assert all(f"### {name.capitalize()}" in printed for name in series)
    assert printed.count("| *exponent* |") == len(series) and printed.endswith(f"{pages.MADE_AT}\n")
    assert (tmp_path / "scaling.png").stat().st_size > 10_000


@on_linux
def test_scaling_measures_in_a_process_of_its_own():
    cost = scaling.in_own_process(scaling.measure, scaling.Size(1, 16, 2, 1000, 1), 2)
    assert min(cost) > 0


def run(module, monkeypatch, *arguments):
    monkeypatch.setattr(sys, "argv", [module.__name__, *map(str, arguments)])
    module.main()


@pytest.mark.long
def test_speed_vs_error_prints_and_draws(small_scenes, monkeypatch, tmp_path, capsys):
    """With a peer that is no other renderer."""

    def run_peer(engine, problem, threads, clock, seconds, polite=False):
        scene = speed_vs_error.SCENES["ring"]()
        return np.array([image(scene, seed) for seed in range(len(seconds))]), np.array(seconds)

    monkeypatch.setattr(speed_vs_error, "run_peer", run_peer)
    base = ("--scene", "ring", "--peers", "mitsuba", "--threads", 1, "--seconds", 0.1, "--photons", 2000)
    few = ("--repeats", 1, "--seeds", 1, "--paper", "--out", tmp_path)
    run(speed_vs_error, monkeypatch, *base, *few)
    printed = capsys.readouterr().out
    assert all(printed.count(f"| ring | {label} | mitsuba |") == 2 for label in speed_vs_error.ERRORS)
    assert "| paper+ |" in printed and "| all bands at once |" in printed
    assert printed.endswith(f"{pages.MADE_AT}\n")
    assert (tmp_path / "speed_vs_error.png").stat().st_size > 10_000
    run(speed_vs_error, monkeypatch, *base, "--slope", 4)
    run(speed_vs_error, monkeypatch, *base, "--check")
    run(speed_vs_error, monkeypatch, *base, "--references")
    printed = capsys.readouterr().out
    assert "slope, last decade" in printed and "  ours " in printed and "reference with a standard error" in printed


def test_errors_of_all_bands_together_and_of_each():
    """One pixel of 100, the worst, errs by 2 K in the two bands of which one gains what the other loses: nothing of
    that is left in their sum."""
    edges = np.array([8.0, 10.0, 12.0])
    truth = np.tile(reference_radiance(edges, 300.0), (10, 10, 1))
    reference = speed_vs_error.Reference(SimpleNamespace(band_edges=edges), np.array([truth, truth]))
    image = truth.copy()
    image[0, 0, 0] = reference_radiance(edges[:2], 302.0)[0]
    image[0, 0, 1] -= image[0, 0, 0] - truth[0, 0, 0]
    colder = apparent_temperature(image[0, 0, 1:], edges[1:])[0]
    together, of_each = reference.errors(image)[:2], reference.errors(image)[2:]
    assert together == pytest.approx([0.0, 0.0], abs=1e-6)
    assert of_each == pytest.approx([0.0, np.sqrt((2.0**2 + (300.0 - colder) ** 2) / 200)], rel=1e-6, abs=1e-6)


@pytest.mark.parametrize(("errors", "gain"), [((1.0, 1.0, 1.0), 1.0), ((1.0, 0.0, 0.0), 3.0)])
def test_gain_of_a_path_that_carries_all_bands(errors, gain):
    """Three runs: none where each brings as much of the error, as independent errors add as their squares; three times
    the paths where one brings all of it. Both exact: the errors are not random here."""
    edges = np.linspace(8.0, 14.0, 10)
    truth = np.tile(reference_radiance(edges, 300.0), (4, 5, 1))
    reference = speed_vs_error.Reference(SimpleNamespace(band_edges=edges), np.array([truth, truth]))
    image = truth + np.repeat(errors, 3) / 3.0
    groups = [[0, 1, 2], [3, 4, 5], [6, 7, 8]]
    assert reference.gain_of_all_bands_at_once(image[None], groups) == pytest.approx(gain)


@pytest.mark.long
def test_the_small_benchmarks_print(small_scenes, monkeypatch, capsys):
    """Those that have one table and no page of their own."""
    room = throughput.room
    for module in (throughput, photon_index):
        monkeypatch.setattr(module, "room", lambda bands=16: small(room(bands)))
        monkeypatch.setattr(module, "REPETITIONS", 2)
    monkeypatch.setattr(throughput, "PHOTONS_PER_PASS", 2000)
    monkeypatch.setattr(photon_index, "COUNTS", (500, 1000))
    monkeypatch.setattr(disk_blur, "PASSES", 1)
    monkeypatch.setattr(disk_blur, "SEEDS", (1, 2))
    monkeypatch.setattr(guided_directions, "TESTED", 4)
    run(throughput, monkeypatch, 1)
    assert "rays" in capsys.readouterr().out
    run(photon_index, monkeypatch)
    assert capsys.readouterr().out.count("  ours ") == 6
    run(disk_blur, monkeypatch, "room")
    assert "  plaster " in capsys.readouterr().out
    run(guided_directions, monkeypatch, "--scene", "ring", "--points", 8, "--rays", 64)
    assert "| ring | " in capsys.readouterr().out


def test_photons_alone_is_a_step_towards_the_papers_estimator(small_scenes):
    """Shared rays bring light in the room's default; photons alone store it, and nothing asks rays. A pass of 2000
    photons errs by some 1.5 % in the mean (the spread of seeds), 16 by 0.4 %: 2 % are five standard errors."""
    assert PHOTONS_ALONE.items() <= PAPERS_ESTIMATOR.items()
    scene, settings = speed_vs_error.SCENES["room"](), Settings(passes=16, photons_per_pass=2000)
    ours = render(scene, settings).bands()
    with photons_alone():
        alone = render(scene, replace(settings, **PAPER)).bands()
    assert np.abs(alone / ours - 1.0).max() > 0.01  # noise that we do not have
    assert alone.mean() == pytest.approx(ours.mean(), rel=0.02)
    np.testing.assert_array_equal(render(scene, settings).bands(), ours)


class Here:
    """Stands in for the process of a variant: makes its changes for the time of a call."""

    def __init__(self, variant, folder):
        self.changes = {key: value for key, value in estimators.VARIANTS[variant].items() if "." in key}

    def submit(self, function, *arguments):
        with changed(self.changes):
            result = function(*arguments)
        return SimpleNamespace(result=lambda: result)


@pytest.mark.long
def test_every_variant_renders(small_scenes, monkeypatch, capsys, tmp_path):
    """But for those that change what kernels read: they would have to be compiled. What they change is there."""
    compiled = [
        variant
        for variant, changes in estimators.VARIANTS.items()
        if any(key.rpartition(".")[2] in estimators.kernel_globals() for key in changes)
    ]
    for variant in compiled:
        with changed({key: value for key, value in estimators.VARIANTS[variant].items() if "." in key}):
            pass
    variants = [variant for variant in estimators.VARIANTS if variant not in compiled]
    assert 0 < len(compiled) < len(variants)
    monkeypatch.setattr(estimators, "start", Here)
    options = ("--passes", 2, "--seeds", 1, "--threads", 1, "--cache", tmp_path)
    run(estimators, monkeypatch, "--scene", "ring", "--variant", *variants, *options)
    printed = capsys.readouterr().out
    assert all(f"| {variant} | " in printed for variant in variants)


def test_variants_start_in_a_process_of_their_own(monkeypatch, tmp_path):
    """With kernels in a folder of their own. What it would render first is left out."""
    monkeypatch.setattr(estimators, "measure", print)
    monkeypatch.setenv(estimators.FOLDER_VARIABLE, str(tmp_path))  # which `start` changes
    with estimators.start("spread of each block", tmp_path) as pool:
        looked_up = pool.submit(eval, "__import__('importlib').import_module('addon.solver.planning.survey')._PRIOR")
        assert looked_up.result() == 4.0
