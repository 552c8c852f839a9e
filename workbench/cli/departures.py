"""Arguments of a stored run that differ from the defaults."""

from __future__ import annotations

import json
from typing import Any

from workbench.bench.project import registry
from workbench.bench.question import asked, plain
from workbench.bench.results import OWN_STUDIES, Run
from workbench.errors import WorkbenchError
from workbench.solvers import Options

LONGEST = 48
"""Most characters of a value that are shown; a longer value is cut."""


def departures(run: Run) -> dict[str, str]:
    """Parameters and options of a run that differ from the defaults, as texts.

    For a comparison or a sweep these are the methods or values compared or swept. All parameters
    are listed if the problem is not registered here or its file cannot be read.
    """
    given: dict[str, Any] = dict(run.info["parameters"])
    usual: dict[str, Any] = {}
    if run.problem in OWN_STUDIES:
        given = {name: given[name] for name in ("pattern", "problem", "over") if name in given}
    elif run.problem in registry().entries:
        try:
            problem = registry().find(run.problem)
            usual = problem.defaults | problem.entry.axes
        # The problem's file is broken; the run's arguments are listed nevertheless.
        except WorkbenchError:
            pass
    differing = {n: v for n, v in given.items() if n not in usual or plain(usual[n]) != v}
    return {name: _short(value) for name, value in (differing | _options(run)).items()}


def _options(run: Run) -> dict[str, Any]:
    """Options that differ from the defaults; the default tolerance may be that of the method."""
    usual = asked(Options())
    return {
        name: value
        for name, value in run.info["options"].items()
        if name in usual and value != usual[name]
    }


def _short(value: Any) -> str:
    text = value if isinstance(value, str) and value else json.dumps(value)
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 3]}..."
