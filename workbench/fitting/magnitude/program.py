"""Stable, minimum-phase rational functions that fit or cover magnitudes: weights, D-scales."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import Dataset, Figure
from workbench.answer import answer_of
from workbench.certificate import THIS_SYSTEM, Check, quantified_checks, worst_value
from workbench.errors import InputError, SolverError
from workbench.fitting.fitted_system import FittedSystem
from workbench.fitting.magnitude import results
from workbench.fitting.magnitude.alternation import error_bound
from workbench.fitting.magnitude.coverage import least_margin
from workbench.fitting.rational import Rational
from workbench.fitting.samples import as_count, as_frequencies, as_positive
from workbench.fitting.storage import restored_rational
from workbench.program import Program
from workbench.second_opinion.fits import covers, decays, inverse_decays, realisation_agrees
from workbench.solvers import Options

LARGEST_ORDER = 12
"""Largest order that `fit_magnitude` tries in search of the smallest one."""
MATCHED_ERROR = 1e-9
"""Worst error at or below which the data count as matched."""
COVER_GAIN_ALLOWANCE = 2e-9
"""Relative excess of a cover's gain, caused by rounding it upward, that the optimality gap
ignores.
"""
_TINY = float(np.finfo(float).tiny)
"""Smallest normal number: the bound of a check that asks for a positive or negative value."""
_HUGE = float(np.finfo(float).max)
"""Largest number: the bound of a check that asks for a finite value."""


@dataclass(frozen=True, eq=False)
class MagnitudeFit(Program):
    """Stable, minimum-phase W with the smallest worst error max_i w_i | |W(j omega_i)| / m_i - 1 |.

    The problem is quasi-convex in the coefficients of |W|^2, so the optimum is global. It is
    certified by alternation. The answer is a `Rational`.

    Parameters
    ----------
    omega
        Angular frequencies [rad/s] (F,), increasing, positive.
    magnitude
        m (F,), positive.
    order
        Largest number n >= 0 of poles, and of zeros; F >= 2 n + 2 data are needed.
    weight
        w (F,), positive; 1 by default.
    cover
        Whether |W| >= m must hold at the data and between them, where m is linear in log-log
        scale. The error is then max_i w_i (|W| / m_i - 1).

    Raises
    ------
    InputError
        Data that are not as above; the message says which and where.

    Examples
    --------
    >>> import numpy as np
    >>> import workbench as wb
    >>> from workbench.fitting import MagnitudeFit
    >>> omega = np.geomspace(0.1, 10, 30)
    >>> solution = wb.solve(MagnitudeFit(omega, 1 / np.hypot(omega, 1), order=1))
    >>> solution.certificate.holds, solution.answer.poles.real.round(4).tolist()
    (True, [-1.0])
    """

    omega: Any  # arrays after construction
    magnitude: Any
    order: int
    _: KW_ONLY
    weight: Any = None
    cover: bool = False

    default_method: ClassVar[str] = "best"
    methods_in: ClassVar[tuple[str, ...]] = (
        "workbench.fitting.magnitude.best",
        "workbench.fitting.magnitude.sanathanan_koerner",
        "workbench.fitting.magnitude.sb10yd",
        "workbench.fitting.magnitude.conic",
        "workbench.fitting.magnitude.minimax",
        "workbench.fitting.magnitude.nonlinear",
    )
    headline: ClassVar[str] = "error_worst"
    relative_metrics: ClassVar[tuple[str, ...]] = ("cover_margin",)

    def __post_init__(self) -> None:
        omega = as_frequencies(self.omega)
        weight = np.ones_like(omega) if self.weight is None else self.weight
        object.__setattr__(self, "omega", omega)
        object.__setattr__(self, "magnitude", as_positive("magnitude", self.magnitude, omega))
        object.__setattr__(self, "weight", as_positive("weight", weight, omega))
        object.__setattr__(self, "order", as_count("order", self.order))
        if 2 * self.order + 2 > omega.size:
            raise InputError(
                f"order {self.order} needs {2 * self.order + 2} data, there are {omega.size}: "
                f"at most order {max(omega.size // 2 - 1, 0)} fits them"
            )

    def with_order(self, order: int) -> MagnitudeFit:
        """Program with the same data and another order."""
        return replace(self, order=order)

    # --- objective ----------------------------------------------------------------------------

    @property
    def problem_size(self) -> float:
        """Number of data."""
        return float(self.omega.size)

    def objective(self, answer: Rational) -> float:
        """The worst error, but at least the error at which data count as matched."""
        error = self.error(answer)
        return max(error, MATCHED_ERROR + self._gain_allowance(error))

    def objective_rounding(self, answer: Rational) -> float:
        """Error of a cover that rounding its gain upward may cause; 0 for other fits."""
        return self._gain_allowance(self.error(answer))

    def _gain_allowance(self, error: float) -> float:
        """Part of a cover's worst error that rounding its gain upward may cause."""
        return COVER_GAIN_ALLOWANCE * float(self.weight.max()) * (1 + error) if self.cover else 0.0

    # --- errors and checks --------------------------------------------------------------------

    def errors(self, answer: Rational) -> RealArray:
        """Weighted relative errors (F,); for a cover they are negative where it is too low."""
        relative = np.abs(answer.response(self.omega)) / self.magnitude - 1
        return np.asarray(self.weight * (relative if self.cover else np.abs(relative)))

    def error(self, answer: Rational) -> float:
        """The worst error; infinite if it is not a finite number."""
        value = float(np.max(self.errors(answer)))
        return value if np.isfinite(value) else float("inf")

    def checks(self, answer: Rational, tolerance: float) -> Sequence[Check]:
        def root(kind: str) -> str:
            return f"{kind} of largest real part over size"

        checks = [
            Check("order", "number of poles", answer.poles.size, self.order),
            *quantified_checks(
                THIS_SYSTEM,
                [
                    Check("stable", root("poles"), _rightmost(answer.poles), -_TINY),
                    Check("minimum phase", root("zeros"), _rightmost(answer.zeros), -_TINY),
                ],
            ),
        ]
        error, where = worst_value(self.errors(answer), lambda i: f"at {self.omega[i]:.6g} rad/s")
        over = f"at the {self.omega.size} given frequencies"
        statement = "worst weighted relative error"
        checks.append(Check("finite error", statement, error, _HUGE, where=where, over=over))
        if self.cover:
            margin, omega = least_margin(self.omega, self.magnitude, answer)
            statement, where = "largest natural logarithm of data over fit", f"at {omega:.6g} rad/s"
            over = "at every frequency between the first and the last"
            checks.append(Check("cover", statement, -margin, 0.0, where=where, over=over))
        return checks

    def second_opinion(self, answer: Rational) -> Sequence[Check]:
        system = answer.state_space()
        found = [
            realisation_agrees(system, self.omega, answer.response(self.omega), self.magnitude),
            decays(system, "fit decays"),
        ]
        if answer.zeros.size == answer.poles.size:
            found.append(inverse_decays(answer, "inverse decays"))
        if self.cover:
            found.append(covers(system, self.omega, self.magnitude))
        return found

    def bound(self, answer: Rational) -> float:
        """Lower bound on the worst error of every fit of the order, from this one's alternation."""
        return error_bound(self.omega, self.magnitude, self.weight, self.cover, answer, self.order)

    def gap(self, answer: Rational) -> tuple[str, float]:
        statement = "worst error above its bound by alternation, relative"
        error = self.error(answer)
        rounding = self._gain_allowance(error)
        if error <= MATCHED_ERROR + rounding:
            return f"{statement}; the data are matched", 0.0
        excess = error - self.bound(answer)
        return statement, (excess if excess < 0 else max(excess - rounding, 0.0)) / error

    def metrics(self, answer: Rational) -> dict[str, float]:
        logs = np.log(np.abs(answer.response(self.omega)) / self.magnitude)
        metrics = {
            "error_worst": self.error(answer),
            "error_rms": float(np.sqrt(np.mean(logs**2))),
            "order": answer.order,
        }
        if self.cover:
            metrics["cover_margin"] = least_margin(self.omega, self.magnitude, answer)[0]
        return metrics

    # --- datasets and figures -----------------------------------------------------------------

    def to_dataset(self, answer: Rational) -> Dataset:
        return results.magnitude_dataset(self.omega, self.magnitude, self.weight, answer)

    def from_dataset(self, data: Dataset) -> Rational:
        return restored_rational(data)

    def figures(self, answer: Rational) -> dict[str, Figure]:
        return results.figures(
            self.omega,
            self.magnitude,
            self.weight,
            answer,
            worst=self.error(answer),
            bound=self.bound(answer),
            cover=self.cover,
        )


def fit_magnitude(
    omega: ArrayLike,
    magnitude: ArrayLike,
    *,
    order: int | None = None,
    weight: ArrayLike | None = None,
    cover: bool = False,
    error: float | None = None,
    method: str | None = None,
    options: Options | None = None,
) -> FittedSystem:
    """Stable, minimum-phase system whose magnitude fits data.

    Parameters
    ----------
    omega, magnitude, order, weight, cover
        The same as for `MagnitudeFit`.
    error
        Largest worst error allowed, instead of ``order``: the smallest order that meets it, up to
        `LARGEST_ORDER`, is taken.
    method
        Name of a method of `MagnitudeFit`; by default ``"best"``.
    options
        Accuracy and time limit for the method.

    Returns
    -------
    control.StateSpace
        In general as many zeros as poles, and at most that order. ``solve(MagnitudeFit(...))``
        gives the roots.

    Raises
    ------
    InputError
        Data that do not fit together, neither order nor error, or both.
    SolverError
        The method gave no valid answer, or no order meets the error.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.fitting import fit_magnitude
    >>> omega = np.geomspace(0.1, 10, 30)
    >>> W = fit_magnitude(omega, 1 / np.hypot(omega, 1), order=1, cover=True)
    >>> bool((abs(W(1j * omega)) >= 1 / np.hypot(omega, 1) * (1 - 1e-9)).all())
    True
    """
    options = options or Options()
    if (order is None) == (error is None):
        raise InputError("give either the order or the worst error allowed")
    if order is not None:
        program = MagnitudeFit(omega, magnitude, order, weight=weight, cover=cover)
        return FittedSystem.of(_answer(program, method, options))
    if error is None or not error > 0:
        raise InputError(f"error must be positive, not {error}")
    least = MagnitudeFit(omega, magnitude, 0, weight=weight, cover=cover)
    best = np.inf
    for n in range(min(LARGEST_ORDER, least.omega.size // 2 - 1) + 1):
        program = MagnitudeFit(least.omega, least.magnitude, n, weight=least.weight, cover=cover)
        answer = _answer(program, method, options)
        if program.error(answer) <= error:
            return FittedSystem.of(answer)
        best = min(best, program.error(answer))
    raise SolverError(
        f"no order up to {n} has a worst error of {error:.6g}; the best reached is {best:.6g}: "
        "allow a larger error, give an order, or smooth the data"
    )


def _answer(program: MagnitudeFit, method: str | None, options: Options) -> Rational:
    """Answer of a method that passes the validity checks; else a `SolverError`."""
    answer: Rational = answer_of(program, method, options)
    with np.errstate(all="ignore"):
        failed = [check.name for check in program.checks(answer, 1.0) if not check.holds]
    if failed:
        raise SolverError(f"{method or program.default_method} fails: {', '.join(failed)}")
    return answer


def _rightmost(roots: np.ndarray) -> float:
    """Largest real part of the roots, each relative to its size; -1 without roots."""
    return float(np.max(roots.real / np.maximum(np.abs(roots), _TINY), initial=-1.0))
