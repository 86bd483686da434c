# SPDX-License-Identifier: GPL-3.0-or-later
"""Compiling all kernels in the background: processes that share the work, and a mark that says that all is done.

Numba is not loaded here: Blender's process only hands out tasks.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
import subprocess
import sys
import threading
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from ..solver.system import kernel_cache
from .scenes import TINY_SCENES

PACKAGE = __package__.rpartition(".")[0]
FOLDER = Path(__file__).parents[1]
LIST = FOLDER / "kernels.json"  # see `kernels`; only an extension has one
MOST_PROCESSES = 8  # more find no work: kernels that others call are compiled first
THREAD = "Infrared Photons kernels"  # name of the threads that hand out tasks
_MARK = "complete"
_LIGHTLY = getattr(subprocess, "BELOW_NORMAL_PRIORITY_CLASS", 0) | getattr(subprocess, "CREATE_NO_WINDOW", 0)


def is_complete() -> bool:
    """Whether all kernels have been compiled, by this Python on this machine, of the sources as they are now."""
    try:
        return (kernel_cache.kernel_folder() / _MARK).read_text(encoding="utf-8") == _stamp()
    except OSError:
        return False


def are_kept() -> bool:
    """Whether kernels outlive the process that compiles them; not where their folder cannot be written."""
    wanted = os.environ.get(kernel_cache.FOLDER_VARIABLE) or FOLDER / "solver"
    return kernel_cache.kernel_folder().is_relative_to(wanted)


def _stamp() -> str:
    """What the kernels that are kept depend on: Numba looks at the dates of sources, too."""
    sources = [path.stat() for path in sorted((FOLDER / "solver").rglob("*.py"))]
    dates = [(about.st_mtime_ns, about.st_size) for about in sources]
    return hashlib.sha256(repr((sys.version, platform.node(), dates)).encode()).hexdigest()


def python() -> str:
    """The Python that runs workers; an empty text if this program does not tell it."""
    known = sys.executable and Path(sys.executable)
    return str(known) if known and known.is_file() and known.name.lower().startswith("python") else ""


class Compilation:
    """Compiles all kernels, in processes of their own.

    done, total: how many tasks. problem: what went wrong, or an empty text. cancelled: whether it was ended early.
    """

    def __init__(self, processes: int = 0, scenes: Sequence[str] = tuple(TINY_SCENES)):
        """processes: 0 is one for each core. scenes: to render; fewer than all are for tests."""
        kernels = len(json.loads(LIST.read_text(encoding="utf-8"))["kernels"]) if LIST.is_file() else 0
        # Numbers of kernels in the list, or names of scenes. What begins a phase needs what the one before it compiles.
        phases = ([*range(kernels)], [*scenes]) if kernels else ([*scenes[:1]], [*scenes[1:]])
        self._phases = [tasks for tasks in phases if tasks]
        self._working = 0  # tasks that are begun
        self.done, self.total, self.problem, self.cancelled = 0, sum(map(len, self._phases)), "", False
        self._changed = threading.Condition()
        self._count = processes or max(1, min(os.cpu_count() or 1, MOST_PROCESSES))
        self._processes: list[subprocess.Popen] = []
        self._threads: list[threading.Thread] = []

    def start(self, arguments: Sequence[str] = ()) -> None:
        """Start the processes and return at once. arguments: of Python. Raises OSError if one cannot be started."""
        kernel_cache.kernel_folder()  # here, or all of them would make it
        command = [python(), *arguments, str(Path(__file__).with_name("worker.py"))]
        try:
            for _ in range(self._count):
                process = subprocess.Popen(
                    command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
                    text=True, encoding="utf-8", creationflags=_LIGHTLY,
                )  # fmt: skip
                self._processes.append(process)
        except OSError:
            self.cancel()
            raise
        for process in self._processes:
            thread = threading.Thread(target=self._serve, args=(process,), name=THREAD, daemon=True)
            self._threads.append(thread)
            thread.start()

    def is_running(self) -> bool:
        """Whether a process is at work."""
        return any(thread.is_alive() for thread in self._threads)

    def cancel(self) -> None:
        """End all processes at once. What they have compiled is kept."""
        with self._changed:
            self.cancelled = True
            self._changed.notify_all()
        for process in self._processes:
            process.kill()

    def wait(self) -> None:
        """Wait until all processes have ended."""
        for thread in self._threads:
            thread.join()

    def _serve(self, process: subprocess.Popen) -> None:
        """Give a process one task after the other."""
        place = {"path": sys.path, "package": PACKAGE, "folder": str(FOLDER), "listed": str(LIST)}
        try:
            with process:
                _send(process, place)
                while (task := self._take()) is not None:
                    _send(process, task)
                    self._end(task, json.loads(process.stdout.readline()))
        except (OSError, ValueError):  # the process has died: there is no answer, or half of one
            self._fail("A process that compiles kernels has ended early")
            process.kill()

    def _take(self) -> int | str | None:
        """The next task, once it may begin; None if there is nothing left to begin."""
        with self._changed:
            while not (self.cancelled or self.problem):
                if self._phases and self._phases[0]:
                    self._working += 1
                    return self._phases[0].pop(0)
                if len(self._phases) < 2:
                    break
                if self._working:
                    self._changed.wait()
                else:
                    self._phases.pop(0)
        return None

    def _end(self, task: int | str, problem: str) -> None:
        """Take the answer to a task. A kernel that does not compile says that the list is out of date: scenes tell."""
        with self._changed:
            self._working -= 1
            self.done += 1
            if problem and isinstance(task, str):
                self.problem = problem
            elif self.done == self.total and not self.problem:
                write_mark()
            self._changed.notify_all()

    def _fail(self, problem: str) -> None:
        with self._changed:
            if not self.cancelled:
                self.problem = problem
            self._changed.notify_all()


def _send(process: subprocess.Popen, content) -> None:
    process.stdin.write(json.dumps(content) + "\n")
    process.stdin.flush()


def write_mark() -> None:
    """Say, in the folder of the kernels, that all of them are compiled: the next start then does not look."""
    with suppress(OSError):  # then the next start looks again
        (kernel_cache.kernel_folder() / _MARK).write_text(_stamp(), encoding="utf-8")
