"""State feedback from records, for every plant that agrees with the records, as a Program."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass, replace
from functools import cached_property, lru_cache
from typing import Any, ClassVar

import numpy as np

from workbench._core.arrays import EPS, RealArray
from workbench._core.heavy_types import Dataset, Figure
from workbench.certificate import Check, relative_excess
from workbench.certify.cones.form import ConicForm
from workbench.certify.cones.membership import fraction, outside
from workbench.certify.cones.rays import dot, excluded_radius, transposed
from workbench.certify.known_plants.exact_function import exact_rational
from workbench.certify.rounding import TINY, UPWARD, Enclosure, exact
from workbench.conic import ConicallyStated
from workbench.conic.claims import NoSolutionOfComputed, parsed_rational
from workbench.conic.ray_search import dual_point, dual_ray, settled_point, settled_ray
from workbench.errors import InputError
from workbench.executor import Context
from workbench.input_checks import as_array, need_choice
from workbench.program import Task
from workbench.solvers import Outcome
from workbench.synthesis.records import figures
from workbench.synthesis.records.inequalities import (
    FeedbackCriterion,
    ProvenFeedback,
    ScaledRecords,
)
from workbench.synthesis.records.lemma import (
    implication,
    proven_least_eigenvalue,
    trace_of_cost,
)
from workbench.synthesis.records.record import StateRecords
from workbench.synthesis.records.trials import EVERY_PLANT, tried_claims

RATE_STEPS = (2e-3, 1e-2, 5e-2, 0.2, 0.5)
"""Relative distances below the level: a proof is sought that no gain reaches these lower rates."""

INNER_SHARE = 1e-7
"""Share of an inner point in a dual point. It keeps the point away from the boundary of the cone,
by about a million rounding errors of the computed form. So the point proves its bound on every
processor.
"""
BOUND_ROUNDING = 1e-12
"""Relative change of a bound that rounding of the unit of scaled records may cause."""


@dataclass(frozen=True, eq=False)
class FeedbackFromRecords(ConicallyStated):
    """The gain u = K x with the least level that one Lyapunov function proves for every plant.

    No model is identified: the inequality depends on the records and the noise bound only. It is
    necessary and sufficient for one Lyapunov function that holds for all plants.

    Parameters
    ----------
    records
        States, inputs and noise bound.
    criterion
        "decay" minimises the rate, below 1: the factor of the square root of x' P x per sample.
        "h2" and "hinf" minimise the norm from v to z = C x + D u of x+ = A x + B u + F v.
    C, D
        Matrices (p, n) and (p, m); None for "decay". D is zero if it is None.
    F
        Matrix (n, q). None stands for the identity, the input of the noise in the records; for
        "decay" it must be None.

    Raises
    ------
    InputError
        The criterion is unknown; or performance matrices are missing, do not fit, or are not
        finite.

    Examples
    --------
    >>> import numpy as np
    >>> import workbench as wb
    >>> from workbench.synthesis import FeedbackFromRecords, NoiseEnergy, StateRecords
    >>> rng = np.random.default_rng(0)
    >>> x, u, w = (
    ...     rng.standard_normal((2, 30)),
    ...     rng.standard_normal((1, 30)),
    ...     rng.random((2, 30)) - 0.5,
    ... )
    >>> next_states = [[1.1, 0.3], [0.0, 0.7]] @ x + [[0.2], [1.0]] @ u + 0.2 * w
    >>> records = StateRecords(x, u, next_states, NoiseEnergy(0.3 * np.eye(2)))
    >>> solution = wb.solve(FeedbackFromRecords(records))
    >>> solution.certificate.holds, bool(solution.answer.level < 1)
    (True, True)
    """

    records: StateRecords
    _: KW_ONLY
    criterion: FeedbackCriterion = "decay"
    C: RealArray | None = None
    D: RealArray | None = None
    F: RealArray | None = None

    default_method: ClassVar[str] = "riccati"
    methods_in: ClassVar[tuple[str, ...]] = (
        "workbench.synthesis.records.conic",
        "workbench.synthesis.records.riccati",
    )
    headline: ClassVar[str] = "level"

    def __post_init__(self) -> None:
        if not isinstance(self.records, StateRecords):
            raise InputError(f"records must be StateRecords, not {type(self.records).__name__}")
        need_choice(self.criterion, FeedbackCriterion, "criterion")
        if self.criterion == "decay":
            if not (self.C is self.D is self.F is None):
                raise InputError("the criterion 'decay' has no performance: C, D, F must be None")
            return
        n, m = self.records.order, self.records.controls
        C = as_array([] if self.C is None else self.C, "C")
        if C.ndim != 2 or C.shape[1] != n or not len(C):
            raise InputError(f"C has shape {C.shape}; (p, {n}) is needed")
        D = np.zeros((len(C), m)) if self.D is None else as_array(self.D, "D")
        if D.shape != (len(C), m):
            raise InputError(f"D has shape {D.shape}; ({len(C)}, {m}) is needed")
        if not (np.isfinite(C).all() and np.isfinite(D).all() and (C.any() or D.any())):
            raise InputError("C and D must be finite, and not both zero")
        F = np.eye(n) if self.F is None else as_array(self.F, "F")
        if F.ndim != 2 or len(F) != n or not (np.isfinite(F).all() and F.any()):
            raise InputError(f"F has shape {F.shape}; finite ({n}, q) are needed, not all zero")
        object.__setattr__(self, "C", C)
        object.__setattr__(self, "D", D)
        object.__setattr__(self, "F", F)

    @property
    def performance(self) -> tuple[RealArray, RealArray]:
        """C (p, n) and D (p, m); without rows (p = 0) if there is no performance output."""
        if self.C is None or self.D is None:
            return np.zeros((0, self.records.order)), np.zeros((0, self.records.controls))
        return self.C, self.D

    @property
    def disturbance(self) -> RealArray:
        """Input matrix F (n, q) of the disturbance."""
        return np.eye(self.records.order) if self.F is None else self.F

    @cached_property
    def scaled(self) -> ScaledRecords:
        """The records in scaled coordinates, for the methods."""
        return ScaledRecords(self.records, self.criterion, *self.performance, self.disturbance)

    def conic_form(self) -> ConicForm:
        """The conic program of the least level, or of the rate 1, in scaled coordinates."""
        return self.scaled.form(1.0 if self.criterion == "decay" else None)

    @cached_property
    def stabilising(self) -> FeedbackFromRecords:
        """The same question for the least rate, which has an answer whenever this one has."""
        return self if self.criterion == "decay" else FeedbackFromRecords(self.records)

    def claim_task(self, claim: Outcome) -> Task | None:
        """The task that proves the claim of no answer, by the smaller inequality for the rate 1."""
        if claim is not Outcome.INFEASIBLE:
            return super().claim_task(claim)
        return NoSolutionOfComputed(self.stabilising.conic_form())

    # --- objective ----------------------------------------------------------------------------

    @property
    def problem_size(self) -> float:
        """Number of states and inputs."""
        return float(self.records.order + self.records.controls)

    def objective(self, answer: ProvenFeedback) -> float:
        """The proven level."""
        return answer.level

    def witnessed(self, answer: ProvenFeedback) -> ProvenFeedback:
        """The answer with a proof that no gain reaches a certain lower level."""
        if self.criterion == "decay":
            for step in RATE_STEPS:
                rate = answer.level * (1.0 - step)
                y = dual_ray(self.scaled.form(rate), Context())
                if y is not None and excluded_radius(self.scaled.form(rate), y) == math.inf:
                    return replace(answer, bound=rate, dual=tuple(map(str, y)))
            return answer
        y = dual_point(self.conic_form(), share=INNER_SHARE)
        if y is None:
            return answer
        return replace(answer, bound=self._bound_of(y), dual=tuple(map(str, y)))

    def _bound_of(self, y: Sequence[Any]) -> float:
        """The level below which an exact point of the dual cone excludes all answers."""
        value = -fraction(dot(self.conic_form().b, y))
        return math.sqrt(max(float(value), 0.0)) * (1.0 - 4.0 * EPS) * self.scaled.size

    def gap(self, answer: ProvenFeedback) -> tuple[str, float]:
        statement = "level over one that no gain with a common Lyapunov matrix has, less 1"
        if not answer.dual:
            return f"{statement}; no such proof was found", math.inf
        return statement, relative_excess(answer.level, self.proven_bound(answer))

    def proven_bound(self, answer: ProvenFeedback) -> float:
        """The level below which an answer's dual excludes every gain, recomputed; 0 without a
        dual.
        """
        return _excluded_level(self, answer.bound, answer.dual) if answer.dual else 0.0

    def excluded_rate(self, rate: float, y: Sequence[Any]) -> float:
        """The rate, if an exact ray proves that no gain reaches it; otherwise 0."""
        if not 0.0 < rate < math.inf:
            return 0.0
        form = self.scaled.form(rate)
        held = len(y) == form.b.size and excluded_radius(form, settled_ray(form, y)) == math.inf
        return rate if held else 0.0

    def excluded_norm(self, y: Sequence[Any]) -> float:
        """The norm below which an exact dual point excludes every gain; 0 if it excludes none."""
        form = self.conic_form()
        y = settled_point(form, y) if len(y) == form.b.size else []
        held = bool(y) and not outside(form, y, dual=True)
        held = held and all(
            value + exact_rational(cost) == 0
            for value, cost in zip(transposed(form, y), form.c, strict=True)
        )
        return self._bound_of(y) if held else 0.0

    # --- checks -------------------------------------------------------------------------------

    def checks(self, answer: ProvenFeedback, tolerance: float) -> list[Check]:
        n, m = self.records.order, self.records.controls
        arrays = (answer.K, (m, n)), (answer.Y, (n, n))
        fits = all(part.shape == shape and np.isfinite(part).all() for part, shape in arrays)
        fits = fits and answer.level > 0.0 and math.isfinite(answer.level + answer.multiplier)
        statement = "whether K, Y, multiplier or level is no finite number of the right shape"
        found = [Check("dimensions", statement, float(not fits), 0.0)]
        if not fits:
            return found
        skew = float(np.abs(answer.Y - answer.Y.T).max())
        found.append(
            Check("symmetry", "largest entry of Y - Y', in units of Y", skew, 0.0, over=EVERY_PLANT)
        )
        positive = proven_least_eigenvalue(exact(answer.Y), (0,))
        statement = "minus the least eigenvalue of the scaled Y, rounded downward"
        found.append(
            Check("Lyapunov matrix", statement, -positive, -TINY, over=EVERY_PLANT, proven=True)
        )
        starts = 0, n, 2 * n + m, 3 * n + m
        least = proven_least_eigenvalue(self._implication(answer), starts)
        statement = (
            "minus the least eigenvalue of the scaled matrix of the S-lemma, rounded downward"
        )
        found.append(Check("S-lemma", statement, -least, -TINY, over=EVERY_PLANT, proven=True))
        beyond = answer.bound - self.proven_bound(answer)
        statement = "difference of the bound from the one that its dual proves, over the level"
        value = beyond / answer.level
        found.append(
            Check("bound", statement, value, BOUND_ROUNDING, over=EVERY_PLANT, proven=True)
        )
        if self.criterion == "decay":
            found.append(
                Check("rate", "rate per sample, less 1", answer.level - 1.0, 0.0, over=EVERY_PLANT)
            )
        elif self.criterion == "h2":
            trace = math.sqrt(trace_of_cost(answer.Y, self.disturbance)) / answer.level
            statement = "root of the trace of F' Y^-1 F, rounded upward, over the level, less 1"
            found.append(
                Check("H2 level", statement, trace - 1.0, -2 * EPS, over=EVERY_PLANT, proven=True)
            )
        return found

    def _implication(self, answer: ProvenFeedback) -> Enclosure:
        """Enclosure of the S-lemma's matrix for an answer."""
        Y = exact(answer.Y)
        if self.criterion == "decay":
            shrunk = Y.times(answer.level).times(answer.level)
        elif self.criterion == "h2":
            shrunk = Y
        else:
            # F / level is rounded, so slightly more than its square is used.
            entering = exact(self.disturbance).times(UPWARD / answer.level)
            shrunk = Y - entering @ entering.H
        multiplier = answer.multiplier
        return implication(self.records, answer.K, answer.Y, multiplier, shrunk, *self.performance)

    def proven(self, answer: ProvenFeedback) -> bool:
        """Whether all checks of an answer hold."""
        return all(check.holds for check in self.checks(answer, 0.0))

    def second_opinion(self, answer: ProvenFeedback) -> Sequence[Check]:
        return tried_claims(self, answer)

    def metrics(self, answer: ProvenFeedback) -> dict[str, float]:
        A_K = self.records.centre @ np.vstack([np.eye(self.records.order), answer.K])
        return {
            "level": answer.level,
            "level_bound": answer.bound,
            "central_spectral_radius": float(np.abs(np.linalg.eigvals(A_K)).max()),
            "largest_gain": float(np.linalg.norm(answer.K, 2)),
            "samples": float(self.records.samples),
        }

    # --- datasets and figures -----------------------------------------------------------------

    def to_dataset(self, answer: ProvenFeedback) -> Dataset:
        import xarray as xr

        about = {
            "K": "gain, u = K x",
            "Y": "inverse of the common Lyapunov matrix",
            "multiplier": "alpha of the S-lemma",
            "level": "proven rate per sample, or norm",
            "bound": "level that no gain has",
        }
        dims = {"K": ("input", "state"), "Y": ("state", "state_")}
        found: dict[str, Any] = {
            name: (dims.get(name, ()), getattr(answer, name), {"units": "1", "long_name": text})
            for name, text in about.items()
        }
        if answer.dual:
            found["dual"] = ("row", list(answer.dual), {"units": "1", "long_name": "its proof"})
        return xr.Dataset(found)

    def from_dataset(self, data: Dataset) -> ProvenFeedback:
        dual = tuple(map(str, data["dual"].values)) if "dual" in data else ()
        multiplier, level, bound = (float(data[name]) for name in ("multiplier", "level", "bound"))
        return ProvenFeedback(
            data["K"].values, data["Y"].values, multiplier, level, bound=bound, dual=dual
        )

    def figures(self, answer: ProvenFeedback) -> dict[str, Figure]:
        return {"loops": figures.loops(self, answer)}


@lru_cache(maxsize=4)
def _excluded_level(program: FeedbackFromRecords, bound: float, dual: tuple[str, ...]) -> float:
    """`FeedbackFromRecords.proven_bound`, cached because checks and gap of a certificate both use
    it.
    """
    y = [parsed_rational(text) for text in dual]
    if program.criterion == "decay":
        return program.excluded_rate(bound, y)
    return program.excluded_norm(y)
