"""A results folder, written and read.

run.json                 the question, who answered it, with what, how long it took
certificate.json  metrics.json
data.nc                  every array, labelled, with units
figures/*.svg, *.png
ro-crate-metadata.json   the folder as a Process Run Crate
log.txt  SHA256SUMS
"""

from __future__ import annotations

import fnmatch
import html
import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from workbench.bench.question import plain
from workbench.bench.store import Store, damage
from workbench.errors import ResultError
from workbench.program import Certificate
from workbench.solvers import Outcome

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

FORMAT = 1


@dataclass(frozen=True)
class Run:
    """A finished run, read from its folder when asked.

    ``reused`` tells that the answer was there before, ``note`` what else there is to say of that.
    """

    path: Path
    reused: bool = False
    note: str = ""

    @cached_property
    def info(self) -> dict[str, Any]:
        """Content of run.json."""
        return read_json(self.path / "run.json")

    @property
    def problem(self) -> str:
        return str(self.info["problem"])

    @property
    def method(self) -> str | None:
        return self.info["method"]

    @property
    def key(self) -> str:
        return str(self.info["key"])

    @property
    def outcome(self) -> Outcome:
        return Outcome(self.info["outcome"])

    @property
    def seconds(self) -> dict[str, float]:
        """Wall time by part: statement, solve, check, total [s].

        ``earlier`` is what runs took that were stopped, where this one went on from theirs.
        """
        return dict(self.info["seconds"])

    @cached_property
    def certificate(self) -> Certificate | None:
        """What was checked, against what, and by how much it holds; None without an answer."""
        file = self.path / "certificate.json"
        return Certificate.from_json(read_json(file)) if file.exists() else None

    @property
    def holds(self) -> bool:
        """The certificate holds, and the answer is not just the best so far."""
        certified = self.certificate is not None and self.certificate.holds
        return certified and not self.best_so_far

    @property
    def best_so_far(self) -> bool:
        """There is a valid answer, of a method that the clock stopped."""
        return self.outcome is Outcome.TIME_LIMIT and self.certificate is not None

    @cached_property
    def metrics(self) -> dict[str, float]:
        """The numbers people quote."""
        file = self.path / "metrics.json"
        stored = read_json(file) if file.exists() else {}
        return {name: float(value) for name, value in stored.items()}  # "nan" is a number too

    @property
    def headline(self) -> str:
        """The key metric, as text."""
        name = self.info["headline"]
        return f"{name} {self.metrics[name]:.4g}" if name in self.metrics else "-"

    @cached_property
    def data(self) -> xr.Dataset:
        """Every array, labelled."""
        from workbench.bench import netcdf

        return netcdf.read(self.path / "data.nc")

    @property
    def figures(self) -> dict[str, Path]:
        """PNG files by name, the one that people look at first."""
        return {name: self.path / "figures" / f"{name}.png" for name in self.info["figures"]}

    @property
    def tables(self) -> dict[str, str]:
        """Tables in Markdown by name."""
        files = sorted(self.path.glob("*.md"))
        return {file.stem: file.read_text(encoding="utf-8") for file in files}

    @property
    def log(self) -> str:
        return (self.path / "log.txt").read_text(encoding="utf-8")

    def show(self, figure: str | None = None) -> Picture:
        """The figure that people look at (default: the first), as an image for a notebook."""
        if not self.figures:
            raise ResultError(f"{self.problem} made no figure")
        name = figure or next(iter(self.figures))
        if name not in self.figures:
            raise ResultError(f"no figure {name!r} here; there are {', '.join(self.figures)}")
        return Picture(self.figures[name])

    def __repr__(self) -> str:
        method = f" by {self.method}" if self.method else ""
        return f"<Run {self.problem}{method}: {self.outcome}, {self.headline}, {self.path}>"

    def _repr_html_(self) -> str:
        rows: list[tuple[str, str]] = [("outcome", self.outcome), ("method", self.method or "-")]
        rows += [(name, f"{value:.6g}") for name, value in self.metrics.items()]
        if self.certificate is not None:
            rows += [
                (check.name, f"{check.value:.3g} &le; {check.limit:.3g}")
                for check in self.certificate.checks
            ]
            if self.certificate.gap is not None:
                rows.append(("optimality gap", f"{self.certificate.gap.value:.3g}"))
        cells = "".join(
            f"<tr><th style='text-align:left'>{html.escape(name)}</th><td>{value}</td></tr>"
            for name, value in rows
        )
        title = html.escape(f"{self.problem}  {self.key}")
        return f"<table><caption><b>{title}</b></caption>{cells}</table>"


@dataclass(frozen=True)
class Picture:
    """A PNG file that a notebook shows."""

    path: Path

    def _repr_png_(self) -> bytes:
        return self.path.read_bytes()


def open_run(path: str | Path) -> Run:
    """The run in a folder.

    Raises
    ------
    ResultError
        The folder is no results folder.
    """
    path = Path(path)
    if not (path / "run.json").is_file():
        raise ResultError(f"{path} is no results folder: it has no run.json")
    return Run(path)


def read_json(file: Path) -> Any:
    try:
        return json.loads(file.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise ResultError(f"{file.name} is missing in {file.parent}") from None
    except ValueError as error:
        raise ResultError(f"{file.name} is no JSON: {error}") from None


def write_json(file: Path, content: Mapping[str, Any]) -> None:
    text = json.dumps(plain(content), indent=2, allow_nan=False)
    file.write_text(text + "\n", encoding="utf-8")


def write_figures(folder: Path, figures: Mapping[str, Figure]) -> list[str]:
    """Every figure as SVG and PNG, and their names; the same figure gives the same file."""
    import matplotlib as mpl

    folder.mkdir()
    with mpl.rc_context({"svg.hashsalt": "workbench"}):
        for name, figure in figures.items():
            figure.savefig(folder / f"{name}.svg", metadata={"Date": None})
            figure.savefig(folder / f"{name}.png", dpi=120, metadata={"Software": None})
    return list(figures)


def stored_runs(root: Path, pattern: str = "*") -> list[Run]:
    """The finished, undamaged runs below a results folder whose problem fits a shell pattern."""
    runs = (Run(folder) for folder in Store(root).folders() if not damage(folder))
    return [run for run in runs if fnmatch.fnmatchcase(run.problem, pattern)]


def damaged(root: Path) -> dict[Path, str]:
    """The folders below a results folder that are not as they were sealed, and what differs."""
    found = {folder: damage(folder) for folder in Store(root).folders()}
    return {folder: "; ".join(wrong) for folder, wrong in found.items() if wrong}
