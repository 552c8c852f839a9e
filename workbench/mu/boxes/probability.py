"""Guaranteed bounds of the probability that a member of a set is stable, or keeps a gain.

The parameters' box is cut into parts that hold good members only, parts that hold bad members only,
and undecided parts. The probability of the undecided parts is the distance of the bounds.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from workbench._core.arrays import RealArray
from workbench.answer import Answer, RepeatedChecker
from workbench.certificate import Check
from workbench.certify.agreement import need_agreement
from workbench.certify.stable_system import StableSystem
from workbench.errors import InputError, UnknownNameError
from workbench.input_checks import need_count, need_kind, need_positive
from workbench.mu.boxes.bands import WHOLE
from workbench.mu.boxes.margin import Growing
from workbench.mu.boxes.partition import BoxPart, Partition, Weight, corner_signs, effects_in
from workbench.mu.boxes.recentred import RealParameters
from workbench.mu.frequency.channels import analysed, even_channels
from workbench.mu.upper.bound import upper_bound
from workbench.second_opinion import members
from workbench.structure import Complex, Structure
from workbench.systems.frequency_grid import starting_grid
from workbench.systems.realisation import realisation
from workbench.uncertainty.algebra.elements import RealElement
from workbench.uncertainty.algebra.system import UncertainSystem

BELOW = 1 - 1e-6
"""A gain is above its level where the bound of its reciprocal is below this. The bound has that
rounding, so the gain is above the level on the whole part. With half or double of the distance from
1, parts at the border are decided a little sooner or later.
"""
PROBABILITY_ROUNDING = 1e-12
"""Largest rounding error of the distribution functions in the probability of one part. SciPy's
distribution functions have about twelve digits. With half of it a sum of parts that is 1 may look
larger; double loosens a probability by 1e-12 for each part.
"""


@dataclass(frozen=True, eq=False, repr=False)
class GuaranteedProbability(Answer):
    """Bounds ``lower`` and ``upper`` of the probability that was asked for.

    ``parts`` is how many parts of the box of parameters were examined.

    Examples
    --------
    >>> import control
    >>> from workbench.mu import guaranteed_probability
    >>> from workbench.uncertainty import feedback, real, tf
    >>> k = real("k", 10, percent=40)
    >>> closed = feedback(tf([18], [1, 1.8, k]) * control.tf([0.4, 1.0], [0.02, 1.0]), 1)
    >>> found = guaranteed_probability(closed, gain=3.0, width=0.1)
    >>> 0 <= found.lower <= found.upper <= 1
    True
    """

    lower: float
    upper: float
    parts: int
    asked: str

    def summary(self) -> str:
        return (
            f"GuaranteedProbability: from {self.lower:.6g} to {self.upper:.6g} that the system is "
            f"{self.asked}; {self.parts} parts"
        )


def guaranteed_probability(
    system: Any,
    *,
    gain: float | None = None,
    distributions: Mapping[str, Any] | None = None,
    width: float = 0.01,
    parts: int = 5000,
) -> GuaranteedProbability:
    """Guaranteed bounds of the probability that a member of a set is stable and keeps a gain.

    Samples give an estimate with a confidence; these bounds are proven, between samples too. The
    number of parts for a distance of the bounds grows as 1 / distance for two parameters, and as
    the power p - 1 of that for p parameters, as for all methods that cut a box ( Thai, Roos and
    Biannic, Probabilistic mu-analysis for stability and H-infinity performance, ACC 2019).

    Parameters
    ----------
    system
        An `UncertainSystem` whose elements are all real, stable at its nominal; or an object that
        stands for one. Its parameters are independent.
    gain
        Level that the largest singular value over frequency has to stay below; None: members only
        have to be stable.
    distributions
        By name, distributions of parameters as frozen ones of `scipy.stats` are (with ``cdf``),
        restricted to the range of each; others are uniform over it.
    width
        Distance of the bounds at which the search ends.
    parts
        Largest number of parts of the box that are examined.

    Raises
    ------
    InputError, UnknownNameError
        An element is no real parameter; a distribution has no cdf, none of its mass lies in the
        range, or it belongs to no element; the nominal system is unstable.

    Examples
    --------
    >>> import control
    >>> from workbench.mu import guaranteed_probability
    >>> from workbench.uncertainty import feedback, real, tf
    >>> k = real("k", 10, percent=40)
    >>> closed = feedback(tf([18], [1, 1.8, k]) * control.tf([0.4, 1.0], [0.02, 1.0]), 1)
    >>> found = guaranteed_probability(closed)
    >>> found.lower > 0.999, found.upper  # every member is stable
    (True, 1.0)
    """
    found = analysed(system)
    need_positive(width, "width")
    need_count("parts", parts)
    if gain is not None:
        need_positive(gain, "gain")
    laws = {} if distributions is None else distributions
    need_kind(laws, Mapping, "distributions")
    weight = _weight(found, laws)
    question = _Question(found, gain)
    partition = Partition(Growing(len(found.elements)).box(1.0), weight)
    good, bad, count = 0.0, 0.0, 0
    while partition and count < parts and 1.0 - good - bad > width:
        part = partition.pop()
        count += 1
        verdict, rest, effects = question.asked_of(part)
        if verdict is None:
            partition.cut(rest, effects)
        elif verdict:
            good += weight(part.low, part.high)
        else:
            bad += weight(part.low, part.high)
    asked = "stable" if gain is None else f"stable with a gain below {gain:g}"
    slack = PROBABILITY_ROUNDING * count
    need_agreement(good - slack, 1 - bad + slack, "the probability", "parts hold good members only")
    bounds = max(good - slack, 0.0), min(1 - bad + slack, 1.0)
    again = partial(
        guaranteed_probability,
        found,
        gain=gain,
        distributions=laws,
        width=width,
        parts=parts,
    )
    checker = ProbabilityChecker(again, "for all values of the parameters", found, gain, laws)
    return GuaranteedProbability(*bounds, count, asked).with_checker(checker)


@dataclass(frozen=True, eq=False)
class ProbabilityChecker(RepeatedChecker):
    """Computes the bounds again, and compares them with the share of good random members."""

    system: UncertainSystem
    gain: float | None
    laws: Mapping[str, Any]

    def second_opinion(self, answer: GuaranteedProbability) -> list[Check]:
        elements = self.system.elements.values()
        ranges = {one.name: (one.low, one.high) for one in elements if isinstance(one, RealElement)}
        values = members.drawn_values(ranges, self.laws)
        counts = members.good_share(self.system.at, values, self.gain)
        return [members.probability_agrees(counts, answer.lower, answer.upper)]


class _Question:
    """Question about a part: do all of its members keep stability and gain, or none of them?"""

    def __init__(self, found: UncertainSystem, gain: float | None) -> None:
        structure, plant = found.structure, found.system
        c, r = structure.columns, structure.rows
        self.gain = gain
        if gain is not None:
            scale = np.concatenate([np.ones(c), np.full(found.noutputs, 1 / gain)])
            scaled = (plant.A, plant.B, scale[:, None] * plant.C, scale[:, None] * plant.D)
            plant = realisation(scaled, plant.dt)
            structure = structure.with_performance(found.noutputs, found.ninputs)
        stable, _ = even_channels(plant, structure)
        self.given = RealParameters(stable, structure)
        self.response = stable.response(starting_grid(stable.poles))
        self.parameters = RealParameters(
            stable.channels(np.arange(c), np.arange(r)), found.structure
        )

    def asked_of(self, part: BoxPart) -> tuple[bool | None, BoxPart, RealArray]:
        """The verdict (None: undecided), the part with its remaining bands, and how much each
        parameter matters.
        """
        effects = self._changes(part)
        if effects.any():
            return None, part, effects
        stable = self.parameters.all_stable(part)
        if stable is False or (stable and self.gain is None):
            return stable, part, effects
        about = self.given.recentred(part)
        if about is None:
            return None, part, effects
        if about.stable:
            bands, response = about.open_bands(part.bands)
            if not bands:
                return True, part, effects
            above = self.gain is not None and self._above(about.system)
            effects = effects_in(response, self.given.structure)
            return (False if above else None), replace(part, bands=bands), effects
        alone = self.parameters.recentred(part)
        if alone is None:
            return None, part, effects
        bands, response = alone.open_bands(WHOLE)
        effects = effects_in(response, self.parameters.structure)
        return (None if bands else False), part, effects

    def _changes(self, part: BoxPart) -> RealArray:
        """For each parameter, the number of edges of a part along which the answer changes, in
        doubles.
        """
        signs = corner_signs(len(part.width))
        values = part.centre + signs * part.width
        bad = self.parameters.unstable(values)
        if self.gain is not None:
            bad = bad | (self._gains(values) > 1.0)
        changes = np.zeros(len(part.width))
        for j in range(min(len(part.width), int(np.log2(len(signs))))):
            changes[j] = np.count_nonzero(bad[signs[:, j] > 0] != bad[signs[:, j] < 0])
        return changes

    def _gains(self, values: RealArray) -> RealArray:
        """Largest gains (k,) at values (k, p), divided by the level, over frequencies chosen for
        the nominal.
        """
        c, r = self.parameters.structure.columns, self.parameters.structure.rows
        M = self.response[None]
        Delta = self.parameters.perturbation(values)[:, None]
        with np.errstate(all="ignore"):
            loop = np.eye(c) - M[..., :c, :r] @ Delta
            inner = Delta @ np.linalg.solve(
                loop, np.broadcast_to(M[..., :c, r:], (*loop.shape[:-1], M.shape[-1] - r))
            )
            found = M[..., c:, r:] + M[..., c:, :r] @ inner
        gains: RealArray = np.linalg.norm(found, 2, axis=(-2, -1)).max(axis=1)
        return gains

    def _above(self, system: StableSystem) -> bool:
        """Whether one entry of the response is proven to be above 1 at one frequency, for all
        members.

        For F = M22 + M21 Delta (I - M11 Delta)^-1 M12, 1 / F is the LFT with that channel reversed.
        """
        c, r = self.parameters.structure.columns, self.parameters.structure.rows
        M = system.response(starting_grid(system.poles))
        size = np.abs(M[:, c:, r:])
        k, i, j = np.unravel_index(int(np.argmax(size)), size.shape)
        if not size[k, i, j] > 1.0:
            return False
        one = M[k]
        direct, out, into = one[c + i, r + j], one[c + i, :r], one[:c, r + j]
        reversed_ = np.block(
            [
                [one[:c, :r] - np.outer(into, out) / direct, into[:, None] / direct],
                [-out[None] / direct, np.array([[1 / direct]])],
            ]
        )
        structure = Structure((*self.parameters.structure, Complex(1)))
        return bool(upper_bound(reversed_, structure).value < BELOW)


def _weight(found: UncertainSystem, distributions: Mapping[str, Any]) -> Weight:
    """Function that gives the probability of a part."""
    elements: list[RealElement] = []
    for name, one in found.elements.items():
        if not isinstance(one, RealElement):
            raise InputError(
                f"{name} is no real parameter; only real parameters can have a distribution"
            )
        elements.append(one)
    for name, given in distributions.items():
        if name not in found.elements:
            raise UnknownNameError("parameter", name, list(found.elements))
        if not hasattr(given, "cdf"):
            raise InputError(
                f"the distribution of {name} is {given!r}; one with a cdf is needed, such as "
                "scipy.stats.norm(10, 1)"
            )
    functions = [_share_below(one, distributions.get(one.name)) for one in elements]

    def weight(low: RealArray, high: RealArray) -> float:
        shares = [f(b) - f(a) for f, a, b in zip(functions, low, high, strict=True)]
        if min(shares) < 0:
            name = elements[int(np.argmin(shares))].name
            raise InputError(f"the cdf of {name} decreases, as no distribution function does")
        return float(np.prod(shares))

    return weight


def _share_below(element: RealElement, given: Any) -> Callable[[float], float]:
    """Function that gives the probability that a parameter, within its range, is at most a
    normalised value.

    A part does not contain its lower end, except at the lower end of the range: a probability that
    is concentrated there belongs to the range.
    """
    low, high = element.low, element.high
    if given is None:
        return lambda delta: (min(max(element.value(delta), low), high) - low) / (high - low)
    beneath = float(given.cdf(np.nextafter(low, -math.inf)))
    whole = float(given.cdf(high)) - beneath
    if not whole > 0:
        raise InputError(
            f"the distribution of {element.name} has no probability between {low:g} and {high:g}, "
            "the range of the parameter"
        )

    def share(delta: float) -> float:
        if delta <= -1.0:
            return 0.0
        return 1.0 if delta >= 1.0 else (float(given.cdf(element.value(delta))) - beneath) / whole

    return share
