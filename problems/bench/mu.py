"""How fast the upper bound of mu is, against SLICOT AB13MD and CVXPY with Clarabel."""

from __future__ import annotations

import time
import tracemalloc
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from workbench import Check, Options, Study, figures, problem
from workbench.executor import WALL_TIME, Context
from workbench.heavy_types import Dataset, Figure, StateSpace
from workbench.mu import peak, upper_bound
from workbench.structure import Block, Complex, Full, Real, Structure
from workbench.systems.generalised_plant import response

CASES: dict[int, tuple[Block, ...]] = {
    3: (Real(1), Complex(1), Complex(1)),
    4: (Real(1), Complex(1), Full(2, 2)),
    6: (Real(1), Real(1), Full(2, 2), Full(2, 2)),
    10: (*[Real(1)] * 3, *[Complex(1)] * 3, Full(2, 2), Full(2, 2)),
    20: (*[Real(1)] * 6, *[Complex(1)] * 6, Full(4, 4), Full(4, 4)),
}
"""Structures that AB13MD takes, by size."""
PEERS = {
    "ab13md": ("ab13md", 1),
    "clarabel": ("clarabel", 1),
    "clarabel_once": ("clarabel", None),
}
"""Method of each peer, and how many matrices it is given at a time; None: all."""
WANTED = {"ab13md": {3: 5.0, 4: 10.0, 6: 5.0, 10: 5.0, 20: 5.0}, "clarabel": {4: 500.0}}
"""Least ratio asked for: how many times faster than the peer, per matrix, the batch must be."""
ABOVE = {"ab13md": 1e-6, "clarabel": 1e-5, "clarabel_once": 1e-5}
"""Largest excess over the peer's bound asked for, relative."""
REPEATS = 3
SYSTEMS, STATES, POINTS = 3, 20, 1000
"""Random systems whose certified peak is timed, and at how many frequencies AB13MD is."""


@problem("bench/mu", slow=True)
def mu(
    frequencies: Annotated[int, Field(ge=10)] = 1000,
    peers: Annotated[int, Field(ge=1)] = 20,
    most: Annotated[int, Field(ge=10)] = 100_000,
    largest: Annotated[int, Field(ge=3)] = 20,
) -> MuSpeed:
    """Speed of the mixed-mu upper bound: ratios to SLICOT AB13MD and to CVXPY with Clarabel.

    Smooth frequency responses of sizes 3, 4, 6, 10 and 20, up to the largest asked for. The peers,
    which take one matrix at a time, get that many of the frequencies, evenly spread; CVXPY states
    its program anew at each, and beside that once for all. The 4x4 case is also solved at ever more
    frequencies, ten times more each, to the most. One certified peak over all frequencies of a 4x4
    system of 20 states is timed against AB13MD at 1,000 of them.
    """
    return MuSpeed(frequencies, peers, most, largest)


@dataclass(frozen=True)
class MuSpeed(Study):
    """Times of the batch and of its peers, taken in one run on the same matrices."""

    frequencies: int
    peers: int
    most: int
    largest: int

    headline: ClassVar[str] = "ab13md_4"

    def compute(self, context: Context) -> Dataset:
        import xarray as xr

        sizes = [size for size in CASES if size <= self.largest]
        names = ["fast", *PEERS]
        seconds = np.full((len(names), len(sizes)), np.nan)
        above = np.full((len(names), len(sizes)), np.nan)
        for column, size in enumerate(context.track(sizes, "sizes")):
            M = smooth_responses(context.rng, size, self.frequencies)
            structure = Structure(CASES[size])
            upper_bound(M[:1], structure)  # compile before the clock starts
            best, bound = _timed(partial(upper_bound, M, structure), REPEATS)
            seconds[0, column], above[0, column] = best / len(M), 0.0
            # A peer's matrices: evenly spread, fewer of those that cost seconds each.
            count = max(1, min(self.peers, len(M)) // (10 if size > 10 else 1))
            some = np.linspace(0, len(M) - 1, count).astype(int)
            for row, peer in enumerate(PEERS.values(), start=1):
                best, value = _timed(partial(_by_peer, M[some], structure, *peer), 1)
                seconds[row, column] = best / len(some)
                above[row, column] = np.max(bound.value[some] / value - 1)
        counts = [10**k for k in range(1, 7) if 10**k <= self.most]
        growth, memory = np.zeros((2, len(counts)))
        structure = Structure(CASES[4])
        for row, count in enumerate(context.track(counts, "frequencies")):
            M = smooth_responses(context.rng, 4, count)
            growth[row], _ = _timed(partial(upper_bound, M, structure), 1)
            tracemalloc.start()  # slows what it watches, so not on the clock
            upper_bound(M, structure)
            memory[row] = tracemalloc.get_traced_memory()[1]
            tracemalloc.stop()
        peaks = [_peak_seconds(context.rng) for _ in context.track(range(SYSTEMS), "peaks")]
        time_units = {"units": "s"} | WALL_TIME
        return xr.Dataset(
            {
                "seconds": (("by", "size"), seconds, time_units | {"long_name": "per matrix"}),
                "above": (
                    ("by", "size"),
                    above,
                    {"units": "1", "long_name": "largest excess over the peer, relative"},
                ),
                "growth": (("count",), growth, time_units | {"long_name": "all frequencies"}),
                "peak": (
                    ("system", "what"),
                    np.array(peaks),
                    time_units | {"long_name": "certified peak, and AB13MD at 1,000 points"},
                ),
                "memory": (
                    ("count",),
                    memory,
                    {"units": "byte", "long_name": "peak of the arrays held"} | WALL_TIME,
                ),
            },
            coords={
                "by": names,
                "size": sizes,
                "count": counts,
                "what": ["peak", "ab13md"],
            },
        )

    def checks(self, answer: Dataset, tolerance: float) -> list[Check]:
        checks = []
        for name, limit in ABOVE.items():
            excess = float(answer["above"].sel(by=name).max())
            statement = "largest excess of the bound over the peer's, relative"
            checks.append(Check(f"never above {name}", statement, excess, limit))
        for name, wanted in WANTED.items():
            checks += [
                Check(
                    f"{name} at size {size}",
                    f"time over the peer's, asked to be at most 1/{ratio:.3g}",
                    1 / self._ratio(answer, name, size),
                    1 / ratio,
                )
                for size, ratio in wanted.items()
                if size in answer["size"]
            ]
        checks.append(
            Check(
                "certified peak",
                f"time over that of AB13MD at {POINTS} frequencies, at worst of {SYSTEMS}",
                self._peak_ratio(answer),
                1.0,
            )
        )
        return checks

    def metrics(self, answer: Dataset) -> dict[str, float]:
        ratios = {
            f"{name}_{size}": self._ratio(answer, name, int(size))
            for name in PEERS
            for size in answer["size"].values
        }
        last = answer.isel(count=-1)
        return ratios | {
            "microseconds_per_frequency": 1e6 * float(last["growth"] / last["count"]),
            "bytes_per_frequency": float(last["memory"] / last["count"]),
            "peak_over_ab13md": self._peak_ratio(answer),
        }

    def figures(self, answer: Dataset) -> dict[str, Figure]:
        figure, (sizes, counts) = figures.axes(1, 2, size=(9.0, 3.8))
        for name in answer["by"].values:
            sizes.loglog(answer["size"], answer["seconds"].sel(by=name), "o-", label=name)
        sizes.set_xlabel("size of M")
        sizes.set_ylabel("time per matrix [s]")
        counts.loglog(answer["count"], answer["growth"], "o-")
        counts.set_xlabel("frequencies, 4 x 4")
        counts.set_ylabel("time of all [s]")
        figures.legend_below(figure, sizes)
        return {"times": figure}

    def tables(self, answer: Dataset) -> dict[str, str]:
        names = list(answer["by"].values)
        lines = [f"| size | {' | '.join(names)} | fastest peer over fast |"]
        lines.append("| ---: |" + " ---: |" * (len(names) + 1))
        for size in answer["size"].values:
            times = answer["seconds"].sel(size=size)
            cells = [f"{1e3 * float(times.sel(by=name)):.4g} ms" for name in names]
            ratio = float(times.isel(by=slice(1, None)).min() / times.sel(by="fast"))
            lines.append(f"| {size} | {' | '.join(cells)} | {ratio:.1f} |")
        growth = ["| frequencies, 4 x 4 | time | memory |", "| ---: | ---: | ---: |"]
        for count in answer["count"].values:
            one = answer.sel(count=count)
            growth.append(
                f"| {count} | {1e3 * float(one['growth']):.4g} ms | "
                f"{float(one['memory']) / 1e6:.4g} MB |"
            )
        return {"sizes": "\n".join(lines) + "\n", "frequencies": "\n".join(growth) + "\n"}

    @staticmethod
    def _peak_ratio(answer: Dataset) -> float:
        times = answer["peak"]
        return float((times.sel(what="peak") / times.sel(what="ab13md")).max())

    @staticmethod
    def _ratio(answer: Dataset, name: str, size: int) -> float:
        seconds = answer["seconds"].sel(size=size)
        return float(seconds.sel(by=name) / seconds.sel(by="fast"))


def random_system(rng: np.random.Generator, size: int, states: int) -> StateSpace:
    """A stable system, size by size, its rightmost pole at -0.1 rad/s."""
    import control

    A = rng.normal(size=(states, states)) / np.sqrt(states)
    A -= (np.linalg.eigvals(A).real.max() + 0.1) * np.eye(states)
    B, C = rng.normal(size=(states, size)), rng.normal(size=(size, states))
    return control.ss(A, B, C, 0.3 * rng.normal(size=(size, size)))


def smooth_responses(rng: np.random.Generator, size: int, count: int) -> np.ndarray:
    """Response (count, size, size) of a random stable system over four decades of frequency."""
    return response(random_system(rng, size, 2 * size), np.logspace(-2, 2, count))


def _by_peer(M: np.ndarray, structure: Structure, method: str, together: int | None) -> np.ndarray:
    """Bounds (F,) of matrices (F, c, r), so many at a time."""
    parts = np.array_split(M, len(M) // together if together else 1)
    options = Options("middle")
    return np.concatenate([upper_bound(part, structure, method, options).value for part in parts])


def _peak_seconds(rng: np.random.Generator) -> tuple[float, float]:
    """Time of a certified peak over all frequencies, and of AB13MD at some."""
    system, structure = random_system(rng, 4, STATES), Structure(CASES[4])
    peak(system, structure)  # compile before the clock starts
    certified, _ = _timed(partial(peak, system, structure), REPEATS)
    M = response(system, np.logspace(-2, 2, POINTS))
    sampled, _ = _timed(partial(_by_peer, M, structure, "ab13md", None), 1)
    return certified, sampled


def _timed(work: Callable[[], Any], repeats: int) -> tuple[float, Any]:
    best, result = np.inf, None
    for _ in range(repeats):
        start = time.perf_counter()
        result = work()
        best = min(best, time.perf_counter() - start)
    return best, result
