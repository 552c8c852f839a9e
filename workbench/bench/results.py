"""Writing and reading results folders.

run.json                 the question, who answered it, with what, how long it took
certificate.json  metrics.json
data.nc                  every array, labelled, with units
ro-crate-metadata.json   the folder as a Process Run Crate
log.txt  SHA256SUMS

Figures and tables are functions of the arrays, computed when somebody looks at them.
"""

from __future__ import annotations

import fnmatch
import html
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import KW_ONLY, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from workbench._core.heavy_types import Dataset, Figure
from workbench.bench.comparison import Comparison
from workbench.bench.declare import Fed
from workbench.bench.files import Picture, picture
from workbench.bench.parameter_sweep import SWEEP, ParameterSweep
from workbench.bench.problem import Problem
from workbench.bench.project import registry, results_root
from workbench.bench.question import CELL_DIGITS, plain
from workbench.bench.registry import Registry
from workbench.bench.store import CHECKSUMS, Store, damage
from workbench.bench.trust.information import run_information
from workbench.bench.trust.untrusted import file_stem, own_file, possible_path, read_json, read_text
from workbench.certificate import Certificate, distinct_texts
from workbench.errors import ResultError
from workbench.figures.printed import PrintedFigure
from workbench.figures.styles import drawn_in, printing_style, settle
from workbench.program import Task
from workbench.solution import certified_answer, proof_task
from workbench.solvers import Outcome

AT_MOST = " \N{LESS-THAN OR EQUAL TO} "
COMPARISON = "compare"
"""The problem name of comparisons, which the bench itself defines."""
OWN_STUDIES: dict[str, type[Comparison | ParameterSweep]] = {
    COMPARISON: Comparison,
    SWEEP: ParameterSweep,
}
"""Studies that the bench makes from other runs, by the problem name of their results."""


@dataclass(frozen=True)
class Run(Fed):
    """A finished run; its parts are read from the folder when they are used.

    ``reused`` tells that the answer was stored before; ``note`` has further remarks on that.
    """

    path: Path
    _: KW_ONLY
    reused: bool = False
    note: str = ""

    @cached_property
    def info(self) -> dict[str, Any]:
        """Content of run.json. Raises ResultError if it is not that of a run."""
        return run_information(read_json(self.path / "run.json"), str(self.path))

    @property
    def problem(self) -> str:
        """Name of the problem."""
        return str(self.info["problem"])

    @property
    def method(self) -> str | None:
        """Name of the method; None for a Study, which has no methods."""
        return self.info["method"]

    @property
    def key(self) -> str:
        """Hash of the question; it names the folder."""
        return str(self.info["key"])

    @property
    def outcome(self) -> Outcome:
        """How the run ended."""
        return Outcome(self.info["outcome"])

    @property
    def seconds(self) -> dict[str, float]:
        """Wall times of statement, solve, check and total [s].

        ``earlier`` is the time of interrupted runs from which this one was resumed.
        """
        return dict(self.info["seconds"])

    @cached_property
    def certificate(self) -> Certificate | None:
        """What was checked, against which limits, and by how much it holds.

        None without an answer.
        """
        file = self.path / "certificate.json"
        if not _exists(file):
            return None
        try:
            return Certificate.from_json(read_json(file))
        except (AttributeError, KeyError, TypeError, ValueError) as error:
            raise ResultError(f"{file.name} holds no certificate: {error!r}") from None

    @property
    def holds(self) -> bool:
        """Whether the certificate holds and the answer is not merely the best so far."""
        certified = self.certificate is not None and self.certificate.holds
        return certified and not self.best_so_far

    @property
    def best_so_far(self) -> bool:
        """Whether a time limit ended the method and the answer so far is valid."""
        return self.outcome is Outcome.TIME_LIMIT and self.certificate is not None

    @cached_property
    def metrics(self) -> dict[str, float]:
        """The numbers people quote."""
        file = self.path / "metrics.json"
        stored = read_json(file) if _exists(file) else {}
        try:
            return {name: float(value) for name, value in stored.items()}  # "nan" is also a number
        except (AttributeError, TypeError, ValueError, OverflowError) as error:
            raise ResultError(f"{file.name} holds no metrics: {error}") from None

    @property
    def headline(self) -> str:
        """The main metric, as text."""
        name = self.info["headline"]
        return f"{name} {self.metrics[name]:.4g}" if name in self.metrics else "-"

    @property
    def value(self) -> float:
        """The main metric; NaN if there is none."""
        return self.metrics.get(self.info["headline"], math.nan)

    @cached_property
    def data(self) -> Dataset:
        """Every array, labelled."""
        from workbench.bench.formats import netcdf

        return netcdf.read(self.path / "data.nc")

    @cached_property
    def task(self) -> Task:
        """The Program or Study that was answered, rebuilt from the question.

        Raises
        ------
        ResultError
            Its problem is not registered here or has other parameters now, or results that it needs
            are missing.
        """
        return rebuilt(self, registry()).task

    @cached_property
    def answer(self) -> Any:
        """The answer, restored from the arrays: the result of the task's method.

        If there is no answer, it is the proof of that.
        """
        return self.answered.from_dataset(self.data)

    @property
    def lti(self) -> Any:
        """The answer as a linear system.

        Raises InputError unless a certificate says that it is valid.
        """
        return certified_answer(self.answer, self.certificate, self.problem)

    @property
    def answered(self) -> Task:
        """The task that the answer belongs to: its own, or a proven claim of no answer."""
        return proof_task(self.task, Outcome(self.info["claim"]), self.outcome) or self.task

    @property
    def figures(self) -> dict[str, Figure]:
        """Figures by name, drawn from the arrays; the first is the main one."""
        return {} if self.certificate is None else self.answered.figures(self.answer)

    @property
    def tables(self) -> dict[str, str]:
        """Tables in Markdown by name, made from the arrays."""
        return {} if self.certificate is None else self.answered.tables(self.answer)

    @property
    def log(self) -> str:
        """Text of the log."""
        return read_text(self.path / "log.txt")

    def show(self, figure: str | None = None) -> Picture:
        """The main figure (default: the first), as an image for a notebook."""
        figures = self.figures
        return picture(figures[self._figure_name(figures, figure)])

    def plot(self, name: str | None = None) -> Picture:
        """The same as `show`, under the name that all answers have for it."""
        return self.show(name)

    def figure(
        self, *, name: str | None = None, style: str = "paper", width: str | float = "column"
    ) -> PrintedFigure:
        """A figure (default: the first) drawn for a paper, to be saved as PDF, SVG and PGF.

        Parameters
        ----------
        name
            One of `figures`.
        style
            "paper": letters of 7 and 8 points that match Times, thin lines, no title above all
            panels.
        width
            "column" (88.9 mm), "page" (181.9 mm), or a number [mm].

        Raises
        ------
        InputError
            Another style or width.
        ResultError
            The figure does not exist.
        """
        (printed,) = self._printed(style, width, lambda drawn: [self._figure_name(drawn, name)])
        return printed

    def _printed(
        self, style: str, width: str | float, choose: Callable[[dict[str, Figure]], Iterable[str]]
    ) -> list[PrintedFigure]:
        """The chosen figures, drawn for a paper."""
        for_paper = printing_style(style, width)
        with drawn_in(for_paper):
            drawn = self.figures
            return [
                PrintedFigure(file_stem(name), drawn[name], for_paper, settle(drawn[name]))
                for name in choose(drawn)
            ]

    def _figure_name(self, figures: Mapping[str, Figure], name: str | None) -> str:
        if not figures:
            raise ResultError(f"{self.problem} has no figure")
        if name is not None and name not in figures:
            raise ResultError(f"no figure {name!r} here; there are {', '.join(figures)}")
        return name or next(iter(figures))

    def draw(
        self, folder: str | Path, *, style: str = "screen", width: str | float = "column"
    ) -> list[Path]:
        """Write every figure and every table (as Markdown) into a folder, and return the files.

        Parameters
        ----------
        folder
            The folder; it is made if it is missing.
        style
            "screen": SVG and PNG; "paper": as `figure` draws and saves them.
        width
            On paper, as `figure` takes it.

        Raises
        ------
        InputError
            Another style or width.
        ResultError
            The folder is a sealed results folder, or cannot be written.
        """
        place = possible_path(folder)
        if any(
            (above / CHECKSUMS).exists() for above in (place.absolute(), *place.absolute().parents)
        ):
            raise ResultError(f"{place} lies in a sealed results folder: name another one")
        try:
            if style == "screen":
                files = [
                    file
                    for name, figure in self.figures.items()
                    for file in picture(figure).save(place, name)
                ]
            else:
                files = [
                    file for one in self._printed(style, width, list) for file in one.save(place)
                ]
            for name, table in self.tables.items():
                place.mkdir(parents=True, exist_ok=True)
                files.append(place / f"{file_stem(name)}.md")
                files[-1].write_text(table, encoding="utf-8")
        except OSError as error:
            raise ResultError(f"cannot write {error.filename}: {error.strerror}") from None
        return files

    def __repr__(self) -> str:
        try:
            method = f" by {self.method}" if self.method else ""
            said = f"{self.problem}{method}: {self.outcome}, {self.headline}"
            over = self._over
        except ResultError as error:
            return f"<Run {self.path}: {error}>"
        return f"<Run {said}, {self.path}{over}>"

    @property
    def _over(self) -> str:
        """The quantifier of its certificate, if it states one."""
        checks = () if self.certificate is None else self.certificate.checks
        return next((f"; {check.over}" for check in checks if check.over), "")

    def _repr_html_(self) -> str:
        rows: list[tuple[str, str]] = [("outcome", self.outcome), ("method", self.method or "-")]
        rows += [(name, f"{value:.6g}") for name, value in self.metrics.items()]
        if self.certificate is not None:
            rows += [
                (check.name, AT_MOST.join(distinct_texts(check.value, check.limit, digits=3)))
                for check in self.certificate.checks
            ]
            if self.certificate.gap is not None:
                rows.append(("optimality gap", f"{self.certificate.gap.value:.3g}"))
        cells = "".join(
            f"<tr><th style='text-align:left'>{html.escape(name)}</th>"
            f"<td>{html.escape(value)}</td></tr>"
            for name, value in rows
        )
        title = html.escape(f"{self.problem}  {self.key}")
        return f"<table><caption><b>{title}</b></caption>{cells}</table>"


def open_run(path: str | Path) -> Run:
    """The run in a folder.

    Raises
    ------
    ResultError
        The folder is not a results folder.
    """
    path = possible_path(path)
    if not _exists(path / "run.json"):
        raise ResultError(f"{path} is no results folder: it has no run.json")
    return Run(path)


def _exists(file: Path) -> bool:
    """Whether the folder has this file; links and anything but regular files are refused."""
    try:
        if not file.exists() and not file.is_symlink():
            return False
    except (OSError, ValueError):  # an impossible file name; the error appears later
        pass
    own_file(file)
    return True


@dataclass(frozen=True)
class Rebuilt:
    """A task rebuilt from a stored question, and the results that it needed.

    A comparison and a sweep have no problem.
    """

    problem: Problem | None
    needs: Mapping[str, Run | list[Run]]
    task: Task


def rebuilt(run: Run, problems: Registry) -> Rebuilt:
    """The problem of a run with the stored parameters; needed results must be stored.

    Raises
    ------
    ResultError
        As `Run.task`.
    """
    info = run.info
    if run.problem in OWN_STUDIES:
        return Rebuilt(None, {}, OWN_STUDIES[run.problem].stored())
    if run.problem not in problems.entries:
        raise ResultError(
            f"problem {run.problem!r} is not registered here; name its folder with --problems or "
            "workbench.add_problems"
        )
    problem = problems.find(run.problem)
    parameters = problem.bind(given(run, problem))
    if plain(problem.asked(parameters)) != info["parameters"]:
        raise ResultError(
            f"the problem takes other parameters now: {problem.asked(parameters)} "
            f"instead of {info['parameters']}"
        )
    stores = Store(root_of(run)).searched
    fed: dict[str, Any] = {}
    for name, need in problem.needs(parameters).items():
        keys = info["needs"][name]
        fed[name] = (
            [_upstream(stores, one.name, key) for one, key in zip(need, keys, strict=True)]
            if isinstance(need, list)
            else _upstream(stores, need.name, keys)
        )
    return Rebuilt(problem, fed, problem.task(parameters, fed))


def given(run: Run, problem: Problem) -> dict[str, Any]:
    """The stored parameters that a user may set; axes come from the name."""
    stored = run.info["parameters"]
    return {name: value for name, value in stored.items() if name in problem.parameters}


def root_of(run: Run) -> Path:
    """The results root that contains a folder: needed results are found there."""
    depth = len(run.problem.split("/")) + len(run.key) // CELL_DIGITS  # cells lie one folder deeper
    parents = run.path.resolve().parents
    return parents[depth] if len(parents) > depth else results_root()


def _upstream(stores: tuple[Store, ...], problem: str, key: str) -> Run:
    folders = [store.folder(problem, key) for store in stores]
    folder = next((one for one in folders if one.exists()), None)
    if folder is None:
        raise ResultError(f"its need {problem}/{key} is not here: run {problem} first")
    wrong = damage(folder)
    if wrong:
        raise ResultError(f"its need {problem}/{key} is damaged: {'; '.join(wrong)}")
    return Run(folder)


def stored_runs(root: Path, pattern: str = "*") -> list[Run]:
    """The finished, undamaged runs below a results folder whose problem fits a shell pattern."""
    return runs_in(Store(root).folders(), pattern)


def runs_in(folders: Iterable[Path], pattern: str) -> list[Run]:
    """Runs in those of the folders that can be read, whose problem fits a shell pattern."""
    runs = [Run(folder) for folder in folders if not unreadable(folder)]
    return [run for run in runs if fnmatch.fnmatchcase(run.problem, pattern)]


def damaged(root: Path) -> dict[Path, str]:
    """The folders below a results folder that are damaged or cannot be read, with the reasons."""
    found = {folder: unreadable(folder) for folder in Store(root).folders()}
    return {folder: wrong for folder, wrong in found.items() if wrong}


def unreadable(folder: Path) -> str:
    """The reason why a folder is damaged or cannot be read; empty if it is sound."""
    wrong, run = damage(folder), Run(folder)
    try:
        if not wrong:
            _ = run.info, run.certificate, run.metrics
    except ResultError as error:
        wrong = [str(error)]
    return "; ".join(wrong)
