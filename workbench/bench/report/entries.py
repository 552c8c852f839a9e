"""The runs of a report."""

from __future__ import annotations

import hashlib
import json
import re
from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from workbench.bench.discovery import RESERVED
from workbench.bench.parameter_sweep import SWEEP
from workbench.bench.project import registry
from workbench.bench.report.badges import Badge, run_badge
from workbench.bench.report.words import text
from workbench.bench.results import COMPARISON, OWN_STUDIES, Run, runs_in, stored_runs
from workbench.bench.store import CHECKSUMS, FAILED, PARTIAL
from workbench.errors import ResultError

OPTIONS = ("tolerance", "time_limit", "seed")
"""Options that are shown beside the parameters if the runs of a problem differ in them."""
LONGEST = 60
"""Most characters of a parameter in the table of runs; a longer one is shortened there, but not on
its page.
"""


@dataclass(frozen=True)
class ReportEntry:
    """A run as the report shows it.

    ``anchor`` identifies it, ``place`` is its folder below the results folder, ``stem`` is the file
    name of its page. ``differing`` holds, as texts, the parameters and options in which the runs of
    its problem differ.
    """

    run: Run
    failed: bool
    anchor: str
    place: str
    theme: str = ""
    summary: str = ""
    differing: Mapping[str, str] = field(default_factory=dict)

    @property
    def stem(self) -> str:
        words = re.sub(r"[^A-Za-z0-9]+", "-", self.anchor)[:60].strip("-")
        return f"{words}-{hashlib.sha256(self.anchor.encode()).hexdigest()[:8]}"

    @property
    def title(self) -> str:
        """The title of a run: its problem, or the pattern of a comparison's problems."""
        pattern = self.run.info["parameters"].get("pattern")
        return f"comparison of {pattern}" if self.is_comparison and pattern else self.run.problem

    @property
    def badge(self) -> Badge:
        return run_badge(self.run, self.failed)

    @property
    def is_comparison(self) -> bool:
        return self.run.problem == COMPARISON

    @property
    def headline(self) -> tuple[str, float] | None:
        """Name and value of the main metric; for a comparison they are in its badge."""
        name = self.run.info["headline"]
        if self.is_comparison or name not in self.run.metrics:
            return None
        return name, float(self.run.metrics[name])

    @property
    def gap(self) -> float | None:
        certificate = self.run.certificate
        return certificate.gap.value if certificate and certificate.gap else None

    @property
    def log(self) -> str:
        try:
            return self.run.log
        except ResultError as error:
            return str(error)


def entries(root: Path, pattern: str = "*") -> list[ReportEntry]:
    """Every run below a results folder, including failures, by theme, problem, method and key."""
    runs = [(run, False) for run in stored_runs(root, pattern)]
    runs += [(run, True) for run in failed_runs(root, pattern)]
    runs.sort(key=lambda pair: (pair[0].problem, pair[0].method or "", pair[0].path.as_posix()))
    differences = _differences([run for run, _ in runs])
    taken, found = set[str](), []
    for (run, failed), differing in zip(runs, differences, strict=True):
        anchor = f"{run.problem}/{run.key}{FAILED if failed else ''}"
        place = run.path.relative_to(root).as_posix()
        while anchor in taken:  # a copied folder has the same problem and key
            anchor += "'"
            differing["folder"] = place
        taken.add(anchor)
        about = theme(run.problem), _summary(run)
        found.append(ReportEntry(run, failed, anchor, place, *about, differing))
    return sorted(found, key=lambda entry: entry.theme)


def entry_of(run: Run) -> ReportEntry:
    """The entry of a single run."""
    failed = run.path.suffix == FAILED
    anchor = f"{run.problem}/{run.key}{FAILED if failed else ''}"
    return ReportEntry(run, failed, anchor, anchor, theme(run.problem), _summary(run))


def theme(problem: str) -> str:
    """The theme of a problem: the folders of its source file, or the first part of its name."""
    if problem in OWN_STUDIES:
        return "comparisons" if problem == COMPARISON else "sweeps"
    entry = registry().entries.get(problem)
    folders = entry.file.relative_to(entry.root).parts[:-1] if entry else ()
    parts = folders[:2] or problem.split("/")[:1]
    return ": ".join(part.replace("_", " ") for part in parts)


def _summary(run: Run) -> str:
    """One line about a run: its problem's help, or the size of a comparison."""
    if run.problem == SWEEP:
        over = run.info["parameters"].get("over")
        names = ", ".join(over) if isinstance(over, dict) else ""
        return f"{run.info['parameters'].get('problem', '')} over {names}"
    if run.problem != COMPARISON:
        entry = registry().entries.get(run.problem)
        return entry.summary if entry else ""
    counted = (("problems", "problem"), ("methods", "method"), ("accuracies", "accuracy level"))
    found = ((run.info["parameters"].get(name), noun) for name, noun in counted)
    return ", ".join(
        f"{len(values)} {noun}{'' if len(values) == 1 else 's'}"
        for values, noun in found
        if isinstance(values, list)
    )


def _differences(runs: Iterable[Run]) -> list[dict[str, str]]:
    """For each run, the parameters and options in which the runs of its problem differ."""
    asked = [(run.problem, _arguments_of(run)) for run in runs]
    groups = defaultdict[str, list[dict[str, str]]](list)
    for problem, one in asked:
        groups[problem].append(one)
    differ = {problem: _differing_names(group) for problem, group in groups.items()}
    return [
        {name: _short(one.get(name, "–")) for name in differ[problem]} for problem, one in asked
    ]


def _differing_names(group: list[dict[str, str]]) -> list[str]:
    names = dict.fromkeys(name for one in group for name in one)
    return [name for name in names if len({one.get(name) for one in group}) > 1]


def _arguments_of(run: Run) -> dict[str, str]:
    """Parameters and options of a run as texts."""
    options = {name: run.info["options"].get(name) for name in OPTIONS}
    return {name: text(value) for name, value in {**options, **run.info["parameters"]}.items()}


def _short(words: str) -> str:
    if not words:
        return '""'
    return words if len(words) <= LONGEST else words[: LONGEST - 1] + "…"


def searchable(entry: ReportEntry) -> str:
    """Text that the report's filter searches in addition to the run's row."""
    asked = " ".join(f"{name}={value}" for name, value in _arguments_of(entry.run).items())
    return f"{entry.summary} {asked}"[:400]


def as_json(differing: Mapping[str, str]) -> str:
    """Differing parameters as JSON for the script of the index page."""
    return json.dumps(differing, ensure_ascii=False)


def failed_runs(root: Path, pattern: str = "*") -> list[Run]:
    """The stored failures below a results folder whose problem fits a shell pattern."""
    aside = {root / PARTIAL, *(root / name for name in RESERVED if name not in OWN_STUDIES)}
    folders = (
        file.parent
        for file in sorted(root.rglob(f"*{FAILED}/{CHECKSUMS}"))
        if not aside.intersection(file.parents)
    )
    return runs_in(folders, pattern)


def places(shown: Iterable[ReportEntry]) -> dict[str, str]:
    """File names of the pages of finished runs by their keys, to link to them."""
    return {entry.run.key: entry.stem for entry in reversed(list(shown)) if not entry.failed}
