"""Time of the upper bound of mu, relative to that of the matrices' eigenvalues."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from workbench import Check, problem
from workbench.executor import WALL_TIME, Context, InProcess
from workbench.mu import upper_bound
from workbench.mu.upper.below import bounds_below
from workbench.structure import Block, Complex, Full, Real, Structure
from workbench.study import Study, array, check, dim, figure, metric, part, table
from workbench.types import Array, DataArray, Figure

from .bars import ratios_by_size
from .interleaved import interleaved
from .mu import smooth_responses

KINDS: dict[str, Callable[[int], tuple[Block, ...]]] = {
    "complex scalars": lambda n: (Complex(1),) * n,
    "real scalars": lambda n: (Real(1),) * n,
    "full 2x2": lambda n: (Full(2, 2),) * (n // 2),
}
"""Structures of n channels."""
SIZES = (4, 10, 20, 50)
"""Sizes of the matrices."""
ENTRIES = 32_000
"""Number of entries of all matrices of one size together, for each of ``rounds``."""
WHAT = ("bound", "eigenvalues")
"""Timed tasks."""
WANTED = {4: 15.0, 10: 40.0, 20: 40.0, 50: 40.0}
"""Largest accepted ratio, by size."""
SWEEPS, SWEEP, SWEEP_SIZE = 5, 1000, 4
"""Sweeps that only ask whether bounds are below a level: their number, their frequencies, and the
size of their matrices.
"""
SWEEP_SHARE = 1 / 3
"""Largest accepted time of these sweeps, as a share of the time of all least bounds."""
LEVEL = 1.001
"""Level of these sweeps, divided by the largest bound."""
REPEATED = (Real(10), Full(2, 2))
"""Blocks of the task with a repeated scalar, which is timed separately; its Newton matrix has 201
rows.
"""
REPEATED_WANTED = 3600.0
"""Largest accepted ratio for the repeated scalar: half of the ratio at the first measurement."""
NOISY = {("real scalars", 4): 20.0, ("real scalars", 50): 46.0}
"""Larger limits for kinds and sizes whose times are too noisy for the ones above."""


@problem("bench/mu-yardstick", slow=True)
def mu_yardstick(rounds: Annotated[int, Field(ge=1, le=50)] = 5) -> MuYardstick:
    """Time of the upper bound of mu on one core, over that of NumPy's eigenvalues of the matrices.

    Random complex matrices of sizes 4, 10, 20 and 50 have complex scalars, real scalars or full 2x2
    blocks. Separate ones have a real scalar that is repeated ten times, with one full block. No
    method that looks at a matrix can be much faster than its eigenvalues. Sweeps of 1,000
    frequencies ask whether the bounds are below a level that is a thousandth above the largest one.

    rounds: number of interleaved timings; the median counts.
    """
    return MuYardstick(rounds)


@dataclass(frozen=True)
class MuYardstick(Study):
    """Times of bounds and of eigenvalues of the same matrices, measured in turn."""

    rounds: int

    headline: ClassVar[str] = "complex_scalars_4"

    @property
    def quantifier(self) -> str:
        return "for these matrices"

    kind = dim(*KINDS)
    size = dim(*SIZES)
    what = dim(*WHAT)
    asked = dim("level", "least")

    @part
    def timed(self, context: Context) -> Array:
        """Times [s] per matrix (kind, size, what)."""
        cases = [(kind, size) for kind in KINDS for size in SIZES]
        found = [
            _timed(context.rng, KINDS[one](size), self.rounds)
            for one, size in context.track(cases, "cases")
        ]
        return np.array(found).reshape(len(KINDS), len(SIZES), 2)

    seconds = array(
        dims=(kind, size, what),
        unit="s",
        meaning="per matrix",
        value=lambda timed: timed,
        **WALL_TIME,
    )

    @array(dims=what, unit="s", meaning="per matrix, of a scalar repeated ten times", **WALL_TIME)
    def repeated(self, context: Context) -> tuple[float, float]:
        return _timed(context.rng, REPEATED, self.rounds)

    @array(
        dims=(kind, "system", asked),
        unit="s",
        meaning="1,000 responses: bounds below a level, least bounds",
        **WALL_TIME,
    )
    def sweep(self, context: Context) -> list[list[tuple[float, float]]]:
        return [
            [_sweep_times(context.rng, KINDS[kind](SWEEP_SIZE), self.rounds) for _ in range(SWEEPS)]
            for kind in KINDS
        ]

    @check()
    def near_the_limit(self, seconds: DataArray) -> list[Check]:
        over = _time_over_eigenvalues(seconds)
        return [
            Check(
                f"{kind} at size {size}",
                "time over that of the eigenvalues, on one core",
                float(over.sel(kind=kind, size=size)),
                NOISY.get((kind, size), WANTED[size]),
            )
            for kind in KINDS
            for size in SIZES
        ]

    @check(
        title="repeated scalar",
        statement="time over that of the eigenvalues, repeated ten times beside a full block",
        at_most=REPEATED_WANTED,
    )
    def repeated_scalar(self, repeated: DataArray) -> float:
        return float(_time_over_eigenvalues(repeated))

    @check(
        title="sweep",
        statement="time of bounds below a level, over that of all, median of systems",
        at_most=SWEEP_SHARE,
    )
    def sweep_below(self, sweep: DataArray) -> DataArray:
        return _share(sweep).max()

    sweep_shares = metric("sweep_{kind}", value=lambda sweep: _share(sweep))
    ratios = metric("{kind}_{size}", value=lambda seconds: _time_over_eigenvalues(seconds))
    repeated_ratio = metric(
        template="repeated_scalar", value=lambda repeated: float(_time_over_eigenvalues(repeated))
    )

    @figure
    def times(self, seconds: DataArray) -> Figure:
        return ratios_by_size(_time_over_eigenvalues(seconds), WANTED)

    @table
    def sizes(self, seconds: DataArray, repeated: DataArray) -> tuple[list[str], list[list[str]]]:
        over = _time_over_eigenvalues(seconds)
        rows = [
            [kind, str(size)]
            + [f"{1e6 * float(seconds.sel(kind=kind, size=size, what=one)):.4g}" for one in WHAT]
            + [f"{float(over.sel(kind=kind, size=size)):.3g}"]
            for kind in KINDS
            for size in SIZES
        ]
        times = [f"{1e6 * float(repeated.sel(what=one)):.4g}" for one in WHAT]
        last = f"{float(_time_over_eigenvalues(repeated)):.3g}"
        rows.append(["real scalar 10 times, full 2x2", str(Structure(REPEATED).rows), *times, last])
        return ["structure", "size", "bound [us]", "eigenvalues [us]", "ratio"], rows


def _time_over_eigenvalues(seconds: DataArray) -> DataArray:
    """Time of bounds, divided by that of eigenvalues."""
    return seconds.sel(what="bound", drop=True) / seconds.sel(what="eigenvalues", drop=True)


def _share(sweep: DataArray) -> DataArray:
    """Time of bounds below a level, divided by that of least bounds; the median over systems
    (kind).
    """
    shares = sweep.sel(asked="level", drop=True) / sweep.sel(asked="least", drop=True)
    return shares.median("system")


def _sweep_times(
    rng: np.random.Generator, blocks: tuple[Block, ...], rounds: int
) -> tuple[float, float]:
    """Median times [s] of a sweep that asks whether bounds are below a level, and of the least
    bounds.
    """
    M, structure = smooth_responses(rng, SWEEP_SIZE, SWEEP), Structure(blocks)
    level = LEVEL * float(upper_bound(M, structure).value.max())
    bounds_below(M, structure, level)  # loads compiled code
    calls: list[Callable[[], Any]] = [
        lambda: bounds_below(M, structure, level),
        lambda: upper_bound(M, structure, executor=InProcess()),
    ]
    below, least = np.median(interleaved(calls, rounds), axis=0).tolist()
    return below, least


def _timed(rng: np.random.Generator, blocks: tuple[Block, ...], rounds: int) -> tuple[float, float]:
    """Median times [s] per matrix of the bound and of the eigenvalues."""
    structure = Structure(blocks)
    size = structure.rows
    count = max(16, ENTRIES // size**2)
    real, imaginary = rng.normal(size=(2, count, size, size))
    M = real + 1j * imaginary
    hermitian = M + M.conj().mT
    calls: list[Callable[[], Any]] = [
        lambda: upper_bound(M, structure, executor=InProcess()),
        lambda: np.linalg.eigvalsh(hermitian),
    ]
    upper_bound(M, structure, executor=InProcess())  # loads compiled code
    bound, eigenvalues = (np.median(interleaved(calls, rounds), axis=0) / count).tolist()
    return bound, eigenvalues
