"""Parametric uncertainty: real perturbations extracted from a model that is rational in its
parameters.

The model is a Python function of physical parameters that does ordinary arithmetic and returns
state-space matrices. Called with numbers, it returns the model at these values. Called with LFTs,
it returns the model as a function of the perturbations.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import Array, RealArray
from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError, UnknownNameError
from workbench.structure import Real, Structure
from workbench.systems.frequency_response import frequency_response
from workbench.uncertainty.algebra.lft import (
    INTEGRATOR,
    LFT,
    SINGULAR_DETERMINANT,
    block_matrix,
    lift,
    scalar,
)
from workbench.uncertainty.algebra.reduction import grouped, reduced
from workbench.uncertainty.algebra.system import Algebraic
from workbench.uncertainty.parametric_models.parameters import Parameter

Model = Callable[..., tuple[Any, Any, Any, Any]]
"""Function of named parameters that returns A, B, C and D."""
Deltas = Mapping[str, ArrayLike] | ArrayLike
"""Normalised deviations of the parameters: a mapping by name, or an array (..., P)."""

MAX_PARAMETERS_CHECKED = 12
"""Largest number of parameters for which all vertices are checked; 12 parameters have 4096
vertices.
"""


@dataclass(frozen=True, eq=False)
class ParametricModel(Algebraic):
    """State-space model with its real perturbations extracted, as made by `parametric_lft`.

    Unlike an `UncertainSystem`, it keeps the function from parameters to matrices of which it
    was made.

    The value of ``lft`` is [A B; C D]; ``repetitions`` holds for each parameter the number of
    channels before and after reduction. Deltas are a mapping from names to values, where missing
    parameters have their nominal value, or an array (..., P) in the order of ``parameters``. Deltas
    outside [-1, 1] are allowed.

    Examples
    --------
    >>> from workbench.uncertainty import Parameter, parametric_lft
    >>> def spring(k):
    ...     '''A, B, C, D of a mass on a spring.'''
    ...     return [[0.0, 1.0], [-k, -0.5]], [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]]
    ...
    >>> model = parametric_lft(spring, [Parameter("k", 4.0, 0.25)], inputs=["f"], outputs=["x"])
    >>> float(model.at({"k": 1.0}).dcgain())  # 1 / 5
    0.2
    """

    model: Model
    parameters: tuple[Parameter, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    lft: LFT
    repetitions: Mapping[str, tuple[int, int]]

    @property
    def states(self) -> int:
        """Number of states."""
        return self.lft.shape[0] - len(self.outputs)

    @cached_property
    def structure(self) -> Structure:
        """A repeated real scalar for each parameter on which the model depends."""
        return Structure(Real(n, name=name) for name, n in self.lft.repetitions().items())

    @cached_property
    def system(self) -> StateSpace:
        """System with the channels of the perturbations first, followed by the model's inputs and
        outputs.

        The channels of a parameter R are called w_R[0], ... (inputs) and z_R[0], ... (outputs).
        """
        channels = [f"{b.name}[{i}]" for b in self.structure for i in range(b.rows)]
        r, n = len(channels), self.states
        order = [*range(r, r + n), *range(r)]  # states first
        rows, columns = ([*order, *range(r + n, size)] for size in self.lft.M.shape)
        return _system(
            self.lft.M[np.ix_(rows, columns)],
            n,
            [*(f"w_{c}" for c in channels), *self.inputs],
            [*(f"z_{c}" for c in channels), *self.outputs],
        )

    @property
    def lti(self) -> StateSpace:
        """The nominal system, with all deltas 0."""
        return self.at({})

    def at(self, deltas: Deltas) -> StateSpace:
        """System for one set of deltas; raises InputError if the model is not well posed there."""
        values = self._values(deltas)
        if any(np.ndim(value) for value in values.values()):
            raise InputError("deltas of many models; give one set at a time, or use `response`")
        return _system(self.lft(values), self.states, self.inputs, self.outputs)

    def direct(self, deltas: Deltas) -> StateSpace:
        """System for one set of deltas by calling the model with numbers, as a check of `at`."""
        values = self._values(deltas)
        plain = {p.name: float(p.at(values[p.name])) for p in self.parameters}
        M, states = _matrices(self.model(**plain))
        return _system(M.M, states, self.inputs, self.outputs)

    def response(self, omega: ArrayLike, deltas: Deltas) -> Array:
        """Responses (..., F, outputs, inputs) at `omega` (F,) [rad/s] for a batch of deltas.

        Raises InputError if the model is not well posed, or has a pole at a frequency.
        """
        M = self.lft(self._values(deltas))
        return frequency_response(M, self.states, 1j * np.atleast_1d(omega))

    def _values(self, deltas: Deltas) -> dict[str, ArrayLike]:
        """Deltas of all parameters by name, or an error for unknown names or a wrong shape."""
        names = [p.name for p in self.parameters]
        if isinstance(deltas, Mapping):
            for name in deltas:
                if name not in names:
                    raise UnknownNameError("parameter", name, names)
            return dict.fromkeys(names, 0.0) | dict(deltas)
        array = np.asarray(deltas, dtype=float)
        if array.ndim == 0 or array.shape[-1] != len(names):
            raise InputError(
                f"deltas have shape {array.shape}; give (..., {len(names)}) for the parameters "
                + ", ".join(names)
            )
        return dict(zip(names, np.moveaxis(array, -1, 0), strict=True))


def parametric_lft(
    model: Model,
    parameters: Sequence[Parameter],
    *,
    inputs: Sequence[str],
    outputs: Sequence[str],
    keep_states: bool = True,
) -> ParametricModel:
    """The model as an LFT in its real perturbations, with repetitions reduced as far as possible.

    Parameters
    ----------
    model
        Function that is called with the parameters as keywords and returns the matrices A, B, C, D.
        It may use `+ - * /`, integer powers, `@`, nested lists, arrays of objects, and
        `block_matrix`,
        `left_divide` and `inverse` of `workbench.uncertainty` in place of NumPy's functions.
    inputs, outputs
        Names of the model's inputs and outputs.
    keep_states
        Whether to keep the model's states. If not, states that are uncontrollable or unobservable
        for all deltas are removed, and the others change their coordinates.

    Raises
    ------
    InputError
        The model uses other arithmetic, does not depend on the parameters, or divides by zero at
        the nominal or at a vertex of the box |delta| <= 1. Vertices are checked for at most 12
        parameters. If each parameter has only one channel, the vertices decide for the whole box.
        Otherwise `at` and `response` raise the error when it occurs.

    Examples
    --------
    >>> from workbench.uncertainty import Parameter, parametric_lft
    >>> def spring(k):
    ...     '''A, B, C, D of a mass on a spring.'''
    ...     return [[0.0, 1.0], [-k, -0.5]], [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]]
    ...
    >>> model = parametric_lft(spring, [Parameter("k", 4.0, 0.25)], inputs=["f"], outputs=["x"])
    >>> model.repetitions
    {'k': (1, 1)}
    """
    parameters = tuple(parameters)
    _check_names(parameters)
    try:
        raw, states = _matrices(
            model(
                **{p.name: scalar(p.name, p.nominal, p.nominal * p.tolerance) for p in parameters}
            )
        )
    except TypeError as error:
        raise InputError(
            f"the model cannot be called with uncertain values: {error}; its arguments must be the "
            "parameters, its arithmetic rational, and left_divide, inverse and matrix those of "
            "workbench.uncertainty"
        ) from error
    if raw.shape != (states + len(outputs), states + len(inputs)):
        raise InputError(
            f"the model has {raw.shape[1] - states} inputs and {raw.shape[0] - states} outputs, "
            f"but {len(inputs)} and {len(outputs)} names were given"
        )
    # [A B; C D] with channels for delta is the transfer function with channels for delta and 1/s.
    whole = LFT(raw.M, raw.names + (INTEGRATOR,) * states)
    whole = grouped(whole, [*(p.name for p in parameters), INTEGRATOR])
    small = reduced(whole, keep=(INTEGRATOR,) if keep_states else ())
    lft = LFT(small.M, tuple(name for name in small.names if name != INTEGRATOR))
    if not lft.names:
        raise InputError("the model depends on none of its parameters; there is no uncertainty")

    before, after = raw.repetitions(), lft.repetitions()
    repetitions = {p.name: (before.get(p.name, 0), after.get(p.name, 0)) for p in parameters}
    result = ParametricModel(model, parameters, tuple(inputs), tuple(outputs), lft, repetitions)
    if len(parameters) <= MAX_PARAMETERS_CHECKED:
        _check_vertices(result)
    return result


def _check_names(parameters: tuple[Parameter, ...]) -> None:
    """Raise InputError for repeated names, or if there are no parameters."""
    names = [p.name for p in parameters]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise InputError(f"more than one parameter is called {', '.join(twice)}; rename them")
    if not names:
        raise InputError("no parameters; give at least one")


def _check_vertices(model: ParametricModel) -> None:
    """Raise InputError if the path from the nominal to a vertex crosses a singularity.

    If each scalar has one channel, det(I - M11 Delta) is linear in each delta, so that its smallest
    value over the box is at a vertex. It is 1 at the nominal.
    """
    lft = model.lft
    used = list(dict.fromkeys(lft.names))
    corners = np.array(list(product((-1.0, 1.0), repeat=len(used))))
    at = np.array([used.index(name) for name in lft.names])

    def determinant(corner: RealArray) -> RealArray:
        loop = np.eye(len(at)) - corner[..., at, None] * lft.blocks[0]
        return np.asarray(np.linalg.det(loop))

    bad = corners[determinant(corners) < SINGULAR_DETERMINANT]
    if not len(bad):
        return
    corner = bad[0]
    for i in range(len(used)):  # leave out parameters that are not needed for the singularity
        without = np.where(np.arange(len(used)) == i, 0.0, corner)
        if determinant(without) < SINGULAR_DETERMINANT:
            corner = without
    guilty = {p.name: p for p in model.parameters}
    where = ", ".join(
        f"{name} = {float(guilty[name].at(delta)):g} (delta {delta:+g})"
        for name, delta in zip(used, corner, strict=True)
        if delta
    )
    raise InputError(
        f"the model divides by zero, or inverts a singular matrix, between the nominal and {where};"
        " narrow the tolerances or rewrite the model"
    )


def _matrices(quadruple: tuple[Any, Any, Any, Any]) -> tuple[LFT, int]:
    """Matrix [A B; C D] as an LFT, and the number of states."""
    A, B, C, D = (lift(part) for part in quadruple)
    if A.shape[0] != A.shape[1]:
        raise InputError(f"the model's A has shape {A.shape}; it must be square")
    return lift(block_matrix([[A, B], [C, D]])), A.shape[0]


def _system(M: Array, states: int, inputs: Sequence[str], outputs: Sequence[str]) -> StateSpace:
    """State-space system of M = [A B; C D] with named inputs and outputs."""
    import control

    n = states
    return control.ss(
        M[:n, :n], M[:n, n:], M[n:, :n], M[n:, n:], inputs=list(inputs), outputs=list(outputs)
    )
