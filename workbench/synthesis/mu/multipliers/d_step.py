"""D steps: the scalings of a round, for the loop that it made."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import RealArray
from workbench.heavy_types import StateSpace
from workbench.mu import upper_bound
from workbench.structure import Real as RealScalar
from workbench.structure import Structure
from workbench.synthesis.mu.biquads import SPREAD, Range
from workbench.synthesis.mu.multipliers import triangles
from workbench.synthesis.mu.multipliers.fit import fit_multipliers
from workbench.synthesis.mu.multipliers.functions import Multipliers
from workbench.systems.frequency_grid import frequencies_of
from workbench.systems.generalised_plant import response

if TYPE_CHECKING:
    from workbench.mu import UpperBound


OUTSIDE = np.exp(1.5 * np.arange(1.0, 5.0))
"""Where scalings are looked at outside the loop's own frequencies, in shares of the outermost."""
BEYOND = 3.0
"""How far outside a loop's own frequencies corners of scalings may lie."""
MOST_BIQUADS = 4
GOOD = 0.002
"""By how much fitted scalings may miss the bound where more biquads are not worth it, relative."""
FLOOR, TILT = 0.5, 0.25
"""Share of the peak below which scalings need not follow the bound; exponent of the share that is
the reference of scalings with G. They cannot follow the bound everywhere; asked to, they miss it at
the peak, and rounds do not settle."""
NEAR = 0.8
"""Share of the largest bound at which a frequency has a say in a guess."""


@dataclass(frozen=True, eq=False)
class Loop:
    """A closed loop at frequencies ``omega`` (F,) [rad/s] that its poles ask for, and its response.

    Some lie farther out, where the loop does not change any more but scalings may. ``corners`` is
    where these may have theirs [rad/s].
    """

    omega: RealArray
    M: NDArray[Any]
    corners: Range

    @classmethod
    def of(cls, system: StateSpace) -> Loop:
        inside = frequencies_of(system)
        omega = np.concatenate([inside[0] / OUTSIDE[::-1], inside, inside[-1] * OUTSIDE])
        corners = float(inside[0]) / BEYOND, float(inside[-1]) * BEYOND
        return cls(omega, response(system, omega), corners)


def d_step(
    structure: Structure, loop: Loop, within: Range, before: tuple[Multipliers, RealArray] | None
) -> tuple[tuple[Multipliers, RealArray], float]:
    """Multipliers of all blocks but the last, by as many biquads as are worth it, and the miss.

    Those of real scalars have G. What is missed is the logarithm of the worst bound that they prove
    over a reference: the upper bound, or FLOOR of its peak where that is larger; with G it is
    nearer to the peak. Corners are within frequencies [rad/s].
    """
    found = upper_bound(loop.M, structure)
    blocks = Structure(structure.blocks[:-1])
    share = np.maximum(found.value / found.value.max(), FLOOR)
    if any(isinstance(block, RealScalar) for block in blocks):
        share = share**TILT
    reference = share * found.value.max()
    middle = float(np.log(loop.omega[np.argmax(found.value)]))
    least = max(0, before[0].biquads - 1) if before else 0
    tried = before[0].biquads if before and before[0].structure == blocks else None
    best: tuple[tuple[Multipliers, RealArray], float] | None = None
    for biquads in range(least, MOST_BIQUADS + 1):
        scalings = Multipliers(blocks, biquads)
        known = [each for each in (before, best and best[0]) if each]
        starts = [scalings.carried(*each, middle) for each in known if each[0].biquads <= biquads]
        # a guess knows D alone: where there is G to carry on with it is worth little
        if tried is None or not (tried == biquads or scalings.real.size):
            starts += [_guess(scalings, found, middle, spread) for spread in SPREAD]
        fits = [fit_multipliers(scalings, loop.M, loop.omega, reference, x, within) for x in starts]
        if not fits:
            continue
        x, missed = min(fits, key=lambda fit: fit[1])
        if best is None or missed < best[1] - GOOD:
            best = (scalings, x), missed
        if missed < GOOD:
            break
    assert best is not None
    return best


def _guess(scalings: Multipliers, found: UpperBound, middle: float, spread: float) -> RealArray:
    """Parameters near the constant D of the largest bounds, corners about a log frequency."""
    bound, D = found.value, found.D_left
    high, worst = bound > NEAR * bound.max(), int(np.argmax(bound))
    size = np.sqrt(D[:, -1, -1].real)
    functions = scalings.functions.rows
    x = np.zeros((scalings.rows, scalings.functions.size))
    x[:functions] = scalings.functions.guess(np.zeros(functions), middle, spread)
    x[scalings.minus] = scalings.functions.inverse(x[scalings.minus])
    for n, at, beside, row, _ in scalings.places:
        if n == 1:
            d = np.sqrt(D[high, row.start, row.start].real) / size[high]
            x[at, 0] = np.median(np.log(d))
            continue
        R = np.linalg.cholesky(D[worst, row, row].real).T / size[worst]
        gains = np.diagonal(R)
        x[at, 0] = np.log(gains)
        entries = x[functions:][beside]
        entries[:, 0] = (R / gains)[triangles.beside(n)]
        entries[:, 1::4] = x[at.start, 3::4]
    return x
