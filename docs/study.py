"""Write docs/study.md, which method to trust for what, from the comparison of all methods."""

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

import workbench as wb
from workbench._core.heavy_types import Dataset, Figure
from workbench._core.tables import markdown_table
from workbench.bench.comparison.layout import METHOD, NOT_COMPARED, cell_labels, command, tried
from workbench.bench.comparison.numbers import (
    badge,
    certified,
    certified_times,
    groups,
    shifted_mean,
)
from workbench.bench.comparison.profiles import performance_profile
from workbench.bench.comparison.styles import method_looks

ROOT = Path(__file__).parents[1]
KINDS = {
    "MuUpperBound": "D/G linear matrix inequalities (upper bounds of mu)",
    "MuLowerBound": "Lower bounds of mu",
    "HinfSynthesis": "H-infinity synthesis",
    "MuSynthesis": "Mu synthesis",
    "Implementation": "Controllers on a processor",
    "LoopController": "The CD drive's mu controllers",
    "MuPid": "The CD drive's mu PID controllers",
    "LowerBandwidth": "The CD drive's slower controllers",
    "NarrowestStadium": "Narrowest stadiums",
    "SmallestAreaStadium": "Stadiums of smallest area",
    "SmallestCircle": "Smallest circles",
    "StadiumCover": "Covers by stadiums",
    "CircleCover": "Covers by circles",
    "MagnitudeFit": "Magnitude fits",
    "ResponseFit": "Response fits",
    "RationalModelFit": "Rational models of responses",
    "FeedbackFromRecords": "Feedback from records, without a model",
    "SwitchedStability": "Dwell times of switched loops",
    "FaultEstimation": "Fault filters",
    "StateSpaceFit": "State-space models of records",
    "CrestFactor": "Crest factors",
    "ExperimentDesign": "Spectra for experiments",
}
"""What the Programs are, in the order of the page."""
SHOWN = ("clarabel", "cvxopt", "scs", "ipopt")
"""Solvers of many kinds of Programs, in the figure."""
SHIFT = 0.01
"""Shift of geometric means of times [s]."""


class Judged(NamedTuple):
    """A method on the problems of a kind: its cells, how many are certified, false claims, time.

    ``excess`` is how far its worst certified objective is above the best that any method found.
    """

    method: str
    cells: int
    certified: int
    wrong: int
    seconds: float
    excess: float

    @property
    def always(self) -> bool:
        return self.certified == self.cells


def stored() -> wb.Run:
    """The comparison that `make study` has left."""
    (folder,) = (ROOT / "results" / "reference" / "compare").iterdir()
    return wb.open_run(folder)


def judged(data: Dataset) -> list[Judged]:
    """Every method that can take a problem of the kind, the trusted ones first, by time."""
    here, good, wrong = tried(data), certified(data), data["verdict"].values == "wrong"
    times, above = certified_times(data)[1], excesses(data)
    found = []
    for j, name in enumerate(data[METHOD].values):
        if here[:, j].any():
            spent = times[:, j][np.isfinite(times[:, j])]
            counted = (int(part[:, j].sum()) for part in (here, good, wrong))
            mean = shifted_mean(spent, SHIFT) if spent.size else np.nan
            worst = float(np.max(above[:, j], where=np.isfinite(above[:, j]), initial=0.0))
            found.append(Judged(str(name), *counted, mean, worst))
    return sorted(found, key=lambda one: (-one.certified / one.cells, one.wrong, one.seconds))


def excesses(data: Dataset) -> np.ndarray:
    """Certified objectives above the problem's best one, over its scale; NaN for no such cell."""
    value = np.where(certified(data), data["objective"].values, np.nan)
    known = np.isfinite(value)
    best = np.min(np.where(known, value, np.inf), axis=(1, 2, 3), keepdims=True)
    scale = np.where(known, data["scale"].values, 1.0)
    return np.where(known, (value - np.where(known, best, 0.0)) / scale, np.nan)


def verdict(found: list[Judged]) -> str:
    """What follows for who has to choose."""
    trusted = [one for one in found if one.always]
    if trusted:
        named = ", ".join(f"`{one.method}` ({one.seconds:.2g} s)" for one in trusted)
        text = f"Certified in every cell: {named}."
    else:
        one = found[0]
        text = (
            f"No method is certified in every cell; `{one.method}` is in most, {one.certified} of "
            f"{one.cells}."
        )
    rest = [one for one in found if not one.always and one.cells]
    if trusted and rest:
        worst = rest[-1]
        text += f" The least: `{worst.method}`, {worst.certified} of {worst.cells}."
    false = [f"{one.wrong} by `{one.method}`" for one in found if one.wrong]
    return text + (f" False claims: {', '.join(false)}." if false else " No claim is false.")


def sections(data: Dataset) -> Iterator[str]:
    kinds = dict(groups(data))
    for program in sorted(kinds, key=lambda name: list(KINDS).index(name)):
        of_kind = kinds[program]
        found = judged(of_kind)
        rows = [
            [
                *(f"`{one.method}`", one.cells, one.certified, one.wrong),
                *(f"{one.seconds:.2g}", f"{one.excess:.1g}"),
            ]
            for one in found
        ]
        names = ", ".join(f"`{name}`" for name in of_kind["problem"].values)
        yield f"## {KINDS[program]}\n\n{verdict(found)}\n"
        heads = ["method", "cells", "certified", "false claims", "time [s]", "above the best"]
        yield markdown_table(heads, rows)
        yield f"Problems: {names}.\n"
        unasked = (of_kind["outcome"].values == NOT_COMPARED).any(axis=(0, 2, 3))
        if unasked.any():
            named = ", ".join(f"`{name}`" for name in of_kind[METHOD].values[unasked])
            yield f"Not compared, as it was never the best (ask by name): {named}.\n"


def false_claims(data: Dataset) -> Iterator[str]:
    """What a solver's maintainers could use: the cell, what is wrong, and how to repeat it."""
    for place in zip(*np.nonzero(data["verdict"].values == "wrong"), strict=True):
        problem, method, level = cell_labels(data, tuple(map(int, place)))
        told = dict.fromkeys(str(data[name].values[place]) for name in ("reason", "message"))
        yield f"- `{problem}` by `{method}`, {level}: {'; '.join(filter(None, told))}"
        yield f"  `{command(data, tuple(map(int, place)))}`"


def page(run: wb.Run) -> str:
    """The page as the stored comparison gives it."""
    data = run.data
    versions = ", ".join(f"{name} {version}" for name, version in run.info["versions"].items())
    limit = float(data.attrs["time_limit"])
    parts = [
        "# Which method to trust\n",
        f"Every method was run on the {data.sizes['problem']} problems of the workbench that have "
        f"methods and are not marked slow, at three accuracy levels, with {limit:g} s for each "
        f"cell (one method on one problem at one level): {badge(data)}. A cell is certified if the "
        "checks of the problem hold and, for a method that claims the optimum, the gap is below "
        "the tolerance; what a solver says about itself does not count. Times are shifted "
        "geometric means over certified cells, for stating and solving the problem. The last "
        "column is the relative distance of a method's worst certified answer from the best "
        "answer of all methods: where no bound on the optimum is known, a certified answer may "
        "still be poor. There are few problems of each kind, so compare orders of magnitude only. "
        "`make study` makes this page anew.\n",
        "![Share of problems that a solver has certified within a multiple of the fastest "
        "method's time](study.svg)\n",
        *sections(data),
        "## False claims\n",
        "Each claim below is refuted by the certificate. The command repeats it:\n",
        "\n".join(false_claims(data)) or "None.",
        "",
        f"Made with {versions}.\n",
    ]
    return "\n".join(parts)


def profile(run: wb.Run) -> Figure:
    """The performance profile of the solvers that serve most kinds of Programs."""
    names = [str(name) for name in run.data[METHOD].values]
    chosen = run.data.isel({METHOD: [names.index(name) for name in SHOWN]})
    return performance_profile(chosen, method_looks(chosen))


if __name__ == "__main__":
    from workbench.figures.formats import svg

    found = stored()
    Path(__file__).with_suffix(".md").write_text(page(found), encoding="utf-8")
    Path(__file__).with_suffix(".svg").write_bytes(svg(profile(found)))
