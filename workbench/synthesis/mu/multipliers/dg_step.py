"""D steps with G or with a full D for repeated scalars, fitted to the loop of a round.

The first one starts from the scalings of the D step of D-K iteration, for which G is zero. That
step has one function for each block, and its fit has second derivatives in closed form. With G, or
with functions that mix channels, the bound is the largest eigenvalue of another matrix, and
`fit_multipliers` has first derivatives only.
"""

from __future__ import annotations

import numpy as np

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import StateSpace
from workbench.mu import upper_bound
from workbench.structure import Real as RealScalar
from workbench.structure import Structure
from workbench.synthesis.mu.biquads import Biquads, FrequencyRange
from workbench.synthesis.mu.d_step import LoopResponse
from workbench.synthesis.mu.multipliers import triangles
from workbench.synthesis.mu.multipliers.fit import fit_multipliers
from workbench.synthesis.mu.multipliers.functions import Multipliers
from workbench.systems.frequency_grid import frequencies_of
from workbench.systems.generalised_plant import response

FittedMultipliers = tuple[Multipliers, RealArray]
"""The multipliers, and their parameters (rows, P)."""

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


def extended_loop(system: StateSpace) -> tuple[LoopResponse, FrequencyRange]:
    """The response of a stable closed loop also at frequencies farther out, where it is constant
    but scalings may still change, and the range [rad/s] for the corners of scalings.
    """
    inside = frequencies_of(system)
    omega = np.concatenate([inside[0] / OUTER_RATIOS[::-1], inside, inside[-1] * OUTER_RATIOS])
    corners = float(inside[0]) / CORNER_REACH, float(inside[-1]) * CORNER_REACH
    return LoopResponse(omega, response(system, omega)), corners


def dg_step(
    structure: Structure, loop: LoopResponse, within: FrequencyRange, before: FittedMultipliers
) -> tuple[FittedMultipliers, float]:
    """Multipliers of all blocks but the last with as few biquads as needed, and their miss.

    Multipliers of real scalars have G. The fit starts from multipliers of the same blocks, in the
    first round with G = 0. The miss is the logarithm of the worst ratio of the bound that they
    prove to a reference. The reference is the upper bound, or `REFERENCE_FLOOR` times its peak
    where this is larger. With G the reference is closer to the peak. Corners lie `within`
    frequencies [rad/s].
    """
    found = upper_bound(loop.M, structure)
    blocks = Structure(structure.blocks[:-1])
    share = np.maximum(found.value / found.value.max(), REFERENCE_FLOOR)
    if any(isinstance(block, RealScalar) for block in blocks):
        share = share**REFERENCE_EXPONENT
    reference = share * found.value.max()
    middle = float(np.log(loop.omega[np.argmax(found.value)]))
    best: tuple[FittedMultipliers, float] | None = None
    idle = 0
    for biquads in range(before[0].biquads, MOST_BIQUADS + 1):
        multipliers = Multipliers(blocks, biquads)
        known = [before] if best is None else [before, best[0]]
        fits = [
            fit_multipliers(
                multipliers,
                loop.M,
                loop.omega,
                reference,
                multipliers.carried(*each, middle),
                within,
            )
            for each in known
        ]
        x, missed = min(fits, key=lambda fit: fit[1])
        idle += 1
        if best is None or missed < best[1] - FIT_TOLERANCE:
            best, idle = ((multipliers, x), missed), 0
        if missed < FIT_TOLERANCE or idle == MOST_IDLE:
            break
    assert best is not None
    return best


def without_G(structure: Structure, loop: LoopResponse, D: RealArray) -> FittedMultipliers:
    """Multipliers with G = 0 from scalings D (blocks, P) of D-K iteration.

    The channels of a repeated scalar have the same function. Its T and gains are constant: at the
    frequency of the largest bound, they make its D the real part of the optimal one.
    """
    structure = structure.complexified()
    functions = Biquads.of(D)
    multipliers = Multipliers(Structure(structure.blocks[:-1]), functions.biquads)
    found = upper_bound(loop.M, structure)
    worst = int(np.argmax(found.value))
    best = found.D_left[worst] / found.D_left[worst, -1, -1].real
    log_d, _ = functions.log_magnitude(D, loop.omega[[worst]])
    x = np.zeros((multipliers.rows, functions.size))
    entries = x[multipliers.functions.rows :]
    for row, log, (n, at, beside, out, _) in zip(D, log_d, multipliers.places, strict=True):
        x[at] = row
        if n > 1:
            R = np.linalg.cholesky(best[out, out].real).T
            gains = np.diagonal(R)
            x[at, 0] += np.log(gains) - log
            entries[beside, 0] = (R / gains)[triangles.beside(n)]
            entries[beside, 1::4] = row[3::4]
    return multipliers, x
