"""Speed of the upper bound of mu over that of looking at each matrix once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from workbench import Check, problem
from workbench.arrays import Array
from workbench.executor import WALL_TIME, Context, InProcess
from workbench.heavy_types import DataArray, Figure
from workbench.mu import upper_bound
from workbench.structure import Block, Complex, Full, Real, Structure
from workbench.study import Study, array, check, dim, figure, metric, part, table

from .bars import ratios_by_size
from .interleaved import interleaved

KINDS: dict[str, Callable[[int], tuple[Block, ...]]] = {
    "complex scalars": lambda n: (Complex(1),) * n,
    "real scalars": lambda n: (Real(1),) * n,
    "full 2x2": lambda n: (Full(2, 2),) * (n // 2),
}
"""Structures of n channels."""
SIZES = (4, 10, 20, 50)
"""Sizes of the matrices."""
ENTRIES = 32_000
"""Entries of all matrices of one size together, for each of ``rounds``."""
WHAT = ("bound", "eigenvalues")
"""What is timed."""
WANTED = {4: 15.0, 10: 40.0, 20: 40.0, 50: 40.0}
"""Largest ratio that is asked for, by size."""
NOISY = {("real scalars", 4): 20.0, ("real scalars", 50): 46.0}
"""Limits where the noise of times reaches past that."""


@problem("bench/mu-yardstick", slow=True)
def mu_yardstick(rounds: Annotated[int, Field(ge=1, le=50)] = 5) -> MuYardstick:
    """Time of the upper bound of mu on one core, over that of NumPy's eigenvalues of the matrices.

    Random complex matrices of sizes 4, 10, 20 and 50, with complex scalars, real scalars and full
    2x2 blocks. Nothing that looks at a matrix can be much faster than its eigenvalues.

    rounds: of interleaved timings, of which the median counts.
    """
    return MuYardstick(rounds)


@dataclass(frozen=True)
class MuYardstick(Study):
    """Times of bounds and of eigenvalues of the same matrices, one after the other."""

    rounds: int

    headline: ClassVar[str] = "complex_scalars_4"

    @property
    def quantifier(self) -> str:
        return "for these matrices"

    kind = dim(*KINDS)
    size = dim(*SIZES)
    what = dim(*WHAT)

    @part
    def timed(self, context: Context) -> Array:
        """Times per matrix (kind, size, what)."""
        cases = [(kind, size) for kind in KINDS for size in SIZES]
        found = [_timed(context.rng, *case, self.rounds) for case in context.track(cases, "cases")]
        return np.array(found).reshape(len(KINDS), len(SIZES), 2)

    seconds = array((kind, size, what), "s", "per matrix", lambda timed: timed, **WALL_TIME)

    @check()
    def near_the_limit(self, seconds: DataArray) -> list[Check]:
        over = _over(seconds)
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

    ratios = metric("{kind}_{size}", lambda seconds: _over(seconds))

    @figure
    def times(self, seconds: DataArray) -> Figure:
        return ratios_by_size(_over(seconds), WANTED)

    @table
    def sizes(self, seconds: DataArray) -> tuple[list[str], list[list[str]]]:
        over = _over(seconds)
        rows = [
            [kind, str(size)]
            + [f"{1e6 * float(seconds.sel(kind=kind, size=size, what=one)):.4g}" for one in WHAT]
            + [f"{float(over.sel(kind=kind, size=size)):.3g}"]
            for kind in KINDS
            for size in SIZES
        ]
        return ["structure", "size", "bound [us]", "eigenvalues [us]", "ratio"], rows


def _over(seconds: DataArray) -> DataArray:
    """Time of bounds over that of eigenvalues (kind, size)."""
    return seconds.sel(what="bound", drop=True) / seconds.sel(what="eigenvalues", drop=True)


def _timed(rng: np.random.Generator, kind: str, size: int, rounds: int) -> tuple[float, float]:
    """Median times [s] per matrix of the bound and of the eigenvalues."""
    count = max(16, ENTRIES // size**2)
    real, imaginary = rng.normal(size=(2, count, size, size))
    M = real + 1j * imaginary
    hermitian, structure = M + M.conj().mT, Structure(KINDS[kind](size))
    calls: list[Callable[[], Any]] = [
        lambda: upper_bound(M, structure, executor=InProcess()),
        lambda: np.linalg.eigvalsh(hermitian),
    ]
    upper_bound(M, structure, executor=InProcess())  # loads what is compiled
    bound, eigenvalues = (np.median(interleaved(calls, rounds), axis=0) / count).tolist()
    return bound, eigenvalues
