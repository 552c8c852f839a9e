"""The confidence region of estimated coefficients as a linear fractional transformation.

In the basis of the fit the numerator and the denominator of a model are b'n and 1 + b'd over one
polynomial. The error of their estimated coefficients is c = L e, where the e are independent and
normal with variance 1. With y = G u,

    y = N u + e' q,    q = L' [b u; -b y],

so the whole set is a system that depends on N and D only, closed with e. This is exact, not a
first-order approximation, and e is the same for all frequencies. Two regions of e contain the truth
with the stated probability: the ball |e| <= rho, and the box |e_i| <= beta, which is smaller along
its axes. For mu the box is a set of real scalars. The ball is one full block with one row, which is
complex: at one frequency its models fill a disc, whose radius is up to sqrt(2) times that of the
real ball.
"""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from workbench._core.arrays import ComplexArray, RealArray
from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError
from workbench.identification.rational_models.model import CommonPoleModel
from workbench.identification.rational_models.uncertainty import ModelUncertainty
from workbench.input_checks import need_choice, need_tolerance
from workbench.structure import Full, Real, Structure
from workbench.uncertainty.algebra.system import Algebraic

Region = Literal["ball", "box"]
"""Shapes of the region of coefficients."""
KNOWN = 1e-12
"""A direction with a singular value of L below this, relative to the largest, counts as known."""


@dataclass(frozen=True, eq=False)
class EstimateRegion(Algebraic):
    """The models with coefficients in a confidence region around those of an estimate.

    Unlike an `UncertainSystem`, it is a confidence region and has a probability.

    Parameters
    ----------
    uncertainty
        Distribution of the estimates, as `fit_rational_model` gives it, in continuous time.
    confidence
        Probability, between 0 and 1, that the region holds the true coefficients.
    region
        "ball" or "box". The structure is one full block with one row for the ball, and real scalars
        for the box.
    entry
        Indices of output and input.

    Raises
    ------
    InputError
        The model is sampled or has a delay; the entry or the region does not exist; or the
        confidence is out of range.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.identification import ResponseEstimate, fit_rational_model
    >>> from workbench.uncertainty import EstimateRegion
    >>> rng, frequency = np.random.default_rng(0), np.geomspace(0.05, 5, 60)
    >>> noise = 1e-2 * rng.standard_normal((60, 2)) @ [1, 1j]
    >>> response = (3 / (2j * np.pi * frequency + 2) + noise)[:, None, None]
    >>> measured = ResponseEstimate(frequency, response, np.full((60, 1, 1), 2e-4), np.inf)
    >>> estimate = fit_rational_model(measured, orders=1, excess=1)
    >>> region = EstimateRegion(estimate.uncertainty, confidence=0.95)
    >>> region.dimension, region.contains(estimate.model)
    (2, True)
    """

    uncertainty: ModelUncertainty
    _: KW_ONLY
    confidence: float = 0.95
    region: Region = "ball"
    entry: tuple[int, int] = (0, 0)

    def __post_init__(self) -> None:
        need_tolerance(self.confidence)
        need_choice(self.region, Region, "region")
        model = self.uncertainty.model
        if model.dt is not None:
            raise InputError("a model in continuous time is needed, not a sampled one")
        (i, j), (p, m) = self.entry, model.shape
        if not (0 <= i < p and 0 <= j < m):
            raise InputError(f"entry is {self.entry!r}; the model has {p} outputs and {m} inputs")
        if model.delay[i, j] or self.uncertainty.structure.free_delay:
            raise InputError(f"entry {self.entry!r} has a delay: fit a model without one")

    # --- the region -----------------------------------------------------------------------------

    @cached_property
    def _numerator(self) -> tuple[int, RealArray]:
        """Index of the first coefficient of the entry's numerator, and the coefficients."""
        place = 0
        for entry, share in self.uncertainty.point.each_share():
            if entry == self.entry:
                return place, share
            place += share.size
        raise AssertionError("the entry is one of the model's")

    @cached_property
    def factor(self) -> RealArray:
        """L (c, k): first rows for the coefficients of the numerator, then for those of the
        denominator.
        """
        place, share = self._numerator
        root, n = self.uncertainty.root, self.uncertainty.model.order
        rows = np.concatenate([root[place : place + share.size], root[len(root) - n :]])
        U, s, _ = np.linalg.svd(rows, full_matrices=False)
        kept = s > KNOWN * s.max(initial=0.0)
        found: RealArray = U[:, kept] * s[kept]
        return found

    @property
    def dimension(self) -> int:
        """Number k of independent normal variables."""
        return int(self.factor.shape[1])

    @property
    def size(self) -> float:
        """Radius of the ball, or half the edge of the box, in standard deviations."""
        if self.region == "ball":
            return float(np.sqrt(stats.chi2.ppf(self.confidence, self.dimension)))
        each = self.confidence ** (1.0 / self.dimension)
        return float(stats.norm.ppf((1.0 + each) / 2.0))

    def coordinates(self, model: CommonPoleModel) -> RealArray:
        """The e (k,) of a model of the same order, relative to the region's size.

        The region holds the model if |e| <= 1, or every |e_i| <= 1. Raises InputError for a model
        with another order or with a delay.
        """
        point, structure = self.uncertainty.point, self.uncertainty.structure
        i, j = self.entry
        if model.order != point.poles.size or model.delay[i, j]:
            raise InputError(
                f"the model has {model.order} poles and a delay of {model.delay[i, j]:.4g} s; "
                f"{point.poles.size} poles and none are needed"
            )
        _, share = self._numerator
        poles = model.poles / structure.unit
        ratio = np.prod([(structure.x - p) / (structure.x - q)
                         for p, q in zip(poles, point.poles, strict=True)], axis=0)  # fmt: skip
        numerator = model.response(structure.data.omega)[:, i, j] * ratio
        basis = point.basis.values
        change = np.concatenate(
            [
                _projected(basis[:, : share.size], numerator) - share,
                _projected(basis[:, :-1], ratio - 1.0),
            ]
        )
        found: RealArray = np.linalg.lstsq(self.factor, change, rcond=None)[0] / self.size
        return found

    def contains(self, model: CommonPoleModel) -> bool:
        """Whether the region contains a model; raises errors like `coordinates`."""
        e = self.coordinates(model)
        return bool(np.linalg.norm(e) <= 1.0 if self.region == "ball" else np.abs(e).max() <= 1.0)

    def sampled(self, rng: np.random.Generator, count: int) -> RealArray:
        """Points e (count, k) on the boundary of the region, relative to its size; half of a box's
        are corners.

        Points of the ball are uniform in direction.
        """
        if self.region == "ball":
            e = rng.standard_normal((count, self.dimension))
            return e / np.linalg.norm(e, axis=1, keepdims=True)
        e = rng.uniform(-1.0, 1.0, (count, self.dimension))
        e[np.arange(count), rng.integers(self.dimension, size=count)] = 1.0
        corner = np.arange(count) % 2 == 0
        return np.where(corner[:, None], np.sign(e), e)

    def response(self, omega: ArrayLike, e: ArrayLike) -> ComplexArray:
        """Responses (..., F) of the models at e (..., k), relative to the region's size."""
        omega = np.atleast_1d(np.asarray(omega, float))
        _, share = self._numerator
        basis = self.uncertainty.point.basis.at(1j * omega / self.uncertainty.structure.unit)
        change = np.asarray(e, float) @ (self.size * self.factor).T
        numerator = (share + change[..., : share.size]) @ basis[:, : share.size].T
        found: ComplexArray = numerator / (1.0 + change[..., share.size :] @ basis[:, :-1].T)
        return found

    # --- the linear fractional transformation ---------------------------------------------------

    @property
    def structure(self) -> Structure:
        """One full block (1, k), or k real scalars."""
        if self.region == "ball":
            return Structure([Full(1, self.dimension, name="coefficients")])
        return Structure([Real(1, name=f"coefficient {k + 1}") for k in range(self.dimension)])

    @property
    def lti(self) -> StateSpace:
        """The estimated model."""
        import control

        A, B, C, D = self._realised[:4]
        return control.ss(A, B[:, -1:], C[-1:], D[-1:, -1:], inputs="u", outputs="y")

    @cached_property
    def system(self) -> StateSpace:
        """System with inputs (w_1, ..., u) and outputs (z_1, ..., y), closed by the structure."""
        import control

        A, B, C, D = self._realised
        inputs = [f"w_{k + 1}" for k in range(B.shape[1] - 1)]
        outputs = [f"z_{k + 1}" for k in range(self.dimension)]
        return control.ss(A, B, C, D, inputs=[*inputs, "u"], outputs=[*outputs, "y"])

    @cached_property
    def _realised(self) -> tuple[RealArray, RealArray, RealArray, RealArray]:
        """A, B, C and D: the basis functions over a stable polynomial, driven by u and again by y.

        If the estimate is stable, this polynomial is its denominator. Unstable poles are mirrored,
        so that no unreachable state is unstable.
        """
        point, structure = self.uncertainty.point, self.uncertainty.structure
        _, share = self._numerator
        n, basis = point.poles.size, point.basis
        mirrored = -np.abs(point.poles.real) + 1j * point.poles.imag
        ratio = np.prod([(structure.x - p) / (structure.x - q)
                         for p, q in zip(mirrored, point.poles, strict=True)], axis=0)  # fmt: skip
        f = _projected(basis.values, ratio)
        one = basis.one * f[-1] / basis.one[-1]  # both polynomials have the leading coefficient 1
        last = np.eye(n)[:, -1:] * basis.recurrence[-1, -1] / f[-1]
        a = structure.unit * (basis.recurrence[:n].T - last * f[:-1])
        b = structure.unit * last
        values = np.vstack([np.eye(n), -f[:-1] / f[-1]]), np.append(np.zeros(n), 1.0 / f[-1])
        held, direct = (part[: share.size] for part in values)
        y = np.concatenate([share @ held, f[:-1] - one[:-1]])
        straight = float(share @ direct)
        count = 1 if self.region == "ball" else self.dimension
        L = self.size * self.factor
        zero = np.zeros((n, n))
        A = np.block([[a, zero], [b * y[None, :n], a + b * y[None, n:]]])
        B = np.block([[np.zeros((n, count)), b], [np.tile(b, count), straight * b]])
        C = np.vstack([np.hstack([L[: share.size].T @ held, -L[share.size :].T]), y[None]])
        D = np.zeros((self.dimension + 1, count + 1))
        D[:-1, -1] = L[: share.size].T @ direct
        D[-1] = np.append(np.ones(count), straight)
        return A, B, C, D


def _projected(columns: ComplexArray, values: ComplexArray) -> RealArray:
    """Real coefficients with which the columns (F, c) give the values (F,)."""
    rows = np.concatenate([columns.real, columns.imag])
    right = np.concatenate([values.real, values.imag])
    return np.asarray(np.linalg.lstsq(rows, right, rcond=None)[0])
