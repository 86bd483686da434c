# SPDX-License-Identifier: GPL-3.0-or-later
"""docs/tools/measure_paper.py: the paper's estimator is what it says, and every part runs, small."""

import math
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image

from addon.solver import Material, PointLight, Settings, render
from addon.solver.photons.lights import light_spectrum
from docs.tools import measure_paper
from docs.tools.paths import DOCS, ROOT
from tests.helpers.paper_estimator import PAPER, papers_estimator
from tests.helpers.scenes import look, make_scene, pass_means, quad


@pytest.fixture
def paper(monkeypatch, tmp_path):
    """The script, with small pictures and few photons, that writes into a folder of its own."""
    (tmp_path / "paper.md").write_text((DOCS / "paper.md").read_text(encoding="utf-8"), encoding="utf-8")
    few = {
        "PAGE": tmp_path / "paper.md",
        "IMAGES": tmp_path,
        "SIZE": 16,
        "PHOTONS": 30_000,
        "TIMED": (1, 3),
        "GATHERED": 30,
        "SEEDS": 2,
        "NOISE_PHOTONS": 3000,
        "NOISE_NEIGHBOURS": 10,
        "NOISE_PASSES": (1, 2, 4, 16),
        "TUBE_PHOTONS": 3000,
        "TUBE_PASSES": 4,
        "COMPARED": Settings(passes=2, photons_per_pass=3000),
        "TRUTH": Settings(passes=4, photons_per_pass=3000, seed=1000),
    }
    for name, value in few.items():
        monkeypatch.setattr(measure_paper, name, value)
    return measure_paper


def lit_plane():
    """A cold plane 1 m below a point light, and the truth: the mean radiance of its middle, W m-2 sr-1."""
    bands = np.array([8.0, 12.0])
    light = PointLight(np.array([0.0, 0.0, 1.0]), 100.0, temperature=1000.0)
    camera = look((0, 0, 0.5), (0, 0, 0), 32, 32, tangent=1.5)
    scene = make_scene(*quad((0, 0, 0), (2, 0, 0), (0, 2, 0)), 0.0, [Material("", 0.5)], camera, bands, lights=(light,))
    x = 0.75 * (np.arange(32) - 15.5) / 16  # m, centres of the pixels on the plane
    distance2 = x[:, None] ** 2 + x**2 + 1.0
    irradiance = 100.0 * light_spectrum(light, bands).sum() / (4 * math.pi) * distance2**-1.5
    return scene, (0.5 / math.pi * irradiance).mean()


def test_photons_show_direct_light_in_the_papers_estimator(paper):
    """The inverse square law within 3 standard errors. The engine sends shadow rays there and stores nothing."""
    scene, truth = lit_plane()
    settings = Settings(passes=32, photons_per_pass=20_000, neighbours=21, **PAPER)
    stored = {}
    for name in ("paper", "engine"):
        phases = paper.Phases()
        with phases.watch() as on_pass:
            if name == "paper":
                paper.papers(scene, on_pass, passes=1, photons_per_pass=1000, neighbours=20)
            else:
                render(scene, Settings(passes=1, photons_per_pass=1000), on_pass)
        stored[name] = phases.stored
    assert stored["engine"] == 0 and 300 < stored["paper"] < 500  # somewhat less than half of them go down
    with papers_estimator():
        means = pass_means(scene, settings).sum(axis=1)
    error = means.std(ddof=1) / math.sqrt(len(means))
    assert error < 0.01 * truth  # else the comparison would say little
    assert abs(means.mean() - truth) < 3 * error


def test_the_switch_leaves_nothing_behind(paper):
    scene, _ = lit_plane()
    settings = Settings(passes=1, photons_per_pass=1000)
    before = render(scene, settings).bands()
    paper.papers(scene, passes=1, photons_per_pass=1000, neighbours=20)
    np.testing.assert_array_equal(render(scene, settings).bands(), before)


def test_blocks_tell_the_noise_of_any_number_of_passes(paper):
    """Independent noise of standard deviation 2: the mean over m passes has 2 / sqrt(m).

    1024 pixels and 64 / m blocks: the variance has a relative error of sqrt(2 / (1024 (64 / m - 1))), the noise half of
    it; asked for are 4 standard errors.
    """
    passes = np.random.default_rng(0).normal(5.0, 2.0, (64, 32, 32))
    blocks = paper.Blocks((1, 4, 16, 64))
    for i in range(64):
        mean = passes[: i + 1].mean(axis=0).astype(np.float32)
        blocks.add(SimpleNamespace(passes=i + 1, radiance=lambda mean=mean: mean))
    for m in (1, 4, 16):
        assert blocks.noise(m) == pytest.approx(2.0 / math.sqrt(m), rel=4 * 0.5 * math.sqrt(2 / (1024 * (64 / m - 1))))
    assert math.isnan(blocks.noise(64))


def test_every_part_writes_its_table_and_draws_its_picture(paper, tmp_path):
    paper.main([])
    page = (tmp_path / "paper.md").read_text(encoding="utf-8")
    for name in paper.PARTS:
        _, marked = page.split(f"<!-- {name}: written by docs/tools/measure_paper.py -->")
        written = marked.split(f"<!-- end of {name} -->")[0].strip()
        assert written.splitlines()[-1].startswith("Made ")
        lines = [line for line in written.splitlines() if line.startswith("|")]
        assert len(lines) > 3 and len({line.count("|") for line in lines}) == 1, written
        if f"paper-{name}.png" in page:
            assert np.ptp(np.asarray(Image.open(tmp_path / f"paper-{name}.png").convert("L")).astype(int)) > 100


def test_the_phases_of_a_render_are_its_time(paper):
    """What the phases add up to is less than the whole, by what is done before the first pass."""
    import time

    scene, phases = paper.ring_scene(), paper.Phases()
    paper.papers(scene, passes=1, photons_per_pass=1000, neighbours=20)
    begin = time.process_time()
    with phases.watch() as on_pass:
        film = paper.papers(scene, on_pass, passes=2, photons_per_pass=100_000, neighbours=20)
    assert 0 < phases.total <= time.process_time() - begin
    assert min(phases.tracing, phases.sorting) > 0 and 0 < phases.gathering < phases.rendering
    assert 0.05 * film.photons < phases.stored < 0.2 * film.photons  # the paper's scene keeps a tenth


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="measured by Linux")
@pytest.mark.long
def test_many_photons(paper, tmp_path):
    script = f"""
from pathlib import Path
from docs.tools import measure_paper as paper
folder = Path({str(tmp_path)!r})
paper.PAGE, paper.IMAGES, paper.SIZE, paper.MANY_PHOTONS = folder / "paper.md", folder, 32, 1000
paper.main(["thousand-million", "--folder", str(folder), "--passes", "2"])
"""
    command = [sys.executable, "-c", script]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "| photons | 2,000 |" in paper.PAGE.read_text(encoding="utf-8")
    picture = np.array(Image.open(tmp_path / "paper-thousand-million.png").convert("RGB"))
    assert len(np.unique(picture.reshape(-1, 3), axis=0)) > 100  # the shades of a scene, not those of an empty frame
