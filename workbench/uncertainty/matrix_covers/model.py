"""Uncertainty models with one Delta between two weights."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass
from functools import cached_property
from typing import Any

import numpy as np

from workbench._core.arrays import Array, RealArray
from workbench._core.heavy_types import Figure, StateSpace
from workbench.certify.stable_system import angular_frequency
from workbench.errors import InputError
from workbench.input_checks import need_choice
from workbench.structure import Full, Structure
from workbench.systems.bilinear import bilinear_continuous
from workbench.systems.conversion import as_system
from workbench.systems.frequency_grid import frequencies_of
from workbench.systems.realisation import realisation
from workbench.uncertainty.algebra.system import Algebraic, UncertainSystem, uncertain
from workbench.uncertainty.matrix_covers.figures import magnitudes_figure
from workbench.uncertainty.matrix_covers.forms import (
    MatrixForm,
    delta_shape,
    interconnection,
)
from workbench.uncertainty.matrix_covers.responses import system_response
from workbench.uncertainty.matrix_covers.sets.shapes import ctranspose
from workbench.uncertainty.matrix_covers.weights import inverse_weight

DRAWN = 200
"""Number of frequencies of a figure, besides those near poles. Corners are not seen at the size of
a page. Half or double changes the figure only.
"""


@dataclass(frozen=True, eq=False)
class MatrixModel(Algebraic):
    """The set of plants that a nominal, two weights and every Delta with |Delta| <= 1 give.

    Unlike an `UncertainSystem`, it keeps its nominal and its weights apart, so that the Delta
    of a plant can be computed.

    Parameters
    ----------
    nominal, W_1, W_2
        Systems of python-control with the same sampling time; X = W_1 Delta W_2.
    form
        Where X acts, such as ``"additive"`` or ``"inverse-output"``; the formulas are in
        `workbench.uncertainty.matrix_covers.forms`.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.uncertainty import MatrixModel
    >>> nominal = control.ss(-np.eye(2), np.eye(2), np.eye(2), np.zeros((2, 2)))
    >>> model = MatrixModel(nominal, 0.1 * np.eye(2), np.eye(2))
    >>> Delta = model.delta_of(nominal * 1.05)
    >>> Delta.ninputs, Delta.noutputs
    (2, 2)
    """

    nominal: Any
    W_1: Any
    W_2: Any
    _: KW_ONLY
    form: MatrixForm = "additive"

    def __post_init__(self) -> None:
        need_choice(self.form, MatrixForm, "form")
        for name in ("nominal", "W_1", "W_2"):
            object.__setattr__(self, name, as_system(getattr(self, name), name))
        rows, columns = delta_shape(self.form, self.nominal.noutputs, self.nominal.ninputs)
        for name, size in (("W_1", rows), ("W_2", columns)):
            W = getattr(self, name)
            if (W.noutputs, W.ninputs) != (size, size):
                raise InputError(
                    f"{name} has {W.noutputs} outputs and {W.ninputs} inputs; the form "
                    f"{self.form!r} needs {size} of each"
                )
            if float(W.dt or 0.0) != self.dt:
                raise InputError(f"{name} has dt = {W.dt}, the nominal {self.nominal.dt}")

    @classmethod
    def unweighted(cls, nominal: Any, *, form: MatrixForm = "additive") -> MatrixModel:
        """The model with weights 1. A loop built around it is the loop for which weights are
        optimised.
        """
        nominal = as_system(nominal, "nominal")
        sizes = delta_shape(form, nominal.noutputs, nominal.ninputs)
        dt = float(nominal.dt or 0.0)
        empty = np.zeros((0, 0))
        W_1, W_2 = (
            realisation((empty, np.zeros((0, n)), np.zeros((n, 0)), np.eye(n)), dt) for n in sizes
        )
        return cls(nominal, W_1, W_2, form=form)

    def __repr__(self) -> str:
        orders = [each.nstates for each in (self.nominal, self.W_1, self.W_2)]
        return f"MatrixModel, {self.form}: nominal, W_1 and W_2 of orders {orders}"

    @property
    def dt(self) -> float:
        """Sampling time [s]; 0 for continuous time."""
        return float(self.nominal.dt or 0.0)

    @property
    def lti(self) -> StateSpace:
        """The nominal system."""
        return self.nominal

    @property
    def structure(self) -> Structure:
        """One full block Delta."""
        return Structure((Full(self.W_1.ninputs, self.W_2.noutputs, name="Delta"),))

    @cached_property
    def system(self) -> StateSpace:
        """System from (w, u) to (z, y), to be closed with w = Delta z."""
        import control

        core = interconnection(self.nominal, self.form)
        unit = [control.ss([], [], [], np.eye(n), self.dt) for n in self.nominal.D.shape]
        found = control.append(self.W_2, unit[0]) * core * control.append(self.W_1, unit[1])
        return found

    def delta_of(self, plant: Any) -> UncertainSystem:
        """The Delta with which an additive model gives a plant; the plant may be uncertain.

        The model contains every plant of an uncertain system, at every frequency, if the worst-case
        gain of this Delta (`workbench.mu.worst_case_gain`) is at most 1 and nominal and plants are
        stable.

        Raises InputError for another form, for which Delta contains inverses of the nominal or the
        plant.
        """
        if self.form != "additive":
            raise InputError(
                f"the model is {self.form}; the Delta of a family needs an additive one"
            )
        before, after = inverse_weight(self.W_1), inverse_weight(self.W_2)
        return uncertain(before) @ (uncertain(plant) - uncertain(self.nominal)) @ uncertain(after)

    def plot(self) -> Figure:
        """Bode magnitudes of the entries, with the band of the model's plants."""
        plane = bilinear_continuous(self.system) if self.dt else self.system
        grid = frequencies_of(plane)
        grid = np.union1d(grid, np.geomspace(grid[0], grid[-1], DRAWN))
        omega = angular_frequency(grid, self.dt)
        response = system_response(self.nominal, omega)
        return magnitudes_figure(omega, response, *self.entry_discs(omega))

    def entry_discs(self, omega: RealArray) -> tuple[Array, RealArray]:
        """Centres and radii (F, p, m) of the discs that the entries of the plants fill.

        Radii are infinite where some plant of the model has a pole at j omega. Let D be the
        response of `system` from w to z. Then the matrices Delta (I - D Delta)^-1 fill a ball of
        matrices with the centre (I - D^* D)^-1 D^* (R. Redheffer, "On a certain linear fractional
        transformation", 1960).
        """
        r, c = self.W_1.ninputs, self.W_2.noutputs
        H = system_response(self.system, omega)
        D, z, y, G = H[:, :c, :r], H[:, :c, r:], H[:, c:, :r], H[:, c:, r:]
        size = np.linalg.norm(D, 2, axis=(1, 2)) if D.size else np.zeros(len(H))
        inside = size < 1
        safe = np.where(inside[:, None, None], D, 0.0)
        Dh = ctranspose(safe)
        left = np.linalg.inv(np.eye(r) - Dh @ safe)
        right = np.linalg.inv(np.eye(c) - safe @ Dh)
        centre = G + y @ left @ Dh @ z
        rows = np.einsum("fij,fjk,fik->fi", y, left, y.conj()).real
        columns = np.einsum("fji,fjk,fki->fi", z.conj(), right, z).real
        radius = np.sqrt(np.maximum(rows[:, :, None] * columns[:, None], 0.0))
        return centre, np.where(inside[:, None, None], radius, np.inf)
