"""Covers of sets of matrix responses: weights beside one Delta, from plants and a nominal.

The weights minimise the size of the sets, or the mu of a loop around the model.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np

from workbench._core.arrays import Array, RealArray
from workbench._core.heavy_types import Dataset, Figure, StateSpace
from workbench.certificate import EVERY_FREQUENCY, THIS_SYSTEM, Check, worst_value
from workbench.certify.norms import certified_norm
from workbench.certify.stable_system import angular_frequency
from workbench.errors import InputError
from workbench.fitting.samples import as_count
from workbench.input_checks import need_choice
from workbench.program import Program
from workbench.second_opinion.fits import decays
from workbench.second_opinion.responses import plain_response
from workbench.systems.conversion import as_system
from workbench.systems.range_hints import warn_far_frequencies
from workbench.uncertainty.covers.weights import between, beyond
from workbench.uncertainty.matrix_covers.checks_of_model import (
    off_shape,
    plants_made,
    semidefinite,
    stays_stable,
    tried_everywhere,
    unstable_poles,
)
from workbench.uncertainty.matrix_covers.figures import (
    deltas_figure,
    loop_mu_figure,
    magnitudes_figure,
    radius_figure,
)
from workbench.uncertainty.matrix_covers.forms import (
    MatrixForm,
    delta_shape,
    left_factors,
    need_reached,
    residuals,
)
from workbench.uncertainty.matrix_covers.found import (
    FoundCover,
    restored_matrix_model,
    stored_cover,
)
from workbench.uncertainty.matrix_covers.loop import need_loop_around
from workbench.uncertainty.matrix_covers.model import MatrixModel
from workbench.uncertainty.matrix_covers.responses import MatrixResponses, system_response
from workbench.uncertainty.matrix_covers.sets.loop import VOLUME_SHARE, loop_level
from workbench.uncertainty.matrix_covers.sets.program import (
    CONTAINED,
    SHAPED,
    FoundSets,
    MatrixSets,
    Size,
)
from workbench.uncertainty.matrix_covers.sets.shapes import WeightShape, between_weights
from workbench.uncertainty.matrix_covers.weights import inverse_weight

LEAST_GAP = 1e-4
"""A set counts as the smallest if its log size exceeds the proven bound by at most this. It is 0.01
% of a set's size. With half of it ill-conditioned frequencies may stay unproven; with double of it
sets 0.02 % too large pass as smallest.
"""

KEEPING_SIDES: tuple[MatrixForm, ...] = ("additive", "input", "output")
"""Forms for which all plants have as many unstable poles as the nominal."""


@dataclass(frozen=True, eq=False)
class MatrixCover(Program):
    """Weights W_1 and W_2 of given orders with which a model contains every plant.

    Without a loop, methods search for weights whose sets are as small as possible; with a loop, for
    weights that make its mu as small as possible. The weights are a local optimum. The answer also
    holds the best sets at each frequency that weights of any order can have; these are a global
    optimum, with a proof.

    Parameters
    ----------
    responses
        Responses of the plants.
    nominal
        A system of python-control.
    form
        Where Delta acts in the model; see `workbench.uncertainty.matrix_covers.forms`.
    left, right
        Shapes of W_1 and W_2: ``"full"``, ``"diagonal"`` or ``"scalar"``. A scalar W_2 is 1,
        because W_1 includes its size.
    left_order, right_order
        Number of poles of each channel of W_1 and of W_2; a full weight of n channels has n times
        as many states.
    floor
        Every set also contains a small change of each single entry: this share of the product of
        the sizes of its row and its column. Otherwise sets of few plants would be flat.
    loop
        A stable uncertain system around `MatrixModel.unweighted(nominal, form=form)`, such as
        ``W * feedback(1, model * K)``, whose mu the weights minimise; None for the smallest sets.
    performance
        Whether mu is that of robust performance from the loop's inputs to its outputs; otherwise
        that of robust stability.

    Raises
    ------
    InputError
        The data do not have these forms, or the form cannot represent a plant.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> import workbench as wb
    >>> from workbench.uncertainty import MatrixCover, MatrixResponses
    >>> nominal = control.ss(-np.eye(2), np.eye(2), np.eye(2), np.zeros((2, 2)))
    >>> systems = [nominal * (1 + d) for d in (-0.1, 0.05, 0.1)]
    >>> responses = MatrixResponses.of_systems(systems, np.geomspace(0.1, 10, 10))
    >>> cover = MatrixCover(responses, nominal, left_order=1, right_order=1)
    >>> wb.solve(cover).certificate.valid
    True

    The same plants, for the loop with a gain of 2:

    >>> from workbench.uncertainty import MatrixModel, feedback
    >>> loop = feedback(np.eye(2), MatrixModel.unweighted(nominal) * 2.0)
    >>> for_loop = MatrixCover(responses, nominal, left_order=1, right_order=1, loop=loop)
    >>> for_loop.headline
    'mu_peak'
    """

    responses: MatrixResponses
    nominal: Any
    _: KW_ONLY
    form: MatrixForm = "additive"
    left: WeightShape = field(default="diagonal", kw_only=True)
    right: WeightShape = field(default="diagonal", kw_only=True)
    left_order: int = field(default=2, kw_only=True)
    right_order: int = field(default=2, kw_only=True)
    floor: float = field(default=1e-3, kw_only=True)
    loop: Any = field(default=None, kw_only=True)
    performance: bool = field(default=True, kw_only=True)

    default_method: ClassVar[str] = "joint"
    methods_in: ClassVar[tuple[str, ...]] = ("workbench.uncertainty.matrix_covers.methods",)
    headline: ClassVar[str] = "radius_mean"
    relative_metrics: ClassVar[tuple[str, ...]] = ("least_gap",)

    def __post_init__(self) -> None:
        if not isinstance(self.responses, MatrixResponses):
            kind = type(self.responses).__name__
            raise InputError(
                f"responses must be MatrixResponses, not {kind}; MatrixResponses.from_frd and "
                "MatrixResponses.of_systems make them"
            )
        object.__setattr__(self, "nominal", as_system(self.nominal, "nominal"))
        p, m = self.responses.values.shape[2:]
        if (self.nominal.noutputs, self.nominal.ninputs) != (p, m):
            raise InputError(
                f"the nominal has {self.nominal.noutputs} outputs and {self.nominal.ninputs} "
                f"inputs, the plants {p} and {m}"
            )
        if float(self.nominal.dt or 0.0) != self.responses.dt:
            raise InputError(
                f"the nominal has dt = {self.nominal.dt}, the responses {self.responses.dt}"
            )
        warn_far_frequencies(self.responses.omega, self.nominal)
        need_choice(self.form, MatrixForm, "form")
        if not isinstance(self.performance, bool):
            raise InputError(f"performance is {self.performance!r}; it must be True or False")
        if self.loop is not None:
            object.__setattr__(self, "default_method", "descent")
            object.__setattr__(self, "headline", "mu_peak")
        for name in ("left_order", "right_order"):
            order = as_count(name, getattr(self, name))
            object.__setattr__(self, name, order)
            most = max(self.responses.omega.size // 2 - 1, 0)
            if order > most:
                raise InputError(
                    f"{name} is {order}; {self.responses.omega.size} frequencies determine {most} "
                    "at most"
                )
        self._need_sides()
        _ = self.sets  # raises InputError if there are no sets

    def _need_sides(self) -> None:
        """Raise InputError for a known plant that no stable Delta of the form can give."""
        if self.form not in KEEPING_SIDES:
            return
        wanted = unstable_poles(self.nominal)
        for name, plant in zip(self.responses.plants, self.responses.known, strict=False):
            if (found := unstable_poles(plant)) != wanted:
                raise InputError(
                    f"plant {name} has {found} unstable poles, the nominal {wanted}: no stable "
                    f"Delta of the form {self.form!r} turns the nominal into this plant; take the "
                    "form 'coprime' or an inverse form"
                )

    @property
    def quantifier(self) -> str:
        F, N = self.responses.values.shape[:2]
        return f"at the {F} given frequencies, for these {N} plants"

    @property
    def problem_size(self) -> float:
        """Number of matrices to cover, at all frequencies together."""
        return float(np.prod(self.responses.values.shape[:2]))

    # --- the question -----------------------------------------------------------------------------

    @property
    def axis(self) -> RealArray:
        """Frequencies (F,) [rad/s] for the fit of weights; for sampled plants those of the bilinear
        plane.
        """
        return self.responses.axis

    @cached_property
    def deviations(self) -> Array:
        """The matrices X (F, N, ., .) of all plants."""
        return self._residuals(system_response)

    def _residuals(self, response: Any) -> Array:
        omega = self.responses.omega
        factors = response(left_factors(self.nominal), omega) if self.form == "coprime" else None
        found, left = residuals(
            self.responses.values, response(self.nominal, omega), self.form, factors
        )
        places = [self.responses.place(f) for f in range(omega.size)]
        need_reached(left, self.form, places, list(self.responses.plants))
        return found

    @cached_property
    def loop_response(self) -> Array | None:
        """Responses (F, ., .) of the loop that X closes, if there is one."""
        if self.loop is None:
            return None
        size = delta_shape(self.form, self.nominal.noutputs, self.nominal.ninputs)
        need_loop_around(self.loop, size, self.responses.dt)
        response = system_response(self.loop.system, self.responses.omega)
        rows, columns = self.deviations.shape[2:]
        return response if self.performance else response[:, :columns, :rows]

    @cached_property
    def sets(self) -> MatrixSets:
        """The program of the smallest sets at each frequency, or of those of the least mu."""
        return self._sets_of(self.deviations, self.loop_response, self.right)

    def sets_with_right_weight(self, W_2: Array) -> MatrixSets:
        """The program of the smallest sets that have a given W_2 (F, ., .), so only W_1 is free."""
        n, loop = W_2.shape[-1], self.loop_response
        if loop is not None:
            loop = np.concatenate([W_2 @ loop[:, :n], loop[:, n:]], axis=1)
        return self._sets_of(self.matrices_to_cover @ np.linalg.inv(W_2)[:, None], loop, "scalar")

    def _sets_of(self, X: Array, loop: Array | None, right: WeightShape) -> MatrixSets:
        size: Size = "volume" if loop is None else "mu"
        return MatrixSets(X, left=self.left, right=right, size=size, floor=self.floor, loop=loop)

    def without_loop(self) -> Self:
        """The program of the smallest sets for the same plants, without the loop."""
        return replace(self, loop=None)

    @cached_property
    def matrices_to_cover(self) -> Array:
        """The matrices that the weights must cover: X of every plant, and the floor."""
        rows, columns = self.deviations.shape[2:]
        return self.sets.away(np.zeros((len(self.deviations), rows, columns)))

    @property
    def covers_every_frequency(self) -> bool:
        """Whether the plants are covered at every frequency: they are known and stable, and the
        form is additive.
        """
        systems = [*self.responses.known, self.nominal]
        return (
            self.form == "additive"
            and bool(self.responses.known)
            and not any(unstable_poles(each) for each in systems)
        )

    def for_fits(self) -> tuple[Self, RealArray]:
        """The program at the frequencies that a fit uses, and their shares (F,) in the objective.

        If the plants are known at every frequency, frequencies are added between the given ones
        and outside their band. Those outside the band have the share 0.
        """
        given = self.responses
        if not self.covers_every_frequency:
            return self, given.shares
        axis = beyond(self.axis)
        omega = angular_frequency(np.union1d(axis, between(axis)), given.dt)
        responses = MatrixResponses.of_systems(given.known, omega, plants=given.plants)
        inside = (omega >= given.omega[0]) & (omega <= given.omega[-1])
        shares = responses.shares * inside
        return replace(self, responses=responses), shares / shares.sum()

    def deltas(self, model: MatrixModel, *, response: Any = system_response) -> Array:
        """The matrices Delta (F, N, ., .) of all plants."""
        omega = self.responses.omega
        X = self.deviations if response is system_response else self._residuals(response)
        W_1, W_2 = response(model.W_1, omega), response(model.W_2, omega)
        return between_weights(W_1, X, W_2)

    def known_deltas(self, model: MatrixModel) -> list[StateSpace]:
        """Delta of every known plant, as a system."""
        left, right = inverse_weight(model.W_1), inverse_weight(model.W_2)
        return [left * (plant - self.nominal) * right for plant in self.responses.known]

    # --- objective --------------------------------------------------------------------------------

    def radii(self, model: MatrixModel) -> RealArray:
        """Geometric mean (F,) of the radius of the model's sets in all directions."""
        logs = [
            np.linalg.slogdet(system_response(W, self.responses.omega))[1] / W.ninputs
            for W in (model.W_1, model.W_2)
        ]
        return np.exp(logs[0] + logs[1])

    def log_mu(self, model: MatrixModel) -> RealArray:
        """Logarithm (F,) of the loop's mu with the model's sets.

        Raises InputError for a cover without a loop.
        """
        if self.loop_response is None:
            raise InputError("this cover has no loop, so no mu: give it loop=")
        omega = self.responses.omega
        inverses = [np.linalg.inv(system_response(W, omega)) for W in (model.W_1, model.W_2)]
        return loop_level(self.loop_response, *inverses)[0]

    def objective(self, answer: FoundCover) -> float:
        """Mean of the logarithm of the radius over the logarithm of frequency.

        With a loop: logarithm of the largest mu, plus VOLUME_SHARE times that mean.
        """
        mean = float(self.responses.shares @ np.log(self.radii(answer.model)))
        if self.loop is None:
            return mean
        return float(self.log_mu(answer.model).max()) + VOLUME_SHARE * mean

    def objective_scale(self, answer: FoundCover) -> float:
        """The scale is 1, since differences of logarithms are already relative."""
        return 1.0

    # --- the check --------------------------------------------------------------------------------

    checks_follow_accuracy = True

    def checks(self, answer: FoundCover, tolerance: float) -> Sequence[Check]:
        model = answer.model
        if model.form != self.form:
            raise InputError(f"the answer has the form {model.form!r}, not {self.form!r}")
        norms = self._norms(model)
        value, where = worst_value(norms - 1, self.responses.numbered)
        checks = [Check("containment", "norm of a Delta, less 1", value, CONTAINED, where=where)]
        if self.covers_every_frequency:
            bounds = [certified_norm(delta) - 1 for delta in self.known_deltas(model)]
            value, where = worst_value(bounds, lambda i: f"plant {self.responses.plants[i[0]]}")
            over = f"{EVERY_FREQUENCY}, for these {len(bounds)} plants"
            statement = "proven bound of the norm of a Delta, less 1"
            found = Check(
                "everywhere", statement, value, CONTAINED, where=where, over=over, proven=True
            )
            checks.append(found)
        checks.append(self._nominal_check(model))
        for name, shape, order in (
            ("W_1", self.left, self.left_order),
            ("W_2", self.right, self.right_order),
        ):
            W = getattr(model, name)
            off = off_shape(system_response(W, self.responses.omega), shape)
            statement = "largest entry that is not of its shape, relative"
            checks += [
                Check(f"order of {name}", "number of states", W.nstates, order * W.ninputs),
                stays_stable(f"{name} stable", W),
                stays_stable(f"inverse of {name} stable", inverse_weight(W)),
                Check(f"{name} {shape}", statement, off, SHAPED, over=THIS_SYSTEM),
            ]
        least = self.sets.checks(answer.least, tolerance)[0]
        checks.append(replace(least, name="smallest sets"))
        if self.sets.size == "volume":  # the least mu of a loop is reported with its gap
            checks.append(self._least_check(answer.least, tolerance))
        return checks

    def _least_check(self, least: FoundSets, tolerance: float) -> Check:
        value, where = worst_value(
            self.sets.excess(least), lambda i: f"at {self.responses.place(i[0])}"
        )
        statement = "logarithm of the size of a smallest set beyond its proven lower bound"
        limit, over = max(tolerance, LEAST_GAP), self.sets.quantifier
        return Check("no set is smaller", statement, value, limit, where=where, over=over)

    def _nominal_check(self, model: MatrixModel) -> Check:
        omega = self.responses.omega
        given = system_response(self.nominal, omega)
        apart = np.abs(system_response(model.nominal, omega) - given).max(axis=(1, 2))
        apart = apart / np.maximum(np.abs(given).max(axis=(1, 2)), np.finfo(float).tiny)
        value, where = worst_value(apart, lambda i: f"at {self.responses.place(i[0])}")
        statement = "distance of its response from that of the given one, relative"
        return Check("nominal given", statement, value, CONTAINED, where=where)

    def second_opinion(self, answer: FoundCover) -> Sequence[Check]:
        model, responses = answer.model, self.responses
        X = self._residuals(plain_response)
        found = [
            semidefinite(responses, X, model),
            plants_made(responses, self.deltas(model, response=plain_response), model),
            decays(model.W_1, "W_1 decays"),
            decays(model.W_2, "W_2 decays"),
            decays(inverse_weight(model.W_1), "inverse of W_1 decays"),
            decays(inverse_weight(model.W_2), "inverse of W_2 decays"),
        ]
        if self.covers_every_frequency:
            found.append(tried_everywhere(responses, self.known_deltas(model)))
        least = self.sets.second_opinion(answer.least)[0]
        return [*found, replace(least, name="smallest sets by eigenvalues")]

    def metrics(self, answer: FoundCover) -> dict[str, float]:
        radii, least = self.radii(answer.model), answer.least.radius
        excess = np.log(radii / least)
        norms = self._norms(answer.model)
        shares = self.responses.shares
        logs = {} if self.loop is None else self._mu_and_least(answer)
        return {name: float(np.exp(log.max())) for name, log in logs.items()} | {
            "radius_mean": float(np.exp(shares @ np.log(radii))),
            "radius_mean_least": float(np.exp(shares @ np.log(least))),
            "inflation_mean": float(np.exp(shares @ excess)),
            "inflation_peak": float(np.exp(excess.max())),
            "least_gap": float(self.sets.excess(answer.least).max()),
            "delta_mean_largest": float(shares @ norms.max(axis=1)),
            "order_W1": answer.model.W_1.nstates,
            "order_W2": answer.model.W_2.nstates,
            "plants": norms.shape[1],
        }

    def _mu_and_least(self, answer: FoundCover) -> dict[str, RealArray]:
        """Logarithms (F,) of the loop's mu, and of its least mu with weights of any order."""
        least = self.sets.log_mu(answer.least)
        return {"mu_peak": self.log_mu(answer.model), "mu_peak_least": least}

    # --- datasets and figures ---------------------------------------------------------------------

    def _norms(self, model: MatrixModel) -> RealArray:
        """Norms (F, N) of Delta of every plant."""
        return np.linalg.norm(self.deltas(model), 2, axis=(2, 3))

    def to_dataset(self, answer: FoundCover) -> Dataset:
        model, sets = answer.model, self.sets.to_dataset(answer.least)
        return stored_cover(self.responses, model, self._norms(model), self.radii(model), sets)

    def from_dataset(self, data: Dataset) -> FoundCover:
        return FoundCover(restored_matrix_model(data, self.form), self.sets.from_dataset(data))

    def figures(self, answer: FoundCover) -> dict[str, Figure]:
        responses, model = self.responses, answer.model
        nominal = system_response(model.nominal, responses.omega)
        discs = model.entry_discs(responses.omega)
        mu = {}
        if self.loop is not None:
            logs = self._mu_and_least(answer).values()
            mu = {"mu": loop_mu_figure(responses, *(np.exp(each) for each in logs))}
        return mu | {
            "magnitudes": magnitudes_figure(responses.omega, nominal, *discs, responses.values),
            "radius": radius_figure(responses, self.radii(model), answer.least.radius),
            "deltas": deltas_figure(responses, self._norms(model)),
        }
