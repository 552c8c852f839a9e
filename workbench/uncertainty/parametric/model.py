"""Parametric uncertainty: real perturbations pulled out of a model rational in its parameters.

The model is a function of physical parameters that does ordinary arithmetic and returns state-space
matrices. Called with numbers it is the plain model; called with LFTs it tells where each
perturbation enters.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array, RealArray
from workbench.errors import InputError, UnknownNameError
from workbench.heavy_types import StateSpace
from workbench.structure import Real, Structure
from workbench.systems.frequency_response import frequency_response
from workbench.systems.interconnection import UncertainPart
from workbench.uncertainty.parametric.lft import INTEGRATOR, LFT, SINGULAR, lift, matrix, scalar
from workbench.uncertainty.parametric.parameters import Parameter
from workbench.uncertainty.parametric.reduction import grouped, reduced

Model = Callable[..., tuple[Any, Any, Any, Any]]
Deltas = Mapping[str, ArrayLike] | ArrayLike

LARGEST_CHECK = 12
"""Parameters up to which all vertices are checked, 4096 of them."""


@dataclass(frozen=True, eq=False)
class ParametricModel(UncertainPart):
    """A state-space model with its real perturbations pulled out; made by `parametric`.

    lft has the value [A B; C D]; `repetitions` of each parameter before and after reduction.
    Deltas are a mapping from names (what is left out is at its nominal) or an array (..., P) in the
    order of `parameters`; those outside [-1, 1] are taken as they are.
    """

    model: Model
    parameters: tuple[Parameter, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    lft: LFT
    repetitions: Mapping[str, tuple[int, int]]

    @property
    def states(self) -> int:
        return self.lft.shape[0] - len(self.outputs)

    @cached_property
    def structure(self) -> Structure:
        """A repeated real scalar for each parameter that the model depends on."""
        return Structure(Real(n, name) for name, n in self.lft.repetitions().items())

    @cached_property
    def system(self) -> StateSpace:
        """Inputs (perturbation w_R[0] ..., inputs), outputs (perturbation z_R[0] ..., outputs)."""
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

    def at(self, deltas: Deltas) -> StateSpace:
        """The model at one set of deltas; raises InputError where it is not well posed."""
        values = self._values(deltas)
        if any(np.ndim(value) for value in values.values()):
            raise InputError("deltas of many models; take one at a time, or use `response`")
        return _system(self.lft(values), self.states, self.inputs, self.outputs)

    def direct(self, deltas: Deltas) -> StateSpace:
        """As `at`, by calling the model with plain numbers: an independent check."""
        values = self._values(deltas)
        plain = {p.name: float(p.at(values[p.name])) for p in self.parameters}
        M, states = _matrices(self.model(**plain))
        return _system(M.M, states, self.inputs, self.outputs)

    def response(self, omega: ArrayLike, deltas: Deltas) -> Array:
        """Responses at `omega` [rad/s] (F,) of a batch of deltas: (..., F, outputs, inputs).

        Raises InputError where the model is not well posed or has a pole.
        """
        M = self.lft(self._values(deltas))
        return frequency_response(M, self.states, 1j * np.atleast_1d(omega))

    def _values(self, deltas: Deltas) -> dict[str, ArrayLike]:
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


def parametric(
    model: Model,
    parameters: Sequence[Parameter],
    *,
    inputs: Sequence[str],
    outputs: Sequence[str],
    keep_states: bool = True,
) -> ParametricModel:
    """Pull the real perturbations out of a model, with as few repetitions as reduction finds.

    Parameters
    ----------
    model
        Called with the parameters by name; returns matrices A, B, C, D. It may use `+ - * /`,
        integer powers, `@`, nested lists, arrays of objects, and `matrix`, `solve` and `inverse`
        of `workbench.uncertainty.lft` in place of NumPy's.
    inputs, outputs
        Names of the model's inputs and outputs.
    keep_states
        Otherwise states that are uncontrollable or unobservable at all deltas are left out, and
        the others change their coordinates.

    Raises
    ------
    InputError
        Where the model is no such arithmetic, does not depend on the parameters, divides by zero at
        the nominal, or does so at a vertex of the box |delta| <= 1 (looked at up to 12 parameters;
        with each repeated once that settles the whole box, else `at` and `response` tell).
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
            "parameters, its arithmetic rational, and solve, inverse and matrix those of "
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
    if len(parameters) <= LARGEST_CHECK:
        _check_vertices(result)
    return result


def _check_names(parameters: tuple[Parameter, ...]) -> None:
    names = [p.name for p in parameters]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise InputError(f"more than one parameter is called {', '.join(twice)}; rename them")
    if not names:
        raise InputError("no parameters; give at least one")


def _check_vertices(model: ParametricModel) -> None:
    """Raise InputError where the path from the nominal to a vertex crosses a singularity.

    With each scalar in one channel det(I - M11 Delta) is linear in each delta and takes its least
    value over the box at a vertex. It is 1 at the nominal.
    """
    lft = model.lft
    used = list(dict.fromkeys(lft.names))
    corners = np.array(list(product((-1.0, 1.0), repeat=len(used))))
    at = np.array([used.index(name) for name in lft.names])

    def determinant(corner: RealArray) -> RealArray:
        loop = np.eye(len(at)) - corner[..., at, None] * lft.blocks[0]
        return np.asarray(np.linalg.det(loop))

    bad = corners[determinant(corners) < SINGULAR]
    if not len(bad):
        return
    corner = bad[0]
    for i in range(len(used)):  # name only the parameters that matter
        without = np.where(np.arange(len(used)) == i, 0.0, corner)
        if determinant(without) < SINGULAR:
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
    """[A B; C D] and the number of states."""
    A, B, C, D = (lift(part) for part in quadruple)
    if A.shape[0] != A.shape[1]:
        raise InputError(f"the model's A has shape {A.shape}; it must be square")
    return lift(matrix([[A, B], [C, D]])), A.shape[0]


def _system(M: Array, states: int, inputs: Sequence[str], outputs: Sequence[str]) -> StateSpace:
    import control

    n = states
    return control.ss(
        M[:n, :n], M[:n, n:], M[n:, :n], M[n:, n:], inputs=list(inputs), outputs=list(outputs)
    )
