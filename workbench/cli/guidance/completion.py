"""Completions for the shell: names of problems, of their parameters, and of their methods."""

from __future__ import annotations

from typing import Any

import click
from click.shell_completion import CompletionItem

from workbench.bench.project import add_problems, registry
from workbench.errors import WorkbenchError


def problem_names(ctx: click.Context, param: click.Parameter, begun: str) -> list[CompletionItem]:
    """Names of problems that begin with this text, each with its first line of help."""
    _add_folders(ctx)
    return [
        CompletionItem(entry.name, help=entry.summary)
        for entry in registry().entries.values()
        if entry.name.startswith(begun)
    ]


def parameter_names(ctx: click.Context, param: click.Parameter, begun: str) -> list[CompletionItem]:
    """Parameters, as ``name=``, of the problem on the command line."""
    described = _described(ctx)
    return [
        CompletionItem(f"{name}=", help=text)
        for name, text in (described.parameters if described else {}).items()
        if f"{name}=".startswith(begun)
    ]


def method_names(ctx: click.Context, param: click.Parameter, begun: str) -> list[CompletionItem]:
    """Methods of the problem on the command line.

    In a list of methods the last name is completed.
    """
    described = _described(ctx)
    *before, last = begun.split(",")
    lead = "".join(f"{one}," for one in before)
    return [
        CompletionItem(f"{lead}{name}", help=text)
        for name, text in (described.methods if described else {}).items()
        if name.startswith(last)
    ]


def _described(ctx: click.Context) -> Any:
    """The first problem on the command line; None if there is none yet."""
    from workbench.bench.describe import describe  # Imports NumPy, which plain commands do without.

    _add_folders(ctx)
    params = ctx.params
    given = params.get("patterns") or params.get("pattern") or params.get("name") or ctx.args
    name = given if isinstance(given, str) else next(iter(given), "")
    try:
        return describe(registry().find(name)) if name else None
    except WorkbenchError:  # an incomplete name, or a pattern
        return None


def _add_folders(ctx: click.Context) -> None:
    """Add the folders that the command names; no command runs during completion."""
    for folder in ctx.find_root().params.get("problems") or ():
        add_problems(folder)
