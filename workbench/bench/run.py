"""Run a named problem: obtain its needs, answer it, certify the answer, write a results folder."""

from __future__ import annotations

import datetime
import inspect
import platform
import shutil
import time
import traceback
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

import workbench
from workbench._core.heavy_types import Dataset
from workbench.bench.checkpoint import FileCheckpoint
from workbench.bench.code import code_hash
from workbench.bench.declare import Ref
from workbench.bench.files import write_json
from workbench.bench.formats import netcdf
from workbench.bench.formats.crate import write_crate
from workbench.bench.notes import compared, log, went_on
from workbench.bench.problem import Problem
from workbench.bench.project import registry, results_root
from workbench.bench.question import Question, asked, canonical, digest, plain
from workbench.bench.registry import Registry
from workbench.bench.results import Run
from workbench.bench.store import FAILED, Store, Writer, damage
from workbench.bench.trust.information import FORMAT
from workbench.certificate import Certificate, Check
from workbench.errors import InputError, RegistryError, ResultError
from workbench.executor import Context, Progress, Row, Watch, no_progress, no_watch
from workbench.program import Program, Task, find_method
from workbench.solution import Solution, solve
from workbench.solvers import Options, Outcome, versions
from workbench.study import Study

LONGEST_CHAIN = 100
"""Largest depth of needs; needs whose parameters grow from one to the next would never end."""


@dataclass(frozen=True)
class Bench:
    """Settings of runs: results folder, options, progress display, reuse of stored answers.

    ``stored_only``: results that a problem needs must be stored already; none is computed.
    ``executor`` runs parts of the work. ``problems`` are those of the project, found once.

    A new answer to a need replaces an earlier one only when the run that needs it has ended, as
    earlier results use the earlier one. Until then it waits in `Store.beside`; ``beside`` has the
    problem and the key of each. An interrupted run finds there what it had finished.
    """

    store: Store
    options: Options
    progress: Progress = no_progress
    watch: Watch = no_watch
    fresh: bool = False
    stored_only: bool = False
    executor: Executor | None = None
    problems: Registry = field(default_factory=registry)
    beside: dict[tuple[str, str], None] = field(default_factory=dict)

    def load(self, name: str, parameters: Mapping[str, Any]) -> Bound:
        """A problem with its data bound; missing results that it needs are computed first."""
        problem, values, fed = self._fed(Ref(name, None, parameters), ())
        if self.beside and not self.stored_only:
            self._move_in()
            fed = {
                need: [self._placed(run) for run in runs]
                if isinstance(runs, list)
                else self._placed(runs)
                for need, runs in fed.items()
            }
        return _bound(problem, values, fed)

    def run(self, name: str, method: str | None, parameters: Mapping[str, Any]) -> Run:
        """The run that answers a question, computed or stored."""
        run = self._run(Ref(name, method, parameters), ())
        if not _failed(run):
            self._move_in()
        return run

    def _move_in(self) -> None:
        """Move the new results of needed problems from `Store.beside` to their places."""
        for problem, key in self.beside:
            made = self.store.beside.folder(problem, key)
            with self.store.writing(problem, key) as writer:
                if made.exists():  # another process may have moved it
                    writer.take(made)
        self.beside.clear()

    def _placed(self, run: Run) -> Run:
        """The run at its place, to which it may have been moved."""
        return replace(run, path=self.store.folder(run.problem, run.key))

    def found(self, name: str, method: str | None, parameters: Mapping[str, Any]) -> Run | None:
        """The stored answer of a question, if it may be reused; nothing is computed."""
        try:
            bound = replace(self, stored_only=True).load(name, parameters)
        except ResultError:  # a result that it needs is not stored
            return None
        question = bound.question(method, self.options)
        return self._stored(question, bound.code(question.method))

    def _load(self, asked_for: Ref, path: tuple[str, ...]) -> Bound:
        return _bound(*self._fed(asked_for, path))

    def _fed(
        self, asked_for: Ref, path: tuple[str, ...]
    ) -> tuple[Problem, dict[str, Any], dict[str, Run | list[Run]]]:
        """A problem, its parameters, and the results that it needs."""
        problem = self.problems.find(asked_for.name)
        parameters = problem.bind(asked_for.parameters)
        step = f"{problem.name} {problem.to_json(parameters)}"
        if step in path:
            chain = " -> ".join(one.partition(" ")[0] for one in (*path, step))
            raise RegistryError(f"cyclic needs: {chain}")
        if len(path) >= LONGEST_CHAIN:
            last = " -> ".join((*path[-2:], step))
            raise RegistryError(f"needs that do not end, {len(path)} of them: ... -> {last}")
        # A needed problem uses its own method, not the accuracy of this run.
        upstream = replace(self, options=Options(seed=self.options.seed), fresh=False)
        fed: dict[str, Run | list[Run]] = {}
        for name, need in problem.needs(parameters).items():
            fed[name] = (
                [upstream._feed(one, problem, (*path, step)) for one in need]
                if isinstance(need, list)
                else upstream._feed(need, problem, (*path, step))
            )
        return problem, parameters, fed

    def _feed(self, need: Ref, problem: Problem, path: tuple[str, ...]) -> Run:
        run = self._run(need, path)
        if not run.holds or run.outcome is not Outcome.SOLVED:
            why = "certificate does not hold" if not run.holds else "certificate says: no answer"
            raise ResultError(f"{problem.name} needs {need.name}, whose {why}: see {run.path}")
        return run

    def _run(self, asked_for: Ref, path: tuple[str, ...]) -> Run:
        bound = self._load(asked_for, path)
        question = bound.question(asked_for.method, self.options)
        code = bound.code(question.method)
        stored = self._stored(question, code)
        if stored:  # without a lock, so that a read-only folder can be read
            note = bound.task.unheeded(question.method, self.options.accuracy)
            return replace(stored, note=note)
        if self.stored_only:
            raise ResultError(f"{question.problem}/{question.key} is not stored")
        with self.store.writing(question.problem, question.key) as writer:
            # While this process waited for the lock, another one may have answered.
            run = self._stored(question, code)
            if (
                run is None
                and path
                and (writer.final.exists() or self._uses_waiting_results(bound))
            ):
                with self.store.beside.writing(question.problem, question.key) as aside:
                    run = self.answer(bound, question, code, aside)
                if not _failed(run):
                    return self._waiting(run)
                run = Run(writer.take(run.path), note=run.note)
            return run or self.answer(bound, question, code, writer)

    def _uses_waiting_results(self, bound: Bound) -> bool:
        """Whether a result that the problem needs still waits in `Store.beside`."""
        return any((run.problem, run.key) in self.beside for run in bound.fed)

    def _waiting(self, run: Run) -> Run:
        """Remember a run that waits in `Store.beside`; it is read now, before it is moved."""
        self.beside[run.problem, run.key] = None
        _ = run.certificate, run.metrics, run.data
        return run

    def _stored(self, question: Question, code: str) -> Run | None:
        """The stored answer, if it may be reused: undamaged, and by the same code.

        A run that waits in `Store.beside` was finished before another run was interrupted.
        """
        if self.fresh:
            return None
        place = self.store.folder(question.problem, question.key)
        aside = self.store.beside.folder(question.problem, question.key)
        run = earlier_run(place, question)
        if run is not None and run.info["code"] == code:
            if aside.exists() and not self.stored_only:  # other code made it
                shutil.rmtree(aside, ignore_errors=True)
            return replace(run, reused=True)
        run = earlier_run(aside, question)
        if run is not None and run.info["code"] == code:
            return self._waiting(replace(run, reused=True))
        return None

    def answer(
        self,
        bound: Bound,
        question: Question,
        code: str,
        writer: Writer,
    ) -> Run:
        """Answer a question, certify the answer and publish the folder."""
        earlier = earlier_run(self.store.folder(question.problem, question.key), question)
        started, clock = now(), time.perf_counter()
        checkpoint = self._checkpoint(question, code, writer)
        context = Context(
            options=self.options,
            progress=self.progress,
            watch=self.watch,
            checkpoint=checkpoint,
            executor=self.executor,
        )
        solution = solve(bound.task, method=question.method, context=context)
        notes = [solution.note] * bool(solution.note) + went_on(solution, checkpoint)
        solution, data = _stored_form(bound, solution)
        if data is not None:
            notes += compared(earlier, data, self.options)
        seconds = dict(solution.seconds) | {"total": time.perf_counter() - clock}
        if checkpoint.earlier:
            seconds["earlier"] = checkpoint.earlier
        about = {"started": started, "seconds": seconds, "code": code}
        path = publish(writer, bound, question, solution, data, about, context.rows, notes)
        if solution.outcome.proven:
            checkpoint.drop()
        return Run(path, note="; ".join(notes))

    def _checkpoint(self, question: Question, code: str, writer: Writer) -> FileCheckpoint:
        """The stored state of the question's iteration; it does not depend on the time limit."""
        untimed = question.untimed
        file = self.store.checkpoint(untimed.problem, untimed.key)
        mark = digest(canonical(asdict(untimed)) + code)
        checkpoint = FileCheckpoint(file, writer.space / file.name, mark)
        if self.fresh:
            checkpoint.drop()
        return checkpoint


def _failed(run: Run) -> bool:
    """Whether a run is stored as a failure, which replaces no result."""
    return run.path.name.endswith(FAILED)


@dataclass(frozen=True)
class Bound:
    """A problem with its parameters and needs: the task, and the data that identify it.

    A comparison, which is a task of the bench itself, has no problem.
    """

    problem: Problem | None
    parameters: Mapping[str, Any]
    needs: Mapping[str, Run | list[Run]]
    task: Task

    @property
    def help(self) -> str:
        return self.problem.entry.help if self.problem else type(self.task).__doc__ or ""

    def code(self, method: str | None) -> str:
        """Hash of the code that answers: everything it imports, and the code of its needs."""
        modules = {
            one.__module__ for one in type(self.task).__mro__ if one.__module__ != "builtins"
        }
        packages: tuple[str, ...] = ()
        if self.problem is not None:
            modules.add(self.problem.function.__module__)
        if isinstance(self.task, Program):
            entry = find_method(self.task, method)
            modules.add(inspect.unwrap(entry.answer).__module__)
            packages = entry.packages
        return code_hash(modules, packages, [run.info["code"] for run in self.fed])

    @property
    def fed(self) -> list[Run]:
        """The results that the problem needs, in one list."""
        needs = self.needs.values()
        return [run for need in needs for run in (need if isinstance(need, list) else [need])]

    def question(self, method: str | None, options: Options) -> Question:
        """The question with the default method filled in."""
        if isinstance(self.task, Program):
            own = self.problem.settings.method if self.problem is not None else None
            method = find_method(self.task, method or own).name
        elif method is not None:
            raise InputError(f"{self.own_question.problem} is a study: it has no method {method!r}")
        tolerance = self.task.judging_tolerance(method, options.accuracy)
        return replace(self.own_question, method=method, options=asked(options, tolerance))

    @cached_property
    def own_question(self) -> Question:
        """The question before a method is chosen."""
        assert self.problem is not None
        needs = {
            name: [run.key for run in need] if isinstance(need, list) else need.key
            for name, need in self.needs.items()
        }
        hashes = self.problem.data_hashes()
        return Question(self.problem.name, self.parameters, hashes, needs, None, {})

    def _named_needs(self) -> Iterator[tuple[str, Run]]:
        for name, need in self.needs.items():
            if isinstance(need, list):
                yield from ((f"{name}[{i}]", run) for i, run in enumerate(need))
            else:
                yield name, need

    def inherit(self, own: Certificate) -> Certificate:
        """A study's certificate: its own checks, and those of the results that it needs."""
        checks = [
            replace(check, name=f"{name}: {check.name}")
            for name, run in self._named_needs()
            if run.certificate is not None
            for check in run.certificate.checks
        ]
        return replace(own, checks=(*checks, *own.checks))


def _bound(problem: Problem, parameters: dict[str, Any], fed: dict[str, Run | list[Run]]) -> Bound:
    """The problem with its data bound."""
    problem.data_hashes()  # a missing file is reported before the function opens it
    task = problem.task(parameters, fed)
    return Bound(problem, problem.asked(parameters), fed, task)


def answer_arrays(bound: Bound, solution: Solution) -> Dataset | None:
    """The arrays of a checked answer, or of a proof that there is none; None without either."""
    if solution.certificate is None:
        return None
    data = (solution.proof or bound.task).to_dataset(solution.answer)
    if not hasattr(data, "data_vars"):
        raise TypeError(f"to_dataset returned {type(data).__name__}; an xarray.Dataset is needed")
    return data


def _stored_form(bound: Bound, solution: Solution) -> tuple[Solution, Dataset | None]:
    """A checked answer with its `answer_arrays`; if they raise an error, there is no answer."""
    try:
        return solution, answer_arrays(bound, solution)
    except Exception as error:
        message = (
            f"{solution.message}; the answer cannot be stored: {type(error).__name__}: {error}"
        )
        lost = replace(
            solution,
            answer=None,
            certificate=None,
            message=message.removeprefix("; "),
            trace=traceback.format_exc(),
        )
        return lost, None


def publish(
    writer: Writer,
    bound: Bound,
    question: Question,
    solution: Solution,
    data: Dataset | None,
    about: Mapping[str, Any],
    rows: Sequence[Row] = (),
    notes: Sequence[str] = (),
) -> Path:
    """Write the folder of a checked answer, and move it to its place.

    ``data`` are its `answer_arrays`. ``about`` holds further entries of run.json: start time,
    seconds, code.
    """
    if solution.certificate is not None and isinstance(bound.task, Study):
        solution = replace(solution, certificate=bound.inherit(solution.certificate))
    folder = writer.start()
    task = solution.proof or bound.task
    if data is not None and solution.certificate is not None:
        solution, metrics, files = _metrics_and_files(task, solution)
        assert solution.certificate is not None
        netcdf.write(data, folder / "data.nc")
        write_json(folder / "certificate.json", solution.certificate.to_json())
        write_json(folder / "metrics.json", metrics)
        for name, content in files.items():
            (folder / name).write_text(content, encoding="utf-8", newline="\n")
    kind = "study" if isinstance(bound.task, Study) else "program"
    info = information(question, solution, about) | {"kind": kind}
    info["headline"] = task.headline if isinstance(task.headline, str) else ""
    text = log(info, solution, rows, notes)
    return seal_folder(writer, folder, info, text, bound.help)


def _metrics_and_files(
    task: Task, solution: Solution
) -> tuple[Solution, dict[str, float], dict[str, str]]:
    """Metrics and files of an answer; if they raise an error, its certificate does not hold.

    The answer itself is still stored.
    """
    try:
        metrics, files = task.metrics(solution.answer), task.files(solution.answer)
        for name, value in metrics.items():
            if not isinstance(name, str):
                raise TypeError(f"a metric is called {name!r}, which is no text")
            np.asarray(value, dtype=float).item()  # raises unless it is a number
        if not isinstance(task.headline, str):
            raise TypeError(f"headline is {task.headline!r}, which is no name of a metric")
        return solution, metrics, files
    except Exception as error:
        said = f"{type(error).__name__}: {error}"
        failed = Check(
            "metrics", "whether metrics or files raise an error", 1.0, 0.0, where=f"({said})"
        )
        certificate = solution.certificate
        assert certificate is not None
        certificate = replace(certificate, checks=(*certificate.checks, failed))
        message = f"{solution.message}; metrics or files failed: {said}".removeprefix("; ")
        trace = traceback.format_exc()
        told = replace(solution, certificate=certificate, message=message, trace=trace)
        return told, {}, {}


def seal_folder(
    writer: Writer, folder: Path, info: Mapping[str, Any], text: str, help: str
) -> Path:
    """Write the files that every folder has, answer or not, and move it to its place."""
    write_json(folder / "run.json", info)
    (folder / "log.txt").write_text(text, encoding="utf-8", errors="backslashreplace")
    write_crate(folder, info, help)
    return writer.publish(failed=not Outcome(info["outcome"]).proven)


def information(question: Question, solution: Solution, about: Mapping[str, Any]) -> dict[str, Any]:
    """Content of run.json: the question, the outcome, the versions."""
    return {
        "format": FORMAT,
        **{name: getattr(question, name) for name in question.__dataclass_fields__},
        "key": question.key,
        "kind": "program",
        "headline": "",
        "claim": solution.claim,
        "outcome": solution.outcome,
        "message": solution.message,
        "finished": now(),
        "versions": environment(),
        "platform": f"{platform.system()} {platform.machine()}",
        **about,
    }


def now() -> str:
    """The present time in the format of run.json."""
    return datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")


def environment() -> dict[str, str]:
    """Versions of everything that can change an answer."""
    own = {"workbench": workbench.__version__, "python": platform.python_version()}
    return own | versions()


def earlier_run(folder: Path, question: Question) -> Run | None:
    """The stored run of a question, if it is undamaged. Raises as `need_same`."""
    if not folder.exists() or damage(folder):
        return None
    run = Run(folder)
    need_same(question, {name: run.info[name] for name in asdict(question)}, str(folder))
    return run


def need_same(question: Question, stored: Any, place: str) -> None:
    """Raise ResultError for the answer to another question: then two keys collide."""
    if plain(asdict(question)) != stored:
        raise ResultError(f"{place} holds the answer to another question of the same key")


def default_bench(
    options: Options | None = None,
    progress: Progress = no_progress,
    watch: Watch = no_watch,
    *,
    fresh: bool = False,
    executor: Executor | None = None,
) -> Bench:
    """The bench with the project's results folder."""
    store = Store(results_root())
    return Bench(store, options or Options(), progress, watch, fresh, executor=executor)
