"""Mu of real uncertainties alone jumps with the data, and a small complex part makes it continuous.

B. Barmish, P. Khargonekar, Z. Shi and R. Tempo showed that the margin of real parameters need not
be continuous: "Robustness margin need not be a continuous function of the problem data", Systems &
Control Letters 15 (1990) 91-98. The remedy is due to A. Packard and P. Pandey, "Continuity
properties of the real/complex structured singular value", IEEE Trans. Automatic Control 38 (1993)
415-428. The example here is smaller than theirs, so that mu can be computed by hand.

    M(p) = [1; 1] [1 + j p, 1 - 3 j p],    Delta = diag(d_1, d_2)

I - M Delta is singular where (1 + j p) d_1 + (1 - 3 j p) d_2 = 1. Real d must meet d_1 + d_2 = 1
and p (d_1 - 3 d_2) = 0. With p = 0 the second equation is void, d_1 = d_2 = 1/2 is the smallest
solution, and mu = 2. With any other p the only one is d = (3/4, 1/4), and mu = 4/3.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from workbench import Check, figures, problem
from workbench.executor import Context
from workbench.mu import branch_and_bound
from workbench.structure import Complex, Real, Structure
from workbench.study import Study, array, check, dim, figure, metric, part, table
from workbench.types import DataArray, Figure, RealArray

PARTS = (0.0, 0.01, 0.1)
"""Sizes of the complex parts, relative to the real scalars."""
SIZES = (1e-3, 1e-2, 0.03, 0.1, 0.3, 1.0)
"""Magnitudes of the parameter p that are tried besides 0."""
DIRECTIONS, ZOOMS = 1001, 4
"""Number of half planes that bound the value set from outside, and how often their directions are
refined around the best one.
"""
BOUNDS_APART = 1e-2
"""Largest relative width of the certified interval."""
EXACT_ROUNDING = 1e-6
"""Largest accepted relative distance of the value by hand outside the certified bounds."""


def exact_mu(p: float, complex_part: float) -> float:
    """Mu from the value set of (1 + j p) d_1 + (1 - 3 j p) d_2, without any multiplier.

    With complex parts the value set for |d| <= k is k times the sum of two segments and a disc. It
    contains 1 if every half plane that contains the set contains 1. So mu is the least ratio, over
    all directions, of the support function of the set to that of the point 1.
    """
    c = np.array([1 + 1j * p, 1 - 3j * p])
    if complex_part == 0.0:
        return 2.0 if p == 0.0 else 4 / 3
    low, high, least = -np.pi / 2, np.pi / 2, np.inf
    for _ in range(ZOOMS):  # the ratio has one minimum
        turn = np.linspace(low, high, DIRECTIONS)[1:-1]
        normal = np.exp(-1j * turn)
        support = abs((normal[:, None] * c).real).sum(axis=1) + complex_part * abs(c).sum()
        values = support / normal.real
        best = int(values.argmin())
        least = min(least, float(values[best]))
        step = turn[1] - turn[0]
        low, high = turn[best] - step, turn[best] + step
    return least


@dataclass(frozen=True, eq=False)
class RealMuJump(Study):
    """Mu over the parameter p: by hand, and certified bounds."""

    apart: float

    headline: ClassVar[str] = "jump_real"

    @property
    def quantifier(self) -> str:
        return "at these parameters"

    complex_part = dim(PARTS, unit="1", meaning="complex part, as a share of each real scalar")
    bound = dim("lower", "upper")
    p = dim(
        lambda: np.array([*(-s for s in reversed(SIZES)), 0.0, *SIZES]),
        unit="1",
        meaning="parameter p",
    )

    @part
    def found(self, context: Context) -> RealArray:
        """Certified bounds of mu (complex parts, p, 2)."""
        bounds = []
        every = [0.0, *SIZES]
        for share in context.track(PARTS, "complex parts"):
            of = {size: self._bounds(size, share) for size in every}
            bounds.append([of[abs(p)] for p in (*(-s for s in reversed(SIZES)), 0.0, *SIZES)])
        return np.array(bounds)

    def _bounds(self, p: float, share: float) -> tuple[float, float]:
        M = np.outer([1.0, 1.0], [1 + 1j * p, 1 - 3j * p])
        structure = Structure([Real(1, name="d_1"), Real(1, name="d_2")])
        if share > 0.0:
            M = np.outer([1.0, 1.0, share, share], [*M[0], *M[0]])
            structure = Structure([*structure, Complex(1), Complex(1)])
        one = branch_and_bound(M, structure, tolerance=self.apart)
        return one.lower, one.upper

    bounds = array(dims=(complex_part, p, bound), unit="1", meaning="certified bounds of mu")(
        lambda found: found
    )
    exact = array(dims=(complex_part, p), unit="1", meaning="mu by hand")(
        lambda complex_part, p: [
            [exact_mu(one, share) for one in p.values.tolist()] for share in complex_part.values
        ]
    )

    @check()
    def exact_within(bounds: DataArray, exact: DataArray) -> list[Check]:  # noqa: N805
        low, high = (bounds.sel(bound=bound) for bound in ("lower", "upper"))
        outside = float(np.maximum(low / exact, exact / high).max()) - 1
        apart = float((high / low).max()) - 1
        return [
            Check("by hand", "mu by hand outside its bounds, relative", outside, EXACT_ROUNDING),
            Check("bounds", "upper over lower bound, less 1", apart, BOUNDS_APART),
        ]

    @metric
    def jumps(self, bounds: DataArray) -> dict[str, float]:
        """Relative decrease of mu from p = 0 to the nearest p: proven least and most."""
        numbers = {}
        for share in PARTS:
            one = bounds.sel(complex_part=share)
            at, beside = one.sel(p=0.0), one.sel(p=SIZES[0])
            low, high = (lambda of: (float(of.sel(bound="lower")), float(of.sel(bound="upper"))))(
                at
            )
            next_low, next_high = float(beside.sel(bound="lower")), float(beside.sel(bound="upper"))
            name = "real" if share == 0.0 else f"complex_{share:g}"
            numbers[f"mu_at_0_{name}"], numbers[f"mu_beside_0_{name}"] = low, next_high
            numbers[f"jump_{name}"] = max(0.0, 1 - next_high / low)
            numbers[f"jump_at_most_{name}"] = 1 - next_low / high
        return numbers

    @table
    def values(self, bounds: DataArray, exact: DataArray) -> tuple[list[str], list[list[str]]]:
        rows = []
        for p in (0.0, *SIZES):
            cells = []
            for share in PARTS:
                low, high = bounds.sel(complex_part=share, p=p).values
                by_hand = float(exact.sel(complex_part=share, p=p))
                cells += [f"{by_hand:.5f}", f"{low:.5f} to {high:.5f}"]
            rows.append([f"{p:g}", *cells])
        heads = [text for share in PARTS for text in (f"mu, part {share:g}", "bounds")]
        return ["p", *heads], rows

    @figure
    def mu(self, bounds: DataArray, exact: DataArray) -> Figure:
        """Mu over the parameter p, without and with complex parts."""
        drawn, (panel,) = figures.axes(1, 1)
        for share, colour in zip(PARTS, figures.CYCLE, strict=False):
            one = exact.sel(complex_part=share)
            name = "real alone" if share == 0.0 else f"complex part {share:g}"
            if share == 0.0:
                panel.plot(one["p"], one, "o", color=colour, label=name)
            else:
                panel.plot(one["p"], one, "-", color=colour, label=name)
            for bound, mark in (("lower", 2), ("upper", 3)):
                edge = bounds.sel(complex_part=share, bound=bound)
                panel.plot(edge["p"], edge, linestyle="", marker=mark, color=colour)
        panel.set_xscale("symlog", linthresh=SIZES[0])
        figures.label(panel, x="parameter $p$", y="$\\mu$")
        figures.legend_below(drawn, panel)
        return drawn


@problem("textbook/real-mu-jump")
def real_mu_jump(gap: Annotated[float, Field(gt=0, lt=0.1)] = 1e-3) -> RealMuJump:
    """Mu of two real parameters jumps with the data; a small complex part makes it continuous.

    Mu of a 2 x 2 matrix over its parameter p, by hand and by certified bounds, with real scalars
    alone and with complex parts of 1 % and 10 %. At p = 0 real mu is 2, at any other p it is 4/3.

    gap: relative width of the certified interval at which branch and bound stops.
    """
    return RealMuJump(gap)
