# SPDX-License-Identifier: GPL-3.0-or-later
"""Run a real Blender, and modules of tests/real_blender in it.

REAL_BLENDER names a launcher that runs `blender ARGS` when called as `LAUNCHER run ARGS`, and with a window as
`LAUNCHER gui ARGS`.
"""

import json
import os
import subprocess
from pathlib import Path

import pytest

import run

ROOT = run.ROOT
LAUNCHER = Path(os.environ.get("REAL_BLENDER", ROOT.parent / "shared" / "blender" / "real-blender"))
WORK = ROOT / "build" / "real_blender"  # inside the checkout, which the launcher shows to Blender

needs_real_blender = [
    pytest.mark.skipif(not LAUNCHER.exists(), reason=f"no real Blender: there is no {LAUNCHER} (set REAL_BLENDER)"),
    pytest.mark.skipif(run.python_version() != run.supported_pythons()[-1], reason="runs once, with the newest Python"),
]


def blender(*arguments, check_scripts=True, window=False) -> str:
    """Run the real Blender with its own, empty user folder; returns what it prints. window: a virtual one."""
    environment = os.environ | {"BLENDER_USER_RESOURCES": str(WORK / "user"), "HOME": str(WORK / "home")}
    environment.pop("INFRARED_PHOTONS_KERNELS", None)  # an artist has none
    background = () if window else ("-b",)
    options = (*background, "--python-exit-code", "1") if check_scripts else ()
    done = subprocess.run(
        [LAUNCHER, "gui" if window else "run", *options, *map(str, arguments)],
        cwd=ROOT, env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        text=True, timeout=900,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout
    assert "Traceback" not in done.stdout, done.stdout
    return done.stdout


def module(name: str, *arguments, before: tuple = ()) -> tuple:
    """Blender's last arguments, which run a module of tests/real_blender with arguments of its own.

    before: arguments to Blender that it has to see behind the module.
    """
    launch = ROOT / "tests" / "real_blender" / "launch.py"
    return "--python", launch, *before, "--", f"tests.real_blender.{name}", *arguments


def facts(text: str) -> dict:
    """What a module found out: lines of JSON, see facts.py."""
    return dict(json.loads(line[5:]) for line in text.splitlines() if line.startswith("FACT "))
