"""The description of a problem, printed by ``workbench show``."""

from __future__ import annotations

import inspect
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from workbench.bench.discovery import Entry
from workbench.bench.problem import Problem
from workbench.program import Program, methods


@dataclass(frozen=True)
class Description:
    """Source, help, parameters, data and methods of a problem."""

    name: str
    source: str
    """File and line of the problem's function, ``path:line``."""
    help: str
    parameters: dict[str, str]
    methods: dict[str, str]
    answer: str
    """Name of the type of the answer that a method returns; empty for a Study."""
    data: tuple[str, ...]
    slow: bool

    @property
    def text(self) -> str:
        lines = [self.name, self.source, "", self.help, ""]
        for title, table in (("parameters", self.parameters), ("methods", self.methods)):
            if table:
                width = max(map(len, table))
                lines += [title, *(f"  {key:<{width}}  {text}" for key, text in table.items()), ""]
        if self.answer:
            lines += ["answer", f"  {self.answer}", ""]
        if self.data:
            lines += ["data", *(f"  {name}" for name in self.data), ""]
        return "\n".join(lines).rstrip()

    def to_json(self) -> dict[str, Any]:
        return dict(self.__dict__)


def describe(problem: Problem) -> Description:
    """Description of an imported problem; the methods follow from its return annotation."""
    parameters = {
        name: _described(one, problem.hint(name)) for name, one in problem.parameters.items()
    }
    kind = problem.kind
    listed, answer = {}, ""
    if kind is not None and issubclass(kind, Program):
        answer = kind.answer_type()
        for name, entry in methods(kind).items():
            claim = " [claims the optimum]" if entry.optimal else ""
            own = problem.settings.method or kind.default_method
            default = " (default)" if name == own else ""
            words = f" [{entry.accuracy.words}]" if entry.accuracy.words else ""
            named = " [compared if it is named]" if entry.by_name else ""
            listed[name] = f"{entry.help}{claim}{words}{named}{default}"
    return Description(
        problem.name,
        _source(problem.entry),
        problem.entry.help,
        parameters,
        listed,
        answer,
        problem.settings.data,
        problem.entry.slow,
    )


def _source(entry: Entry) -> str:
    """File and line of a problem, relative to the working directory if it lies below that."""
    here = Path.cwd().resolve()
    file = entry.file.resolve()
    shown = file.relative_to(here) if file.is_relative_to(here) else file
    return f"{shown}:{entry.line}"


def _described(parameter: inspect.Parameter, hint: Any) -> str:
    from pydantic import TypeAdapter

    kind = _kind(TypeAdapter(hint).json_schema())
    if parameter.default is inspect.Parameter.empty:
        return f"{kind}, required"
    return f"{kind} = {parameter.default!r}"


_NAMES = {"number": "number", "integer": "integer", "null": "None", "boolean": "true or false"}
_BOUNDS = {"minimum": ">=", "exclusiveMinimum": ">", "maximum": "<=", "exclusiveMaximum": "<"}


def _kind(schema: dict[str, Any]) -> str:
    """A JSON schema in words."""
    if "enum" in schema:
        return " | ".join(repr(choice) for choice in schema["enum"])
    if "anyOf" in schema:
        return " | ".join(_kind(one) for one in schema["anyOf"])
    if "items" in schema:
        return f"list of {_kind(schema['items'])}"
    text = _NAMES.get(schema.get("type", "any"), schema.get("type", "any"))
    bounds = [f"{sign} {schema[key]:g}" for key, sign in _BOUNDS.items() if key in schema]
    return " ".join([text, ", ".join(bounds)]).strip()
