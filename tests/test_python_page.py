# SPDX-License-Identifier: GPL-3.0-or-later
"""docs/python.md: its scripts print what the page says, but for times."""

import os
import re
import subprocess
import sys

import numpy as np

from run import ROOT

PAGE = (ROOT / "docs" / "python.md").read_text(encoding="utf-8")
NUMBER = r"\d+(?:\.\d+)?(?:e[-+]\d+)?"


def parts(lines):
    """Lines without times and numbers, and the numbers."""
    lines = [re.sub(rf", {NUMBER} s$", "", line) for line in lines]
    return [re.sub(NUMBER, "#", line) for line in lines], [float(number) for number in re.findall(NUMBER, str(lines))]


def test_scripts_print_what_the_page_says(tmp_path):
    """Random numbers are the same everywhere; the tolerance is for the last digit, which rounding may change."""
    blocks = re.findall(r"```(\w*)\n(.*?)```", PAGE, re.DOTALL)
    plates, groups = (next(text for _, text in blocks if mark in text) for mark in ("def square", "layered_image"))
    plates_print, groups_print = (text.splitlines() for language, text in blocks if not language)
    script = tmp_path / "two_plates.py"
    script.write_text(plates + groups, encoding="utf-8")
    run = subprocess.run(
        [sys.executable, "-u", script], env=os.environ | {"PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=900,
    )  # fmt: skip
    assert run.returncode == 0, run.stdout
    lines = run.stdout.splitlines()
    printed = lines[: len(plates_print)] + lines[-len(groups_print) :]  # the page leaves out how the groups render
    (words, numbers), (page_words, page_numbers) = parts(printed), parts(plates_print + groups_print)
    assert words == page_words
    np.testing.assert_allclose(numbers, page_numbers, rtol=1e-3, atol=2e-3)
