# SPDX-License-Identifier: GPL-3.0-or-later
"""Rules about the source that no other test would notice to be broken."""

import ast
import functools
import graphlib
import re
import string
import subprocess
import sys
import tomllib
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).resolve().parent.parent
ADDON = ROOT / "addon"
MODULES = sorted(ADDON.rglob("*.py"))
SOLVER = [path for path in MODULES if path.is_relative_to(ADDON / "solver")]
SOURCES = sorted({*ROOT.glob("*.py"), *MODULES, *(ROOT / "tests").rglob("*.py"), *(ROOT / "docs").rglob("*.py")})
MANIFEST = tomllib.loads((ROOT / "blender_manifest.toml").read_text(encoding="utf-8"))
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]

# The rooms, as docs/architecture.md describes them: each may import from itself and from those further down. A room is
# a module, or a package with all that is in it; "" is the __init__ of the whole. Rooms in one line may import from each
# other. What is in presets are scripts that Blender runs.
ROOMS = (
    ("engine", "", "preferences", "commands"),
    ("ui",),
    ("pairs",),
    ("rendering",),
    ("reading",),
    ("properties", "kept", "heat_settings", "measure_settings", "object_settings", "interface"),
    ("measuring", "merge", "convert"),
    ("output", "compiling"),
    ("pass_ranges", "version", "solver", "presets"),
)
SOLVERS_ROOMS = (
    ("",),
    ("checkpoint",),
    ("passes",),
    ("memory",),
    ("camera",),
    ("planning",),
    ("photons",),
    ("geometry",),
    ("image",),
    ("moments",),
    ("settings",),
    ("physics",),
    ("sampling",),
    ("scene",),
    ("system",),
)
LARGE_LIBRARIES = {"numba", "embreex", "OpenEXR"}  # Blender must start without them
USERS_OWN = {"meshio", "netCDF4"}  # of the user's own Python, for the command that reads simulations
MOST_PARAMETERS = 8
FINDERS = {
    "tests/real_blender/launch.py",
    "addon/compiling/compilation.py",
    "addon/compiling/worker.py",
    "tests/test_startup.py",
}


def name(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def broken(paths: Sequence[Path], rule: Callable[[Path], object]) -> dict[str, object]:
    """What a rule finds wrong, by the name of each source that it finds wrong."""
    found = ((name(path), rule(path)) for path in paths)
    return {source: wrong for source, wrong in found if wrong}


@functools.cache
def parsed(source: str) -> ast.Module:
    return ast.parse(source)


def tree(path: Path) -> ast.Module:
    """What a source says; many tests ask for that of the same ones."""
    return parsed(path.read_text(encoding="utf-8"))


def absolute_imports(path: Path) -> set[str]:
    """The top-level packages that a module imports by absolute name, anywhere in it."""
    found = set()
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.Import):
            found |= {alias.name.partition(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            found.add(node.module.partition(".")[0])
    return found


# Imports within the add-on


class Import(NamedTuple):
    """An import of one module by another, by their full names.

    when: "at once" when the importer is loaded, "in a function" when that is called, or never, "for types" alone.
    """

    importer: str
    imported: str
    when: str = "at once"


def module_name(path: Path, package: Path) -> str:
    """Full name of a module in a package, which is a folder."""
    parts = path.relative_to(package.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def statements(node: ast.AST, when: str = "at once") -> Iterator[tuple[ast.Import | ast.ImportFrom, str]]:
    """All import statements below a node of a module's tree, and when they are executed, see Import."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.Import | ast.ImportFrom):
            yield child, when
        elif isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
            yield from statements(child, "in a function")
        elif isinstance(child, ast.If) and ast.unparse(child.test).endswith("TYPE_CHECKING"):
            yield from statements(child, "for types")
        else:
            yield from statements(child, when)


@functools.cache
def imports_of(module: ast.Module) -> list[tuple[ast.Import | ast.ImportFrom, str]]:
    """As statements, of a whole module."""
    return list(statements(module))


def targets(statement: ast.Import | ast.ImportFrom, package: str) -> list[str]:
    """The full names of what a statement imports: modules, or what is in them. package: the one that it stands in."""
    if isinstance(statement, ast.Import):
        return [alias.name for alias in statement.names]
    parents = package.split(".")
    base = parents[: len(parents) + 1 - statement.level] if statement.level else []
    origin = ".".join([*base, *filter(None, [statement.module])])
    return [f"{origin}.{alias.name}" for alias in statement.names]


def imports_in(package: Path) -> set[Import]:
    """Every import in every module of a package: those of other packages by their top-level name.

    What a package's __init__ imports for types alone, it fetches when it is asked for it: that is an import from where
    it is fetched.
    """
    paths = {module_name(path, package): path for path in package.rglob("*.py")}
    wanted = []  # (module, full name of what it imports, when)
    for module, path in paths.items():
        parent = module if path.stem == "__init__" else module.rpartition(".")[0]
        for statement, when in imports_of(tree(path)):
            wanted += [(module, target, when) for target in targets(statement, parent)]
    typed = ((module, target) for module, target, when in wanted if when == "for types")
    fetched = {f"{module}.{target.rpartition('.')[2]}": target for module, target in typed}
    found = set()
    for module, target, when in wanted:
        target = fetched.get(target, target)
        if target.partition(".")[0] != package.name:
            found.add(Import(module, target.partition(".")[0], when))
        else:
            found.add(Import(module, target if target in paths else target.rpartition(".")[0], when))
    return found


def internal(package: Path) -> list[Import]:
    """The imports in a package of its own modules, sorted."""
    return sorted(each for each in imports_in(package) if each.imported.partition(".")[0] == package.name)


def room(module: str, package: str, rooms: Sequence[Sequence[str]]) -> int | None:
    """Index of the room that a module is in; None if it is in none. package: the whole that has these rooms."""
    inside = module[len(package) + 1 :]
    for index, names in enumerate(rooms):
        if any(inside == each or each and inside.startswith(f"{each}.") for each in names):
            return index
    return None


def trespasses(package: Path, prefix: str, rooms: Sequence[Sequence[str]]) -> list[str]:
    """What is against the order of rooms. prefix: what has these rooms, the package or one in it, by its full name."""

    def is_inside(module: str) -> bool:
        return f"{module}.".startswith(f"{prefix}.")

    modules = {module_name(path, package) for path in package.rglob("*.py")}
    homeless = (each for each in modules if is_inside(each) and room(each, prefix, rooms) is None)
    found = {f"{each} is in no room" for each in homeless}
    for each in internal(package):
        if not is_inside(each.importer):
            continue
        here, there = (room(module, prefix, rooms) for module in each[:2])
        if not is_inside(each.imported):
            found.add(f"{each.importer} leaves {prefix} for {each.imported}")
        elif here is not None and (there is None or there < here):
            found.add(f"{each.importer} imports from {each.imported}")
    return sorted(found)


def circle(package: Path) -> list[str]:
    """Modules of a package that import each other in a circle, the first one at both ends; empty if none do."""
    graph = {}
    for each in internal(package):
        graph.setdefault(each.importer, set()).add(each.imported)
    try:
        graphlib.TopologicalSorter(graph).prepare()
    except graphlib.CycleError as error:
        return error.args[1]
    return []


def loads(package: Path, libraries: set[str]) -> set[str]:
    """The modules of a package that load one of the libraries, themselves or through other modules."""
    at_once = [each for each in imports_in(package) if each.when == "at once"]
    found, before = set(), None
    while found != before:
        before = set(found)
        found |= {each.importer for each in at_once if each.imported in libraries | found}
    return found


def test_imports_run_from_room_to_room_in_one_direction():
    assert trespasses(ADDON, "addon", ROOMS) == []


def test_imports_in_the_solver_run_from_room_to_room_in_one_direction():
    assert trespasses(ADDON, "addon.solver", SOLVERS_ROOMS) == []


def test_no_modules_import_each_other_in_a_circle():
    assert circle(ADDON) == []


def test_imports_in_functions_have_a_reason():
    """They keep large libraries from being loaded before they are needed. Others stand at the top, where they are seen.

    The add-on itself imports Blender and its own modules in functions, so that its solver can be used without Blender.
    """
    large = loads(ADDON, LARGE_LIBRARIES) | LARGE_LIBRARIES | USERS_OWN
    in_functions = {each for each in imports_in(ADDON) if each.when == "in a function" and each.importer != "addon"}
    assert {each for each in in_functions if each.imported not in large} == set()


@pytest.fixture
def house(tmp_path):
    """A function that makes a package of modules with given sources; its rooms are attic, hall and cellar."""

    def build(**sources: str) -> Path:
        for module, source in {"__init__": "", "attic.__init__": "", **sources}.items():
            path = tmp_path / "house" / Path(*module.split(".")).with_suffix(".py")
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(source, encoding="utf-8")
        return tmp_path / "house"

    return build


HOUSE = (("", "attic"), ("hall",), ("cellar",))


@pytest.mark.parametrize(
    "source",
    [
        "from .attic.roof import tile",
        "from .attic import roof",
        "def climb():\n    from .attic import roof",
        "class Stairs:\n    def climb(self):\n        from . import attic",
        "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from .attic.roof import tile",
        "try:\n    import house.attic.roof\nexcept ImportError:\n    pass",
    ],
)
def test_an_arrow_that_runs_back_is_found(house, source):
    package = house(**{"attic.roof": "from ..cellar import wine", "hall": "from . import cellar", "cellar": ""})
    assert trespasses(package, "house", HOUSE) == [] and circle(package) == []
    package = house(cellar=source)
    (found,) = trespasses(package, "house", HOUSE)
    assert found in ("house.cellar imports from house.attic.roof", "house.cellar imports from house.attic")


def test_a_module_without_a_room_is_found(house):
    package = house(hall="", cellar="from . import garden", garden="from .attic import ladder", **{"attic.ladder": ""})
    expected = ["house.cellar imports from house.garden", "house.garden is in no room"]
    assert trespasses(package, "house", HOUSE) == expected


def test_who_leaves_a_package_is_found(house):
    package = house(**{"attic.roof": "from ..hall import door", "hall": ""})
    assert trespasses(package, "house.attic", (("", "roof"),)) == ["house.attic.roof leaves house.attic for house.hall"]


@pytest.mark.parametrize("last", ["from .one import a", "def late():\n    from . import one"])
def test_a_circle_is_found(house, last):
    package = house(**{"attic.one": "from .two import b", "attic.two": "from . import three", "attic.three": last})
    found = circle(package)
    assert found[0] == found[-1] and set(found) == {f"house.attic.{each}" for each in ("one", "two", "three")}


def test_what_loads_a_large_library_is_known_whoever_stands_between(house):
    package = house(
        hall="from .cellar import engine",
        cellar="import numba.core",
        garden="def later():\n    from .cellar import engine",
        street="from . import hall",
        roof="from .attic import engine",
        tower="from .attic import ladder",
        **{"attic.__init__": "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from ..cellar import engine"},
    )
    assert loads(package, {"numba"}) == {f"house.{each}" for each in ("cellar", "hall", "street", "roof")}


# Functions


def parameters(function: ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda) -> int:
    """How many parameters a function takes from its callers, who do not write self or cls; *args and **kwargs are one
    each."""
    given = function.args
    several = [each for each in (given.vararg, given.kwarg) if each]
    taken = given.posonlyargs + given.args + given.kwonlyargs + several
    return sum(each.arg not in ("self", "cls") for each in taken)


def crowded(source: str) -> list[str]:
    """The functions of a module, wherever they stand in it, with more parameters than a reader can keep in mind."""
    kinds = ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda
    functions = [node for node in ast.walk(parsed(source)) if isinstance(node, kinds)]
    return [
        f"line {function.lineno}: {getattr(function, 'name', 'lambda')} takes {parameters(function)}"
        for function in functions
        if parameters(function) > MOST_PARAMETERS
    ]


def test_functions_take_few_parameters():
    assert broken(SOURCES, lambda path: crowded(path.read_text(encoding="utf-8"))) == {}


@pytest.mark.parametrize(
    "source, found",
    [
        ("def f(a, b, c, d, /, e, f, *args, g): pass", 0),
        ("def f(a, b, c, d, /, e, f, *args, g, **rest): pass", 1),
        ("class A:\n    def f(self, a, b, c, d, e, f, g, h): pass", 0),
        ("class A:\n    async def f(self, a, b, c, d, e, f, g, h, i): pass", 1),
        ("def f():\n    def g(a, b, c, d, e, f, g, h, i): pass", 1),
        ("f = lambda a, b, c, d, e, f, g, *, h, i=0: 0", 1),
    ],
)
def test_parameters_are_counted(source, found):
    assert len(crowded(source)) == found


# Sources


def test_every_source_names_its_licence():
    licence = "# SPDX-License-Identifier: GPL-3.0-or-later\n"
    assert broken(SOURCES, lambda path: not path.read_text(encoding="utf-8").startswith(licence)) == {}


def test_solver_never_imports_blender():
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
    assert broken(SOLVER, lambda path: absolute_imports(path) & blenders_modules) == {}


def test_solver_works_without_blender():
    script = "import sys; sys.modules['bpy'] = None; from addon.solver import Scene, Settings, render"
    done = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_kernels_are_made_where_they_are_kept():
    """By `kernels.njit`: Numba's own would keep them beside the sources, where it misses changes in what they call."""
    makers = {name(path).rpartition("/")[2] for path in SOLVER if "numba" in absolute_imports(path)}
    assert makers == {"compiler.py", "kernels.py", "kernel_cache.py"}


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
    assert "module" not in run.stdout.split() and run.stdout.split().count("function") == 5


def test_addon_imports_itself_relatively():
    """Installed, the package is called bl_ext.<repository>.infrared_photons."""
    assert broken(MODULES, lambda path: "addon" in absolute_imports(path)) == {}


def test_addon_needs_only_what_the_extension_brings():
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
        "yaml",  # the extension works without
    }
    users_own = {"addon/convert.py": USERS_OWN}
    rest = broken(MODULES, lambda path: absolute_imports(path) - allowed - sys.stdlib_module_names)
    assert {source: found for source, found in rest.items() if found - users_own.get(source, set())} == {}


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


def test_only_launchers_change_where_python_looks_for_modules():
    """Scripts run as modules, in the project's folder. Code in texts, for other processes, counts as well.

    The two of the add-on let a process of its own look where Blender does.
    """
    changed = re.compile(r"\bsys\.path\b|syspath[_]|addsite[d]ir")
    assert set(broken(SOURCES, lambda path: changed.search(path.read_text(encoding="utf-8")))) == FINDERS


def test_no_source_imports_a_test_module():
    """What tests share is in tests/helpers; here, too, code in texts counts."""
    imported = re.compile(r"^\s*(from|import)\s+(tests\.)?test_|^\s*from\s+tests\s+import\b.*\btest_", re.MULTILINE)
    assert broken(SOURCES, lambda path: imported.search(path.read_text(encoding="utf-8"))) == {}


@functools.cache
def names_in(path: Path) -> set[str]:
    """What a module has by name: what it defines or imports, and what it gives a value; a package, its modules too."""
    names = {each.stem for each in path.parent.iterdir()} if path.stem == "__init__" else set()
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            names.add(node.name)
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            names.add(node.id)
        elif isinstance(node, ast.Import | ast.ImportFrom):
            names |= {alias.asname or alias.name for alias in node.names}
    return names


def missing_names(path: Path, root: Path) -> list[str]:
    """What a source imports by name from modules below a folder that do not have it."""
    missing = []
    for node in ast.walk(tree(path)):
        if not isinstance(node, ast.ImportFrom):
            continue
        base = path.parents[node.level - 1] if node.level else root
        origin = base.joinpath(*(node.module or "").split("."))
        origin = origin / "__init__.py" if origin.is_dir() else origin.with_suffix(".py")
        if origin.is_file():
            missing += sorted({alias.name for alias in node.names} - names_in(origin) - {"*"})
    return missing


def test_what_a_source_imports_by_name_is_there():
    """Benchmarks are run by hand, so that a name that moved would be missed long after it did."""
    assert broken(SOURCES, lambda path: missing_names(path, ROOT)) == {}


def test_a_missing_name_is_found(house):
    package = house(one="a = 1\n", two="from .one import a, b\nfrom . import one, three\n")
    assert missing_names(package / "two.py", package.parent) == ["b", "three"]
