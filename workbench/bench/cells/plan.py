"""The plan of a comparison: its cells, their questions, and the code that answers them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from workbench.bench.cells.site import Site
from workbench.bench.project import registry, results_root
from workbench.bench.question import Question, canonical
from workbench.bench.run import Bench, Bound
from workbench.bench.store import Store
from workbench.errors import WorkbenchError
from workbench.program import Program, methods
from workbench.solvers import ACCURACY, Options
from workbench.study import Study


@dataclass(frozen=True)
class Planned:
    """A method of a problem: why it is unfit, whether it claims the optimum, its code.

    ``tolerances`` are those of the certificate, by accuracy level; two levels with the same
    tolerance share one cell. ``by_name``: it is compared only if it is named.
    """

    unfit: str
    optimal: bool = False
    code: str = ""
    tolerances: Mapping[str, float] = field(default_factory=dict)
    by_name: bool = False


@dataclass(frozen=True)
class Plan:
    """A problem of a comparison, as a worker has loaded it.

    ``question`` is the problem's question without a method. It is None if the problem could not be
    loaded (``failure`` says why), or is a study, which has no methods.
    """

    problem: str
    question: Question | None = None
    program: str = ""
    size: float = np.nan
    methods: Mapping[str, Planned] = field(default_factory=dict)
    failure: str = ""
    study: bool = False


_loaded: dict[tuple[str, str], Bound] = {}
"""Problems that this worker has loaded, with their needs; the latest `MOST_LOADED` are kept."""
MOST_LOADED = 32


def loaded(name: str, parameters: Mapping[str, Any], seed: int, *, stored: bool = False) -> Bound:
    """A problem with its needs, kept for the next cell; ``stored``: its needs may not be run."""
    key = (name, canonical(parameters))
    if key not in _loaded:
        while len(_loaded) >= MOST_LOADED:
            del _loaded[next(iter(_loaded))]
        bench = Bench(Store(results_root()), Options(seed=seed), stored_only=stored)
        _loaded[key] = bench.load(name, parameters)
    return _loaded[key]


def plan(
    name: str, parameters: Mapping[str, Any], seed: int, place: Site, stored: bool = False
) -> Plan:
    """The plan of a problem, loaded anew; any error is recorded in the plan."""
    place.enter()
    _loaded.pop((name, canonical(parameters)), None)
    kind = registry().find(name).kind
    if kind is not None and issubclass(kind, Study):
        return Plan(name, study=True)
    try:
        bound = loaded(name, parameters, seed, stored=stored)
    except WorkbenchError as error:
        return Plan(name, failure=f"{type(error).__name__}: {error}")
    task = bound.task
    if not isinstance(task, Program):
        return Plan(name, study=True)
    size = task.problem_size
    planned = {}
    for method, entry in methods(task).items():
        reason = entry.unfit(task)
        if reason:
            planned[method] = Planned(reason)
            continue
        levels = {level: entry.judging_tolerance(value) for level, value in ACCURACY.items()}
        planned[method] = Planned("", entry.optimal, bound.code(method), levels, entry.by_name)
    own = bound.own_question
    return Plan(name, own, type(task).__name__, np.nan if size is None else size, planned)
