# SPDX-License-Identifier: GPL-3.0-or-later
"""README and pages name files, modules and functions that exist, where the pages say."""

import ast
import re
from functools import cache
from pathlib import Path

import pytest

from run import ROOT

PAGES = sorted([ROOT / "README.md", *(ROOT / "docs").rglob("*.md")])
SOURCES = sorted(path for folder in ("addon", "docs", "tests") for path in (ROOT / folder).rglob("*.py"))
SHORT_FOR = (ROOT, ROOT / "addon", ROOT / "addon" / "solver", ROOT / "docs")  # where a path on a page may start
EXAMPLES = {"two_plates.py"}  # that readers write themselves
VARIABLES = {"film", "scene"}  # of scripts on the pages, called like modules of the solver


@cache
def defined(path: Path) -> frozenset[str]:
    """The names that a module defines or imports, anywhere in it: functions, fields and parameters, too."""
    tree, found = ast.parse(path.read_text(encoding="utf-8")), set()
    for node in ast.walk(tree):
        match node:
            case ast.FunctionDef(name=name) | ast.ClassDef(name=name) | ast.Name(id=name, ctx=ast.Store()):
                found.add(name)
            case ast.ImportFrom(names=names):
                found |= {alias.asname or alias.name for alias in names}
            case ast.arg(arg=name):
                found.add(name)
    return frozenset(found)


def missing_files(text: str) -> set[str]:
    """Python files that a page names in backticks and that are nowhere: by path, or by name alone."""
    named = {name for span in re.findall(r"`([^`]+)`", text) for name in re.findall(r"[\w./-]+\.py\b", span)}
    known = {path.name for path in SOURCES} | {path.name for path in ROOT.glob("*.py")} | EXAMPLES
    return {
        name
        for name in named
        if not (any((folder / name).is_file() for folder in SHORT_FOR) if "/" in name else name in known)
    }


def source(module: str) -> tuple[Path, str] | None:
    """The file of the longest part of a dotted name that is a module, and the rest of the name; None if none is."""
    parts = module.split(".")
    for end in range(len(parts), 0, -1):
        path = ROOT.joinpath(*parts[:end])
        for file in (path.with_suffix(".py"), path / "__init__.py"):
            if file.is_file():
                return file, ".".join(parts[end:])
    return None


def missing_names(text: str) -> set[str]:
    """Dotted names into the code, modules that are run, and imports, that do not resolve."""
    wanted = set(re.findall(r"\b(?:addon|docs\.tools|tests\.\w+)\.\w+(?:\.\w+)*", text))
    wanted |= {module for module in re.findall(r"python -m ([\w.]+)", text) if "." in module}
    for module, names in re.findall(r"from (addon[\w.]*) import (\([^)]*\)|.*)", text):
        wanted |= {f"{module}.{name}" for name in re.findall(r"\w+", names)}
    pairs = re.findall(r"`(\w+)\.(?!py`|csv`)(\w+)\(?[^`]*`", text)  # `module.name`
    pairs += re.findall(r"`(?:\w+/)*(\w+)\.py`(?: \(|, )`(\w+)`\)", text)  # `module.py` (`name`)
    for stem, name in pairs:
        files = [path for path in SOURCES if path.stem == stem and path.is_relative_to(ROOT / "addon" / "solver")]
        if files and stem not in VARIABLES and not any(name in defined(path) for path in files):
            wanted.add(f"{stem}.{name}")
    return {name for name in wanted if not resolves(name)}


def resolves(name: str) -> bool:
    found = source(name)
    return found is not None and (not found[1] or found[1].partition(".")[0] in defined(found[0]))


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_what_a_page_names_is_there(page):
    text = page.read_text(encoding="utf-8")
    assert missing_files(text) == set()
    assert missing_names(text) == set()


def test_every_kernel_that_the_architecture_names_is_there():
    """Single words in backticks are functions, classes, files, folders or fields of the add-on."""
    text = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    names = {name for path in SOURCES for name in defined(path)} | {path.name for path in (ROOT / "addon").rglob("*")}
    assert set(re.findall(r"`(\w+)`", text)) - names == set()


@pytest.mark.parametrize(
    "text, files, names",
    [
        ("`passes.py` and `camera/rays.py`, `addon/solver/scene.py`, `addon.solver.render`", set(), set()),
        ("`render_all.py` in `camera/passes.py`", {"render_all.py", "camera/passes.py"}, set()),
        ("`addon.solver.physics.no_module.f`", set(), {"addon.solver.physics.no_module.f"}),
        ("`addon.solver.passes.render` and `passes.renderer(scene)`", set(), {"passes.renderer"}),
        ("`camera/shadow_rays.py` (`send_sky`), (`surfaces.py`, `patch_in_ball`)", set(), {"surfaces.patch_in_ball"}),
        ("`python -m docs.tools.measure_all`", set(), {"docs.tools.measure_all"}),
        ("from addon.solver.physics.spectrum import planck, plank", set(), {"addon.solver.physics.spectrum.plank"}),
    ],
)
def test_what_is_missing_is_found(text, files, names):
    assert (missing_files(text), missing_names(text)) == (files, names)
