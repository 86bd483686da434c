# SPDX-License-Identifier: GPL-3.0-or-later
"""The self-test of an installation: it passes here, and says what is wrong where something is."""

import sys

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from addon import self_check  # noqa: E402
from addon.output import exr  # noqa: E402


def test_the_check_passes():
    assert bpy.ops.infrared.self_check() == {"FINISHED"}


def test_every_part_of_it_was_looked_at():
    lines = list(self_check.run_checks())
    assert len(lines) == 4 and all(what and not problem for what, problem in lines)


@pytest.mark.parametrize("off", [2.0, np.nan])
def test_wrong_temperatures_are_told(monkeypatch, off):
    real = self_check._render
    monkeypatch.setattr(self_check, "_render", lambda subtract: real(subtract) + off)
    with pytest.raises(RuntimeError, match=r"looks black: off by .* K; So it does by photons alone: off by .* K"):
        bpy.ops.infrared.self_check()


def test_wrong_files_are_told(monkeypatch):
    write = exr.write_band_exr

    def one_too_hot(path, bands, edges, radiance, temperature, noise):
        write(path, bands, edges, radiance, temperature + 1, noise)

    monkeypatch.setattr(exr, "write_band_exr", one_too_hot)
    with pytest.raises(RuntimeError, match="other values were read"):
        bpy.ops.infrared.self_check()


def test_a_missing_library_is_told(monkeypatch):
    monkeypatch.setitem(sys.modules, "OpenEXR", None)
    with pytest.raises(RuntimeError, match="Bundled libraries load: .*OpenEXR"):
        bpy.ops.infrared.self_check()
