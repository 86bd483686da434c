# SPDX-License-Identifier: GPL-3.0-or-later
"""Which kernels there are, with the types of their arguments: a list in a file, from which any process compiles one.

A kernel of Numba gets its types from the values of its first call, deep in a render. A list of them, made where the
kernels are compiled already, lets several processes compile at once. It may be out of date: who uses it renders
`TINY_SCENES` afterwards, which compile what it lacks.
"""

from __future__ import annotations

import importlib
import json
import sys
from collections.abc import Iterator
from pathlib import Path

from numba.core import types
from numba.core.caching import NullCache
from numba.core.dispatcher import Dispatcher

from ..solver.system.kernel_cache import source_digest
from .scenes import TINY_SCENES, render_tiny_scene

SOLVER = __package__.rpartition(".")[0] + ".solver"


class TypeTable:
    """Types of Numba as JSON: each once, by its number in `rows`.

    A row is a name of a number's type, [literal], [dtype, dimensions, layout, whether it is read-only and aligned] of
    an array, or [[members], module and name of its class, if any] of a tuple; all types in it are numbers of rows.
    """

    def __init__(self, rows: list | None = None):
        self.rows = rows or []
        self._numbers = {}
        self._types = {}

    def number(self, kind) -> int:
        """The number of a type, which gets a row if it has none. Raises TypeError if it is of an unknown kind."""
        if kind not in self._numbers:
            row = self._row(kind)
            self._numbers[kind] = len(self.rows)
            self.rows.append(row)
        return self._numbers[kind]

    def _row(self, kind):
        if isinstance(kind, types.IntegerLiteral):
            return [kind.literal_value]
        if isinstance(kind, types.Number | types.Boolean):
            return str(kind)
        if isinstance(kind, types.Array):
            return [self.number(kind.dtype), kind.ndim, kind.layout, not kind.mutable, kind.aligned]
        if isinstance(kind, types.BaseTuple):
            made = getattr(kind, "instance_class", tuple)
            name = [] if made is tuple else [made.__module__.removeprefix(SOLVER), made.__qualname__]
            return [[self.number(member) for member in kind], *name]
        raise TypeError(f"{kind} is of a kind that lists of kernels do not have")

    def type(self, number: int):
        """The type of a number."""
        if number not in self._types:
            self._types[number] = self._made(self.rows[number])
        return self._types[number]

    def _made(self, row):
        if isinstance(row, str):
            return types.boolean if row == "bool" else getattr(types, row)
        if isinstance(row[0], list):
            made = find(*row[1:]) if row[1:] else None
            return types.BaseTuple.from_types([self.type(member) for member in row[0]], made)
        if len(row) == 1:
            return types.literal(row[0])
        dtype, dimensions, layout, readonly, aligned = row
        return types.Array(self.type(dtype), dimensions, layout, readonly, aligned=aligned)


def find(module: str, name: str):
    """What a module of the solver, by its name in there, calls so."""
    return getattr(importlib.import_module(SOLVER + module), name)


def write_list(path: Path) -> int:
    """Write the list of all kernels that renders call by themselves; returns how many.

    This process loads them from where they are kept: one that compiled a kernel would list what that calls, too.
    """
    table, listed = TypeTable(), {}
    for scene in TINY_SCENES:
        render_tiny_scene(scene)
        added = [each for each in _loaded() if (each[0], each[1].signature.args) not in listed]
        # the largest first, as they take longest: so that all processes end at about the same time
        for kernel, compiled in sorted(added, key=_size, reverse=True):
            place = [kernel.py_func.__module__.removeprefix(SOLVER), kernel.py_func.__qualname__]
            arguments = compiled.signature.args
            listed[kernel, arguments] = [*place, [table.number(kind) for kind in arguments]]
    content = {"sources": source_digest(), "types": table.rows, "kernels": list(listed.values())}
    path.write_text(json.dumps(content), encoding="utf-8")
    return len(listed)


def _size(loaded: tuple[Dispatcher, object]) -> int:
    """Bytes that what `_loaded` gives has in its file: the more, the longer it takes to compile."""
    kernel, compiled = loaded
    file = kernel._cache._cache_file
    names = [name for (types_, *_), name in file._load_index().items() if types_ == compiled.signature.args]
    return max((Path(file._data_path(name)).stat().st_size for name in names), default=0)


def _loaded() -> Iterator[tuple[Dispatcher, object]]:
    """Each kernel of the solver that is kept, with each result of compiling it that this process has."""
    modules = [module for name, module in sys.modules.items() if name.startswith(SOLVER)]
    kernels = {value: None for module in modules for value in vars(module).values() if isinstance(value, Dispatcher)}
    for kernel in kernels:
        if not isinstance(kernel._cache, NullCache):  # its one name for it; the tests would tell of a change
            yield from ((kernel, compiled) for compiled in kernel.overloads.values())


def read_list(path: Path) -> dict:
    """The content of the file of a list; empty if there is none."""
    return json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}


def compile_kernel(content: dict, index: int) -> None:
    """Compile a kernel of a list, unless it is kept already. content: see read_list."""
    module, name, arguments = content["kernels"][index]
    table = TypeTable(content["types"])
    find(module, name).compile(tuple(table.type(number) for number in arguments))
