"""The least inflation that the order of a nominal allows, proven: `least_inflation`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench.answer import Answer
from workbench.certificate import Check, Checker, relative_excess
from workbench.certify.proofs.rational_discs import none_within
from workbench.errors import InputError
from workbench.executor import Context
from workbench.fitting.response.numerator import NumeratorBasis, real_over_imaginary
from workbench.input_checks import need_kind
from workbench.solvers import Options
from workbench.uncertainty.covers.cover import UncertaintyCover
from workbench.uncertainty.covers.joint.starts import nearest_fit
from workbench.uncertainty.covers.limits.multipliers import PointForms, best_weights
from workbench.uncertainty.covers.nominal import mean_response, nominal_fit
from workbench.uncertainty.covers.sizes.inflation import extent

LEAST_EXTENT = 1e-9
"""Sets whose extent, relative to their largest point, is below this are left out of the bound. They
are one point up to rounding, and a ratio to their size says nothing. Half or double decides the
same.
"""
ROUNDED_DOWN = (1e-9, 1e-7, 1e-5, 1e-3)
"""Shares by which the computed bound is lowered, until the weights prove it. Each next one gives up
a hundred times as much. Half or double changes the proven bound by as little.
"""
REPEATED_ROUNDING = 1e-4
"""Relative rounding error of the second opinion, which works in doubles. Weights over many decades
cost half of the digits, and of the rest squares cost half. With half of it a true bound may be
contradicted; double overlooks 2e-4.
"""


@dataclass(frozen=True, eq=False, repr=False)
class LeastInflation(Answer):
    """A lower bound on the inflation, over the sets with free centres, of any cover.

    ``value`` holds for all weights and for every nominal with at most ``order`` poles and ``zeros``
    zeros; 0 says nothing. ``weights`` (F, N) of the points prove it. `least_inflation` returns it.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.uncertainty import CircleCover, Responses, least_inflation
    >>> s = 1j * np.geomspace(0.1, 10, 30)[:, None]
    >>> plants = Responses(omega=s.imag[:, 0], values=1 / (s * [0.9, 1.0, 1.1] + 1))
    >>> bound = least_inflation(CircleCover(plants, order=0))
    >>> bound.value > 10, bound.zeros
    (True, 0)
    """

    order: int
    zeros: int
    value: float
    weights: RealArray


@dataclass(frozen=True, eq=False)
class LeastInflationChecker(Checker):
    """Checks by the responses and the weights alone that no nominal comes below the bound."""

    program: UncertaintyCover

    @property
    def quantifier(self) -> str:
        program = self.program
        return (
            f"for all weights and every nominal with at most {program.order} poles and "
            f"{program.zeros} zeros, {program.responses.over}"
        )

    def proves(self, value: float, weights: RealArray) -> bool:
        """Whether the weights prove the bound."""
        program = self.program
        if np.shape(weights) != program.points.shape:
            return False
        f, i = np.nonzero(weights)
        sizes = extent(program.raw_sets)
        return value == 0.0 or none_within(
            program.responses.axis[f],
            program.points[f, i],
            sizes[f],
            value,
            weights[f, i],
            (program.zeros, program.order),
        )

    def checks(self, answer: LeastInflation, tolerance: float) -> list[Check]:
        asked = self.program.order, self.program.zeros
        statement = "number of claims that the weights do not prove"
        wrong = (answer.order, answer.zeros) != asked or not answer.value >= 0
        failed = wrong or not self.proves(answer.value, answer.weights)
        return [Check("least inflation", statement, float(failed), 0.0, proven=True)]

    def second_opinion(self, answer: LeastInflation) -> list[Check]:
        excess = relative_excess(answer.value, self.bound(answer.weights))
        statement = "bound over the one from singular values, less 1"
        return [Check("least inflation again", statement, excess, REPEATED_ROUNDING)]

    def bound(self, weights: RealArray) -> float:
        """The bound that weights (F, N) prove, in doubles: one over the largest singular value."""
        program = self.program
        if np.shape(weights) != program.points.shape or not (weights >= 0).all():
            return 0.0
        f = np.flatnonzero(weights.any(axis=1))
        if not _determine(program, f):
            return 0.0
        weights, points = weights[f], program.points[f]
        omega, size = program.responses.axis[f], extent(program.raw_sets)[f]
        root = np.sqrt(weights.sum(axis=1))
        top = _powers(omega, root, program.zeros)
        bottom = _powers(omega, root * size, program.order)
        beside = -points[..., None] * bottom[:, None] / size[:, None, None]
        first = np.broadcast_to(top[:, None], (*points.shape, top.shape[1]))
        away = np.concatenate([first, beside], axis=2) / root[:, None, None]
        away *= np.sqrt(weights)[..., None]
        rows = real_over_imaginary(away.reshape(-1, away.shape[2]))
        below = real_over_imaginary(np.hstack([np.zeros_like(top), bottom]))
        triangle = np.asarray(np.linalg.qr(rows, mode="r"))
        try:
            seen = np.linalg.solve(triangle.T, below.T)
        except np.linalg.LinAlgError:  # a nominal passes through the points
            return 0.0
        return 1 / float(np.linalg.norm(seen, 2))


def _determine(program: UncertaintyCover, f: np.ndarray) -> bool:
    """Whether so many frequencies (f,) determine polynomials of the nominal's order."""
    return 2 * f.size > program.order


def _powers(omega: RealArray, weight: RealArray, degree: int) -> ComplexArray:
    """Weighted values (F, C) of polynomials in s up to a degree, orthonormal over frequencies."""
    x, none = omega / np.exp(np.log(omega).mean()), np.zeros(0, dtype=complex)
    columns = NumeratorBasis.over(x, weight, none, degree).columns
    return np.asarray(columns[: omega.size] + 1j * columns[omega.size :])


def least_inflation(program: UncertaintyCover, *, options: Options | None = None) -> LeastInflation:
    """Lower bound on ``inflation_free`` of every cover with a nominal of the program's order.

    A set that contains the plants reaches from its centre, the nominal, to the farthest plant. So
    the largest ratio of radius plus half-length to that of the narrowest set with a free centre is
    at least the largest ratio of this distance. The bound holds for the weights of any order: what
    a cover has above it is due to its weights, or to the search.

    Parameters
    ----------
    program
        A `CircleCover` or `StadiumCover` whose nominal is not given, without points left out.
    options
        Limit of time and seed of the fit from which the search starts.

    Raises
    ------
    InputError
        The nominal is given, or points may be left out.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.uncertainty import CircleCover, Responses, least_inflation
    >>> omega = np.geomspace(0.1, 10, 30)
    >>> plants = np.array([1 / (1j * omega * time + 1) ** 3 for time in (0.95, 1.0, 1.05)]).T
    >>> bound = least_inflation(CircleCover(Responses(omega=omega, values=plants), order=2))
    >>> round(bound.value, 1), bound.holds
    (4.8, True)

    Notes
    -----
    The bound is the S-procedure for the coefficients of the nominal, proven in ball arithmetic.
    """
    need_kind(program, UncertaintyCover, "program")
    if program.nominal is not None:
        raise InputError("the nominal is given, so its order limits nothing; leave out nominal=")
    if program.leave_out:
        raise InputError("with leave_out a cover chooses the points to leave out; leave out none")
    weights = np.zeros(program.points.shape)
    checker = LeastInflationChecker(program)
    sizes, largest = extent(program.raw_sets), np.abs(program.points).max(axis=1)
    apart = np.flatnonzero(sizes > LEAST_EXTENT * largest)
    if _determine(program, apart):
        found = best_weights(_forms(program, apart, options or Options()))
        weights[apart] = 0.0 if found is None else found / found.max()
    bound = checker.bound(weights)
    lowered = (bound * (1 - share) for share in ROUNDED_DOWN)
    value = next((one for one in lowered if checker.proves(one, weights)), 0.0)
    return LeastInflation(program.order, program.zeros, value, weights).with_checker(checker)


def _forms(program: UncertaintyCover, apart: np.ndarray, options: Options) -> PointForms:
    """The forms of the points at frequencies with these indices."""
    near = nominal_fit(mean_response(program.responses.points), program.raw_sets, program)
    return PointForms(
        program.responses.axis[apart],
        program.points[apart],
        extent(program.raw_sets)[apart],
        nearest_fit(near, Context(options=options)),
        program.zeros,
        program.order,
    )
