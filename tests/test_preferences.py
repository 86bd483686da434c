# SPDX-License-Identifier: GPL-3.0-or-later
"""The self-test of an installation: it passes here, and says what is wrong where something is."""

import dataclasses
import sys
import threading
from types import SimpleNamespace

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

import addon  # noqa: E402
from addon import preferences  # noqa: E402
from addon.output import exr  # noqa: E402
from addon.preferences import INFRARED_OT_self_check  # noqa: E402
from addon.rendering import self_check  # noqa: E402


def test_blender_finds_the_preferences_by_the_add_ons_own_name():
    """Installed, the package has another name, under which Blender looks for them."""
    assert preferences.InfraredPreferences.bl_idname == addon.__name__


def test_the_check_passes():
    assert bpy.ops.infrared.self_check() == {"FINISHED"}


def test_every_part_of_it_was_looked_at():
    lines = list(self_check.run_checks())
    assert len(lines) == 4 and all(what and not problem for what, problem in lines)


@pytest.mark.parametrize("off", [2.0, np.nan])
def test_wrong_temperatures_are_told(monkeypatch, off):
    real = self_check._render
    monkeypatch.setattr(self_check, "_render", lambda subtract: real(subtract) + off)
    with pytest.raises(
        RuntimeError, match=r"looks like a blackbody: off by .* K; So it does by photons alone: off by .* K"
    ):
        bpy.ops.infrared.self_check()


def test_wrong_files_are_told(monkeypatch):
    write = exr.write_band_exr

    def one_too_hot(path, images):
        write(path, dataclasses.replace(images, temperature=images.temperature + 1))

    monkeypatch.setattr(exr, "write_band_exr", one_too_hot)
    with pytest.raises(RuntimeError, match="other values were read"):
        bpy.ops.infrared.self_check()


def test_a_missing_library_is_told(monkeypatch):
    monkeypatch.setitem(sys.modules, "OpenEXR", None)
    with pytest.raises(RuntimeError, match="Bundled libraries load: .*OpenEXR"):
        bpy.ops.infrared.self_check()


class Check:
    """The operator in a window, which these tests do not have."""

    invoke, modal = INFRARED_OT_self_check.invoke, INFRARED_OT_self_check.modal
    cancel, _end = INFRARED_OT_self_check.cancel, INFRARED_OT_self_check._end

    def __init__(self):
        self.timers, self.reports = [], []
        manager = SimpleNamespace(
            event_timer_add=lambda *_, **__: self.timers.append("timer") or "timer",
            event_timer_remove=self.timers.remove,
            modal_handler_add=lambda _: None,
        )
        self.context = SimpleNamespace(window_manager=manager, window=None)

    def report(self, kind, _message):
        self.reports.append(kind)

    def after_a_while(self):
        return self.modal(self.context, SimpleNamespace(type="TIMER"))


@pytest.fixture
def end_check(monkeypatch):
    """The check passes when this is called, and not before."""
    done = threading.Event()

    def run_checks():
        done.wait(10.0)
        yield "A slow one", ""

    def end():
        done.set()
        INFRARED_OT_self_check._thread.join(10.0)

    monkeypatch.setattr(preferences, "run_checks", run_checks)
    yield end
    end()


def test_one_check_runs_at_a_time_and_tells_its_result(end_check):
    check = Check()
    assert check.invoke(check.context, None) == {"RUNNING_MODAL"}
    assert check.after_a_while() == {"PASS_THROUGH"} and check.timers
    assert preferences.is_running() and not bpy.ops.infrared.self_check.poll()
    end_check()
    assert check.after_a_while() == {"FINISHED"} and check.reports == [{"INFO"}] and not check.timers
    assert not preferences.is_running() and bpy.ops.infrared.self_check.poll()


def test_after_a_check_whose_window_closed_there_can_be_another(end_check):
    """Or another file was opened: Blender ends the operator, which does not see that the check has ended."""
    check = Check()
    check.invoke(check.context, None)
    check.cancel(check.context)
    assert not check.timers and not bpy.ops.infrared.self_check.poll()
    end_check()
    assert bpy.ops.infrared.self_check() == {"FINISHED"}
