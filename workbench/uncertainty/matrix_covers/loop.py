"""Covers for a loop: weights that minimise the peak of its mu instead of the size of the sets."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from workbench._core.arrays import Array, RealArray
from workbench._core.heavy_types import Figure
from workbench.errors import InputError
from workbench.structure import Full
from workbench.systems.realisation import worst_pole
from workbench.uncertainty.algebra.system import UncertainSystem
from workbench.uncertainty.matrix_covers.cover import FoundCover, MatrixCover
from workbench.uncertainty.matrix_covers.figures import loop_mu_figure
from workbench.uncertainty.matrix_covers.forms import delta_shape
from workbench.uncertainty.matrix_covers.model import MatrixModel
from workbench.uncertainty.matrix_covers.responses import system_response
from workbench.uncertainty.matrix_covers.sets.loop import VOLUME_SHARE, loop_level
from workbench.uncertainty.matrix_covers.sets.program import MatrixSets


@dataclass(frozen=True, eq=False)
class MatrixCoverForLoop(MatrixCover):
    """A `MatrixCover` with which a loop has the least mu.

    Parameters
    ----------
    loop
        A stable uncertain system around `MatrixModel.unweighted(nominal, form)`, such as
        ``W * feedback(1, model * K)``.
    performance
        Whether mu is that of robust performance from the loop's inputs to its outputs; otherwise
        that of robust stability.

    The weights are a local optimum. The sets at each frequency, with the least mu possible for
    weights of any order, are a global optimum.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.uncertainty import MatrixCoverForLoop, MatrixModel, MatrixResponses, feedback
    >>> nominal = control.ss(-np.eye(2), np.eye(2), np.eye(2), np.zeros((2, 2)))
    >>> systems = [nominal * (1 + d) for d in (-0.1, 0.05, 0.1)]
    >>> responses = MatrixResponses.of_systems(systems, np.geomspace(0.1, 10, 10))
    >>> loop = feedback(np.eye(2), MatrixModel.unweighted(nominal, form="additive") * 2.0)
    >>> cover = MatrixCoverForLoop(responses, nominal, left_order=1, right_order=1, loop=loop)
    >>> cover.quantifier
    'at the 10 given frequencies, for these 3 plants'
    """

    loop: Any = field(kw_only=True)
    performance: bool = field(default=True, kw_only=True)

    default_method: ClassVar[str] = "descent"
    headline: ClassVar[str] = "mu_peak"

    def __post_init__(self) -> None:
        if not isinstance(self.performance, bool):
            raise InputError(f"performance is {self.performance!r}; it must be True or False")
        super().__post_init__()

    @cached_property
    def loop_response(self) -> Array:
        """Responses (F, ., .) of the loop that X closes; raises InputError if it is not such a
        loop.
        """
        size = delta_shape(self.form, self.nominal.noutputs, self.nominal.ninputs)
        _need_loop(self.loop, size, self.responses.dt)
        response = system_response(self.loop.system, self.responses.omega)
        rows, columns = self.deviations.shape[2:]
        return response if self.performance else response[:, :columns, :rows]

    @cached_property
    def sets(self) -> MatrixSets:
        """The program of the sets for which the loop has the least mu at each frequency."""
        return MatrixSets(
            self.deviations,
            left=self.left,
            right=self.right,
            size="mu",
            floor=self.floor,
            loop=self.loop_response,
        )

    def sets_beside(self, W_2: Array) -> MatrixSets:
        n = W_2.shape[-1]
        loop = self.loop_response
        loop = np.concatenate([W_2 @ loop[:, :n], loop[:, n:]], axis=1)
        X = self.covered @ np.linalg.inv(W_2)[:, None]
        return MatrixSets(X, left=self.left, right="scalar", size="mu", floor=self.floor, loop=loop)

    def without_loop(self) -> MatrixCover:
        """The program of the smallest sets for the same plants, without the loop."""
        names = [each.name for each in fields(MatrixCover)]
        return MatrixCover(**{name: getattr(self, name) for name in names})

    def log_mu(self, model: MatrixModel) -> RealArray:
        """Logarithm (F,) of the loop's mu with the model's sets."""
        omega = self.responses.omega
        inverses = [np.linalg.inv(system_response(W, omega)) for W in (model.W_1, model.W_2)]
        return loop_level(self.loop_response, *inverses)[0]

    def objective(self, answer: FoundCover) -> float:
        """Logarithm of the largest mu, plus VOLUME_SHARE times the mean logarithm of the radius."""
        return float(self.log_mu(answer.model).max()) + VOLUME_SHARE * super().objective(answer)

    def metrics(self, answer: FoundCover) -> dict[str, float]:
        logs = self.log_mu(answer.model), self.sets.log_mu(answer.least)
        peak, least = (float(np.exp(each.max())) for each in logs)
        return {"mu_peak": peak, "mu_peak_least": least} | super().metrics(answer)

    def figures(self, answer: FoundCover) -> dict[str, Figure]:
        logs = self.log_mu(answer.model), self.sets.log_mu(answer.least)
        mu = loop_mu_figure(self.responses, *(np.exp(each) for each in logs))
        return {"mu": mu} | super().figures(answer)


def _need_loop(given: Any, size: tuple[int, int], dt: float) -> None:
    """Raise InputError unless the loop is stable and is closed by one block of the given size."""
    if not isinstance(given, UncertainSystem):
        raise InputError(f"loop must be an uncertain system, not {type(given).__name__}")
    blocks = list(given.structure) if given.elements else []
    fits = len(blocks) == 1 and isinstance(blocks[0], Full)
    if not fits or (blocks[0].rows, blocks[0].columns) != size:
        raise InputError(
            f"loop must contain one full block of {size[0]} x {size[1]}, that of "
            f"MatrixModel.unweighted(nominal, form), once; it has {blocks or 'none'}"
        )
    system = given.system
    if float(system.dt or 0.0) != dt:
        raise InputError(f"loop has dt = {system.dt}, the responses {dt}")
    pole, beyond = worst_pole(system)
    if beyond >= 0:
        raise InputError(f"the loop around the nominal is unstable: it has a pole at {pole:.6g}")
