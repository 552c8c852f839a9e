"""Lower bound of a peak of mu: perturbations found at frequencies, proven for the system."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from workbench._core.arrays import Array
from workbench.certify.balls import in_plane
from workbench.certify.band_cover import FrequencyBounds
from workbench.certify.perturbed_loop import proven_at, proven_over_frequency, sharp_response
from workbench.certify.rounding import in_its_unit
from workbench.certify.singularity import said
from workbench.certify.stable_system import StableSystem
from workbench.mu.lower.methods import proposals
from workbench.structure import Real, Structure

LOWER_BOUND_SHARE = 0.97
"""Lower bounds are computed at frequencies whose upper bound is above this share of the largest. A
lower bound at a smaller upper one could not reach the largest. With half of the distance from 1 a
peak next to the highest may be missed; double costs time.
"""

QUICK_FREQUENCIES = 60
"""Largest number of frequencies at which a quick lower bound is computed. They are the highest of
those above `LOWER_BOUND_SHARE`. With half of them one of several peaks may be missed; double costs
time.
"""

THOROUGH_FREQUENCIES = 6
"""Number of these frequencies at which a thorough lower bound follows. With half of them a lower
bound may be smaller; with twice as many it takes twice as long.
"""

MOST_PROOFS = 8
"""Number of the best proposals for which a proof is tried. The trials end at the first that
succeeds. With half of them a lower bound may be 0 that could be proven; double costs time where
none succeeds.
"""

SCALE_BISECTIONS = 50
"""Number of bisections for the scale at which a perturbation begins to destabilise. They leave
1e-15, the rounding of a double. With half of them the bound is lower by 3e-8; more change nothing.
"""

WORTHWHILE_GAIN = 1e-4
"""A proof over frequency is tried where it would raise the bound by more than this share. Peaks are
quoted to three or four digits. Half or double: gains of a fourth digit are taken more or less
often.
"""

PROVEN_SHARE = 1 - 1e-6
"""A proof counts as complete if it reaches this share of the mu that the perturbation claims;
otherwise a more accurate response is tried. A proof moves Delta by less than this where responses
are accurate. With half of the distance from 1 more accurate responses are tried more often; double
gives up 2e-6.
"""

BEYOND_BORDER = 1 + 1e-6
"""A perturbation on the stability boundary, multiplied by this, lies beyond the boundary. The poles
then lie right of the axis by more than their rounding. With half of the distance from 1 fewer are
proven at the first try; double lowers a bound by 2e-6.
"""


@dataclass(frozen=True, eq=False)
class Attained:
    """A proven lower bound of the peak, its frequency [rad/s] and its Delta (r, c).

    If nothing was proven, the value is 0, Delta is NaN, and the frequency is that of the largest
    upper bound.
    """

    value: float
    omega: float
    Delta: Array


def attained_peak(
    system: StableSystem, structure: Structure, found: FrequencyBounds, whole_axis: bool
) -> Attained:
    """The largest lower bound proven near the largest upper bounds.

    A Delta is proven at its frequency. Over the whole axis, a Delta that destabilises the loop
    proves a bound too. With real blocks this bound may be larger than any at the given frequencies,
    because their mu may stand out at a single frequency between them.
    """
    order = np.argsort(-found.upper)[:QUICK_FREQUENCIES]
    order = order[found.upper[order] >= LOWER_BOUND_SHARE * found.upper[order[0]]]
    quick = proposals(found.M[order], structure, "power")
    chosen = np.unique([order[0], *order[np.argsort(-quick.value)[:THOROUGH_FREQUENCIES]]])
    thorough = proposals(found.M[chosen], structure, "best")
    value = np.concatenate([quick.value, thorough.value])
    omega = found.omega[np.concatenate([order, chosen])]
    Delta = np.concatenate([quick.Delta, thorough.Delta])
    best = Attained(0.0, float(omega[0]), np.full(Delta.shape[1:], np.nan + 0j))
    ranked = [k for k in np.argsort(-value)[:MOST_PROOFS] if value[k] > 0]
    for k in ranked:
        best = _proven(system, structure, Delta[k], float(omega[k]))
        if best.value > 0:
            break
    if whole_axis and any(isinstance(block, Real) for block in structure):
        for k in ranked:
            found_one = destabilised(system, structure, Delta[k], best.value)
            best = found_one if found_one.value > best.value else best
    return best


def _proven(system: StableSystem, structure: Structure, Delta: Array, omega: float) -> Attained:
    """The bound that Delta proves at a frequency, with a sharper response where it proves too
    little.

    The value is 0 if nothing is proven.
    """
    best = Attained(0.0, omega, np.full(Delta.shape, np.nan + 0j))
    # the frequency at which the proof is repeated
    there = in_plane(system.angular(omega), system.period)
    for sharper in (False, True):
        if sharper:
            M = sharp_response(system, there)
            if M is None:
                break
            Delta = proposals(M[None], structure, "best").Delta[0]
        if not np.isfinite(Delta).all() or not Delta.any():
            continue
        claimed = 1 / float(np.linalg.norm(Delta, 2))
        proven = min(said(proven_at(system, structure, Delta, there)), claimed)
        # of two equal bounds, that of the more accurate response is more singular
        if proven > 0 and proven >= best.value:
            best = Attained(proven, omega, Delta)
        if proven >= PROVEN_SHARE * claimed:
            break
    return best


def destabilised(
    system: StableSystem,
    structure: Structure,
    Delta: Array,
    above: float = 0.0,
    reach: float = BEYOND_BORDER,
) -> Attained:
    """The bound proven by the least multiple of Delta, up to `reach`, that destabilises the loop.

    The value is 0 if no multiple destabilises it, or if none proves a bound worth more than
    `above`.
    """
    norm = float(np.linalg.norm(Delta, 2))
    none = Attained(0.0, 0.0, Delta)
    if not norm > 0:
        return none
    # A destabilising multiple is worthwhile only up to this size, where there is a bound already.
    high = reach
    if above > 0:
        high = min(high, 1 / (norm * above * (1 + WORTHWHILE_GAIN)))
    if not _rightmost(system, high * Delta).real > 0:
        return none
    low = 0.0
    for _ in range(SCALE_BISECTIONS):
        middle = (low + high) / 2
        if _rightmost(system, middle * Delta).real > 0:
            high = middle
        else:
            low = middle
    Delta = high * Delta
    value = min(said(proven_over_frequency(system, structure, Delta)), 1 / (high * norm))
    omega = _rightmost(system, Delta).imag
    # The response at a negative frequency is the conjugate of that at the positive one.
    there = Delta if omega >= 0 else Delta.conj()
    return Attained(value, abs(omega), there)


def _rightmost(system: StableSystem, Delta: Array) -> complex:
    """The eigenvalue of the closed loop with the largest real part; infinite where ill-posed."""
    loop = np.eye(len(system.D)) - system.D @ Delta
    try:
        closed = system.A + system.B @ Delta @ np.linalg.solve(loop, system.C)
        near, unit = in_its_unit(closed)
        poles = np.linalg.eigvals(near) * unit
    except np.linalg.LinAlgError:
        return complex(np.inf)
    return complex(poles[np.argmax(poles.real)]) if len(poles) else complex(-np.inf)
