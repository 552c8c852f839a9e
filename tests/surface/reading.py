"""The public surface as data: every signature, field and property, with what is said of it."""

from __future__ import annotations

import dataclasses
import enum
import functools
import importlib
import inspect
import re
import sys
from collections.abc import Iterable
from pathlib import Path
from types import ModuleType
from typing import Any

from surface.docstrings import documented, own_classes, unit_of, words_of

TOOLS = Path(__file__).parents[2] / "docs" / "_tools"
EMPTY = inspect.Parameter.empty


@dataclasses.dataclass(frozen=True)
class Said:
    """A public name of a number or an object: a parameter, a field or a property."""

    owner: str
    """Function or class that it belongs to, by its public path."""
    name: str
    kind: str
    """``"parameter"``, ``"field"`` or ``"property"``."""
    type: str = ""
    words: str = ""
    unit: str = ""
    """Unit in its docstring: Hz, rad/s, deg, rad, samples, s; empty for none of these."""
    answer: bool = False
    """Whether it belongs to a class that functions return."""
    default: Any = EMPTY

    @property
    def place(self) -> str:
        """How lists and messages call it."""
        inside = f"({self.name})" if self.kind == "parameter" else f".{self.name}"
        return self.owner + inside


@dataclasses.dataclass(frozen=True)
class Call:
    """What can be called: a function, a method, or a class that makes its objects."""

    owner: str
    parameters: tuple[inspect.Parameter, ...]
    kind: str
    """``"function"``, ``"method"`` or ``"class"``; ``"tuple"`` for a class of named tuples."""
    words: str = ""
    """Its docstring."""
    answer: bool = False


@dataclasses.dataclass(frozen=True)
class Surface:
    """All names and all calls."""

    names: tuple[Said, ...]
    calls: tuple[Call, ...]


def reference() -> ModuleType:
    """The module that writes the pages of the reference; it stands among others that it needs."""
    sys.path.insert(0, str(TOOLS))
    try:
        return importlib.import_module("api_pages")
    finally:
        sys.path.pop(0)


@functools.cache
def library() -> Surface:
    """The surface of the rooms on the pages of the reference; each object counts once."""
    pages = reference()
    found: dict[int, tuple[str, Any]] = {}
    for room in pages.ROOMS:
        module = importlib.import_module(room)
        for name in pages.public_names(module):
            thing = getattr(module, name)
            if pages.kind_of(thing) in {"function", "class"}:
                found.setdefault(id(thing), (f"{room}.{name}", thing))
    return read(found.values())


def read(objects: Iterable[tuple[str, Any]]) -> Surface:
    """The surface of functions and classes, given with their public paths."""
    objects = list(objects)
    reader = _Reader([thing for _, thing in objects])
    for path, thing in objects:
        if not inspect.isclass(thing):
            reader.call(path, thing, "function")
        elif not issubclass(thing, enum.Enum | BaseException):
            reader.cls(path, thing)
    return Surface(tuple(reader.names), tuple(reader.calls))


class _Reader:
    """Collects the names and the calls of objects; a member that classes share counts once."""

    def __init__(self, objects: list[Any]) -> None:
        self.classes = {thing for thing in objects if inspect.isclass(thing)}
        self.answers = answers(objects)
        self.names: list[Said] = []
        self.calls: list[Call] = []
        self.met: set[int] = set()

    def call(self, path: str, function: Any, kind: str) -> None:
        """Add a function or a method, and the names of its parameters."""
        parameters = tuple(p for p in _parameters(function) if p.name not in {"self", "cls"})
        docstring = inspect.getdoc(function) or ""
        self.calls.append(Call(path, parameters, kind, docstring))
        said = documented(docstring)
        for one in parameters:
            type_, (words, unit) = type_of(one), said.get(one.name, ("", ""))
            self.names.append(
                Said(path, one.name, "parameter", type_, words, unit, default=one.default)
            )

    def cls(self, path: str, cls: type) -> None:
        """Add a class: its constructor, its fields, its own members and those of hidden bases."""
        answer = cls.__name__ in self.answers
        kind = "tuple" if issubclass(cls, tuple) else "class"
        docstring = vars(cls).get("__doc__") or ""
        if docstring.startswith(f"{cls.__name__}("):  # which a dataclass without one is given
            docstring = ""
        self.calls.append(Call(path, _parameters(cls), kind, docstring, answer))
        self._fields(path, cls, answer)
        for base in own_classes(cls):
            if base is cls or base not in self.classes:
                for name, member in vars(base).items():
                    if not name.startswith("_") and id(member) not in self.met:
                        self.met.add(id(member))
                        self._member(path, name, member, cls)

    def _fields(self, path: str, cls: type, answer: bool) -> None:
        """Add the fields, and what else the constructor takes, that no other public class has."""
        fields = dict.fromkeys(getattr(cls, "_fields", ()), "")
        if dataclasses.is_dataclass(cls):
            fields = {field.name: _text(field.type) for field in dataclasses.fields(cls)}
        given, said = {one.name: one for one in _parameters(cls)}, words_of(cls)
        bases = (self.classes - {cls}).intersection(cls.__mro__)
        above = {name for base in bases for name in getattr(base, "__annotations__", {})}
        for name in {**fields, **given}:
            if name.startswith("_") or name in above:
                continue
            words, unit = said.get(name, ("", ""))
            one = given.get(name)
            type_, default = (type_of(one), one.default) if one else (fields[name], EMPTY)
            kind = "field" if name in fields else "parameter"
            self.names.append(Said(path, name, kind, type_, words, unit, answer, default))

    def _member(self, path: str, name: str, member: Any, cls: type) -> None:
        """Add a method or a property."""
        if isinstance(member, property | functools.cached_property):
            words = inspect.getdoc(member) or ""
            function = member.fget if isinstance(member, property) else member.func
            answer, unit = cls.__name__ in self.answers, unit_of(words)
            type_ = _returned(function)
            self.names.append(Said(path, name, "property", type_, words, unit, answer))
        function = getattr(member, "__func__", member)
        foreign = {*cls.__mro__} - {*own_classes(cls)}
        if inspect.isfunction(function) and not any(name in vars(base) for base in foreign):
            self.call(f"{path}.{name}", function, "method")


def _parameters(thing: Any) -> tuple[inspect.Parameter, ...]:
    try:
        return tuple(inspect.signature(thing).parameters.values())
    except ValueError:  # a class of the language itself, such as a warning
        return ()


def type_of(parameter: inspect.Parameter) -> str:
    """The annotation of a parameter; empty without one."""
    return "" if parameter.annotation is EMPTY else _text(parameter.annotation)


def _returned(function: Any) -> str:
    """The annotation of what a function returns; empty without one."""
    return _text(getattr(function, "__annotations__", {}).get("return", ""))


def _text(annotation: Any) -> str:
    return annotation if isinstance(annotation, str) else inspect.formatannotation(annotation)


def answers(objects: Iterable[Any]) -> set[str]:
    """Names of the classes that functions and methods return, and of what these contain.

    What is computed when it is asked for is contained, too.
    """
    classes: dict[str, type] = {}
    waiting: list[str] = []
    for thing in objects:
        if not inspect.isclass(thing):
            waiting += _words(_returned(thing))
            continue
        classes[thing.__name__] = thing
        for member in (member for base in own_classes(thing) for member in vars(base).values()):
            made = _words(_returned(getattr(member, "__func__", member)))
            # Questions too are made from others of their class.
            waiting += [name for name in made if name != thing.__name__]
    found: set[str] = set()
    while waiting:
        name = waiting.pop()
        cls = classes.get(name)
        if cls is None or name in found or _is_question(cls):
            continue
        found.add(name)
        if dataclasses.is_dataclass(cls):
            waiting += _words(" ".join(_text(field.type) for field in dataclasses.fields(cls)))
        late = (
            member for member in vars(cls).values() if isinstance(member, functools.cached_property)
        )
        waiting += [name for member in late for name in _words(_returned(member.func))]
    return found


def _is_question(cls: type) -> bool:
    return any(base.__name__ in {"Program", "Study"} for base in cls.__mro__)


def _words(annotation: str) -> list[str]:
    return re.findall(r"\w+", annotation)
