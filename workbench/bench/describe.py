"""What ``workbench show`` says of a problem."""

from __future__ import annotations

import inspect
import typing
from dataclasses import dataclass
from typing import Any

from workbench.bench.registry import Problem
from workbench.program import Program, methods


@dataclass(frozen=True)
class Description:
    """Help, parameters, data and methods of a problem."""

    name: str
    help: str
    parameters: dict[str, str]
    methods: dict[str, str]
    data: tuple[str, ...]
    slow: bool

    @property
    def text(self) -> str:
        lines = [self.name, "", self.help, ""]
        for title, table in (("parameters", self.parameters), ("methods", self.methods)):
            if table:
                width = max(map(len, table))
                lines += [title, *(f"  {key:<{width}}  {text}" for key, text in table.items()), ""]
        if self.data:
            lines += ["data", *(f"  {name}" for name in self.data), ""]
        return "\n".join(lines).rstrip()

    def to_json(self) -> dict[str, Any]:
        return dict(self.__dict__)


def describe(problem: Problem) -> Description:
    """Description of an imported problem; its methods are known from its return annotation."""
    parameters = {name: _described(one) for name, one in problem.parameters.items()}
    kind = typing.get_type_hints(problem.function).get("return")
    listed = {}
    if inspect.isclass(kind) and issubclass(kind, Program):
        for name, entry in methods(kind).items():
            claim = " [claims the optimum]" if entry.optimal else ""
            default = " (default)" if name == kind.default_method else ""
            listed[name] = f"{entry.help}{claim}{default}"
    return Description(
        problem.name,
        problem.entry.help,
        parameters,
        listed,
        problem.settings.data,
        problem.entry.slow,
    )


def _described(parameter: inspect.Parameter) -> str:
    kind = parameter.annotation
    text = kind if isinstance(kind, str) else getattr(kind, "__name__", str(kind))
    if parameter.default is inspect.Parameter.empty:
        return f"{text}, required"
    return f"{text} = {parameter.default!r}"
