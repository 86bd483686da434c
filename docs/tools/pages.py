# SPDX-License-Identifier: GPL-3.0-or-later
"""What scripts write into the pages, and the line that says which code it was measured on."""

import subprocess
import tomllib
from collections.abc import Iterable
from pathlib import Path

from docs.tools.paths import ROOT

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


def table(head: Iterable, *rows: Iterable) -> str:
    """A Markdown table of cells that are anything with a text."""
    head = list(head)
    lines = [f"| {' | '.join(map(str, line))} |" for line in (head, *rows)]
    return "\n".join([lines[0], "|---" * len(head) + "|", *lines[1:]])


def write_blocks(page: Path, script: str, blocks: dict[str, str], last: str = MADE_AT) -> None:
    """Replace what stands between the marks of each block in the page, which carry its name and the script's.

    script: its path in the project's folder. last: the line below each block; empty for none.
    """
    text = page.read_text(encoding="utf-8")
    for name, block in blocks.items():
        start, end = START.format(name=name, script=script), END.format(name=name)
        before, rest = text.split(start)
        _, after = rest.split(end)
        content = "\n\n".join(part for part in (start, block, last, end) if part)
        text = f"{before}{content}{after}"
    page.write_text(text, encoding="utf-8")
