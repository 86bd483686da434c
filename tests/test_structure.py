# SPDX-License-Identifier: GPL-3.0-or-later
"""Rules about the source that no other test would notice to be broken."""

import ast
import re
import string
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
ADDON = ROOT / "addon"
MODULES = sorted(ADDON.rglob("*.py"))
SOURCES = sorted({*ROOT.glob("*.py"), *MODULES, *(ROOT / "tests").rglob("*.py"), *(ROOT / "docs").rglob("*.py")})
MANIFEST = tomllib.loads((ROOT / "blender_manifest.toml").read_text(encoding="utf-8"))
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def name(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def absolute_imports(path: Path) -> set[str]:
    """The top-level packages that a module imports by absolute name, anywhere in it."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name.partition(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            found.add(node.module.partition(".")[0])
    return found


@pytest.mark.parametrize("path", SOURCES, ids=name)
def test_every_source_names_its_licence(path):
    assert path.read_text(encoding="utf-8").startswith("# SPDX-License-Identifier: GPL-3.0-or-later\n")


@pytest.mark.parametrize("path", sorted((ADDON / "solver").rglob("*.py")), ids=name)
def test_solver_never_imports_blender(path):
    blenders_modules = {
        "bpy",
        "bpy_extras",
        "bl_math",
        "blf",
        "bmesh",
        "gpu",
        "gpu_extras",
        "idprop",
        "imbuf",
        "mathutils",
    }
    assert not absolute_imports(path) & blenders_modules


def test_solver_works_without_blender():
    script = "import sys; sys.modules['bpy'] = None; from addon.solver import Scene, Settings, render"
    done = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("path", sorted((ADDON / "solver").rglob("*.py")), ids=name)
def test_kernels_are_made_where_they_are_kept(path):
    """By `kernels.njit`: Numba's own would keep them beside the sources, where it misses changes in what they call."""
    assert path.stem in ("kernels", "kernel_cache") or "numba" not in absolute_imports(path)


def test_kernels_are_kept_whoever_loads_them_first():
    code = "from addon.solver.geometry import sorting; print(sorting.radix_sort._cache.cache_path); "
    code += "from addon.solver.system import kernel_cache; print(kernel_cache.kernel_folder()); "
    code += "import numba; print(numba.config.CACHE_DIR)"
    run = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    place, folder, numbas_own = run.stdout.splitlines()
    assert Path(folder) in Path(place).parents and numbas_own != folder


def test_the_solver_has_its_functions_whatever_was_loaded_before():
    """The module `render` must not take the place of the function in it."""
    code = "import sys, addon.solver; assert 'numba' not in sys.modules; import addon.solver.checkpoint;"
    code += "from addon.solver import *; print(*(type(globals()[name]).__name__ for name in addon.solver.__all__))"
    run = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert "module" not in run.stdout.split() and run.stdout.split().count("function") == 3


@pytest.mark.parametrize("path", MODULES, ids=name)
def test_addon_imports_itself_relatively(path):
    """Installed, the package is called bl_ext.<repository>.infrared_photons."""
    assert "addon" not in absolute_imports(path)


@pytest.mark.parametrize("path", MODULES, ids=name)
def test_addon_needs_only_what_the_extension_brings(path):
    """Standard library, Blender's own modules (numpy among them) and the bundled wheels."""
    allowed = {
        "bpy",
        "bpy_extras",
        "bl_operators",
        "bl_ui",
        "blf",
        "gpu",
        "gpu_extras",
        "imbuf",
        "mathutils",
        "numpy",
        "numba",
        "llvmlite",
        "embreex",
        "OpenEXR",
    }
    assert absolute_imports(path) <= allowed | sys.stdlib_module_names


def test_versions_agree():
    assert MANIFEST["version"] == PROJECT["version"]


def test_licences_agree():
    assert MANIFEST["license"] == ["SPDX:" + PROJECT["license"]]
    assert "GNU GENERAL PUBLIC LICENSE" in (ROOT / "LICENSE").read_text(encoding="utf-8")


def test_manifest_texts_fit_blenders_rules():
    for text in (MANIFEST["tagline"], *MANIFEST["permissions"].values()):
        assert 0 < len(text) <= 64
        assert text[-1] not in string.punctuation
    assert "blender" not in MANIFEST["name"].lower()


def test_manifest_has_the_fixed_names():
    assert (MANIFEST["id"], MANIFEST["name"], MANIFEST["type"]) == ("infrared_photons", "Infrared Photons", "add-on")


def test_manifest_leaves_wheels_to_the_build():
    assert not {"wheels", "platforms"} & set(MANIFEST)


# How modules find each other


@pytest.mark.parametrize("path", SOURCES, ids=name)
def test_only_blenders_launcher_changes_where_python_looks_for_modules(path):
    """Scripts run as modules, in the project's folder. Code in texts, for other processes, counts as well."""
    changed = re.search(r"\bsys\.path\b|syspath[_]|addsite[d]ir", path.read_text(encoding="utf-8"))
    assert bool(changed) == (name(path) == "tests/real_blender/launch.py")


@pytest.mark.parametrize("path", SOURCES, ids=name)
def test_no_source_imports_a_test_module(path):
    """What tests share is in tests/helpers; here, too, code in texts counts."""
    imported = r"^\s*(from|import)\s+(tests\.)?test_|^\s*from\s+tests\s+import\b.*\btest_"
    assert not re.search(imported, path.read_text(encoding="utf-8"), re.MULTILINE)
