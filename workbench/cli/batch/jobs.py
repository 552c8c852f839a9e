"""Runs of many problems, yielded as they end, in this process or in several."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

import workbench
from workbench.bench.project import add_problems, added_problems
from workbench.cli.batch.plan import JobPlan
from workbench.errors import ClusterError, WorkbenchError

if TYPE_CHECKING:
    from workbench.bench.results import Run


def ended(
    names: Sequence[str],
    asked: Mapping[str, Any],
    jobs: int,
    executor: Executor | None = None,
) -> Iterator[tuple[str, Run | WorkbenchError]]:
    """Yield each problem's run as it ends, or the error that prevented the run.

    ``asked`` holds arguments of `workbench.run`. With several jobs each is a process; they share
    the cores, and a problem whose results several others need runs first. An executor that is given
    receives whole problems; if there is only one problem, it receives the parts of that.
    """
    if executor is not None and len(names) > 1:
        return _several(names, asked, nullcontext(executor), jobs)
    if jobs > 1 and executor is None:
        return _several(names, asked, workers(jobs), jobs)
    return _one_by_one(names, {**asked, "executor": executor})


def _one_by_one(
    names: Sequence[str], asked: Mapping[str, Any]
) -> Iterator[tuple[str, Run | WorkbenchError]]:
    from workbench.executor.live import shown_live

    for position, name in enumerate(names, start=1):
        done: Run | WorkbenchError
        with shown_live(f"[{position}/{len(names)}] {name}") as (progress, watch):
            try:
                done = workbench.run(name, progress=progress, watch=watch, **asked)
            except WorkbenchError as error:
                done = error
        yield name, done


def _several(
    names: Sequence[str],
    asked: Mapping[str, Any],
    where: AbstractContextManager[Executor],
    most: int,
) -> Iterator[tuple[str, Run | WorkbenchError]]:
    """Run several problems at once, at most ``most``.

    Each starts after the problems that it needs.
    """
    from workbench.executor.live import shown_live

    plan = JobPlan(names, asked)
    under_way: dict[Future[Run], str] = {}
    ended = 0
    with where as executor, shown_live("several at once") as (progress, _):
        most = getattr(executor, "window", most)
        while under_way or plan.waiting:
            for label in plan.ready(most - len(under_way), idle=not under_way):
                call = executor.submit(_run, *plan.calls[label], added_problems())
                under_way[call] = label
            now = ", ".join(plan.calls[label][0] for label in under_way.values())
            progress(now, ended, len(names))
            for call in wait(under_way, return_when=FIRST_COMPLETED).done:
                label = under_way.pop(call)
                plan.over.add(label)
                error = call.exception()
                if isinstance(error, ClusterError) or not isinstance(error, WorkbenchError | None):
                    raise error
                # if a needed problem fails, the problems that need it report that
                if label in plan.named:
                    ended += 1
                    yield plan.named[label], error or call.result()


def _run(name: str, asked: dict[str, Any], folders: Sequence[Path]) -> Run:
    for folder in folders:
        add_problems(folder)
    return workbench.run(name, **asked)


def workers(jobs: int) -> Executor:
    """The executor for the jobs: processes that share the cores; for a single job this process."""
    from workbench.executor import InProcess, Workers

    if jobs == 1:
        return InProcess()
    return Workers(count=jobs, threads=max(1, (os.cpu_count() or 1) // jobs))
