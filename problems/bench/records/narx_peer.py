"""Polynomial models by SysIdentPy, linear and nonlinear, as candidates to choose from."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from workbench.identification import Experiments
from workbench.identification.innovations.scaling import Scaling
from workbench.types import RealArray

from .linear_peers import Fitting

LINEAR_LAGS = (2, 4, 8, 12)
TERMS = {1: 40, 2: 30, 3: 25}
"""Largest number of terms, by degree of the polynomial."""
NONLINEAR_LAGS = {2: (2, 4), 3: (2,)}
"""Lags that are tried, by degree above one."""
MOST_REGRESSORS = 160
"""Largest number of candidate terms from which the package selects."""


@dataclass(frozen=True, eq=False)
class NarxModel:
    """Models of the package for scaled signals, one for each output."""

    parts: list[Any]
    scaling: Scaling

    def one_step(self, u: RealArray, y: RealArray, washout: int) -> RealArray:
        """One-step predictions (N, ny); the first samples, as many as the longest lag, are the
        measured ones.
        """
        return self._run(u, y, 0, 1)

    def free_run(self, u: RealArray, y: RealArray, washout: int) -> RealArray:
        """Simulation (N, ny) that starts from the measured outputs at the end of the washout."""
        return self._run(u, y, washout, None)

    def _run(self, u: RealArray, y: RealArray, washout: int, ahead: int | None) -> RealArray:
        inputs, outputs = self.scaling.scaled(u, y)
        found = outputs.copy()
        for o, part in enumerate(self.parts):
            first = max(washout - part.max_lag, 0)
            with contextlib.redirect_stdout(io.StringIO()):
                made = part.predict(
                    X=_now(inputs)[first:], y=outputs[first:, [o]], steps_ahead=ahead
                )
            found[first:, o] = np.ravel(made)
        return np.asarray(found * self.scaling.y_spread + self.scaling.y_mean)


def sysidentpy(nu: int, ny: int, samples: int, linear: bool) -> Iterator[tuple[str, Fitting]]:
    """Polynomials of the first degree or of higher degrees, selected by orthogonal
    least squares.
    """
    degrees = {1: LINEAR_LAGS} if linear else NONLINEAR_LAGS
    for degree, every in degrees.items():
        for lags in every:
            variables = lags * (1 + nu)
            terms = int(np.prod([(variables + k) / k for k in range(1, degree + 1)]) + 0.5)
            if terms <= min(MOST_REGRESSORS, samples // 3):
                yield f"degree {degree}, {lags} lags", _frols(degree, lags, terms)


def _frols(degree: int, lags: int, terms: int) -> Fitting:
    from sysidentpy.basis_function import Polynomial
    from sysidentpy.model_structure_selection import FROLS

    def fit(record: Experiments) -> NarxModel:
        scaling = Scaling.of(record)
        u, y = scaling.scaled(record.u, record.y)
        parts = []
        for o in range(y.shape[1]):
            model = FROLS(
                order_selection=True,
                n_info_values=min(terms, TERMS[degree]) + 1,
                ylag=lags,
                xlag=[list(range(1, lags + 1))] * u.shape[1] if u.shape[1] > 1 else lags,
                info_criteria="bic",
                basis_function=Polynomial(degree=degree),
            )
            with contextlib.redirect_stdout(io.StringIO()):
                model.fit(X=_now(u), y=y[:, [o]])
            parts.append(model)
        return NarxModel(parts, scaling)

    return fit


def _now(u: RealArray) -> RealArray:
    """Inputs shifted one sample earlier: the package's first lag then means the input at the same
    time.
    """
    return np.vstack([u[1:], u[-1:]])
