"""Make the technical report: values and figures from stored results, then a PDF by Typst.

Every number of the text is read here, from results/reference or from the page of benchmarks; the
text itself (report.typ) has none of them. `make report` does it.
"""

from __future__ import annotations

import json
import math
import re
import tempfile
from pathlib import Path
from typing import Any

import workbench as wb
from workbench.bench.comparison import counts, judged_cells

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
REFERENCE = ROOT / "results" / "reference"
BIBLIOGRAPHY = ROOT / "workbench" / "guidance" / "references.bib"
PROBLEMS = (
    "cd/claims",
    "cd/focus/controllers",
    "cd/radial/controllers",
    "cd/focus/fault-filter",
    "cd/focus/five-x",
    "cd/focus/mu-pid-analysis",
    "cd/focus/stadiums",
    "cd/focus/strategies",
    "cd/focus/switching-stability",
    "cd/focus/uncertainty-comparison",
    "cd/playability",
)
"""Problems whose metrics the text names."""
FIGURES = {
    "stadiums": ("cd/focus/stadiums", "plane-first-resonance"),
    "sizes": ("cd/focus/uncertainty-comparison", "sizes"),
    "mu": ("cd/focus/mu-pid-analysis", "one-x"),
    "switching": ("cd/focus/switching-stability", "figure-8-10"),
    "verdicts": ("cd/claims", "verdicts"),
}
"""Figures that are drawn from stored arrays, by the name that the text has for them."""
WIDE = ("mu", "switching", "verdicts")
"""Figures as wide as the page."""
CLAIMS = (
    "D-K iteration takes real uncertainties as complex",
    "The procedure finds the narrowest stadium",
    "Robust performance from w_p to z_p holds with parametric",
    "A mu-controller reduced to third order",
    "Parametric and complex uncertainty",
    "The narrowest stadium about a given centre",
    "A low bandwidth copes better",
    "In a defect the estimator runs by itself",
)
"""How items of the ledger begin that the report shows."""


def stored(problem: str) -> wb.Run:
    """The committed run of a problem that has one."""
    (folder,) = (REFERENCE / problem).iterdir()
    return wb.open_run(folder)


def table_rows(page: Path) -> list[list[str]]:
    """The cells of every table of a Markdown page, without heads and rules."""
    lines = [line for line in page.read_text(encoding="utf-8").splitlines() if line[:1] == "|"]
    rows = [[cell.strip() for cell in line.strip("|").split(" | ")] for line in lines]
    return [row for row in rows if not set("".join(row)) <= set("-: |")]


def ledger() -> list[dict[str, str]]:
    """The chosen items of the page about the thesis: what it says, what was found, the verdict."""
    rows = table_rows(ROOT / "docs" / "thesis.md")
    found = []
    for start in CLAIMS:
        some = [row for row in rows if len(row) == 5 and row[2].startswith(start)]
        if some:
            _, place, says, became, verdict = some[0]
            first = re.split(r"(?<=[.])\s", became)[0]
            found.append({"place": place, "says": says, "found": first, "verdict": verdict})
    return found


def values() -> dict[str, Any]:
    """Everything that the text reads."""
    metrics = {
        problem: {name: one for name, one in stored(problem).metrics.items() if math.isfinite(one)}
        for problem in PROBLEMS
    }
    (folder,) = (REFERENCE / "compare").iterdir()
    comparison = wb.open_run(folder)
    data = judged_cells(comparison.data)
    benchmarks = [row for row in table_rows(ROOT / "docs" / "benchmarks.md") if len(row) == 6]
    return {
        "version": wb.__version__,
        "metrics": metrics,
        "methods": {**counts(data), "problems": data.sizes["problem"]},
        "ledger": ledger(),
        "benchmarks": benchmarks[1:],
        "benchmark_heads": benchmarks[0],
        "problems": len(wb.problems("*")),
    }


def entries() -> str:
    """The bibliography, its formulas as letters: Typst reads no TeX in titles."""
    text = BIBLIOGRAPHY.read_text(encoding="utf-8")
    formulas = {r"{$H_\infty$}": "H-infinity", "{$H_2$}": "H2", r"{$\mu$}": "mu"}
    for formula, letters in formulas.items():
        text = text.replace(formula, letters)
    return text


def make(pdf: Path) -> Path:
    """Draw the figures, write the values, and compile the report."""
    try:
        import typst
    except ModuleNotFoundError:
        raise SystemExit("typst is missing: pip install 'robust-workbench[docs]'") from None

    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        for name, (problem, figure) in FIGURES.items():
            width = "page" if name in WIDE else 120.0
            drawn = stored(problem).figure(name=figure, width=width)
            (place / f"{name}.svg").write_bytes(drawn.svg)
        for name in ("study.svg", "benchmarks.svg"):
            (place / name).write_bytes((ROOT / "docs" / name).read_bytes())
        (place / "values.json").write_text(json.dumps(values()), encoding="utf-8")
        (place / "report.typ").write_bytes((HERE / "report.typ").read_bytes())
        (place / BIBLIOGRAPHY.name).write_text(entries(), encoding="utf-8")
        typst.compile(str(place / "report.typ"), output=str(pdf))
    return pdf


if __name__ == "__main__":
    make(HERE / "report.pdf")
