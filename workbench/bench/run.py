"""Run a named problem: feed its needs, answer it, certify the answer, leave a results folder."""

from __future__ import annotations

import datetime
import platform
import time
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import workbench
from workbench.bench import netcdf
from workbench.bench.checkpoint import FileCheckpoint
from workbench.bench.crate import write_crate
from workbench.bench.declare import Ref
from workbench.bench.files import write_json
from workbench.bench.notes import compared, log, went_on
from workbench.bench.problem import Problem
from workbench.bench.project import registry, results_root
from workbench.bench.question import Question, asked, canonical, code_hash, digest
from workbench.bench.results import Run
from workbench.bench.store import Store, Writer, damage
from workbench.bench.trust.information import FORMAT
from workbench.certificate import Certificate
from workbench.errors import InputError, RegistryError, ResultError
from workbench.executor import Context, Progress, Watch, silent, unwatched
from workbench.heavy_types import Dataset
from workbench.program import Program, Task, find_method
from workbench.solution import Solution, solve
from workbench.solvers import Options, Outcome, versions
from workbench.study import Study


@dataclass(frozen=True)
class Bench:
    """Settings of runs: results folder, options, progress display, reuse of stored answers."""

    store: Store
    options: Options
    progress: Progress = silent
    watch: Watch = unwatched
    fresh: bool = False

    def load(self, name: str, parameters: Mapping[str, Any]) -> Bound:
        """A problem with its data bound, its needs run first where they are missing."""
        return self._load(Ref(name, None, parameters), ())

    def run(self, name: str, method: str | None, parameters: Mapping[str, Any]) -> Run:
        """The run that answers a question, computed or found."""
        return self._run(Ref(name, method, parameters), ())

    def _load(self, asked_for: Ref, path: tuple[str, ...]) -> Bound:
        problem = registry().find(asked_for.name)
        parameters = problem.bind(asked_for.parameters)
        stored = problem.to_json(parameters)
        step = f"{problem.name} {stored}"
        if step in path:
            chain = " -> ".join(one.partition(" ")[0] for one in (*path, step))
            raise RegistryError(f"cyclic needs: {chain}")
        # What a problem is fed with is made by its own method, not at this run's accuracy.
        upstream = replace(self, options=Options(seed=self.options.seed), fresh=False)
        fed: dict[str, Any] = {}
        for name, need in problem.needs(parameters).items():
            fed[name] = (
                [upstream._feed(one, problem, (*path, step)) for one in need]
                if isinstance(need, list)
                else upstream._feed(need, problem, (*path, step))
            )
        problem.data_hashes()  # a missing file is named before the function meets it
        task = problem.task(parameters, fed)
        return Bound(problem, stored, fed, task)

    def _feed(self, need: Ref, problem: Problem, path: tuple[str, ...]) -> Run:
        run = self._run(need, path)
        if not run.holds or run.outcome is not Outcome.SOLVED:
            why = "certificate does not hold" if not run.holds else "certificate says: no answer"
            raise ResultError(f"{problem.name} needs {need.name}, whose {why}: see {run.path}")
        return run

    def _run(self, asked_for: Ref, path: tuple[str, ...]) -> Run:
        bound = self._load(asked_for, path)
        question = bound.question(asked_for.method, self.options)
        code = bound.code
        stored = self._stored(question, code)
        if stored:  # without a lock, so that a read-only folder can be read
            note = bound.task.unheeded(question.method, self.options.accuracy)
            return replace(stored, note=note)
        with self.store.writing(question.problem, question.key) as writer:
            # While this process waited for the lock another may have answered.
            return self._stored(question, code) or self.answer(bound, question, code, writer)

    def _stored(self, question: Question, code: str) -> Run | None:
        """The stored answer, if it may be reused: whole, and of the same code."""
        run = _earlier(self.store.folder(question.problem, question.key), question)
        same = run is not None and run.info["code"] == code and not self.fresh
        return replace(run, reused=True) if run is not None and same else None

    def answer(
        self,
        bound: Bound,
        question: Question,
        code: str,
        writer: Writer,
    ) -> Run:
        """Answer a question, certify the answer and publish the folder."""
        earlier = _earlier(writer.final, question)
        started, clock = _now(), time.perf_counter()
        checkpoint = self._checkpoint(question, code, writer)
        context = Context(self.options, self.progress, self.watch, checkpoint)
        solution = solve(bound.task, question.method, context=context)
        notes = [solution.note] * bool(solution.note) + went_on(solution, checkpoint)
        if solution.certificate is not None and isinstance(bound.task, Study):
            solution = replace(solution, certificate=bound.inherit(solution.certificate))

        folder = writer.start()
        data = _write_answer(folder, solution.proof or bound.task, solution)
        if data is not None:
            notes += compared(earlier, data, self.options)
        seconds = dict(solution.seconds) | {"total": time.perf_counter() - clock}
        if checkpoint.earlier:
            seconds["earlier"] = checkpoint.earlier
        info = _information(bound.task, question, solution) | {
            "started": started,
            "finished": _now(),
            "seconds": seconds,
            "code": code,
            "versions": environment(),
            "platform": f"{platform.system()} {platform.machine()}",
        }
        write_json(folder / "run.json", info)
        text = log(info, solution, context.rows, notes)
        (folder / "log.txt").write_text(text, encoding="utf-8")
        write_crate(folder, info, bound.help)
        proven = solution.outcome.proven
        path = writer.publish(failed=not proven)
        if proven:
            checkpoint.drop()
        return Run(path, note="; ".join(notes))

    def _checkpoint(self, question: Question, code: str, writer: Writer) -> FileCheckpoint:
        """The stored state of the question's iteration, which is the same for every time limit."""
        untimed = question.untimed
        file = self.store.checkpoint(untimed.problem, untimed.key)
        mark = digest(canonical(asdict(untimed)) + code)
        checkpoint = FileCheckpoint(file, writer.space / file.name, mark)
        if self.fresh:
            checkpoint.drop()
        return checkpoint


@dataclass(frozen=True)
class Bound:
    """A problem with its parameters and needs: the task, and what identifies it.

    A task of the bench's own, a comparison, has no problem.
    """

    problem: Problem | None
    parameters: Mapping[str, Any]
    needs: Mapping[str, Run | list[Run]]
    task: Task

    @property
    def help(self) -> str:
        return self.problem.entry.help if self.problem else type(self.task).__doc__ or ""

    @property
    def code(self) -> str:
        """Hash of the code that answers: the plant's, the workbench's, and that of its needs."""
        plants = [self.problem.sources] if self.problem else []
        return code_hash(plants, [run.info["code"] for run in self.fed])

    @property
    def fed(self) -> list[Run]:
        """The results that the problem is fed with, in one list."""
        needs = self.needs.values()
        return [run for need in needs for run in (need if isinstance(need, list) else [need])]

    def question(self, method: str | None, options: Options) -> Question:
        """The question with the default method filled in."""
        assert self.problem is not None
        if isinstance(self.task, Program):
            method = find_method(self.task, method).name
        elif method is not None:
            raise InputError(f"{self.problem.name} is a study: it has no method {method!r}")
        return Question(
            self.problem.name,
            self.parameters,
            self.problem.data_hashes(),
            {
                name: [run.key for run in need] if isinstance(need, list) else need.key
                for name, need in self.needs.items()
            },
            method,
            asked(options, self.task.judging_tolerance(method, options.accuracy)),
        )

    def _named_needs(self) -> Iterator[tuple[str, Run]]:
        for name, need in self.needs.items():
            if isinstance(need, list):
                yield from ((f"{name}[{i}]", run) for i, run in enumerate(need))
            else:
                yield name, need

    def inherit(self, own: Certificate) -> Certificate:
        """A study's certificate: those of its needs, and its own checks."""
        checks = [
            replace(check, name=f"{name}: {check.name}")
            for name, run in self._named_needs()
            if run.certificate is not None
            for check in run.certificate.checks
        ]
        return replace(own, checks=(*checks, *own.checks))


def _write_answer(folder: Path, task: Task, solution: Solution) -> Dataset | None:
    """Write arrays, certificate and metrics; nothing, and None, where there is no answer."""
    if solution.certificate is None:
        return None
    data = task.to_dataset(solution.answer)
    netcdf.write(data, folder / "data.nc")
    write_json(folder / "certificate.json", solution.certificate.to_json())
    write_json(folder / "metrics.json", task.metrics(solution.answer))
    return data


def _information(task: Task, question: Question, solution: Solution) -> dict[str, Any]:
    """The part of run.json that says what was asked and how it ended."""
    return {
        "format": FORMAT,
        **{name: getattr(question, name) for name in question.__dataclass_fields__},
        "key": question.key,
        "kind": "study" if isinstance(task, Study) else "program",
        "headline": (solution.proof or task).headline,
        "claim": solution.claim,
        "outcome": solution.outcome,
        "message": solution.message,
    }


def _now() -> str:
    return datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")


def environment() -> dict[str, str]:
    """Versions of what can change an answer."""
    own = {"workbench": workbench.__version__, "python": platform.python_version()}
    return own | versions()


def _earlier(folder: Path, question: Question) -> Run | None:
    """The stored run of a question, if it is whole."""
    if not folder.exists() or damage(folder):
        return None
    run = Run(folder)
    if run.info["problem"] != question.problem or run.info["key"] != question.key:
        raise ResultError(f"{folder} holds the answer to another question")
    return run


def default_bench(
    options: Options | None = None,
    progress: Progress = silent,
    watch: Watch = unwatched,
    *,
    fresh: bool = False,
) -> Bench:
    """The bench over the project's results folder."""
    return Bench(Store(results_root()), options or Options(), progress, watch, fresh)
