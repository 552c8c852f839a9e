"""Tables of what `judge` has written: fits of each package, and how far ours are from the best.

python -m problems.bench.records.summary RESULTS/judged
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from workbench.errors import InputError
from workbench.tables import markdown

OURS = "workbench"
NONLINEAR = "SysIdentPy, nonlinear"
NEAR = 0.5
"""Points [%] below the best peer that still count as level with it."""
FAR = 2.0
"""Points [%] that ours may be below the best peer at most."""


@dataclass(frozen=True)
class Cell:
    """Mean fits over outputs [%] of the packages, for one record and one use."""

    record: str
    use: str
    fits: dict[str, float]

    def ahead(self, nonlinear: bool) -> float:
        """Our fit less that of the best peer, in points; nonlinear models are peers or not."""
        others = [
            fit
            for package, fit in self.fits.items()
            if package != OURS and (nonlinear or package != NONLINEAR) and np.isfinite(fit)
        ]
        return self.fits[OURS] - max(others)


def cells(folder: Path) -> list[Cell]:
    """The cells of all files of results in a folder; raises InputError where there is none."""
    found = [cell for path in sorted(folder.glob("*.csv")) for cell in _cells_of(path)]
    if not found:
        raise InputError(f"no results in {folder}; make some with problems.bench.records.judge")
    return found


def _cells_of(path: Path) -> Iterator[Cell]:
    import pandas as pd

    table = pd.read_csv(path)
    means = table.groupby(["use", "package"], sort=False)["fit"].mean().unstack()
    for use in ("one_step", "free_run"):
        yield Cell(path.stem, use, {str(k): float(v) for k, v in means.loc[use].items()})


def fits_table(found: list[Cell]) -> str:
    """Fits of all packages and the distances, in Markdown."""
    packages = list(dict.fromkeys(package for cell in found for package in cell.fits))
    rows = [
        [
            cell.record,
            cell.use.replace("_", " "),
            *(_told(cell.fits.get(package, np.nan)) for package in packages),
            f"{cell.ahead(False):+.2f}",
            f"{cell.ahead(True):+.2f}",
        ]
        for cell in found
    ]
    return markdown(["record", "use", *packages, "ahead of linear", "ahead of all"], rows)


def _told(fit: float) -> str:
    return f"{fit:.2f}" if np.isfinite(fit) else "-"


def verdict(found: list[Cell], nonlinear: bool) -> str:
    """In how many cells ours are level with the best peer or ahead, and where they are farthest."""
    ahead = np.array([cell.ahead(nonlinear) for cell in found])
    worst = found[int(ahead.argmin())]
    kind = "all peers" if nonlinear else "linear peers"
    return (
        f"{kind}: level within {NEAR} points or ahead in {(ahead >= -NEAR).sum()} of {len(found)} "
        f"({100 * (ahead >= -NEAR).mean():.0f} %); more than {FAR:g} points below in "
        f"{(ahead < -FAR).sum()}; worst {ahead.min():+.2f} ({worst.record}, "
        f"{worst.use.replace('_', ' ')})"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="results of judge")
    found = cells(parser.parse_args().folder)
    print(fits_table(found))
    for use in ("one_step", "free_run"):
        part = [cell for cell in found if cell.use == use]
        for nonlinear in (False, True):
            print(f"{use.replace('_', ' ')}, {verdict(part, nonlinear)}")
    for nonlinear in (False, True):
        print(f"both uses, {verdict(found, nonlinear)}")


if __name__ == "__main__":
    main()
