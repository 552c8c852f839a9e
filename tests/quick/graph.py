"""Which tests an edit can reach: names, strings and fixtures are followed to the end.

The nodes are definitions of files: functions, classes, constants, and the rest of each module. A
node leads to what its source names, to the fixtures that it takes, to the problems and files whose
names stand in its strings, and from a class to the methods that are registered on it.
"""

from __future__ import annotations

import ast
import re
from collections import defaultdict, deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cached_property
from pathlib import Path

from quick.files import CODE, alike, dotted, module_of, read, source_files, without_collection
from quick.sources import BODY, EXAMPLES, TEXT, VARIES, Definition, Source

Node = tuple[str, str]
"""A file, relative to the root, and the name of a definition; a family has no file."""

PROBLEMS: Node = ("", "problems")
"""Every named problem; tests that go through all of them lead here."""
LIBRARY: Node = ("", "library")
"""Every definition of the library and of the problems, by the names that users import."""
PAGES: Node = ("", "pages")
"""Every page of the documentation, notebook and example."""
FAMILIES = (PROBLEMS, LIBRARY, PAGES)

ANYTHING = {"pyproject.toml", "requirements.txt", "Makefile"}
"""Files that every test may hang on."""
EVERY_PROBLEM = {
    ("workbench/api.py", "problems"),
    ("workbench/bench/verify.py", "finished_folders"),
}
"""A test that calls one of them goes through all problems."""
REGISTRY = ("workbench/bench/registry.py", "Registry")
"""It imports the files of problems that register methods."""
WALKS = re.compile(r"(^|/)(\*|__init__)\.(py|md|ipynb)$")
"""Strings of tests that read all sources or pages."""
BY_NAME = {
    ("tests/problems/conftest.py", "reference"),
    *(("tests/test_reference.py", name) for name in ("SLOW", "ILL_CONDITIONED", "marked")),
}
"""Tests that use them say, or their cases' names do, of which problem."""


class Graph:
    """Sources below a root, deleted ones with their last texts, and what leads to what."""

    def __init__(self, root: Path, gone: Mapping[str, str] | None = None) -> None:
        self.root, self.gone = root, gone or {}
        self.sources: dict[str, Source] = {}
        self.modules: dict[str, str] = {}
        with without_collection():
            for file in sorted(source_files(root)):
                self._add(file, (root / file).read_text(encoding="utf-8"))
        for file, text in self.gone.items():
            if Path(file).suffix in {".py", ".md", ".ipynb"}:
                self._add(file, text)

    def _add(self, file: str, text: str) -> None:
        self.sources[file] = read(file, text)
        if file.endswith(".py"):
            self.modules[module_of(file)] = file
            if file.startswith(("tests/", "problems/")):
                self.modules[dotted(file.removeprefix("tests/"))] = file

    # --- what names lead to ----------------------------------------------------------------

    def resolve(self, path: str) -> Iterator[Node]:
        """The definition that a dotted path names; of a module each."""
        parts = path.split(".")
        for count in range(len(parts), 0, -1):
            file = self.modules.get(".".join(parts[:count]))
            if file is not None:
                break
        else:
            return
        source, rest = self.sources[file], parts[count:]
        if not rest:
            yield (file, BODY)
            if not file.endswith("__init__.py"):
                yield from ((file, name) for name in source.definitions)
        elif rest[0] in source.definitions:
            yield (file, rest[0])
        elif rest[0] in source.bound:
            target = ".".join([source.bound[rest[0]], *rest[1:]])
            if target != path:
                yield from self.resolve(target)
            yield from ((file, name) for name in (BODY, "__getattr__"))
        else:
            yield (file, rest[0])  # defined before the edit, perhaps

    def _named(self, file: str, chain: str) -> Iterator[Node]:
        """What a chain of names leads to from a file."""
        source = self.sources[file]
        first, dot, rest = chain.partition(".")
        if first in source.definitions:
            yield (file, first)
        elif first in source.bound:
            yield from self.resolve(f"{source.bound[first]}{dot}{rest}")
        else:
            yield (file, first)

    @cached_property
    def problems(self) -> dict[str, Node]:
        """The function of each named problem, by the name's pattern."""
        found = {}
        for file in self.sources:
            if not (file.startswith("problems/") and file.endswith(".py")):
                continue
            for node in ast.parse((self.root / file).read_bytes()).body:
                for decorator in getattr(node, "decorator_list", []):
                    if ast.unparse(decorator).startswith("problem("):
                        name = re.sub(r"\{\w+\}", VARIES, ast.literal_eval(decorator.args[0]))
                        found[name] = (file, node.name)
        return found

    def _meant(self, file: str, text: str) -> Iterator[Node]:
        """Modules, problems and files that a string names."""
        plain = text.replace(":", ".")
        if re.fullmatch(r"workbench\.[\w.]+", plain):
            yield from self.resolve(plain)
        if "/" in text and not file.startswith("workbench/"):
            for word in text.split():
                yield from self._named_problems(word.strip("'\"`,;()"))
        if not file.startswith(CODE):
            for pointed in self._pointed.get(text, ()):
                yield from ((pointed, name) for name in self.sources[pointed].definitions)

    def _named_problems(self, word: str) -> list[Node]:
        """Problems that a word may name; of stars alone none."""
        if not set(word.split("/")) - {VARIES, "*", ""}:
            return []
        return [node for name, node in self.problems.items() if alike(word, name)]

    @cached_property
    def _pointed(self) -> dict[str, list[str]]:
        """Pages and scripts, by the names under which a test may open them."""
        found = defaultdict(list)
        for file in self.sources:
            if not file.startswith(CODE) and not Path(file).name.startswith(("test_", "conftest")):
                for k in range(len(Path(file).parts)):
                    found["/".join(Path(file).parts[k:])].append(file)
        return found

    # --- edges ------------------------------------------------------------------------------

    @cached_property
    def edges(self) -> dict[Node, set[Node]]:
        found: dict[Node, set[Node]] = defaultdict(set)
        for file, source in self.sources.items():
            for name, definition in source.definitions.items():
                node = (file, name)
                found[node] |= set(self._leads_to(file, name, definition))
                for other in self._hosts(file, definition):
                    found[other].add(node)
                    if file.startswith("problems/"):
                        found[REGISTRY].add((file, BODY))
            body = found[(file, BODY)]
            for path in source.imported:
                body |= {(one, BODY) for one, _ in self.resolve(path)}
        found[PROBLEMS] |= set(self.problems.values())
        for file, source in self.sources.items():
            if file.startswith(CODE):
                found[LIBRARY] |= {(file, TEXT), *((file, name) for name in source.definitions)}
            elif self._is_page(file):
                found[PAGES].add((file, BODY))
        return found

    def _hosts(self, file: str, definition: Definition) -> Iterator[Node]:
        """What leads to a definition that is registered there: a Program, a group of commands."""
        for chain in definition.registers:
            yield from filter(self._is_class, self._named(file, chain))
        for chain in definition.hosts:
            yield from (one for one in self._named(file, chain) if one[0].startswith(CODE))

    def _leads_to(self, file: str, name: str, definition: Definition) -> Iterator[Node]:
        if name != BODY:
            yield (file, BODY)
        for chain in definition.names:
            yield from self._named(file, chain)
        for text in definition.strings if (file, name) not in BY_NAME else ():
            yield from self._meant(file, text)
        if file.startswith("tests/"):
            yield from self._fixtures(file, name, definition)
        if not file.startswith(CODE):
            yield from self._families(file, name, definition)

    def _fixtures(self, file: str, name: str, definition: Definition) -> Iterator[Node]:
        """Those that a test or a fixture takes, and those in force wherever it stands."""
        folder = Path(file).parent
        places = [file, *(f"{f.as_posix()}/conftest.py" for f in (folder, *folder.parents))]
        wanted = definition.arguments | definition.strings
        for place in places:
            for one, other in getattr(self.sources.get(place), "definitions", {}).items():
                if one != name or place != file:
                    if other.is_fixture and (one in wanted or other.is_automatic):
                        yield (place, one)
                    if one.startswith("pytest_"):
                        yield (place, one)

    def _families(self, file: str, name: str, definition: Definition) -> Iterator[Node]:
        if (file, name) in BY_NAME:
            return
        reached = {node for chain in definition.names for node in self._named(file, chain)}
        walked = {chain.rpartition(".")[2] for chain in definition.names}
        if reached & EVERY_PROBLEM or ("registry" in walked and {"entries", "match"} & walked):
            yield PROBLEMS
        if {"rglob", "glob"} & walked and any(map(WALKS.search, definition.strings)):
            yield LIBRARY
            yield PAGES
        if "importlib.import_module" in definition.names:
            for module in definition.strings & self.modules.keys():
                yield (self.modules[module], BODY)
        if "import_module" in walked:
            yield LIBRARY
        listed = {c.partition(".")[0] for c in definition.names if c.endswith(".iterdir")}
        if "notebook_files" in walked or any(one.isupper() or not one for one in listed):
            yield PAGES

    def _is_class(self, node: Node) -> bool:
        source = self.sources.get(node[0])
        return (
            source is not None
            and node[1] in source.definitions
            and source.definitions[node[1]].is_class
        )

    def _is_page(self, file: str) -> bool:
        return file.endswith((".md", ".ipynb")) or file.startswith("examples/")

    # --- what is reached ----------------------------------------------------------------------

    def leading_to(self, targets: Iterable[Node]) -> dict[Node, int]:
        """Nodes that lead to some nodes, and in how few steps; families are not passed."""
        found = dict.fromkeys(targets, 0)
        waiting = deque(found)
        while waiting:
            node = waiting.popleft()
            for before in self._backwards[node]:
                if before not in found and before not in FAMILIES:
                    found[before] = found[node] + 1
                    waiting.append(before)
        return found

    @cached_property
    def tests(self) -> set[Node]:
        """Every test function."""
        return {
            (file, name)
            for file, source in self.sources.items()
            if Path(file).name.startswith("test_")
            for name in source.definitions
            if name.startswith(("test_", "Test")) and not name.endswith(EXAMPLES)
        }

    def readers(self, file: str) -> set[Node]:
        """What may read a file of data: it names the file, or a folder on the way there."""
        parts = Path(file).parts
        if parts[:2] == ("results", "reference"):
            found = {
                node for name, node in self.problems.items() if alike("/".join(parts[2:-2]), name)
            }
            return found or self._naming(lambda text, _: text == "reference")
        folders = {
            ("/".join(parts[k:end]), "/".join(parts[:k]))
            for end in range(1, len(parts) + 1)
            for k in range(end)
        }

        def named(text: str, where: str) -> bool:
            if text == parts[-1] or (VARIES in text and "." in text and alike(text, parts[-1])):
                return True
            return any(text == name and f"{where}/".startswith(base) for name, base in folders)

        room = "/".join(parts[:-1])
        return self._naming(named) or {
            (one, name)
            for one in self.sources
            if one.startswith(CODE) and room.startswith(Path(one).parent.as_posix() + "/")
            for name in self.sources[one].definitions
        }

    def _naming(self, named: Callable[[str, str], bool]) -> set[Node]:
        return {
            (file, name)
            for file, source in self.sources.items()
            for name, definition in source.definitions.items()
            if any(named(text, file) for text in definition.strings)
        }

    @cached_property
    def _backwards(self) -> dict[Node, list[Node]]:
        found: dict[Node, list[Node]] = defaultdict(list)
        for node, targets in self.edges.items():
            for target in targets:
                found[target].append(node)
        return found

    @cached_property
    def labels(self) -> dict[str, list[Node]]:
        """How the members of families are called in the names of tests."""
        found = {name: [node] for name, node in self.problems.items()}
        for module, file in self.modules.items():
            if file.startswith("workbench/") and file.endswith("__init__.py"):
                every = found.setdefault(module, [(file, BODY)])
                source = self.sources[file]
                for name in {*source.bound, *source.definitions} - {BODY}:
                    nodes = list(self.resolve(f"{module}.{name.strip()}"))
                    nodes += [(one, name + EXAMPLES) for one, _ in nodes]
                    found[f"{module}.{name}"] = nodes
                    every += nodes
        for file in filter(self._is_page, self.sources):
            path = Path(file)
            for label in {file, file.partition("/")[2], path.stem, path.parent.name} - {""}:
                found.setdefault(label, []).append((file, BODY))
        return found
