"""D steps: scalings fitted to the loop of a round."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import StateSpace
from workbench.mu import upper_bound
from workbench.structure import Real as RealScalar
from workbench.structure import Structure
from workbench.synthesis.mu.biquads import CORNER_SPREADS, FrequencyRange
from workbench.synthesis.mu.multipliers import triangles
from workbench.synthesis.mu.multipliers.fit import fit_multipliers
from workbench.synthesis.mu.multipliers.functions import Multipliers
from workbench.systems.frequency_grid import frequencies_of
from workbench.systems.generalised_plant import response

if TYPE_CHECKING:
    from workbench.mu import UpperBound


OUTER_RATIOS = np.exp(1.5 * np.arange(1.0, 5.0))
"""Additional frequencies at which scalings are evaluated, as multiples of the loop's highest
frequency and as divisors of its lowest."""
CORNER_REACH = 3.0
"""Factor by which corners of scalings may lie outside the loop's own frequencies."""
MOST_BIQUADS, MOST_IDLE = 4, 2
"""Largest number of biquads of a multiplier, and number of biquads that may be added without gain.
If the bound has two peaks, the first biquad lowers only one of them.
"""
FIT_TOLERANCE = 0.002
"""More biquads are used only if they lower the relative miss of the bound by more than this."""
REFERENCE_FLOOR, REFERENCE_EXPONENT = 0.5, 0.25
"""Scalings need not follow the bound below the first share of its peak. With G the reference is the
relative bound raised to the power of the second number: scalings with G cannot follow the bound
everywhere. If they had to, they would miss it at the peak, and the rounds would not settle.
"""
GUESS_SHARE = 0.8
"""The initial guess uses the frequencies with a bound above this share of the largest one."""


@dataclass(frozen=True, eq=False)
class ExtendedLoopResponse:
    """The response ``M`` of a closed loop at frequencies ``omega`` (F,) [rad/s] from its poles.

    Unlike a `LoopResponse`, it reaches to frequencies where only scalings still change.

    Some frequencies lie farther out, where the response of the loop is constant but scalings may
    still change. ``corners`` is the range [rad/s] for the corners of scalings.
    """

    omega: RealArray
    M: NDArray[Any]
    corners: FrequencyRange

    @classmethod
    def of(cls, system: StateSpace) -> ExtendedLoopResponse:
        """The response of a stable closed loop."""
        inside = frequencies_of(system)
        omega = np.concatenate([inside[0] / OUTER_RATIOS[::-1], inside, inside[-1] * OUTER_RATIOS])
        corners = float(inside[0]) / CORNER_REACH, float(inside[-1]) * CORNER_REACH
        return cls(omega, response(system, omega), corners)


def dg_step(
    structure: Structure,
    loop: ExtendedLoopResponse,
    within: FrequencyRange,
    before: tuple[Multipliers, RealArray] | None,
) -> tuple[tuple[Multipliers, RealArray], float]:
    """Multipliers of all blocks but the last with as few biquads as needed, and their miss.

    Multipliers of real scalars have G. The miss is the logarithm of the worst ratio of the bound
    that they prove to a reference. The reference is the upper bound, or `REFERENCE_FLOOR` times its
    peak where this is larger. With G the reference is closer to the peak. Corners lie `within`
    frequencies [rad/s].
    """
    found = upper_bound(loop.M, structure)
    blocks = Structure(structure.blocks[:-1])
    share = np.maximum(found.value / found.value.max(), REFERENCE_FLOOR)
    if any(isinstance(block, RealScalar) for block in blocks):
        share = share**REFERENCE_EXPONENT
    reference = share * found.value.max()
    middle = float(np.log(loop.omega[np.argmax(found.value)]))
    least = max(0, before[0].biquads - 1) if before else 0
    tried = before[0].biquads if before and before[0].structure == blocks else None
    best: tuple[tuple[Multipliers, RealArray], float] | None = None
    idle = 0
    for biquads in range(least, MOST_BIQUADS + 1):
        scalings = Multipliers(blocks, biquads)
        known = [each for each in (before, best and best[0]) if each]
        starts = [scalings.carried(*each, middle) for each in known if each[0].biquads <= biquads]
        # a guess has no G, so it is of little use if earlier multipliers have G
        if tried is None or not (tried == biquads or scalings.real.size):
            starts += [_guess(scalings, found, middle, spread) for spread in CORNER_SPREADS]
        fits = [fit_multipliers(scalings, loop.M, loop.omega, reference, x, within) for x in starts]
        if not fits:
            continue
        x, missed = min(fits, key=lambda fit: fit[1])
        idle += 1
        if best is None or missed < best[1] - FIT_TOLERANCE:
            best, idle = ((scalings, x), missed), 0
        if missed < FIT_TOLERANCE or idle == MOST_IDLE:
            break
    assert best is not None
    return best


def _guess(scalings: Multipliers, found: UpperBound, middle: float, spread: float) -> RealArray:
    """Parameters near the constant D of the largest bounds, with corners around a log frequency."""
    bound, D = found.value, found.D_left
    high, worst = bound > GUESS_SHARE * bound.max(), int(np.argmax(bound))
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
