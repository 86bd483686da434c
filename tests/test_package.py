# SPDX-License-Identifier: GPL-3.0-or-later
"""run.py: the environment it makes, the wheels it selects, the extension it builds with Blender's own tool."""

import importlib.metadata
import itertools
import json
import shutil
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest
from packaging.requirements import Requirement

import run

PYPROJECT = run.read_toml(run.PYPROJECT)
BUNDLED = run.bundled_requirements(PYPROJECT)


def write_wheels(folder: Path, requirements=BUNDLED, tag="cp313-cp313-manylinux_2_27_x86_64.manylinux_2_28_x86_64"):
    """Fill a folder with empty archives named like the wheels of the requirements."""
    folder.mkdir(parents=True, exist_ok=True)
    for requirement in requirements:
        name, version = requirement.split("==")
        zipfile.ZipFile(folder / f"{name.replace('-', '_')}-{version}-{tag}.whl", "w").close()


@pytest.fixture
def project(tmp_path, monkeypatch):
    """A project with a small add-on and the litter that running it leaves; run.py works on it."""
    for name in ("LICENSE", "blender_manifest.toml"):
        shutil.copy(run.ROOT / name, tmp_path)
    for name in (
        "__init__.py",
        "solver/passes.py",
        "materials.csv",
        "__pycache__/__init__.cpython-313.pyc",
        "solver/__pycache__/render.trace-10.py313.nbi",
        "solver/passes.trace-10.py313.1.nbc",
    ):
        path = tmp_path / "addon" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    monkeypatch.setattr(run, "ROOT", tmp_path)
    return tmp_path


@pytest.fixture
def calls(monkeypatch):
    """The commands that run.py would have run; they succeed and do nothing."""
    made = []

    def record(*command):
        made.append([str(part) for part in command])
        return 0

    monkeypatch.setattr(run, "call", record)
    return made


# The environment


def test_other_python_versions_are_told_what_is_needed(monkeypatch):
    monkeypatch.setattr(run, "python_version", lambda: "3.12")
    with pytest.raises(SystemExit, match=r"needs Python 3\.11 or 3\.13.*runs in Python 3\.12"):
        run.main()


def test_this_environment_has_the_blender_that_pyproject_names():
    needed = [Requirement(line) for line in PYPROJECT["dependency-groups"]["blender"]]
    (bpy,) = [requirement for requirement in needed if requirement.marker.evaluate()]
    assert importlib.metadata.version("bpy") in bpy.specifier


def test_environment_is_made_once_and_again_when_the_requirements_change(project, calls, monkeypatch):
    python = (
        project / f".venv-{run.python_version()}" / ("Scripts/python.exe" if sys.platform == "win32" else "bin/python")
    )
    python.parent.mkdir(parents=True)
    python.touch()

    assert run.environment() == python
    steps = [next(word for word in ("venv", "install", "import bpy") if word in command) for command in calls]
    assert steps == ["venv", "install", "import bpy"]
    assert any(requirement.startswith("bpy==") for requirement in calls[1])

    calls.clear()
    run.environment()
    assert calls == []

    monkeypatch.setattr(run, "environment_requirements", lambda pyproject: ["bpy==0"])
    run.environment()
    assert "bpy==0" in calls[1]


def test_a_failed_installation_is_tried_again(project, monkeypatch):
    monkeypatch.setattr(run, "call", lambda *command: int("install" in command))
    for _ in range(2):
        with pytest.raises(SystemExit, match="pip could not install"):
            run.environment()


# The wheels


def test_bundled_wheels_are_complete():
    """All that a bundled wheel needs is bundled at a version it accepts, or comes with every Blender."""
    bundled = dict(requirement.split("==") for requirement in BUNDLED)
    assert {"numba", "llvmlite", "embreex", "openexr"} <= set(bundled)
    assert "numpy" not in bundled
    for name in bundled:
        for needed in map(Requirement, importlib.metadata.requires(name) or []):
            if needed.marker is None or needed.marker.evaluate({"extra": ""}):
                key = run.normalised(needed.name)
                assert key == "numpy" or needed.specifier.contains(bundled[key], prereleases=True), needed


def test_every_dependency_is_bundled_but_numpy():
    dependencies = {run.normalised(Requirement(line).name) for line in PYPROJECT["project"]["dependencies"]}
    assert dependencies == {requirement.split("==")[0] for requirement in BUNDLED} | {"numpy"}


def test_wheels_at_hand_are_not_fetched_again(project, calls):
    write_wheels(project / "wheels" / "linux-x64-3.13")
    folder = run.fetch_wheels(Path("python"), "linux-x64", "3.13")
    assert run.wheel_requirements(folder) == set(BUNDLED)
    assert calls == []


def test_outdated_wheels_are_replaced(project, monkeypatch):
    folder = project / "wheels" / "macos-arm64-3.11"
    write_wheels(folder, [*BUNDLED[1:], BUNDLED[0].split("==")[0] + "==0.1"])

    def download(*command):
        assert command[command.index("--platform") + 1].endswith("_arm64")
        assert command[command.index("--python-version") + 1] == "3.11"
        write_wheels(Path(command[command.index("--dest") + 1]), [word for word in command if "==" in str(word)])
        return 0

    monkeypatch.setattr(run, "call", download)
    assert run.wheel_requirements(run.fetch_wheels(Path("python"), "macos-arm64", "3.11")) == set(BUNDLED)


def test_a_wheel_that_does_not_come_is_named(project, monkeypatch):
    def download(*command):
        write_wheels(Path(command[command.index("--dest") + 1]), BUNDLED[1:])
        return 0

    monkeypatch.setattr(run, "call", download)
    with pytest.raises(SystemExit, match=f"windows-x64 and Python 3.13 of {BUNDLED[0]}"):
        run.fetch_wheels(Path("python"), "windows-x64", "3.13")


def test_a_python_without_wheels_is_an_error(project, monkeypatch):
    monkeypatch.setattr(run, "call", lambda *command: 1)
    with pytest.raises(SystemExit, match="no wheels for linux-x64 and Python 3.7"):
        run.fetch_wheels(Path("python"), "linux-x64", "3.7")


# The extension


def stage(project: Path, platform="linux-x64", version="3.13") -> Path:
    """Stage the project's extension for a platform and a Python, with empty wheels."""
    folder, tag = project / "wheels" / f"{platform}-{version}", f"cp{version.replace('.', '')}"
    write_wheels(folder, tag=f"{tag}-{tag}-{run.PLATFORMS[platform]}")
    kernels = project / "kernels.json"
    kernels.write_text('{"types": [], "kernels": []}')
    run.stage_extension(project / "stage", platform, version, folder, kernels)
    return project / "stage"


def test_staging_holds_the_code_and_no_litter(project):
    folder = stage(project)
    files = {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}
    assert {name for name in files if not name.startswith("wheels/")} == {
        "__init__.py", "solver/passes.py", "materials.csv", "LICENSE", "blender_manifest.toml", "kernels.json",
    }  # fmt: skip
    manifest = run.read_toml(folder / "blender_manifest.toml")
    assert {name for name in files if name.startswith("wheels/")} == {name[2:] for name in manifest["wheels"]}
    assert len(manifest["wheels"]) == len(BUNDLED)


@pytest.mark.parametrize(("version", "last"), [("3.11", {"blender_version_max"}), ("3.13", set()), ("3.14", set())])
def test_staging_leaves_the_source_manifest_alone_and_keeps_what_it_says(project, version, last):
    source = run.read_toml(project / "blender_manifest.toml")
    staged = run.read_toml(stage(project, version=version) / "blender_manifest.toml")
    assert run.read_toml(project / "blender_manifest.toml") == source
    same = set(source) - {"blender_version_min"}
    assert {key: staged[key] for key in same} == {key: source[key] for key in same}
    assert set(staged) - set(source) == {"platforms", "wheels"} | last


def test_each_blender_has_one_zip():
    """The ranges of versions meet, and begin with the oldest Blender that the manifest allows."""
    ranges = [run.BLENDERS[version][:2] for version in run.supported_pythons()]
    assert ranges[0][0] == run.read_toml(run.ROOT / "blender_manifest.toml")["blender_version_min"]
    assert all(end == begin for (_, end), (begin, _) in itertools.pairwise(ranges)) and ranges[-1][1] == ""


def build(project: Path) -> list[Path]:
    """The zips of the project's extension for every platform and Python."""
    pairs = itertools.product(run.PLATFORMS, run.supported_pythons())
    (project / "dist").mkdir()
    return [
        run.build_extension(Path(sys.executable), stage(project, *pair), project / "dist" / run.archive_name(*pair))
        for pair in pairs
    ]


def test_blender_builds_one_valid_zip_per_platform_and_python_with_its_own_wheels(project):
    archives = build(project)
    assert len({archive.name for archive in archives}) == len(run.PLATFORMS) * len(run.supported_pythons())
    pairs = itertools.product(run.PLATFORMS.items(), run.supported_pythons())
    for archive, ((platform, tag), version) in zip(archives, pairs, strict=True):
        with zipfile.ZipFile(archive) as content:
            names = content.namelist()
            manifest = tomllib.loads(content.read("blender_manifest.toml").decode())
        wheels = [f"./{name}" for name in names if name.startswith("wheels/")]
        assert manifest["platforms"] == [platform]
        assert sorted(manifest["wheels"]) == sorted(wheels)
        assert len(wheels) == len(BUNDLED)
        assert all(wheel.endswith(f"cp{version.replace('.', '')}-{tag}.whl") for wheel in wheels)
        assert {"__init__.py", "LICENSE", "solver/passes.py", "kernels.json"} <= set(names)


def test_the_index_says_what_each_zip_is_for(project):
    archives = build(project)
    listed = json.loads(run.generate_index(Path(sys.executable), project / "dist").read_text())["data"]
    assert sorted(entry["archive_url"] for entry in listed) == sorted(f"./{archive.name}" for archive in archives)
    for entry in listed:
        (version,) = entry["python_versions"]
        (platform,) = entry["platforms"]
        assert entry["archive_url"] == "./" + run.archive_name(platform, version)
        first, end, _ = run.BLENDERS[version]
        assert (entry["blender_version_min"], entry.get("blender_version_max", "")) == (first, end)
        assert (entry["id"], entry["archive_size"] > 0) == ("infrared_photons", True)


def test_blender_refuses_a_broken_manifest(project):
    folder = stage(project)
    manifest = folder / "blender_manifest.toml"
    manifest.write_text(manifest.read_text().replace('type = "add-on"', 'type = "engine"'))
    with pytest.raises(SystemExit, match="did not build"):
        run.build_extension(Path(sys.executable), folder, project / "broken.zip")


# The application template


def test_the_templates_zip_is_what_blender_installs(tmp_path):
    """One folder, whose name the menu shows, with the start-up file and the script that enables the extension."""
    with zipfile.ZipFile(run.package_template(tmp_path / "dist")) as content:
        assert sorted(content.namelist()) == ["Infrared_Photons/__init__.py", "Infrared_Photons/startup.blend"]
        source = run.ROOT / "docs" / "template"
        assert all(content.read(name) == (source / name).read_bytes() for name in content.namelist())
