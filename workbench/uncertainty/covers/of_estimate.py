"""The uncertainty model of one plant from its estimate: discs that contain it at a stated
confidence.

The plants of the estimate's confidence ellipsoid fill a set around the estimated response at every
frequency. A disc contains it, to first order in the errors, and a weight covers the radii of the
discs. So the true plant lies in the cover with the stated probability, at all frequencies together,
if the model structure can follow it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import ComplexArray, RealArray
from workbench._core.heavy_types import Figure
from workbench.answer import Answer
from workbench.certificate import Check, Checker, worst_value
from workbench.errors import InputError
from workbench.executor import Context
from workbench.executor.effort import tries
from workbench.fitting.samples import as_count, as_frequencies
from workbench.geometry.enclosing_shape import CONTAINMENT_TOLERANCE
from workbench.identification.rational_models.uncertainty import ModelUncertainty
from workbench.input_checks import need_tolerance
from workbench.second_opinion import SEED
from workbench.solvers import Options
from workbench.uncertainty.covers.model import UncertaintyModel
from workbench.uncertainty.covers.weights import complex_weight

COVERED_DECADE_POINTS = 100
"""Number of frequencies in a decade at which discs are computed, besides those of the data. A step
is 2.3 %, which resolves a damping of 0.01. With half of them narrower resonances are seen between
`BETWEEN` frequencies only; double takes twice as long.
"""


BETWEEN = 8
"""Number of frequencies that a check uses between two covered ones. They make steps of 0.3 %. With
half of them the check may miss a narrow peak; double takes twice as long.
"""
DRAWN = 400
"""Number of models that the second opinion draws from the distribution of the estimates. 95 % of
400 has a standard deviation of 1 %. With half of them a confidence wrong by a few percent is not
noticed; double takes twice as long.
"""
DOUBT = 1e-9
"""Probability that drawn models wrongly refute a cover at the stated confidence. The ledger is
verified often, so a false alarm must be rare; it allows six standard deviations. Half or double
changes the count by one.
"""


@dataclass(frozen=True, eq=False, repr=False)
class CoverOfEstimate(Answer, UncertaintyModel):
    """A model of the plants that agree with an estimate; ``value`` is the largest ratio of disc to
    weight.

    Examples
    --------
    See `cover_of_estimate`.
    """

    @property
    def value(self) -> float:
        """Largest ratio of a disc's radius to the weight's, at most 1."""
        return self._checked_by[0].headline_value(self) if self._checked_by else np.nan

    def summary(self) -> str:
        return UncertaintyModel.__repr__(self).replace("UncertaintyModel", type(self).__name__, 1)

    def plot(self, name: str | None = None) -> Figure:
        """The sets of the model over frequency, as `UncertaintyModel.plot`."""
        return UncertaintyModel.plot(self)


@dataclass(frozen=True, eq=False)
class CoverOfEstimateChecker(Checker):
    """Checks a `CoverOfEstimate` with the distribution of the estimates, on a finer grid."""

    uncertainty: ModelUncertainty
    confidence: float
    entry: tuple[int, int]
    omega: RealArray

    @property
    def quantifier(self) -> str:
        return f"at {self._fine.size} frequencies, for the plants of the estimate's region"

    @property
    def _fine(self) -> RealArray:
        places = np.arange((self.omega.size - 1) * BETWEEN + 1) / BETWEEN
        found: RealArray = np.exp(np.interp(places, np.arange(self.omega.size), np.log(self.omega)))
        return found

    def _sizes(self, answer: UncertaintyModel) -> RealArray:
        """Radius (F,) of the model's discs."""
        found: RealArray = np.abs(answer.W_c.response(self._fine))
        if answer.form == "multiplicative":
            found = found * np.abs(answer.nominal.response(self._fine))
        return found

    def headline_value(self, answer: UncertaintyModel) -> float:
        return float((self._discs() / self._sizes(answer)).max())

    def _discs(self) -> RealArray:
        radius = self.uncertainty.radius(self._fine, confidence=self.confidence, everywhere=True)
        return radius[:, *self.entry]

    def checks(self, answer: UncertaintyModel, tolerance: float) -> list[Check]:
        apart = answer.nominal.response(self._fine) - self._estimated()
        beyond = (self._discs() + np.abs(apart)) / self._sizes(answer) - 1.0
        value, where = worst_value(beyond, lambda at: f"at {self._fine[at[0]]:.6g} rad/s")
        statement = "radius of a disc over that of the model, less 1"
        return [Check("containment", statement, value, CONTAINMENT_TOLERANCE, where=where)]

    def second_opinion(self, answer: UncertaintyModel) -> list[Check]:
        from scipy.stats import binom

        rng = np.random.default_rng(SEED)
        count = tries(DRAWN)
        drawn = self.uncertainty.drawn(rng, self._fine, count)[:, :, *self.entry]
        away = np.abs(drawn - answer.nominal.response(self._fine))
        outside = int((away > self._sizes(answer)).any(axis=1).sum())
        most = float(binom.isf(DOUBT, count, 1.0 - self.confidence))
        statement = f"number of {count} models drawn from the estimate that are not in the model"
        return [Check("drawn", statement, outside, most)]

    def _estimated(self) -> ComplexArray:
        """Response (F,) of the entry of the estimate."""
        found: ComplexArray = self.uncertainty.model.response(self._fine)[:, *self.entry]
        return found


def cover_of_estimate(
    uncertainty: ModelUncertainty,
    order: int,
    *,
    confidence: float = 0.95,
    entry: tuple[int, int] = (0, 0),
    form: Literal["multiplicative", "additive"] = "multiplicative",
    omega: ArrayLike | None = None,
    options: Options | None = None,
) -> CoverOfEstimate:
    """Cover of one entry of an estimated continuous-time model, with discs at a confidence.

    Its ``system`` and ``structure`` are the linear fractional transformation that mu synthesis
    takes.

    Parameters
    ----------
    uncertainty
        Distribution of the estimates, as `fit_rational_model` gives it.
    order
        Order of the complex weight.
    confidence
        Probability, between 0 and 1, that the true response is in all discs.
    entry
        Indices of output and input.
    form
        Form of the model, as in `UncertaintyModel`.
    omega
        Frequencies (F,) [rad/s] to cover; None for the band of the data.
    options
        Accuracy and time limit of the fit of the weight.

    Raises
    ------
    InputError
        The model is sampled or has a delay; the entry does not exist; or the confidence is out of
        range.
    SolverError
        No weight of that order covers the discs.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.identification import ResponseEstimate, fit_rational_model
    >>> from workbench.uncertainty import cover_of_estimate
    >>> rng, frequency = np.random.default_rng(0), np.geomspace(0.05, 5, 60)
    >>> noise = 1e-2 * rng.standard_normal((60, 2)) @ [1, 1j]
    >>> response = 3 / (2j * np.pi * frequency + 2) + noise
    >>> measured = ResponseEstimate(
    ...     frequency, response[:, None, None], np.full((60, 1, 1), 2e-4), np.inf
    ... )
    >>> estimate = fit_rational_model(measured, orders=1, excess=1)
    >>> model = cover_of_estimate(estimate.uncertainty, order=1, confidence=0.95)
    >>> model.structure.rows, model.holds
    (1, True)
    """
    need_tolerance(confidence)
    order = as_count("order", order)
    model, data = uncertainty.model, uncertainty.structure.data
    if model.dt is not None:
        raise InputError("a model in continuous time is needed, not a sampled one")
    i, j = entry
    p, m = model.shape
    if not (0 <= i < p and 0 <= j < m):
        raise InputError(f"entry is {entry!r}; the model has {p} outputs and {m} inputs")
    if model.delay[i, j]:
        raise InputError(
            f"entry {entry!r} has a delay of {model.delay[i, j]:.4g} s: fit a model without one, "
            "or give its rational part a weight of its own"
        )
    if omega is None:
        low, high = float(data.omega[0]), float(data.omega[-1])
        count = int(np.ceil(np.log10(high / low) * COVERED_DECADE_POINTS)) + 2
        grid = np.union1d(np.geomspace(low, high, count), data.omega)
    else:
        grid = as_frequencies(omega)
    nominal = model.entries[i][j]

    def wanted(at: RealArray) -> RealArray:
        radius: RealArray = uncertainty.radius(at, confidence=confidence, everywhere=True)[:, i, j]
        return radius / np.abs(nominal.response(at)) if form == "multiplicative" else radius

    # The weight covers straight lines in log-log scale from one frequency to the next. The lines
    # are raised by twice the excess of the radii between the frequencies, which is largest near a
    # resonance.
    radius, middle = wanted(grid), np.sqrt(grid[1:] * grid[:-1])
    excess = np.max(wanted(middle) / np.sqrt(radius[1:] * radius[:-1]), initial=1.0) - 1.0
    radius = radius * (1.0 + 2.0 * excess)
    weight = complex_weight(
        grid, radius, np.ones_like(radius), order, Context(options=options or Options())
    )
    found = CoverOfEstimate(nominal, weight, form=form)
    return found.with_checker(CoverOfEstimateChecker(uncertainty, confidence, entry, grid))
