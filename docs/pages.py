# SPDX-License-Identifier: GPL-3.0-or-later
"""What scripts write into these pages, and the line that says which code it was measured on."""

import subprocess
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
START, END = "<!-- {name}: written by {script} -->", "<!-- end of {name} -->"


def made_at(root: Path = ROOT) -> str:
    """A sentence: the commit that the code in this folder is of; its version where there is no commit."""
    git = ("git", "--git-dir", ".git")  # not that of a folder around
    try:
        last = subprocess.run([*git, "log", "-1", "--format=%h of %cs"], cwd=root, capture_output=True, check=True)
        same = subprocess.run([*git, "diff", "--quiet", "HEAD", "--", "*.py"], cwd=root, capture_output=True)
    except (OSError, subprocess.CalledProcessError):
        project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]
        return f"Made with version {project['version']}."
    return f"Made at commit {last.stdout.decode().strip()}{' and changes since' * (same.returncode != 0)}."


MADE_AT = made_at()  # now, as the code that runs is that of the start


def write_blocks(page: Path, script: str, blocks: dict[str, str]) -> None:
    """Replace what stands between the marks of each block in the page, which carry its name and the script's."""
    text = page.read_text(encoding="utf-8")
    for name, block in blocks.items():
        start, end = START.format(name=name, script=script), END.format(name=name)
        before, rest = text.split(start)
        _, after = rest.split(end)
        text = f"{before}{start}\n\n{block}\n\n{MADE_AT}\n\n{end}{after}"
    page.write_text(text, encoding="utf-8")
