"""What each definition of a source file names: other definitions, modules, problems and files."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass, field

BODY = ""
"""Name of the statements of a module that define no name."""
EXAMPLES = " >>>"
"""Follows the name of a definition where its examples are meant."""
TEXT = " text"
"""Name of a file's text, whatever it defines; what reads sources hangs on it."""
VARIES = "\N{OBJECT REPLACEMENT CHARACTER}"
"""Stands in a string for what is filled in when the program runs."""
FENCE = re.compile(r"^(`{3,})\{?([\w-]*)\}?[^\n]*\n(.*?)^\1$", re.MULTILINE | re.DOTALL)
"""A block of code on a page of Markdown."""
_IMPORTS = re.compile(r"\bimport\b")
_EMPTY = frozenset({"", VARIES})


@dataclass
class Definition:
    """A function, a class, a constant, or the rest of a module.

    ``names`` are dotted chains as the source has them, the first part looked up where it stands;
    ``strings`` are texts, in which `VARIES` stands for each part that is filled in. ``registers``
    are what its decorators are given, ``hosts`` the objects whose methods decorate it.
    """

    names: set[str] = field(default_factory=set)
    strings: set[str] = field(default_factory=set)
    arguments: set[str] = field(default_factory=set)
    registers: set[str] = field(default_factory=set)
    hosts: set[str] = field(default_factory=set)
    is_class: bool = False
    is_fixture: bool = False
    is_automatic: bool = False


@dataclass
class Source:
    """A file's definitions by name, and the dotted path of each name that it imports."""

    definitions: dict[str, Definition] = field(default_factory=lambda: {BODY: Definition()})
    bound: dict[str, str] = field(default_factory=dict)
    imported: set[str] = field(default_factory=set)


def read_python(text: str, package: str) -> Source:
    """Facts of a module; ``package`` is where its relative imports begin."""
    source, tree = Source(), ast.parse(text)
    for statement in _statements(tree.body):
        if isinstance(statement, ast.Import | ast.ImportFrom):
            source.imported |= {path for _, path in _bindings(statement, package)}
            continue
        if _is_text(statement):
            continue
        for name in _defined(statement):
            found = source.definitions.setdefault(name, Definition())
            _collect(statement, found)
            found.is_class |= isinstance(statement, ast.ClassDef)
        source.definitions[BODY].names |= set(_called_at_import(statement))
        if isinstance(statement, ast.FunctionDef | ast.ClassDef) and ">>>" in text:
            source.definitions[statement.name + EXAMPLES] = _examples(statement)
    for node in _import_statements(tree):
        source.bound |= dict(_bindings(node, package))
    _import_code_in_strings(source, package)
    return source


def texts(text: str) -> dict[str, str]:
    """What tells whether a definition of a module is the same, comments and layout aside."""
    found: dict[str, str] = {}
    for statement in _statements(ast.parse(text).body):
        if not isinstance(statement, ast.Import | ast.ImportFrom):
            for name in _defined(statement):
                found[name] = found.get(name, "") + ast.dump(statement)
    return found


def read_page(text: str) -> Source:
    """Facts of a page of Markdown, or of a notebook: all of its code is one definition."""
    source = Source()
    page = source.definitions[BODY]
    page.strings = set(re.findall(r"[\w*./-]*/[\w*./-]+", text))
    for _, language, code in FENCE.findall(text):
        if language not in {"python", "code-cell"}:
            continue
        _take_in(_typed(code), source, page)
    return source


def _typed(text: str) -> str:
    """What somebody types in a session; of a program all of it, but options of a directive."""
    lines = text.splitlines()
    if any(line.lstrip().startswith(">>>") for line in lines):
        lines = [line.lstrip() for line in lines]
        lines = [line[4:] for line in lines if line.startswith((">>>", "..."))]
    return "\n".join(line for line in lines if not line.startswith((":", "%")))


def _take_in(code: str, source: Source, page: Definition) -> None:
    """Add what a program names to a definition."""
    try:
        inner = read_python(code, "")
    except SyntaxError:  # parts of a program
        page.strings |= set(_dotted_words(code))
        return
    source.bound |= inner.bound
    for one in inner.definitions.values():
        page.names |= one.names
        page.strings |= one.strings


def _dotted_words(text: str) -> Iterator[str]:
    """Every word of what is no whole program, as if each were a name of each module in it."""
    words = set(re.findall(r"\w+", text))
    for module in set(re.findall(r"workbench(?:\.\w+)*", text)):
        yield from (f"{module}.{word}" for word in words)


def _examples(statement: ast.FunctionDef | ast.ClassDef) -> Definition:
    """What the examples in docstrings of a definition name."""
    found, inner = Definition(), Source()
    for node in ast.walk(statement):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            text = ast.get_docstring(node) or ""
            if ">>>" in text:
                _take_in(_typed(text), inner, found)
    for chain in found.names:
        first, dot, rest = chain.partition(".")
        if first in inner.bound:
            found.strings.add(f"{inner.bound[first]}{dot}{rest}")
    found.names = {statement.name}
    return found


def _import_statements(tree: ast.AST) -> Iterator[ast.Import | ast.ImportFrom]:
    """Those of functions among them; expressions are not looked through."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.Import | ast.ImportFrom):
            yield node
        elif isinstance(node, ast.stmt | ast.excepthandler):
            yield from _import_statements(node)


def _statements(body: list[ast.stmt]) -> Iterator[ast.stmt]:
    """The statements of a module, those of its conditions among them."""
    for statement in body:
        if isinstance(statement, ast.If) and ast.unparse(statement.test) == "TYPE_CHECKING":
            yield from _statements(statement.orelse)
        elif isinstance(statement, ast.If | ast.Try | ast.With):
            parts = [statement.body, getattr(statement, "orelse", [])]
            parts += [handler.body for handler in getattr(statement, "handlers", [])]
            for part in [*parts, getattr(statement, "finalbody", [])]:
                yield from _statements(part)
        else:
            yield statement


def _defined(statement: ast.stmt) -> list[str]:
    """The names that a statement defines; of others `BODY`."""
    if isinstance(statement, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
        return [statement.name]
    if isinstance(statement, ast.Assign):
        targets = statement.targets
    elif isinstance(statement, ast.AnnAssign | ast.AugAssign):
        targets = [statement.target]
    else:
        return [BODY]
    names = [
        node.id
        for target in targets
        for node in ast.walk(target)
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)
    ]
    return names or [BODY]


def _collect(statement: ast.stmt, found: Definition) -> None:
    if isinstance(statement, ast.FunctionDef):
        given = statement.args
        found.arguments |= {one.arg for one in (*given.args, *given.kwonlyargs)}
        decorators = " ".join(map(ast.unparse, statement.decorator_list))
        found.is_fixture |= "fixture" in decorators
        found.is_automatic |= "autouse" in decorators
    for decorator in getattr(statement, "decorator_list", []):
        if isinstance(decorator, ast.Call):
            found.registers |= set(filter(None, map(_chain, decorator.args)))
            found.hosts |= {_chain(decorator.func).rpartition(".")[0]} - _EMPTY
    hints = bool(getattr(statement, "decorator_list", []))
    waiting: list[ast.AST] = [statement]
    while waiting:
        node = waiting.pop()
        kind = type(node)
        if kind in {ast.Name, ast.Attribute} and (chain := _chain(node)):
            found.names.add(chain)
            continue
        if kind is ast.Attribute:  # of what has no name of its own
            found.names.add(f".{node.attr}")
        if kind is ast.JoinedStr:
            parts = (one.value if isinstance(one, ast.Constant) else VARIES for one in node.values)
            found.strings.add("".join(map(str, parts)))
        elif kind is ast.Constant and isinstance(node.value, str):
            found.strings.add(node.value)
        waiting += _children(node, hints)
    found.strings -= _EMPTY


def _called_at_import(node: ast.AST) -> Iterator[str]:
    """Functions that a statement calls where its module is imported, decorators among them."""
    for decorator in getattr(node, "decorator_list", []):
        yield from filter(None, [_chain(decorator)])
        yield from _called_at_import(decorator)
    if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
        return
    if isinstance(node, ast.Call):
        yield from filter(None, [_chain(node.func)])
    for child in _children(node, hints=False):
        yield from _called_at_import(child)


def _children(node: ast.AST, hints: bool) -> Iterator[ast.AST]:
    """What a node consists of but docstrings and, unless they are asked for, hints of functions."""
    for name in node._fields:
        value = getattr(node, name)
        if isinstance(value, list):
            for one in value:
                if isinstance(one, ast.AST) and not _is_text(one):
                    yield one
        elif isinstance(value, ast.AST) and (hints or name not in _HINTS.get(type(node), ())):
            yield value


_HINTS = {ast.arg: {"annotation"}, ast.FunctionDef: {"returns"}, ast.AsyncFunctionDef: {"returns"}}


def _is_text(node: ast.AST) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)


def _chain(node: ast.AST) -> str:
    """The text of ``a.b.c``; of anything else nothing."""
    parts = []
    while isinstance(node, ast.Attribute):
        parts.append(node.attr)
        node = node.value
    return ".".join([node.id, *reversed(parts)]) if isinstance(node, ast.Name) else ""


def _bindings(node: ast.Import | ast.ImportFrom, package: str) -> Iterator[tuple[str, str]]:
    """Names that an import binds, and their dotted paths."""
    if isinstance(node, ast.Import):
        for alias in node.names:
            first = alias.name.partition(".")[0]
            yield alias.asname or first, alias.name if alias.asname else first
            yield f"{alias.name} ", alias.name  # imported, whatever it is bound to
        return
    parts = package.split(".") if package else []
    above = parts[: len(parts) - node.level + 1] if node.level else []
    base = ".".join([*above, *([node.module] if node.module else [])])
    for alias in node.names:
        yield alias.asname or alias.name, f"{base}.{alias.name}"


def _import_code_in_strings(source: Source, package: str) -> None:
    """Take strings that are programs for what they are."""
    for found in source.definitions.values():
        for text in list(found.strings):
            if not _IMPORTS.search(text):
                continue
            try:
                inner = read_python(text.replace(VARIES, "0"), "")
            except SyntaxError:
                found.strings |= set(_dotted_words(text))
                continue
            for one in inner.definitions.values():
                for chain in one.names:
                    first, dot, rest = chain.partition(".")
                    if first in inner.bound:
                        found.strings.add(f"{inner.bound[first]}{dot}{rest}")
                found.strings |= one.strings
            found.strings |= set(inner.bound.values())
