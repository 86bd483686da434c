# SPDX-License-Identifier: GPL-3.0-or-later
"""Set up this project and run it. Needs nothing but Python 3.11 or 3.13 with pip.

python run.py demo [options]     render the demo; options are those of docs/demo/render.py
python run.py test [options]     run the tests; options are pytest's
python run.py check              lint, and check the format of the code
python run.py package            build the extension, one zip for each platform and Python, an index by which Blender
                                 chooses among them, and the application template

Each Python gets its own environment beside this file (.venv-3.11, .venv-3.13). It is made on the first run, which
downloads about 500 MB, and made again when the requirements in pyproject.toml change.
"""

from __future__ import annotations

import argparse
import hashlib
import itertools
import json
import os
import re
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).resolve().parent
PYPROJECT = ROOT / "pyproject.toml"
BPY_NEEDS = "on Linux it needs libx11-6 libxi6 libxrender1 libxfixes3 libxkbcommon0 libsm6 libgl1"
# Blender's name of a platform, and the newest platform tag of wheels that run on every such machine it supports
PLATFORMS = {
    "linux-x64": "manylinux_2_28_x86_64",
    "windows-x64": "win_amd64",
    "macos-arm64": "macosx_13_0_arm64",
}
# Python of Blender's own builds -> the first Blender that has it, the first that has it no more (empty: none yet), and
# how the names of zips say that
BLENDERS = {
    "3.11": ("4.5.0", "5.1.0", "blender_4.5_to_5.0"),
    "3.13": ("5.1.0", "", "blender_5.1_or_newer"),
}


def main() -> int:
    """Run one command; returns the exit code."""
    pythons, this = supported_pythons(), python_version()
    if this not in pythons:
        sys.exit(f"This needs Python {' or '.join(pythons)}, as Blender's module bpy does, but runs in Python {this}")
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    for name in ("demo", "test"):
        commands.add_parser(name, add_help=False)  # -h goes on to the script behind it
    commands.add_parser("check")
    package_parser = commands.add_parser("package", description=package.__doc__)
    package_parser.add_argument("--python", nargs="+", default=pythons, help=f"versions, usually {' '.join(pythons)}")
    package_parser.add_argument("--platform", nargs="+", default=list(PLATFORMS), choices=PLATFORMS)
    package_parser.add_argument("--output", type=Path, default=ROOT / "dist", help="folder of the zips")
    options, rest = parser.parse_known_args()
    if rest and options.command in ("check", "package"):
        parser.error(f"unknown options: {' '.join(rest)}")

    python = environment()
    if options.command == "demo":
        return call(python, "-m", "docs.demo.render", *rest)
    if options.command == "test":
        # most tests render small scenes, which leave a second core idle; tests of a file share what it prepares
        return call(python, "-m", "pytest", "--numprocesses", "auto", "--dist", "loadfile", *rest)
    if options.command == "check":
        return call(python, "-m", "ruff", "check") or call(python, "-m", "ruff", "format", "--check")
    package(python, options.python, options.platform, options.output)
    print(package_template(options.output / "template"))
    return 0


# The environment


def supported_pythons() -> list[str]:
    """The versions of Python that there is a bpy for: those that Blender's own builds use."""
    return re.findall(r"bpy==.*python_version == '([\d.]+)'", PYPROJECT.read_text(encoding="utf-8"))


def python_version() -> str:
    """The version of the running Python, such as 3.11."""
    return f"{sys.version_info.major}.{sys.version_info.minor}"


def environment() -> Path:
    """The Python of this project's environment, which is made or renewed if need be."""
    folder = ROOT / f".venv-{python_version()}"
    python = folder / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    requirements = environment_requirements(read_toml(PYPROJECT))
    fingerprint = hashlib.sha256("\n".join([sys.version, *requirements]).encode()).hexdigest()
    stamp = folder / "fingerprint"
    if not (python.exists() and stamp.exists() and stamp.read_text() == fingerprint):
        print(f"Making {folder.name} (once; some minutes) ...", flush=True)
        venv = sys.executable, "-m", "venv", "--clear", folder
        # Python compiles what it imports, a small part of all: pip would take as long for it as for everything else
        pip = python, "-m", "pip", "install", "--quiet", "--no-compile"
        run("Python made no virtual environment (on Debian and Ubuntu: apt install python3-venv)", *venv)
        run("pip could not install the requirements", *pip, *requirements)
        run(f"Blender's module does not start; {BPY_NEEDS}", python, "-c", "import bpy")
        stamp.write_text(fingerprint)  # last, so that a broken environment is made again
    return python


def read_toml(path: Path) -> dict:
    """The content of a TOML file."""
    import tomllib  # here, so that a Python too old to have it gets as far as being told

    return tomllib.loads(path.read_text(encoding="utf-8"))


def environment_requirements(pyproject: dict) -> list[str]:
    """What pip has to install to run and test the add-on, and to render the demo."""
    groups = pyproject["dependency-groups"].values()
    return [*pyproject["project"]["dependencies"], *itertools.chain.from_iterable(groups)]


# The extension


def package(python: Path, versions: Iterable[str], platforms: Iterable[str], output: Path) -> None:
    """Build the extension, one zip for each platform and Python version, and the index of them all, index.json.

    One zip for all would make every user download the wheels of three systems and two Pythons, 380 MB, to use a sixth.
    """
    output.mkdir(parents=True, exist_ok=True)
    kernels = list_kernels(python)
    for name, version in itertools.product(platforms, versions):
        stage = ROOT / "build" / f"extension-{name}-{version}"
        stage_extension(stage, name, version, fetch_wheels(python, name, version), kernels)
        archive = build_extension(python, stage, output / archive_name(name, version))
        print(f"{archive} ({archive.stat().st_size / 1e6:.0f} MB)")
    print(generate_index(python, output))


def archive_name(platform: str, version: str) -> str:
    """The name of a zip, which says what it is for in words of Blender's users. version: of Python."""
    blender = BLENDERS[version][-1] if version in BLENDERS else f"python_{version}"
    manifest = read_toml(ROOT / "blender_manifest.toml")
    return f"{manifest['id']}-{manifest['version']}-{blender}-{platform.replace('-', '_')}.zip"


def list_kernels(python: Path) -> Path:
    """The list of kernels that goes into the extension, see addon/compiling; they are compiled if need be."""
    path = ROOT / "build" / "kernels.json"
    path.parent.mkdir(exist_ok=True)
    run("The kernels could not be listed", python, "-m", "docs.tools.list_kernels", path)
    return path


def fetch_wheels(python: Path, platform: str, version: str) -> Path:
    """The folder with the wheels for one platform and Python version; pip downloads what is not there yet."""
    wanted = set(bundled_requirements(read_toml(PYPROJECT)))
    folder = ROOT / "wheels" / f"{platform}-{version}"
    if wheel_requirements(folder) != wanted:
        shutil.rmtree(folder, ignore_errors=True)
        print(f"Fetching the wheels for {platform}, Python {version} ...", flush=True)
        # What a wheel needs is listed in pyproject.toml as well, because pip would add numpy, which is Blender's own.
        command = (python, "-m", "pip", "download", "--quiet", "--no-deps", "--only-binary=:all:", "--dest", folder)
        target = ("--platform", PLATFORMS[platform], "--python-version", version, "--implementation", "cp")
        run(f"pip found no wheels for {platform} and Python {version}", *command, *target, *sorted(wanted))
        if missing := wanted - wheel_requirements(folder):
            sys.exit(f"No wheel for {platform} and Python {version} of {', '.join(sorted(missing))}")
    return folder


def bundled_requirements(pyproject: dict) -> list[str]:
    """The dependencies that the extension brings along, each as normalised name==version."""
    pinned = [line.partition("==") for line in pyproject["project"]["dependencies"] if "==" in line]
    return [f"{normalised(name)}=={version}" for name, _, version in pinned]


def wheel_requirements(folder: Path) -> set[str]:
    """The wheels in a folder, each as normalised name==version."""
    names = [wheel.name.split("-") for wheel in folder.glob("*.whl")]
    return {f"{normalised(name)}=={version}" for name, version, *_ in names}


def normalised(name: str) -> str:
    """The one spelling of a distribution's name (PEP 503)."""
    return re.sub(r"[-_.]+", "-", name).lower()


def stage_extension(stage: Path, platform: str, version: str, wheels: Path, kernels: Path) -> None:
    """Lay out the extension as Blender wants it: the add-on's code, manifest, licence and wheels in one folder.

    stage: the folder, emptied first. version: of Python. wheels: folder of them. kernels: the list of them.
    """
    shutil.rmtree(stage, ignore_errors=True)
    shutil.copytree(ROOT / "addon", stage, ignore=shutil.ignore_patterns("__pycache__", "*.py[co]", "*.nb[ic]"))
    shutil.copy(ROOT / "LICENSE", stage)
    shutil.copy(kernels, stage / "kernels.json")
    (stage / "wheels").mkdir()
    files = sorted(wheels.glob("*.whl"))
    for wheel in files:
        shutil.copy(wheel, stage / "wheels")
    added = {"platforms": [platform], "wheels": [f"./wheels/{wheel.name}" for wheel in files]}
    manifest = (ROOT / "blender_manifest.toml").read_text(encoding="utf-8")
    if version in BLENDERS:
        first, end, _ = BLENDERS[version]
        manifest, count = re.subn(r"(?m)^(blender_version_min = ).*$", rf'\g<1>"{first}"', manifest)
        if count != 1:
            sys.exit("blender_manifest.toml needs one blender_version_min")
        added |= {"blender_version_max": end} if end else {}
    # In front, because what follows a table's header belongs to the table. JSON's texts and lists are TOML's as well.
    head = "".join(f"{key} = {json.dumps(value, indent=4)}\n" for key, value in added.items())
    (stage / "blender_manifest.toml").write_text(head + manifest, encoding="utf-8")


def build_extension(python: Path, stage: Path, archive: Path) -> Path:
    """Zip and validate a staged extension with Blender's own tool; returns the zip."""
    archive = archive.resolve()
    source, target = f"--source-dir={stage}", f"--output-filepath={archive}"
    run("The extension did not build", python, extension_tool(python), "build", source, target)
    run("The extension is not valid", python, extension_tool(python), "validate", archive)
    return archive


def generate_index(python: Path, folder: Path) -> Path:
    """Make the index of the zips in a folder, which is then a repository of extensions; returns the index.

    From a repository Blender installs the zip that is for it. The index says of each for which Blender, system and
    Python it is.
    """
    where = f"--repo-dir={folder.resolve()}"
    run("The index was not made", python, extension_tool(python), "server-generate", where, "--html")
    return folder / "index.json"


def extension_tool(python: Path) -> Path:
    """Blender's own tool for extensions, which bpy brings along."""
    tools = [*python.parent.parent.glob("**/bl_pkg/cli/blender_ext.py")]
    if len(tools) != 1:
        sys.exit(f"Expected one blender_ext.py in {python.parent.parent}, found {len(tools)}")
    return tools[0]


# The application template


def package_template(output: Path) -> Path:
    """Zip the template as *Install Application Template* wants it: a folder with its start-up file; returns the zip."""
    output.mkdir(parents=True, exist_ok=True)
    archive, folder = output / "infrared_photons_template.zip", ROOT / "docs" / "template" / "Infrared_Photons"
    with zipfile.ZipFile(archive, "w") as content:
        for name in ("__init__.py", "startup.blend"):
            content.write(folder / name, f"{folder.name}/{name}")
    return archive


# Commands


def call(*command: str | Path) -> int:
    """Run a command in the project's folder; returns its exit code."""
    return subprocess.run(command, cwd=ROOT).returncode


def run(complaint: str, *command: str | Path) -> None:
    """Run a command that has to succeed; leave with the complaint if it does not."""
    if code := call(*command):
        sys.exit(f"{complaint} (exit code {code})")


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit(130)
