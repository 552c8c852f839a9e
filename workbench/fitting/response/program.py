"""Real rational functions that fit complex frequency-response data with the least worst error."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import ComplexArray
from workbench._core.heavy_types import Dataset, Figure
from workbench.certificate import THIS_SYSTEM, Check, worst_value
from workbench.errors import InputError, SolverError
from workbench.fitting.fitted_system import FittedSystem
from workbench.fitting.rational import Rational
from workbench.fitting.response.data import Data
from workbench.fitting.response.figures import bode, nyquist
from workbench.fitting.samples import as_count, as_frequencies, as_responses, as_weights
from workbench.fitting.storage import rational_variables, restored_rational
from workbench.program import Program
from workbench.second_opinion.fits import (
    decays,
    growing_modes,
    inverse_decays,
    realisation_agrees,
    within,
)
from workbench.solution import solve
from workbench.solvers import Options

LARGEST_ORDER = 12
"""Largest order that `fit_response` tries in search of the smallest one."""


@dataclass(frozen=True, eq=False)
class ResponseFit(Program):
    """The `Rational` R of a given order with the least max_i v_i |R(j omega_i) - g_i|.

    The problem has many local minima and no cheap lower bound, so no method claims to find the best
    fit, and certificates have no optimality gap.

    Parameters
    ----------
    omega
        Frequencies [rad/s], shape (F,), positive, rising.
    response
        g, complex, shape (F,).
    order
        Largest number of poles.
    weight
        v, shape (F,), not negative; responses of weight 0 are ignored. The default 1 / |g| gives
        the relative error, ones give the absolute error, w / |g| gives relative errors weighted
        by w.
    stable
        Whether every pole must lie left of the imaginary axis.
    unstable_poles
        Number of poles that must lie right of the imaginary axis; if any, the others must lie left.
    minimum_phase
        Whether every zero must lie left of the imaginary axis.
    zeros
        Largest number of zeros; by default that of the poles.
    error
        Largest worst error of a valid answer; by default there is no limit.

    Raises
    ------
    InputError
        Data or options other than these; more coefficients than data; a response of zero under the
        default weight.

    Examples
    --------
    >>> import numpy as np
    >>> import workbench as wb
    >>> from workbench.fitting import ResponseFit
    >>> omega = np.geomspace(0.1, 10, 30)
    >>> solution = wb.solve(ResponseFit(omega, 3 / (1j * omega + 2), order=1))
    >>> solution.certificate.holds, solution.answer.poles.real.round(4).tolist()
    (True, [-2.0])
    """

    omega: Any  # arrays after construction
    response: Any
    order: int
    _: KW_ONLY
    weight: Any = None
    stable: bool = True
    minimum_phase: bool = False
    zeros: Any = None  # an int after construction
    error: float | None = None
    unstable_poles: int = 0

    default_method: ClassVar[str] = "best"
    methods_in: ClassVar[tuple[str, ...]] = (
        "workbench.fitting.response.vector_fitting",
        "workbench.fitting.response.conic",
        "workbench.fitting.response.nonlinear",
        "workbench.fitting.response.best",
    )
    headline: ClassVar[str] = "error_worst"

    def __post_init__(self) -> None:
        omega = as_frequencies(self.omega)
        response = as_responses(self.response, omega)
        weight = as_weights(self.weight, response, omega)
        order = as_count("order", self.order)
        zeros = order if self.zeros is None else as_count("zeros", self.zeros)
        if zeros > order:
            raise InputError(f"zeros is {zeros}; at most the order, {order}, can be had")
        if not 0 <= as_count("unstable_poles", self.unstable_poles) <= order:
            raise InputError(f"unstable_poles is {self.unstable_poles}; the order is {order}")
        if self.error is not None and not 0 < self.error < np.inf:
            raise InputError(f"error must be positive and finite or None, it is {self.error}")
        fields = {"omega": omega, "response": response, "weight": weight}
        for name, value in (fields | {"order": order, "zeros": zeros}).items():
            object.__setattr__(self, name, value)
        used = int(np.sum(weight > 0))
        if 2 * used < self.coefficients:
            raise InputError(
                f"{used} responses of positive weight are {2 * used} real numbers, but order "
                f"{order} with {zeros} zeros has {self.coefficients} coefficients: lower it"
            )

    @property
    def coefficients(self) -> int:
        """Number of free real coefficients."""
        return self.order + self.zeros + 1

    @cached_property
    def active(self) -> Data:
        """The data of positive weight."""
        used = self.weight > 0
        return Data(self.omega[used], self.response[used], self.weight[used])

    @cached_property
    def size(self) -> float:
        """Largest weighted |response|, which is the worst error of the zero function."""
        return float(np.max(self.active.weight * np.abs(self.active.response)))

    # --- objective ----------------------------------------------------------------------------

    @property
    def problem_size(self) -> float:
        """Number of responses of positive weight."""
        return float(self.active.omega.size)

    def objective(self, answer: Rational) -> float | None:
        """The worst weighted error; None where a largest error is given, which any fit may meet."""
        return float(np.max(self.errors(answer))) if self.error is None else None

    def objective_rounding(self, answer: Rational) -> float:
        """Relative rounding errors of weighted responses: eps of the largest, for each root."""
        return float(np.finfo(float).eps * (1 + self.coefficients) * self.size)

    # --- checks -------------------------------------------------------------------------------

    def checks(self, answer: Rational, tolerance: float) -> Sequence[Check]:
        error, where = worst_value(self.errors(answer), self._place)
        limit = np.finfo(float).max if self.error is None else self.error
        over = f"at the {self.active.omega.size} given frequencies"
        found = [
            Check("order", "number of poles", answer.poles.size, self.order),
            Check("zeros", "number of zeros", answer.zeros.size, self.zeros),
            Check(
                "error",
                "largest weighted error v |R - g|, in units of v R",
                error,
                float(limit),
                where=where,
                over=over,
            ),
        ]
        if self.unstable_poles:
            found.append(right_check(answer.poles, self.unstable_poles))
        elif self.stable:
            found.append(_left("stable", "poles", answer.poles))
        if self.minimum_phase:
            found.append(_left("minimum phase", "zeros", answer.zeros))
        return found

    def second_opinion(self, answer: Rational) -> Sequence[Check]:
        system, used = answer.state_space(), self.active
        found = [
            realisation_agrees(
                system, used.omega, answer.response(used.omega), np.abs(used.response)
            )
        ]
        if self.error is not None:
            data = used.omega, used.response, used.weight
            found.append(within(system, *data, self.error))
        if self.unstable_poles:
            found.append(growing_modes(system, self.unstable_poles, "fit"))
        elif self.stable:
            found.append(decays(system, "fit decays"))
        if self.minimum_phase and answer.gain and answer.zeros.size == answer.poles.size:
            found.append(inverse_decays(answer, "inverse decays"))
        return found

    def errors(self, answer: Rational) -> np.ndarray:
        """v |R - g| (F,) at every frequency, computed from the roots in extended precision."""
        s = 1j * self.omega.astype(np.longdouble)
        value = np.full(s.shape, answer.gain, dtype=np.clongdouble)
        for k in range(max(answer.poles.size, answer.zeros.size)):  # interleaved: no overflow
            value *= s - answer.zeros[k] if k < answer.zeros.size else 1
            value /= s - answer.poles[k] if k < answer.poles.size else 1
        return np.where(self.weight > 0, self.weight * np.abs(value - self.response), 0.0)

    def metrics(self, answer: Rational) -> dict[str, float]:
        errors = self.errors(answer).astype(float)
        return {
            "error_worst": float(errors.max()),
            "error_rms": float(np.sqrt(np.mean(errors[self.weight > 0] ** 2))),
            "order": answer.poles.size,
            "zeros": answer.zeros.size,
        }

    def _place(self, index: tuple[int, ...]) -> str:
        """A frequency, for messages."""
        return f"at {self.omega[index[0]]:.6g} rad/s"

    # --- datasets and figures -----------------------------------------------------------------

    def to_dataset(self, answer: Rational) -> Dataset:
        import xarray as xr

        fit = answer.response(self.omega)
        return xr.Dataset(
            {
                "response": ("omega", self.response, _one("response to fit")),
                "weight": ("omega", self.weight, _one("weight of the error")),
                "fit": ("omega", fit, _one("response of the fit")),
                "error": ("omega", self.errors(answer).astype(float), _one("weighted error")),
                **rational_variables(answer, "the fit"),
            },
            {"omega": ("omega", self.omega, {"units": "rad/s", "long_name": "angular frequency"})},
        )

    def from_dataset(self, data: Dataset) -> Rational:
        return restored_rational(data)

    def figures(self, answer: Rational) -> dict[str, Figure]:
        errors = self.errors(answer)[self.weight > 0].astype(float)
        return {
            "bode": bode(self.active, answer, errors),
            "nyquist": nyquist(self.active, answer),
        }


def fit_response(
    omega: ArrayLike,
    response: ArrayLike,
    *,
    order: int | None = None,
    weight: ArrayLike | None = None,
    stable: bool = True,
    minimum_phase: bool = False,
    zeros: int | None = None,
    error: float | None = None,
    unstable_poles: int = 0,
    method: str = "best",
    options: Options | None = None,
) -> FittedSystem:
    """Real rational function that fits complex response data, as a cascade of sections.

    Parameters
    ----------
    omega, response, weight, stable, minimum_phase, zeros, unstable_poles
        The same as for `ResponseFit`.
    order
        Number of poles; None: the smallest, up to 12, whose worst error is at most ``error``.
    error
        Largest worst weighted error allowed; needed if no order is given.
    method
        ``"best"``, ``"vector-fitting"``, ``"ipopt"``, ``"sb10yd"`` or the name of a conic solver.
    options
        Accuracy and time limit for the method.

    Raises
    ------
    InputError
        The same as for `ResponseFit`; neither an order nor an error is given.
    SolverError
        No valid answer, or none within ``error``; the message names the best error reached.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.fitting import fit_response
    >>> omega = np.geomspace(0.1, 10, 30)
    >>> G = fit_response(
    ...     omega, 3 / (1j * omega + 2), error=1e-6
    ... )  # the least order that has this error
    >>> G.nstates, G.poles().real.round(4).tolist()
    (1, [-2.0])
    """
    if order is None and error is None:
        raise InputError("neither order nor error is given: give one of them, or both")

    reached: list[tuple[float, int]] = []
    message = ""
    for tried in range(unstable_poles, LARGEST_ORDER + 1) if order is None else [order]:
        most = zeros if zeros is None or order is not None else min(zeros, tried)
        try:
            program = ResponseFit(
                omega,
                response,
                tried,
                weight=weight,
                stable=stable,
                minimum_phase=minimum_phase,
                zeros=most,
                error=error,
                unstable_poles=unstable_poles,
            )
        except InputError:
            if not reached:
                raise
            break  # the data do not determine so high an order
        solution = solve(program, method=method, options=options)
        if solution.certificate is None:
            message = solution.message
        elif solution.certificate.valid:
            return FittedSystem.of(solution.answer)
        else:
            message = "; ".join(solution.certificate.failures)
            reached.append((program.metrics(solution.answer)["error_worst"], tried))
    best = "; best: {:.3g} at order {}".format(*min(reached)) if reached else ""
    raise SolverError(f"{method}: no valid fit: {message}{best}")


def right_check(poles: ComplexArray, count: int) -> Check:
    """Check that exactly ``count`` poles lie right of the imaginary axis, and none on it."""
    off = abs(int((poles.real > 0).sum()) - count) + int((poles.real == 0).sum())
    statement = f"poles right of the imaginary axis, more or fewer than {count}, or on it"
    return Check("unstable poles", statement, float(off), 0.0, over=THIS_SYSTEM)


def _left(name: str, roots: str, values: ComplexArray) -> Check:
    """Check that roots lie left of the imaginary axis."""
    beyond = values[~(values.real < 0)]
    where = f"the first at {beyond[0]:.6g} rad/s" if beyond.size else ""
    statement = f"number of {roots} on or right of the imaginary axis"
    return Check(name, statement, float(beyond.size), 0.0, where=where, over=THIS_SYSTEM)


def _one(long_name: str) -> dict[str, str]:
    """Attributes of an array without a unit."""
    return {"units": "1", "long_name": long_name}
