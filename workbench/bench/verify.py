"""Verify a results folder from its stored arrays alone: no solver runs, no stored code runs.

The steps are: the checksums; the key, from the question in run.json; the problem, rebuilt through
the registry; its arrays and derived files, compared with the stored ones; the certificate,
recomputed. A deep verification also makes the expensive checks of a second opinion, and certifies
every cell of a comparison again.

Things that cannot be recomputed are protected by their checksums only: the log, the seconds, the
versions, and the method's claim. Figures and tables are not stored: they are functions of the
arrays.

A folder is data; it is checked by the code of the current project. If a project is found only
through the folder's own path, its problems are imported only if the caller trusts them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from textwrap import indent

from workbench.bench.formats import netcdf
from workbench.bench.parameter_sweep import SWEEP
from workbench.bench.problem import Problem
from workbench.bench.project import Project, add_problems, registry, results_root
from workbench.bench.question import Question, plain
from workbench.bench.results import COMPARISON, OWN_STUDIES, Run, given, rebuilt
from workbench.bench.run import Bench, Bound, environment
from workbench.bench.store import CHECKSUMS, FAILED, Store, damage
from workbench.bench.trust.numbers import SAME_NUMBER, certificates_apart, metrics_apart
from workbench.bench.trust.untrusted import possible_path, read_json, read_text
from workbench.bench.verify_cells import cell_of, rerun_cells, stored_cells, stored_points
from workbench.certificate import Certificate, Check, deep_checks
from workbench.errors import InputError, ResultError, WorkbenchError
from workbench.program import Program, find_method
from workbench.solution import Solution, proof_task
from workbench.solvers import Options, Outcome
from workbench.study import Study


@dataclass(frozen=True)
class Verification:
    """The result of verifying a folder.

    ``problems`` says what is wrong; ``notes`` has further remarks. ``certificate`` is recomputed
    here; None if that was impossible, and then the answer was not checked. ``deep`` are the
    expensive checks of the second opinion, if they were asked for. ``stated`` are problems that the
    folder itself states: it has no answer, or one whose certificate fails.
    """

    path: Path
    problems: tuple[str, ...]
    notes: tuple[str, ...]
    certificate: Certificate | None
    deep: tuple[Check, ...] = ()
    stated: tuple[str, ...] = ()

    @property
    def intact(self) -> bool:
        """Whether nothing is wrong with the parts that could be checked."""
        return not self.problems

    @property
    def holds(self) -> bool:
        """Whether the folder is intact and its certificate was recomputed."""
        return self.intact and self.certificate is not None

    def __repr__(self) -> str:
        verdict = "verified" if self.holds else "NOT verified"
        if self.intact and not self.holds:
            verdict = "intact, its answer NOT checked"
        lines = [f"{self.path}: {verdict}"]
        lines += [f"  {problem}" for problem in self.problems]
        lines += [f"  note: {note}" for note in self.notes]
        lines += [indent(f"deep: {check.line}", "  ") for check in self.deep]
        return "\n".join(lines)


def verify_folder(
    path: Path, *, rerun: bool = False, trust: bool = False, deep: bool = False
) -> Verification:
    """Verify one results folder.

    ``rerun``: also run the problem again. ``deep``: also make the expensive checks. ``trust``:
    import the problems of the project that contains the folder, as well as those of the current
    project.

    Raises
    ------
    ResultError
        The folder is not a results folder.
    """
    found: list[str] = damage(possible_path(path))
    if trust:
        for folder in _of_its_project(path):
            add_problems(folder)
    if not (path / "run.json").is_file():
        if not (path / CHECKSUMS).is_file():
            raise ResultError(f"{path} is no results folder: it has neither run.json nor checksums")
        return Verification(path, tuple(found), (), None)
    run = Run(path)
    notes: list[str] = []
    answer = _Rechecked(None)
    try:
        found += _misplaced(run)
        problems = registry()
        if run.problem not in OWN_STUDIES and run.problem not in problems.entries:
            notes.append(f"problem {run.problem!r} is not registered: checksums and key only")
            if not trust and _of_its_project(path):
                notes.append("the project about the folder is not trusted; --trust imports it")
        else:
            again = rebuilt(run, problems)
            bound = Bound(again.problem, run.info["parameters"], again.needs, again.task)
            notes += _other_code(run, bound, again.problem) if again.problem else []
            answer = _recheck(run, bound, deep)
            notes += answer.notes
            found += answer.wrong + answer.failures + cell_of(run)
            if run.problem == COMPARISON:
                wrong, said = _cells(run, rerun, deep)
                found, notes = found + wrong, notes + said
            if run.problem == SWEEP:
                wrong, said = stored_points(run, _faults(deep))
                found, notes = found + wrong, notes + said
            if run.best_so_far:
                notes.append(f"stopped by the clock: {run.info['message']}")
            if rerun and again.problem:
                found += _rerun(run, again.problem, notes)
    except WorkbenchError as error:
        found.append(str(error))
    except (KeyError, TypeError, ValueError) as error:
        found.append(f"run.json cannot be read as a run: {type(error).__name__}: {error}")
    stated = tuple(answer.failures)
    return Verification(path, tuple(found), tuple(notes), answer.certificate, answer.deep, stated)


def _cells(run: Run, rerun: bool, deep: bool) -> tuple[list[str], list[str]]:
    """Disagreements between a comparison and its cells, each certified again; and notes.

    Answers of cells without a folder are lost: a deep verification computes them anew.
    """
    if rerun:
        return rerun_cells(run)
    wrong, notes, without = stored_cells(run, _faults(deep))
    if deep and without:
        more, said = rerun_cells(run, without)
        return wrong + more, [f"{len(without)} cells without an answer here, answered anew", *said]
    return wrong, notes


def _faults(deep: bool) -> Callable[[Path], list[str]]:
    """Function that verifies the folder of a cell or point and returns its unstated problems."""

    def faults(path: Path) -> list[str]:
        found = verify_folder(path, deep=deep)
        return [text for text in found.problems if text not in found.stated]

    return faults


def _of_its_project(path: Path) -> list[Path]:
    """Problem folders of the project that contains a results folder, if that is another project."""
    own = Project.around(path.absolute()).problems
    return [folder for folder in own if folder not in Project.around(Path.cwd()).problems]


def _misplaced(run: Run) -> list[str]:
    """Check that key, question, and the folder's name and place agree."""
    question = Question(**{name: run.info[name] for name in Question.__dataclass_fields__})
    found = []
    if question.key != run.key:
        found.append(f"run.json: its question has key {question.key}, not {run.key} as it says")
    if run.path.resolve().name.removesuffix(FAILED) != question.key:
        found.append(f"run.json: its question has key {question.key}, unlike the folder's name")
    above, named = run.path.resolve().parents, Path(run.problem).parts
    root = results_root().resolve()
    if root in above and above[0].relative_to(root).parts[-len(named) :] != named:
        found.append(
            f"run.json: it answers {run.problem}, and lies in {above[0].relative_to(root)}"
        )
    return found


def _other_code(run: Run, bound: Bound, problem: Problem) -> list[str]:
    notes = []
    if run.info["code"] != bound.code(run.method):
        notes.append("answered by other code than this")
    stored, here = run.info["versions"], environment()
    notes += [
        f"{name} {stored.get(name, 'absent')} then, {here.get(name, 'absent')} now"
        for name in sorted(stored.keys() | here.keys())
        if stored.get(name) != here.get(name)
    ]
    hashes = problem.data_hashes()
    if hashes != run.info["data"]:
        changed = [name for name in hashes if hashes[name] != run.info["data"].get(name)]
        raise ResultError(f"the problem's data has changed since: {', '.join(changed)}")
    return notes


@dataclass(frozen=True)
class _Rechecked:
    """The recomputed certificate, disagreements with stored files, failures, and notes."""

    certificate: Certificate | None
    wrong: list[str] = field(default_factory=list)
    failures: list[str] = field(default_factory=list)
    deep: tuple[Check, ...] = ()
    notes: list[str] = field(default_factory=list)


def _recheck(run: Run, bound: Bound, deep: bool) -> _Rechecked:
    """Recompute the certificate from the stored arrays, and compare the stored files with them."""
    if not (run.path / "data.nc").exists():
        return _Rechecked(None, [], ["data.nc is missing: there is no answer to check"])
    claim = Outcome(run.info["claim"])
    proof = proof_task(bound.task, claim, run.outcome)
    task = proof or bound.task
    try:
        answer = task.from_dataset(run.data)
        rebuilt = task.to_dataset(answer)
    except (KeyError, ValueError, InputError) as error:
        return _Rechecked(None, [f"data.nc holds no answer to the question: {error}"])
    wrong = [f"data.nc: {text}" for text in netcdf.differences(run.data, rebuilt, SAME_NUMBER)]
    task = task if wrong else task.of_stored(run.data)
    optimal = isinstance(task, Program) and find_method(task, run.method).optimal
    optimal = optimal and claim is not Outcome.TIME_LIMIT
    certificate = task.certify(answer, float(run.info["options"]["tolerance"]), optimal=optimal)
    if isinstance(task, Study):
        certificate = bound.inherit(certificate)
    outcome = Solution(answer, claim, "", certificate, proof=proof).outcome
    if run.info["outcome"] != outcome:
        wrong.append(f"run.json says {run.info['outcome']!r}, the certificate {str(outcome)!r}")
    stored, fresh = read_json(run.path / "certificate.json"), plain(certificate.to_json())
    wrong += [f"certificate.json: {text}" for text in certificates_apart(stored, fresh)]
    stored, fresh = read_json(run.path / "metrics.json"), plain(task.metrics(answer))
    added = _metrics_of_later_code(run, bound, stored, fresh)
    fresh = {name: value for name, value in fresh.items() if name not in added}
    wrong += [f"metrics.json: {text}" for text in metrics_apart(stored, fresh, task)]
    wrong += [
        f"{name} is not what the arrays give"
        for name, content in task.files(answer).items()
        if not (run.path / name).is_file() or read_text(run.path / name) != content
    ]
    dear = deep_checks(task, answer) if deep and certificate.valid else ()
    wrong += [f"deep: {check.failure}" for check in dear if not check.holds]
    failures = [f"certificate: {text}" for text in certificate.failures]
    notes = [f"metrics that its code did not have: {', '.join(added)}"] if added else []
    return _Rechecked(certificate, wrong, failures, dear, notes)


def _metrics_of_later_code(
    run: Run, bound: Bound, stored: object, fresh: dict[str, float]
) -> list[str]:
    """Names of metrics that this code computes, and the run's code did not."""
    if not isinstance(stored, dict) or run.info["code"] == bound.code(run.method):
        return []
    return sorted(fresh.keys() - stored.keys())


def _rerun(run: Run, problem: Problem, notes: list[str]) -> list[str]:
    """Run the problem again, outside the project's results, and compare the arrays."""
    import tempfile

    info = run.info
    options = Options(**info["options"])
    with tempfile.TemporaryDirectory() as folder:
        again = Bench(Store(folder), options).run(run.problem, run.method, given(run, problem))
        if again.path.name.endswith(FAILED):
            return [f"re-run: {again.outcome}. {again.info['message']}"]
        found = netcdf.differences(run.data, again.data, options.accuracy)
        ratio = again.seconds["total"] / run.seconds["total"]
    notes.append(f"re-run within {options.accuracy:g}; it took {ratio:.2g} times as long")
    return [f"re-run: {text}" for text in found]


def finished_folders(path: Path) -> list[Path]:
    """The results folders at or below a path, without failures.

    Raises
    ------
    ResultError
        There are none.
    """
    if (possible_path(path) / "run.json").is_file():
        return [path]
    folders = Store(path).folders()
    if not folders:
        raise ResultError(f"no results folder at or below {path}")
    return folders
