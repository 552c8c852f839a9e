"""Tables of the results of `judge`: fits of each package, and how far ours are from the best.

python -m problems.bench.records.summary problems/bench/records/results.csv
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from workbench.errors import InputError
from workbench.identification.state_space.identified import USES
from workbench.study import markdown_table
from workbench.types import RealArray

OURS = "workbench"
NONLINEAR = "SysIdentPy, nonlinear"
NEAR = 0.5
"""Distance [percentage points] below the best peer that still counts as level with it."""
FAR = 2.0
"""Largest accepted distance [percentage points] of ours below the best peer."""


@dataclass(frozen=True)
class Cell:
    """Mean fits over outputs [%] of the packages, for one record and one use."""

    record: str
    use: str
    fits: dict[str, float]

    def ahead(self, nonlinear: bool, package: str = OURS) -> float:
        """Fit of a package minus that of the best of the others, in percentage points.

        `nonlinear` says whether nonlinear models are among the others. A package without a model
        has minus infinity.
        """
        others = [
            fit
            for other, fit in self.fits.items()
            if other != package and (nonlinear or other != NONLINEAR) and np.isfinite(fit)
        ]
        own = self.fits.get(package, np.nan)
        return own - max(others) if np.isfinite(own) else -np.inf


def cells(results: Path) -> list[Cell]:
    """The cells of a file of results, or of all files in a folder. Raises InputError if there is
    none.
    """
    import pandas as pd

    files = sorted(results.glob("*.csv")) if results.is_dir() else [results]
    if not files or not files[0].is_file():
        raise InputError(f"no results in {results}; make some with problems.bench.records.judge")
    table = pd.concat([pd.read_csv(file) for file in files])
    fits: dict[tuple[str, str], dict[str, float]] = {}
    for (record, use, package), part in table.groupby(["record", "use", "package"], sort=False):
        fits.setdefault((record, use), {})[package] = float(np.mean(part["fit"].to_numpy()))
    return [
        Cell(*key, fits[key]) for record in table["record"].unique() for key in _keys_of(record)
    ]


def _keys_of(record: str) -> list[tuple[str, str]]:
    return [(record, use) for use in USES]


def fits_table(found: list[Cell]) -> str:
    """Fits of all packages and distances from the best, in Markdown."""
    packages = list(dict.fromkeys(package for cell in found for package in cell.fits))
    rows = [
        [
            cell.record,
            cell.use.replace("_", " "),
            *(_points_or_dash(cell.fits.get(package, np.nan)) for package in packages),
            f"{cell.ahead(False):+.2f}",
            f"{cell.ahead(True):+.2f}",
        ]
        for cell in found
    ]
    return markdown_table(["record", "use", *packages, "ahead of linear", "ahead of all"], rows)


def _points_or_dash(fit: float) -> str:
    return f"{fit:.2f}" if np.isfinite(fit) else "-"


def verdict(found: list[Cell], nonlinear: bool) -> str:
    """Number of cells in which ours are level with the best peer or ahead, and the worst cell."""
    ahead = np.array([cell.ahead(nonlinear) for cell in found])
    kind = "all peers" if nonlinear else "linear peers"
    return (
        f"{kind}: level within {NEAR} points or ahead in {(ahead >= -NEAR).sum()} of {len(found)} "
        f"({100 * (ahead >= -NEAR).mean():.0f} %); more than {FAR:g} points below in "
        f"{(ahead < -FAR).sum()}; worst {_worst(found, ahead)}"
    )


def _worst(found: list[Cell], ahead: RealArray) -> str:
    """The smallest lead over all cells, and the cell that has it."""
    place = int(ahead.argmin())
    cell = found[place]
    return f"{ahead[place]:+.2f} ({cell.record}, {cell.use.replace('_', ' ')})"


def standings(found: list[Cell]) -> str:
    """Every package against the best of the others, in Markdown, by the same measure for all."""
    rows = []
    for package in dict.fromkeys(package for cell in found for package in cell.fits):
        ahead = np.array([cell.ahead(True, package) for cell in found])
        known = np.isfinite(ahead)
        rows.append(
            [
                package,
                f"{100 * (ahead >= -NEAR).mean():.0f} %",
                str(int((ahead < -FAR).sum())),
                f"{np.median(ahead):+.2f}",
                _worst(found, np.where(known, ahead, np.inf)),
                str(int((~known).sum())),
            ]
        )
    titles = [
        "package", f"level within {NEAR} points or ahead", f"more than {FAR:g} points below",
        "median distance", "worst", "without a model",
    ]  # fmt: skip
    return markdown_table(titles, rows)


def duels(found: list[Cell]) -> str:
    """Ours against each package alone, in Markdown; a cell in which it has no model
    counts as won.
    """
    rows = []
    for package in dict.fromkeys(package for cell in found for package in cell.fits):
        if package == OURS:
            continue
        ahead = np.array(
            [cell.fits[OURS] - cell.fits.get(package, np.nan) for cell in found], dtype=float
        )
        known = np.isfinite(ahead)
        level = ~(ahead < -NEAR)
        shares = [level[[cell.use == use for cell in found]].mean() for use in USES]
        rows.append(
            [
                package,
                *(f"{100 * share:.0f} %" for share in (*shares, level.mean())),
                str(int((ahead[known] < -FAR).sum())),
                f"{np.median(ahead[known]):+.2f}",
                _worst(found, np.where(known, ahead, np.inf)),
            ]
        )
    uses = [use.replace("_", " ") for use in USES]
    titles = ["beside", *uses, "both", f"more than {FAR:g} points below", "median", "worst"]
    return markdown_table(titles, rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("results", type=Path, help="what judge has written: a folder, or one file")
    found = cells(parser.parse_args().results)
    print(fits_table(found))
    for use in USES:
        part = [cell for cell in found if cell.use == use]
        for nonlinear in (False, True):
            print(f"{use.replace('_', ' ')}, {verdict(part, nonlinear)}")
    for nonlinear in (False, True):
        print(f"both uses, {verdict(found, nonlinear)}")
    print(f"\nOurs level within {NEAR} points or ahead of each package, in {len(found)} cells:\n")
    print(duels(found))
    print(f"\nEvery package beside the best of the others, in {len(found)} cells:\n")
    print(standings(found))


if __name__ == "__main__":
    main()
