"""Speed of the upper bound of mu, against SLICOT AB13MD and CVXPY with Clarabel."""

from __future__ import annotations

import time
import tracemalloc
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from workbench import Check, Options, figures, problem
from workbench.executor import WALL_TIME, Context
from workbench.mu import peak, upper_bound
from workbench.structure import Block, Complex, Full, Real, Structure
from workbench.study import Study, array, check, dim, figure, metric, part, table
from workbench.systems import response
from workbench.types import Array, DataArray, Figure, StateSpace

CASES: dict[int, tuple[Block, ...]] = {
    3: (Real(1), Complex(1), Complex(1)),
    4: (Real(1), Complex(1), Full(2, 2)),
    6: (Real(1), Real(1), Full(2, 2), Full(2, 2)),
    10: (*[Real(1)] * 3, *[Complex(1)] * 3, Full(2, 2), Full(2, 2)),
    20: (*[Real(1)] * 6, *[Complex(1)] * 6, Full(4, 4), Full(4, 4)),
}
"""Structures that AB13MD accepts, by size."""
PEERS = {
    "ab13md": ("ab13md", 1),
    "clarabel": ("clarabel", 1),
    "clarabel_once": ("clarabel", None),
}
"""Method of each peer, and the number of matrices that it is given at a time (None: all)."""
LEAST_RATIO = {"ab13md": {3: 5.0, 4: 25.0, 6: 5.0, 10: 5.0, 20: 5.0}, "clarabel": {4: 500.0}}
"""Least speed per matrix of the batch, relative to each peer's, by size."""
LARGEST_EXCESS = {"ab13md": 1e-6, "clarabel": 1e-5, "clarabel_once": 1e-5}
"""Largest accepted excess over the peer's bound, relative."""
REPEATS = 3
"""Number of runs of the batch and of the certified peak; the shortest counts."""
SYSTEMS, STATES, POINTS = 3, 20, 1000
"""Number of random systems whose certified peak is timed, number of their states, and number of
frequencies of AB13MD.
"""


@problem("bench/mu", slow=True)
def mu(
    frequencies: Annotated[int, Field(ge=10)] = 1000,
    peers: Annotated[int, Field(ge=1)] = 20,
    most: Annotated[int, Field(ge=10)] = 100_000,
    largest: Annotated[int, Field(ge=3)] = 20,
) -> MuSpeed:
    """Speed of the mixed-mu upper bound: ratios to SLICOT AB13MD and to CVXPY with Clarabel.

    The matrices are smooth frequency responses of sizes 3, 4, 6, 10 and 20. The peers take one
    matrix at a time. CVXPY is timed twice: with a new program for each matrix, and with one program
    for all. The 4x4 case is also solved at 10, 100, 1000, ... frequencies. The certified peak over
    all frequencies of a 4x4 system of 20 states is timed against AB13MD at 1,000 frequencies.

    frequencies: number of frequencies at each size. peers: number of these that the peers get,
    evenly spread. most: largest number of frequencies of the 4x4 case. largest: largest size.
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

    @property
    def quantifier(self) -> str:
        return "for these matrices"

    by = dim("fast", *PEERS)
    size = dim(lambda self: [size for size in CASES if size <= self.largest])
    count = dim(lambda self: [10**k for k in range(1, 7) if 10**k <= self.most])
    what = dim("peak", "ab13md")

    @part
    def timed(self, size: DataArray, context: Context) -> Array:
        """Times [s] per matrix, and largest excesses over the peer, (2, method, size)."""
        sizes = context.track(size.values.tolist(), "sizes")
        return np.array(
            [_times_and_excesses(context.rng, n, self.frequencies, self.peers) for n in sizes]
        ).T

    seconds = array(
        dims=(by, size), unit="s", meaning="per matrix", value=lambda timed: timed[0], **WALL_TIME
    )
    above = array(
        dims=(by, size),
        unit="1",
        meaning="largest excess over the peer, relative",
        value=lambda timed: timed[1],
    )

    @part
    def grown(self, count: DataArray, context: Context) -> Array:
        """Times [s] and memory [byte] of the 4x4 case for each number of frequencies, (2,
        count).
        """
        counts = context.track(count.values.tolist(), "frequencies")
        return np.array([_time_and_memory(smooth_responses(context.rng, 4, n)) for n in counts]).T

    growth = array(
        dims=count, unit="s", meaning="all frequencies", value=lambda grown: grown[0], **WALL_TIME
    )
    memory = array(
        dims=count,
        unit="byte",
        meaning="peak of the arrays held",
        value=lambda grown: grown[1],
        **WALL_TIME,
    )

    @array(
        dims=("system", what),
        unit="s",
        meaning="certified peak, and AB13MD at 1,000 points",
        **WALL_TIME,
    )
    def peak(self, context: Context) -> list[tuple[float, float]]:
        return [_peak_seconds(context.rng) for _ in context.track(range(SYSTEMS), "peaks")]

    @check()
    def never_above(self, above: DataArray) -> list[Check]:
        statement = "largest excess of the bound over the peer's, relative"
        return [
            Check(f"never above {name}", statement, float(above.sel(by=name).max()), limit)
            for name, limit in LARGEST_EXCESS.items()
        ]

    @check()
    def fast_enough(self, seconds: DataArray) -> list[Check]:
        statement = "time over the peer's, asked to be at most 1/{:.3g}"
        faster, sizes = _speed_ratios(seconds), seconds["size"].values
        return [
            Check(
                f"{name} at size {size}",
                statement.format(ratio),
                1 / float(faster.sel(by=name, size=size)),
                1 / ratio,
            )
            for name, asked in LEAST_RATIO.items()
            for size, ratio in asked.items()
            if size in sizes
        ]

    certified_peak = check(
        title="certified peak",
        statement=f"time over that of AB13MD at {POINTS} frequencies, at worst of {SYSTEMS}",
        value=lambda peak: _peak_over_ab13md(peak),
        at_most=1.0,
    )

    ratios = metric("{by}_{size}", value=lambda seconds: _speed_ratios(seconds))
    microseconds_per_frequency = metric(lambda growth: 1e6 * _last_per_frequency(growth))
    bytes_per_frequency = metric(lambda memory: _last_per_frequency(memory))
    peak_over_ab13md = metric(lambda peak: _peak_over_ab13md(peak))

    @figure
    def times(self, seconds: DataArray, growth: DataArray) -> Figure:
        figure, (sizes, counts) = figures.axes(1, 2, size=(9.0, 3.8))
        for name in seconds["by"].values:
            sizes.plot(seconds["size"], seconds.sel(by=name), "o-", label=name)
        counts.plot(growth["count"], growth, "o-")
        figures.label(sizes, x="size of $M$", y="time per matrix [s]", log="xy")
        figures.label(counts, x=r"frequencies, $4 \times 4$", y="time of all [s]", log="xy")
        sizes.set_xticks(seconds["size"].values, map(str, seconds["size"].values), minor=False)
        sizes.minorticks_off()
        figures.legend_below(figure, sizes)
        return figure

    @table
    def sizes(self, seconds: DataArray) -> tuple[list[str], list[list[str]]]:
        names, least = seconds["by"].values.tolist(), _speed_ratios(seconds).min("by")
        rows = [
            [str(size), *(f"{1e3 * one:.4g}" for one in times), f"{ratio:.1f}"]
            for size, times, ratio in zip(
                seconds["size"].values, seconds.values.T, least.values, strict=True
            )
        ]
        return ["size", *(f"{name} [ms]" for name in names), "fastest peer over fast"], rows

    @table
    def _frequencies(
        self, growth: DataArray, memory: DataArray
    ) -> tuple[list[str], list[list[str]]]:
        cells = zip(growth["count"].values, growth.values, memory.values, strict=True)
        rows = [
            [str(count), f"{1e3 * time:.4g}", f"{held / 1e6:.4g}"] for count, time, held in cells
        ]
        return ["frequencies, 4 x 4", "time [ms]", "memory [MB]"], rows


def _speed_ratios(seconds: DataArray) -> DataArray:
    """Speed of the batch relative to each peer's, by peer and size."""
    return seconds.sel(by=list(PEERS)) / seconds.sel(by="fast", drop=True)


def _last_per_frequency(grown: DataArray) -> float:
    """Time or memory per frequency, at the largest number of frequencies."""
    last = grown.isel(count=-1)
    return float(last / last["count"])


def _peak_over_ab13md(peak: DataArray) -> float:
    """Largest ratio of the time of a certified peak to that of AB13MD."""
    return float((peak.sel(what="peak") / peak.sel(what="ab13md")).max())


def random_system(rng: np.random.Generator, size: int, states: int) -> StateSpace:
    """A random stable system with `size` inputs and outputs, whose rightmost pole is at
    -0.1 rad/s.
    """
    import control

    A = rng.normal(size=(states, states)) / np.sqrt(states)
    A -= (np.linalg.eigvals(A).real.max() + 0.1) * np.eye(states)
    B, C = rng.normal(size=(states, size)), rng.normal(size=(size, states))
    return control.ss(A, B, C, 0.3 * rng.normal(size=(size, size)))


def smooth_responses(rng: np.random.Generator, size: int, count: int) -> Array:
    """Responses (count, size, size) of a random stable system over four decades of frequency."""
    return response(random_system(rng, size, 2 * size), np.logspace(-2, 2, count))


def _times_and_excesses(
    rng: np.random.Generator, size: int, frequencies: int, peers: int
) -> list[tuple[float, float]]:
    """Time [s] per matrix and largest excess over the peer's bound, of the batch and of
    each peer.
    """
    M, structure = smooth_responses(rng, size, frequencies), Structure(CASES[size])
    upper_bound(M[:1], structure)  # compile before the clock starts
    best, bound = _timed(partial(upper_bound, M, structure), REPEATS)
    found = [(best / len(M), 0.0)]
    # A peer gets matrices evenly spread, and fewer if each costs seconds.
    count = max(1, min(peers, len(M)) // (10 if size > 10 else 1))
    some = np.linspace(0, len(M) - 1, count).astype(int)
    for peer in PEERS.values():
        best, value = _timed(partial(_peer_bounds, M[some], structure, *peer), 1)
        found.append((best / len(some), np.max(bound.value[some] / value - 1)))
    return found


def _time_and_memory(M: Array) -> tuple[float, float]:
    """Time [s] of the bounds of 4x4 matrices, and peak memory [byte]."""
    structure = Structure(CASES[4])
    seconds, _ = _timed(partial(upper_bound, M, structure), 1)
    tracemalloc.start()  # slows the computation, so the time is measured before
    upper_bound(M, structure)
    held = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return seconds, held


def _peer_bounds(M: Array, structure: Structure, method: str, together: int | None) -> Array:
    """Bounds (F,) of matrices (F, c, r) by a peer that gets ``together`` at a time (None: all)."""
    parts = np.array_split(M, len(M) // together if together else 1)
    options = Options(tolerance="middle")
    return np.concatenate(
        [upper_bound(part, structure, method=method, options=options).value for part in parts]
    )


def _peak_seconds(rng: np.random.Generator) -> tuple[float, float]:
    """Times [s] of a certified peak over all frequencies, and of AB13MD at POINTS frequencies."""
    system, structure = random_system(rng, 4, STATES), Structure(CASES[4])
    peak(system, structure)  # compile before the clock starts
    certified, _ = _timed(partial(peak, system, structure), REPEATS)
    M = response(system, np.logspace(-2, 2, POINTS))
    sampled, _ = _timed(partial(_peer_bounds, M, structure, "ab13md", None), 1)
    return certified, sampled


def _timed(work: Callable[[], Any], repeats: int) -> tuple[float, Any]:
    """Shortest time [s] of some runs, and the result of the last one."""
    best, result = np.inf, None
    for _ in range(repeats):
        start = time.perf_counter()
        result = work()
        best = min(best, time.perf_counter() - start)
    return best, result
