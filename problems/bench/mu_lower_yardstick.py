"""Time of the lower bound of mu, relative to that of the matrices' eigenvalues."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from workbench import Check, problem
from workbench.executor import WALL_TIME, Context
from workbench.mu import lower_bound
from workbench.mu.lower.methods import proposals
from workbench.structure import Block, Complex, Full, Real, Structure
from workbench.study import Study, array, check, dim, figure, metric, part, table
from workbench.types import Array, DataArray, Figure

from .bars import ratios_by_size
from .interleaved import interleaved

KINDS: dict[str, Callable[[int], tuple[Block, ...]]] = {
    "complex scalars": lambda n: (Complex(1),) * n,
    "real scalars": lambda n: (Real(1),) * n,
    "mixed": lambda n: (
        *(Real(1),) * (n // 4),
        *(Complex(1),) * (n // 4),
        Full(n - n // 4 * 2, n - n // 4 * 2),
    ),
}
"""Structures of n channels. In the mixed ones a quarter are real scalars and half are one full
block.
"""
SIZES = (4, 10, 20)
"""Sizes of the matrices."""
ENTRIES = 1600
"""Number of entries of all matrices of one size together."""
WHAT = ("search", "bound", "eigenvalues")
"""Timed tasks: the search for perturbations, the search with its proofs, and the yardstick."""
WANTED = 500.0
"""Largest accepted ratio of a search to the yardstick."""
NOT_YET = {
    ("real scalars", 4): 700.0,
    ("real scalars", 10): 1500.0,
    ("real scalars", 20): 6000.0,
    ("mixed", 10): 700.0,
    ("mixed", 20): 2500.0,
}
"""Larger limits for kinds and sizes that do not reach this yet."""


@problem("bench/mu-lower-yardstick", slow=True)
def mu_lower_yardstick(rounds: Annotated[int, Field(ge=1, le=50)] = 5) -> MuLowerYardstick:
    """Time of the lower bound of mu on one core, over that of NumPy's eigenvalues of the matrices.

    Processor time is compared, because other load on the computer changes it little.

    Random complex matrices of sizes 4, 10 and 20, with complex scalars, real scalars, and real and
    complex scalars with a full block. The search for perturbations is held to a limit; the proof by
    the certificate's kernel is timed as well.

    rounds: number of interleaved timings; the shortest counts.
    """
    return MuLowerYardstick(rounds)


@dataclass(frozen=True)
class MuLowerYardstick(Study):
    """Times of lower bounds and of eigenvalues of the same matrices, measured in turn."""

    rounds: int

    headline: ClassVar[str] = "mixed_4"

    @property
    def quantifier(self) -> str:
        return "for these matrices"

    kind = dim(*KINDS)
    size = dim(*SIZES)
    what = dim(*WHAT)

    @part
    def timed(self, context: Context) -> Array:
        """Times [s] per matrix (kind, size, what)."""
        cases = [(kind, size) for kind in KINDS for size in SIZES]
        found = [_timed(context.rng, *case, self.rounds) for case in context.track(cases, "cases")]
        return np.array(found).reshape(len(KINDS), len(SIZES), len(WHAT))

    seconds = array(
        dims=(kind, size, what),
        unit="s",
        meaning="per matrix",
        value=lambda timed: timed,
        **WALL_TIME,
    )

    @check()
    def near_the_limit(self, seconds: DataArray) -> list[Check]:
        over = _time_over_eigenvalues(seconds, "search")
        return [
            Check(
                f"{kind} at size {size}",
                "time of the search over that of the eigenvalues, on one core",
                float(over.sel(kind=kind, size=size)),
                NOT_YET.get((kind, size), WANTED),
            )
            for kind in KINDS
            for size in SIZES
        ]

    ratios = metric(
        "{kind}_{size}", value=lambda seconds: _time_over_eigenvalues(seconds, "search")
    )

    @figure
    def times(self, seconds: DataArray) -> Figure:
        return ratios_by_size(
            _time_over_eigenvalues(seconds, "search"), dict.fromkeys(SIZES, WANTED)
        )

    @table
    def sizes(self, seconds: DataArray) -> tuple[list[str], list[list[str]]]:
        ratios = [_time_over_eigenvalues(seconds, what) for what in ("search", "bound")]
        rows = [
            [kind, str(size)]
            + [f"{1e6 * float(seconds.sel(kind=kind, size=size, what=one)):.4g}" for one in WHAT]
            + [f"{float(ratio.sel(kind=kind, size=size)):.3g}" for ratio in ratios]
            for kind in KINDS
            for size in SIZES
        ]
        heads = ["structure", "size", "search [us]", "with proof [us]", "eigenvalues [us]"]
        return [*heads, "ratio of the search", "ratio with proof"], rows


def _time_over_eigenvalues(seconds: DataArray, what: str) -> DataArray:
    """Time of a search or of proven bounds, divided by that of eigenvalues (kind, size)."""
    return seconds.sel(what=what, drop=True) / seconds.sel(what="eigenvalues", drop=True)


def _timed(rng: np.random.Generator, kind: str, size: int, rounds: int) -> tuple[float, ...]:
    """Shortest processor times [s] per matrix of the tasks in WHAT."""
    count = max(4, ENTRIES // size**2)
    real, imaginary = rng.normal(size=(2, count, size, size))
    M = real + 1j * imaginary
    hermitian, structure = M + M.conj().mT, Structure(KINDS[kind](size))
    calls: list[Callable[[], Any]] = [
        lambda: proposals(M, structure, "best"),
        lambda: lower_bound(M, structure),
        lambda: [np.linalg.eigvalsh(hermitian) for _ in range(20)],
    ]
    lower_bound(M[:2], structure)  # loads compiled code
    times = interleaved(calls, rounds, time.process_time) / count
    search, bound, eigenvalues = times.min(axis=0).tolist()
    return search, bound, eigenvalues / 20
