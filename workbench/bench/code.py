"""The code behind an answer: a hash of the sources that its modules import, and no others.

A stored answer is reused only while the code that made it is unchanged. That code is everything
imported, directly or not, by the problem's file, its Program, the method and their checks, together
with the versions of the solvers among it. Imports are read from the sources; nothing is imported
for this. A name that a package re-exports is traced to the module that defines it, so that one
module of a room can change without affecting answers of its neighbours.
"""

from __future__ import annotations

import ast
import hashlib
import site
import sys
import sysconfig
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from workbench.bench.question import canonical, digest
from workbench.solvers import PACKAGES, versions

OWN = "workbench"
_ADDED = "workbench_problems_"
"""Common beginning of the package names of added problem folders; the rest of a name depends on the
folder's path.
"""


def code_hash(
    modules: Iterable[str], solvers: Iterable[str] = (), upstream: Iterable[str] = ()
) -> str:
    """Hash of everything except the question that can change an answer.

    Parameters
    ----------
    modules
        Names of imported modules: those of the problem, its Program and the method.
    solvers
        Packages that the method calls without importing them by name.
    upstream
        Code hashes of the results that the problem needs.
    """
    found, packages = closure(modules)
    lines = sorted(f"{_label(name)} {facts.digest}\n" for name, facts in found.items())
    counted = {*packages.intersection(PACKAGES), *solvers}
    return digest("".join([*lines, *upstream]) + canonical(versions(packages=sorted(counted))))[:16]


def source_digests(folders: Iterable[Path]) -> dict[str, str]:
    """Hashes of all sources of the workbench and of problem folders, wherever these lie."""
    return {
        f"{place} {file.relative_to(folder).as_posix()}": digest(file.read_bytes())
        for place, folder in enumerate((Path(__file__).parents[1], *folders))
        for file in folder.rglob("*.py")
    }


def closure(modules: Iterable[str]) -> tuple[dict[str, Facts], set[str]]:
    """All modules that some modules import, directly or not, with themselves; and other packages.

    Imports are followed into the workbench, into the packages of the modules themselves, and into
    the user's own modules, which are not installed. Of all others only the package's name is
    returned.
    """
    waiting: list[Import] = [(name, None) for name in modules]
    followed = {OWN, *(name.partition(".")[0] for name, _ in waiting)}
    found: dict[str, Facts] = {}
    packages: set[str] = set()
    seen: set[Import] = set()
    while waiting:
        wanted: Import = waiting.pop()
        first = wanted[0].partition(".")[0]
        if wanted in seen or first in packages:
            continue
        seen.add(wanted)
        if first not in followed:
            if not _is_users(first):
                packages.add(first)
                continue
            followed.add(first)
        module = _defining(*wanted)
        if module in found:
            continue
        file = file_of(module)
        if file is not None:  # not a notebook's cell, nor a built-in module
            found[module] = _facts(file, module)
            waiting += found[module].imports
    return found, packages


def helper_modules(modules: Iterable[str]) -> set[str]:
    """The user's own modules that some modules import from outside their packages."""
    waiting, seen, found = list(modules), set[str](), set[str]()
    own = {OWN, *(name.partition(".")[0] for name in waiting)}
    while waiting:
        module = waiting.pop()
        file = None if module in seen else file_of(module)
        seen.add(module)
        if file is None or not file.is_file():
            continue
        first = module.partition(".")[0]
        if first not in own:
            found.add(module)
        for imported in _facts(file, module).imports:
            name = _defining(*imported)
            first = name.partition(".")[0]
            if first not in own and _is_users(first):
                waiting.append(name)
    return found


def _is_users(package: str) -> bool:
    """Whether an imported package is neither installed nor part of Python.

    An editable install counts as the user's: its files lie where they are edited.
    """
    module = sys.modules.get(package)
    files = [*getattr(module, "__path__", []), getattr(module, "__file__", None) or ""]
    places = [file for file in files if file]
    return bool(places) and not any(_is_installed(place) for place in places)


@cache
def _is_installed(place: str) -> bool:
    """Whether a file or folder belongs to Python or to an installed package."""
    above = {*Path(place).absolute().parents, *Path(place).resolve().parents}  # it may be a link
    return not above.isdisjoint(_installed())


@cache
def _installed() -> frozenset[Path]:
    """Folders of Python's own modules and of installed packages.

    Those of packages may be any that are searched, by PYTHONPATH or a .pth file: an installer
    leaves a folder ``*.dist-info`` beside what it installs, for an editable install elsewhere.
    """
    names = ("stdlib", "platstdlib", "purelib", "platlib")
    paths = [sysconfig.get_paths()[name] for name in names]
    searched = [path for path in sys.path if any(Path(path).glob("*.dist-info"))]
    found = map(Path, [*paths, *site.getsitepackages(), *_user_site(), *searched])
    return frozenset(one for path in found for one in (path.absolute(), path.resolve()))


def _user_site() -> list[str]:
    return [site.getusersitepackages()] if site.ENABLE_USER_SITE else []


Import = tuple[str, str | None]
"""A module, and the name imported from it; None: the module as a whole."""


@dataclass(frozen=True)
class Facts:
    """Facts read from a source file.

    ``imports`` are the modules that it uses at run time; ``bound`` maps the names that it imports
    to their sources, including those imported for type checkers only.
    """

    digest: str
    imports: tuple[Import, ...]
    bound: Mapping[str, Import]


def _is_own(module: str) -> bool:
    """Whether a module is the workbench's, whose files do not change while it runs."""
    return module.partition(".")[0] == OWN and not f"{module}.".startswith(f"{OWN}.plants.")


def _defining(module: str, name: str | None) -> str:
    """The module that defines a name which another module offers."""
    return (_own_definition if _is_own(module) else _definition)(module, name)


def _definition(module: str, name: str | None) -> str:
    for _ in range(20):  # chains of re-exports are followed to a limit
        if name is None:
            return module
        below = f"{module}.{name}"
        file = file_of(module)
        if file is None or file.name != "__init__.py":
            return module
        source = _facts(file, module).bound.get(name)
        if source is None or source == (module, name):
            return below if file_of(below) else module
        if source[1] is None or source[0].partition(".")[0] != module.partition(".")[0]:
            return source[0] if source[1] is None else module
        module, name = source
    return module


_own_definition = cache(_definition)


def file_of(module: str) -> Path | None:
    """The source file of a module, located from its nearest imported parent package."""
    return (_own_file if _is_own(module) else _file)(module)


def _file(module: str) -> Path | None:
    parts = module.split(".")
    for count in range(len(parts), 0, -1):
        package = sys.modules.get(".".join(parts[:count]))
        if package is None:
            continue
        folders = vars(package).get("__path__")  # `getattr` would ask the package's own one
        if folders is None:
            file = vars(package).get("__file__")
            return Path(file) if file and count == len(parts) and file.endswith(".py") else None
        for folder in folders:
            place = Path(folder, *parts[count:])
            for candidate in (place / "__init__.py", place.with_suffix(".py")):
                if candidate.is_file() and (count < len(parts) or candidate.parent == place):
                    return candidate
        return None
    return None


_own_file = cache(_file)


def _facts(file: Path, module: str) -> Facts:
    """Facts of a file; a file of the workbench is read once, soon after it was imported."""
    if _is_own(module):
        return _read(file, module, (0, 0))
    state = file.stat()
    return _read(file, module, (state.st_mtime_ns, state.st_size))


@cache
def _read(file: Path, module: str, state: tuple[int, int]) -> Facts:
    source = file.read_bytes()
    package = module if file.name == "__init__.py" else module.rpartition(".")[0]
    nodes = list(ast.walk(ast.parse(source)))
    statements = [node for node in nodes if isinstance(node, ast.Import | ast.ImportFrom)]
    bound = dict(pair for node in statements for pair in _bindings(node, package))
    checked = {id(one) for node in nodes if _for_types(node) for one in ast.walk(node)}
    running = [node for node in statements if id(node) not in checked]
    taken = dict(pair for node in running for pair in _bindings(node, package))
    imports = {one for node in running for one in _imports(node, package)}
    for node in nodes:
        name, *attributes = _chain(node)
        if name in taken:
            imports |= set(_through(taken[name], attributes))
    return Facts(hashlib.sha256(source).hexdigest(), tuple(sorted(imports, key=str)), bound)


def _for_types(node: ast.AST) -> bool:
    """Whether a node is ``if TYPE_CHECKING:``, whose body never runs."""
    test = node.test if isinstance(node, ast.If) else None
    return isinstance(test, ast.Name) and test.id == "TYPE_CHECKING"


def _base(node: ast.ImportFrom, package: str) -> str:
    """The module that ``from ... import`` names, with its dots resolved."""
    if not node.level:
        return node.module or ""
    parts = package.split(".")
    above = parts[: len(parts) - node.level + 1]
    return ".".join([*above, *([node.module] if node.module else [])])


def _bindings(node: ast.Import | ast.ImportFrom, package: str) -> Iterator[tuple[str, Import]]:
    """Names that an import binds, and their sources."""
    if isinstance(node, ast.ImportFrom):
        for alias in node.names:
            yield alias.asname or alias.name, (_base(node, package), alias.name)
    else:
        for alias in node.names:
            first = alias.name.partition(".")[0]
            yield alias.asname or first, (alias.name if alias.asname else first, None)


def _imports(node: ast.Import | ast.ImportFrom, package: str) -> Iterator[Import]:
    if isinstance(node, ast.ImportFrom):
        base = _base(node, package)
        yield from ((base, None if alias.name == "*" else alias.name) for alias in node.names)
    else:
        yield from ((alias.name, None) for alias in node.names)


def _chain(node: ast.AST) -> list[str]:
    """The parts of ``a.b.c``; a single empty name for anything else."""
    parts = []
    while isinstance(node, ast.Attribute):
        parts.append(node.attr)
        node = node.value
    return [node.id, *reversed(parts)] if isinstance(node, ast.Name) and parts else [""]


def _through(source: Import, attributes: list[str]) -> Iterator[Import]:
    """The source of ``a.b.c`` where ``a`` is a package: its name, or that of a module in it."""
    module = source[0] if source[1] is None else f"{source[0]}.{source[1]}"
    for name in attributes:
        file = file_of(module)
        if file is None or file.name != "__init__.py":
            return
        yield module, name
        module = f"{module}.{name}"


def _label(module: str) -> str:
    """The name of a module, independent of where its problem folder lies."""
    first, dot, rest = module.partition(".")
    return f"problems{dot}{rest}" if first.startswith(_ADDED) else module
