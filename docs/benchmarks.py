"""Write docs/benchmarks.md, the workbench beside its peers, from runs of bench/* (`make bench`)."""

from __future__ import annotations

import importlib.metadata
import importlib.util
import os
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import psutil

import workbench as wb
from workbench import figures
from workbench._core.heavy_types import Dataset, Figure
from workbench._core.tables import markdown_table

ROOT = Path(__file__).parents[1]
RESULTS = ROOT / "results" / "bench"
"""Where the runs stand; they are not committed."""
PEERS = {
    "slycot": "SLICOT through slycot: AB13MD, AB13DD, SB10AD",
    "control": "python-control: hinfsyn, linfnorm",
    "cvxpy": "CVXPY with Clarabel",
    "clarabel": "Clarabel",
    "shapely": "shapely: bounding circles by GEOS",
    "dkpy": "dkpy: D-K iteration",
    "sippy_unipi": "SIPPY: subspace identification",
}
"""Distributions of the peers, and what they are compared in."""
OPTIONAL = {"dkpy": "pip install dkpy==0.1.9", "sippy_unipi": "pip install sippy_unipi==1.0.1"}
"""Peers that are no dependency of the workbench, and how to install them."""
PROBLEMS = ("mu", "norms", "synthesis", "geometry", "covers", "cd-arm")
"""Problems below bench/ that the page is made from."""
HEADS = ["what is computed", "size", "peer", "peer's time", "workbench's time", "times faster"]


class Row(NamedTuple):
    """A task by both, their times [s]; ``note`` stands in place of times that are not known."""

    task: str
    size: str
    peer: str
    theirs: float = np.nan
    ours: float = np.nan
    note: str = ""

    def cells(self) -> list[str]:
        if self.note:
            return [self.task, self.size, self.peer, self.note, "", ""]
        ratio = self.theirs / self.ours
        shown = f"{ratio:,.0f}" if ratio >= 100 else f"{ratio:.2g}"
        return [self.task, self.size, self.peer, *map(seconds, (self.theirs, self.ours)), shown]


def seconds(time: float) -> str:
    """A time [s] with its unit."""
    for limit, factor, unit in ((1e-3, 1e6, "us"), (1.0, 1e3, "ms")):
        if time < limit:
            return f"{time * factor:.3g} {unit}"
    return f"{time:.3g} s"


def missing(peer: str) -> str:
    """What a row says of a peer that is not installed; empty where it is."""
    return "" if importlib.util.find_spec(peer) else f"not installed: `{OPTIONAL[peer]}`"


# --- the runs --------------------------------------------------------------------------------


def run_all() -> dict[str, wb.Run]:
    """Every benchmark, one after the other; what needs a peer that is missing is left out."""
    found = {}
    for name in PROBLEMS:
        if name == "cd-arm" and missing("sippy_unipi"):
            continue
        parameters = {"distillation": False} if name == "synthesis" and missing("dkpy") else {}
        print(f"bench/{name}", flush=True)
        found[name] = wb.run(f"bench/{name}", fresh=True, **parameters)
    return found


def stored() -> dict[str, wb.Run]:
    """The newest run of each problem that an earlier `make bench` has left.

    Runs that miss a limit of speed are among them: their ratios are as true as the others.
    """
    found: dict[str, wb.Run] = {}
    for name in PROBLEMS:
        folders = (RESULTS / "bench" / name).glob("*")
        runs = [wb.open_run(folder) for folder in folders if (folder / "run.json").exists()]
        if runs:
            found[name] = max(runs, key=lambda one: str(one.info["started"]))
    return found


# --- the rows --------------------------------------------------------------------------------


def of_mu(data: Dataset) -> Iterator[Row]:
    time = data["seconds"]
    named = {"ab13md": "SLICOT AB13MD", "clarabel": "CVXPY, Clarabel"}
    for peer, name in named.items():
        for size in time["size"].values.tolist():
            one = time.sel(size=size)
            yield Row(
                "upper bound of mixed mu",
                f"{size} x {size}",
                name,
                *(float(one.sel(by=by)) for by in (peer, "fast")),
            )
    peak = data["peak"]
    ratio = (peak.sel(what="peak") / peak.sel(what="ab13md")).values
    slowest = peak.isel(system=int(ratio.argmax()))
    yield Row(
        "peak of mixed mu, proven",
        "20 states",
        "SLICOT AB13MD",
        *(float(slowest.sel(what=what)) for what in ("ab13md", "peak")),
    )


def of_norms(data: Dataset) -> Iterator[Row]:
    for states in (40, 120):
        times = data["seconds"].sel(case=f"norm, {states} states")
        yield Row(
            "H-infinity norm, proven",
            f"{states} states",
            "SLICOT AB13DD",
            *(float(times.sel(step=step)) for step in ("yardstick", "workbench")),
        )


def of_synthesis(data: Dataset) -> Iterator[Row]:
    for group, mean in grouped(data).items():
        yield Row("H-infinity controller, certified", group, "hinfsyn", *mean)
    if "dk_seconds" in data:
        times = data["dk_seconds"]
        yield Row(
            "D-K iteration, peak proven",
            "distillation column",
            "dkpy",
            *(float(times.sel(package=package)) for package in ("dkpy", "workbench")),
        )
    else:
        yield Row("D-K iteration", "distillation column", "dkpy", note=missing("dkpy"))


def grouped(data: Dataset) -> dict[str, tuple[float, float]]:
    """Geometric means of the times [s] of hinfsyn and of ours, by group of plants."""
    groups = data["group"].values
    logs = np.log(data["seconds"].sel(by=["hinfsyn", "workbench"]).values)
    return {
        str(group): tuple(np.exp(logs[groups == group].mean(axis=0)).tolist())
        for group in dict.fromkeys(groups.tolist())
    }


def of_geometry(data: Dataset) -> Iterator[Row]:
    pairs = {
        "smallest circles of 1,000 sets": ("exact circles", "12 points", "conic circles"),
        "narrowest stadiums of 1,000 sets": ("exact stadiums", "12 points", "conic stadiums"),
        "smallest circles, one by one": ("exact circles", "12 points", "shapely circles"),
        "smallest circle": ("exact large circle", "1,000,000 points", "shapely large circle"),
    }
    for task, (own, size, peer) in pairs.items():
        name = "shapely" if "shapely" in peer else "CVXPY, Clarabel"
        yield Row(task, size, name, *(float(data["seconds"].sel(task=one)) for one in (peer, own)))


def of_covers(data: Dataset) -> Iterator[Row]:
    own, peer, *_ = (float(one) for one in data["seconds"].values)
    size = f"12 x {data.sizes['frequency']} points"
    yield Row("cover by stadiums", size, "CVXPY, Clarabel", peer, own)


def rows(runs: Mapping[str, wb.Run]) -> list[Row]:
    """All rows of times, in the order of the page."""
    makers = {
        "mu": of_mu,
        "norms": of_norms,
        "synthesis": of_synthesis,
        "geometry": of_geometry,
        "covers": of_covers,
    }
    return [row for name, of in makers.items() if name in runs for row in of(runs[name].data)]


def fits(runs: Mapping[str, wb.Run]) -> str:
    """The table of fits beside those of SIPPY, or how to install it."""
    if "cd-arm" not in runs:
        return f"SIPPY is {missing('sippy_unipi') or 'installed, but was not run'}.\n"
    fit = runs["cd-arm"].data["fit"]
    uses = {"one_step": "one step ahead", "free_run": "free run"}
    cells = [
        [uses[use], output]
        + [
            f"{float(fit.sel(package=one, use=use, output=output)):.1f}"
            for one in fit["package"].values
        ]
        for use in fit["use"].values.tolist()
        for output in fit["output"].values.tolist()
    ]
    return markdown_table(["use", "output", "workbench [%]", "SIPPY [%]"], cells)


# --- the figure ------------------------------------------------------------------------------


def growth(runs: Mapping[str, wb.Run]) -> Figure:
    """How times grow with the size of a matrix, the frequencies and the states, beside peers."""
    figure, (sizes, counts, states) = figures.axes(1, 3, size=(10.5, 3.8))
    looks = {"fast": ("workbench", figures.BLUE, "o-"), "ab13md": ("AB13MD", figures.ORANGE, "s--")}
    looks["clarabel"] = ("CVXPY, Clarabel", figures.GREEN, "^:")
    mu = runs["mu"].data
    time = mu["seconds"]
    for name, (label, colour, style) in looks.items():
        sizes.plot(time["size"], time.sel(by=name), style, color=colour, label=label)
    figures.label(sizes, x="size of the matrix", y="time per matrix [s]", log="xy")
    sizes.set_xticks(time["size"].values, map(str, time["size"].values), minor=False)
    sizes.minorticks_off()
    count = mu["count"].values
    counts.plot(count, mu["growth"], "o-", color=figures.BLUE)
    for name in ("ab13md", "clarabel"):  # they take one matrix at a time
        _, colour, style = looks[name]
        counts.plot(count, count * float(time.sel(by=name, size=4)), style[1:], color=colour)
    figures.label(counts, x=r"frequencies, $4 \times 4$", y="time of all [s]", log="xy")
    found = {
        int(group.split()[0]): pair
        for group, pair in grouped(runs["synthesis"].data).items()
        if group.endswith("states")
    }
    theirs, ours = np.array([found[size] for size in found]).T
    states.plot(list(found), ours, "o-", color=figures.BLUE, label="workbench")
    states.plot(list(found), theirs, "v-.", color=figures.PURPLE, label="hinfsyn")
    figures.label(states, x="states, H-infinity controller", y="time [s]", log="xy")
    states.set_xticks(list(found), map(str, found), minor=False)
    states.minorticks_off()
    figures.legend_below(figure, sizes, columns=3)
    states.legend()
    return figure


# --- the page --------------------------------------------------------------------------------


def version_of(peer: str) -> str:
    try:
        return importlib.metadata.version(peer)
    except importlib.metadata.PackageNotFoundError:
        return missing(peer)


def page(runs: Mapping[str, wb.Run]) -> str:
    """The page as the runs give it."""
    info: Mapping[str, Any] = next(iter(runs.values())).info
    names = [[PEERS[peer], version_of(peer)] for peer in PEERS]
    parts = [
        "# Beside other tools\n",
        "`make bench` runs named problems `bench/*` and writes this page. Each row compares "
        "the workbench with another tool on the same data, in one run, on one machine. Both take "
        "turns, and the shortest or the median of several times counts. On your machine the times "
        "differ, and the ratios should be similar. The answers of both are compared as well; a row "
        "is shown only if they agree, or if the workbench's bound is the better one.\n",
        "Most times of the workbench contain a proof, and those of the other tools do not. A "
        "proven norm or peak holds at every frequency, rounding included. AB13DD gives no error "
        "bound; AB13MD bounds mu at 1,000 frequencies. The workbench's D-K iteration continues "
        "until its proven peak is at most 0.975; dkpy ends with 1.036, and with 1.025 after six "
        "iterations with orders up to 4 that it finds by itself; its documentation reaches 1.0144. "
        "A ratio below 1 means that the other tool is faster.\n",
        markdown_table(HEADS, [row.cells() for row in rows(runs)]),
        "## How times grow\n",
        "![Times over the size of a matrix, the number of frequencies and the number of states]"
        "(benchmarks.svg)\n",
        "*Left: time for the upper bound of mixed mu of one matrix. Middle: time for all matrices "
        "of a frequency sweep; the other tools take one matrix at a time, so their lines are their "
        "time for one matrix, times the number of frequencies. Right: time for an H-infinity "
        "controller for random plants, geometric mean; the workbench's controllers are "
        "certified.*\n",
        "## Fits of a measured record\n",
        "Models of the CD-player arm (a public record), chosen alike from both packages on the "
        "first half and judged on the second. A fit is 100 % where the model explains "
        "everything.\n",
        fits(runs),
        "## Versions\n",
        markdown_table(["tool", "version"], [["workbench", wb.__version__], *names]),
        f"Python {info['versions']['python']}, {info['started'][:10]}, on {psutil.cpu_count()} "
        f"cores with a load of {psutil.getloadavg()[0]:.0f}. A load above the number of cores "
        "distorts the ratios of calls that take a few milliseconds.\n",
    ]
    return "\n".join(parts)


if __name__ == "__main__":
    from workbench.figures.formats import svg

    os.environ["WORKBENCH_RESULTS"] = str(RESULTS)
    found = stored() if "--stored" in sys.argv else run_all()
    Path(__file__).with_suffix(".md").write_text(page(found), encoding="utf-8")
    Path(__file__).with_suffix(".svg").write_bytes(svg(growth(found)))
