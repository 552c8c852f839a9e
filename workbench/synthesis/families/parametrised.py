"""A user's own families: state-space matrices as functions of parameters, differentiated by
CasADi.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import ComplexArray, RealArray
from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError
from workbench.input_checks import as_array
from workbench.solvers import in_one_thread
from workbench.synthesis.families.family import Family, need_size
from workbench.synthesis.families.least_squares import fitted_parameters
from workbench.synthesis.families.matrices import matrix_slopes
from workbench.systems.generalised_plant import response
from workbench.systems.realisation import Matrices, realisation

MEMBER_TOLERANCE = 1e-6
"""Relative distance of responses within which a controller is a member."""


@dataclass(frozen=True, init=False, eq=False)
class Parametrised(Family):
    """Controllers whose A, B, C and D are a function of parameters, with derivatives by CasADi.

    Parameters
    ----------
    matrices
        A function that returns A, B, C and D for the parameters x, a CasADi column of k numbers.
        Each matrix is a CasADi matrix, a numpy array or a list of rows. For example ``lambda x:
        ([[-x[0]]], [[1.0]], [[x[1]]], [[0.0]])``.
    near
        Parameters (k,) of typical size, from which searches start. A member that stabilises is
        best.

    Raises
    ------
    InputError
        The function fails, its matrices do not fit together, or K is not finite at ``near``.

    Examples
    --------
    >>> from workbench.synthesis import Parametrised
    >>> lag = Parametrised(lambda x: ([[-x[0]]], [[1.0]], [[x[0] * x[1]]], [[0.0]]), [1.0, 2.0])
    >>> lag.system([3.0, 2.0]).dcgain().item()
    2.0
    """

    near: tuple[float, ...]
    _of: Any

    def __init__(self, matrices: Callable[[Any], Sequence[Any]], near: ArrayLike) -> None:
        x = as_array(near, "near")
        if x.ndim != 1 or not len(x):
            raise InputError(f"near has shape {x.shape}; give a list of one number per parameter")
        if not callable(matrices):
            raise InputError(
                f"matrices must be a function of the parameters, not {type(matrices).__name__}"
            )
        object.__setattr__(self, "near", tuple(map(float, x)))
        object.__setattr__(self, "_of", _compiled_function(matrices, len(x)))
        at = self._values(np.asarray(self.near))
        if not all(np.isfinite(part).all() for part in at):
            raise InputError(f"matrices are not finite at near = {list(self.near)}")

    def __repr__(self) -> str:
        return f"Parametrised({self.count} parameters, {self._sizes[0]} states)"

    @property
    def count(self) -> int:
        return len(self.near)

    @cached_property
    def _sizes(self) -> tuple[int, int, int]:
        """Numbers of states, inputs and outputs."""
        A, _, _, D = self._values(np.asarray(self.near))[:4]
        return len(A), D.shape[1], D.shape[0]

    def sized(self, inputs: int, outputs: int) -> Parametrised:
        _, m, p = self._sizes
        do = "D needs a row for each control and a column for each measurement"
        need_size(self, (m, p), inputs, outputs, do)
        return self

    def system(self, x: RealArray) -> StateSpace:
        return realisation(self._matrices(x), 0.0)

    def response(self, x: RealArray, omega: RealArray) -> tuple[ComplexArray, ComplexArray]:
        matrices = self._matrices(x)
        slopes = [
            each.reshape(*part.shape, len(x), order="F").transpose(2, 0, 1)
            for each, part in zip(self._values(x)[4:], matrices, strict=True)
        ]
        return matrix_slopes(matrices, (slopes[0], slopes[1], slopes[2], slopes[3]), omega)

    def parameters(self, controller: StateSpace) -> RealArray:
        n, m, p = self._sizes
        has = controller.nstates, controller.ninputs, controller.noutputs
        if has != (n, m, p) or controller.dt:
            raise InputError(
                f"the controller has {has[0]} states, {has[1]} inputs and {has[2]} outputs; a "
                f"member of {self} has {n}, {m} and {p}, in continuous time"
            )
        x = self._by_matrices(controller)
        sizes = np.abs(controller.poles())
        middle = float(np.median(sizes[sizes > 0])) if (sizes > 0).any() else 1.0
        omega = 1.0123 * middle * np.geomspace(1e-2, 1e2, 20 + 4 * n)
        wanted = response(controller, omega)
        size = np.linalg.norm(wanted, axis=(1, 2))
        weight = 1.0 / np.where(size > 0, size, 1.0)
        limit = MEMBER_TOLERANCE * np.sqrt(len(omega))
        best = np.inf
        for start in (x, np.asarray(self.near)):
            miss = float(
                np.linalg.norm(weight[:, None, None] * (self.response(start, omega)[0] - wanted))
            )
            if miss > limit:
                start, miss = fitted_parameters(self.response, start, wanted, omega, weight)
            if miss <= limit:
                return start
            best = min(best, miss)
        raise InputError(
            f"the controller is no member of {self}, as far as a search from near tells: the "
            f"nearest response has a relative error of {best / np.sqrt(len(omega)):.3g}"
        )

    def examples(self, omega: float, gain: float) -> Sequence[StateSpace]:
        """The member with the parameters ``near``."""
        return [self.system(np.asarray(self.near))]

    def _by_matrices(self, controller: StateSpace) -> RealArray:
        """Parameters whose matrices are nearest to those of a controller."""
        from scipy.optimize import least_squares

        wanted = [np.asarray(getattr(controller, name), dtype=float) for name in "ABCD"]
        scale = [max(float(np.abs(part).max(initial=0.0)), 1e-12) for part in wanted]

        def missed(x: RealArray) -> RealArray:
            parts = zip(self._values(x)[:4], wanted, scale, strict=True)
            return np.concatenate([((own - part) / size).ravel("F") for own, part, size in parts])

        def slopes(x: RealArray) -> RealArray:
            parts = zip(self._values(x)[4:], scale, strict=True)
            return np.vstack([each / size for each, size in parts])

        found = least_squares(missed, self.near, slopes, x_scale="jac", xtol=1e-15, ftol=1e-15)
        x: RealArray = found.x
        return x

    def _matrices(self, x: RealArray) -> Matrices:
        A, B, C, D = self._values(x)[:4]
        return A, B, C, D

    @in_one_thread
    def _values(self, x: RealArray) -> list[RealArray]:
        """Entries of A, B, C and D, column by column, and their derivatives (entries, k)."""
        return [np.asarray(part.full(), dtype=float) for part in self._of(np.asarray(x))]


@in_one_thread
def _compiled_function(matrices: Callable[[Any], Sequence[Any]], count: int) -> Any:
    """The CasADi function of A, B, C and D and their derivatives. Raises InputError if `matrices`
    fails.
    """
    import casadi

    x = casadi.SX.sym("x", count)
    try:
        parts = [_casadi_matrix(part) for part in matrices(x)]
    except Exception as error:  # the user's function may raise anything
        raise InputError(
            f"matrices(x) fails for a CasADi column x of {count} numbers: "
            f"{' '.join(str(error).split())[:200]}; it returns A, B, C and D"
        ) from None
    if len(parts) != 4:
        raise InputError(f"matrices(x) returns {len(parts)} parts; A, B, C and D are needed")
    (n, _), (p, m) = parts[0].shape, parts[3].shape
    needed = {"A": (n, n), "B": (n, m), "C": (p, n), "D": (p, m)}
    for name, part in zip("ABCD", parts, strict=True):
        empty = 0 in needed[name] and 0 in part.shape
        if part.shape != needed[name] and not empty:
            raise InputError(
                f"{name} has shape {part.shape}; with {n} states, {m} inputs and {p} outputs "
                f"{needed[name]} is needed"
            )
    shaped = [casadi.reshape(part, *needed[name]) for name, part in zip("ABCD", parts, strict=True)]
    slopes = [casadi.jacobian(casadi.vec(part), x) for part in shaped]
    return casadi.Function("K", [x], [*map(casadi.densify, [*shaped, *slopes])])


def _casadi_matrix(part: Any) -> Any:
    """A CasADi matrix from a CasADi matrix, an array, or a list of rows."""
    import casadi

    if isinstance(part, list | tuple) and part and isinstance(part[0], list | tuple):
        return casadi.vertcat(*(casadi.horzcat(*map(casadi.SX, row)) for row in part))
    return casadi.SX(part)
