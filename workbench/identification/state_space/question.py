"""The question of a state-space fit: the record, its parts, and the admissible models.

Arguments are checked and completed here, before anything is computed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import KW_ONLY, dataclass, field
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import RealArray
from workbench.errors import InputError
from workbench.identification.experiments.several import (
    Experiments,
    SamplesAlong,
    as_experiments,
)
from workbench.identification.innovations.knowledge import Knowledge
from workbench.identification.innovations.model import InnovationsModel
from workbench.identification.innovations.scaling import Scaling
from workbench.identification.record_tests.report import RecordReport
from workbench.identification.responses.local_polynomial import (
    LocalPolynomial,
    polynomials_in_bands,
)
from workbench.identification.state_space.delays import checked_delays, estimated_delays
from workbench.identification.state_space.folds import (
    VALIDATION_SHARE,
    final_prediction_factor,
    scored_fit,
    scored_samples,
    validation_folds,
)
from workbench.identification.state_space.identified import USES
from workbench.identification.state_space.known import checked_knowledge, refuse_poles_outside
from workbench.identification.state_space.orders import OrderLimits
from workbench.identification.state_space.validation import autocorrelation, cross_correlation
from workbench.input_checks import need_count

RESIDUAL_LAGS = 25
"""Largest number of lags in the tests of residuals."""
FEWEST_SCORED = 4
"""Fewest samples, after a washout, on which a model is judged."""
REST_SAMPLES = 50
"""Number of samples at rest that are put before a record whose inputs never move."""
USUAL_WASHOUT = 50
"""Longest washout [samples] by default."""
MOST_VALIDATED = 200_000
"""Most samples, counted from the first, that are divided into folds to choose an order."""
MOST_LINES = 50_000
"""Most lines at which the nonparametric response is computed, evenly spread."""
ESTIMATION_SHARE = 2 / 3
"""Default share of the record that methods may use."""

Fitter = Callable[[Experiments], InnovationsModel | None]
"""Function of experiments that returns a model, or None."""
Poles = Literal["stable", "marginal", "any"]


@dataclass(frozen=True, eq=False)
class RecordedQuestion:
    """A record with a first part for estimation and choice, and a remaining part for judgement.

    The parameters are those of `StateSpaceFit`.
    """

    u: Any
    y: Any = None
    _: KW_ONLY
    estimation: int | None = None
    orders: Sequence[int] | None = None
    washout: int | None = None
    title: str = field(default="record", kw_only=True)
    dt: float | None = field(default=None, kw_only=True)
    samples: SamplesAlong | None = field(default=None, kw_only=True)
    direct: bool = field(default=True, kw_only=True)
    delay_samples: int | Sequence[int] | Literal["estimate"] = field(default=0, kw_only=True)
    poles: Poles = field(default="marginal", kw_only=True)
    known_poles: Sequence[complex] = field(default=(), kw_only=True)
    static_gain: ArrayLike | None = field(default=None, kw_only=True)
    assume: str | Sequence[str] = field(default=(), kw_only=True)

    def __post_init__(self) -> None:
        record = self.record
        if self.poles not in ("stable", "marginal", "any"):
            raise InputError(f'poles is {self.poles!r}; it must be "stable", "marginal" or "any"')
        if not isinstance(self.direct, bool):
            raise InputError(f"direct is {self.direct!r}; it must be True or False")
        checked_delays(self.delay_samples, record)
        known = self.known
        if known is not None:
            refuse_poles_outside(known.poles, self.poles)
        settle = object.__setattr__
        if self.estimation is None:
            settle(self, "estimation", round(ESTIMATION_SHARE * len(record)))
        need_count("estimation", self.estimation)
        shortest = min(
            round(self.estimation_samples * VALIDATION_SHARE), len(record) - self.estimation_samples
        )
        if self.washout is None:
            settle(self, "washout", max(1, min(USUAL_WASHOUT, shortest // 3)))
        need_count("washout", self.washout)
        washout = int(self.washout or 0) + (
            0 if isinstance(self.delay_samples, str) else max(self.delays_samples, default=0)
        )
        if shortest <= washout + FEWEST_SCORED:
            raise InputError(
                f"{len(record)} samples with {self.estimation} for estimation leave parts of "
                f"{shortest} to judge on; more than washout + delay + {FEWEST_SCORED} = "
                f"{washout + FEWEST_SCORED} are needed: take a longer record or a shorter washout"
            )
        self._refuse_unjudged()
        settle(self, "orders", self._limits.settled(self.orders))
        self.report.need_usable()

    def _refuse_unjudged(self) -> None:
        """Raise `InputError` if hardly any sample of an output is left to estimate or to judge."""
        for part, first in (
            (self.estimation_record, 0),
            (self.judged_record, int(self.washout or 0)),
        ):
            for i, name in enumerate(self.record.outputs):
                known = sum(int(np.isfinite(y[first:, i]).sum()) for _, y in part.pieces())
                if known < FEWEST_SCORED:
                    use = (
                        "judges behind its washout"
                        if part is self.judged_record
                        else "is estimated from"
                    )
                    raise InputError(
                        f"y: channel {i} ({name}) has {known} measured samples in the part of the "
                        f"record that {use}; {FEWEST_SCORED} are needed: give another estimation, "
                        "cut the record, or leave the channel out"
                    )

    @property
    def _limits(self) -> OrderLimits:
        """The orders that the shortest estimation part can determine."""
        nu, ny = self.record.u.shape[1], self.record.y.shape[1]
        samples = self.estimation_samples - round(self.estimation_samples * VALIDATION_SHARE)
        known = 0 if self.known is None else len(self.known.poles)
        return OrderLimits(samples, nu, ny, known)

    def determines_arx(self, order: int) -> bool:
        """Whether the shortest part determines an ARX model of an order."""
        return self._limits.determines_arx(order)

    # --- the record ------------------------------------------------------------------------------

    @cached_property
    def record(self) -> Experiments:
        """All experiments, concatenated."""
        return as_experiments(self.u, self.y, dt=self.dt, samples=self.samples, assume=self.assume)

    @cached_property
    def report(self) -> RecordReport:
        """Tests and findings of the record, for models of the largest order asked for."""
        return self.record.report_for(direct=self.direct, order=max(self.orders or (1,)))

    @property
    def estimation_samples(self) -> int:
        """Length of the part that methods may use [samples]."""
        return int(self.estimation or 0)

    @property
    def washout_samples(self) -> int:
        """Samples at the start that do not count [samples].

        Their inputs act later, or they tell the state.
        """
        return int(self.washout or 0) + max(self.delays_samples, default=0)

    @cached_property
    def estimation_record(self) -> Experiments:
        """The samples that methods may use; if no input moves in them, preceded by rest."""
        part = self.record.part(0, self.estimation_samples)
        still = len(part.still_inputs()) == part.u.shape[1]
        return part.from_rest(REST_SAMPLES) if still else part

    @cached_property
    def judged_record(self) -> Experiments:
        """The samples on which the answer is judged."""
        return self.record.part(self.estimation_samples, len(self.record))

    @cached_property
    def folds(self) -> list[tuple[Experiments, Experiments]]:
        """Parts for estimation and for validation, within the samples that methods may use."""
        return self.folds_within(MOST_VALIDATED)

    def folds_within(self, samples: int) -> list[tuple[Experiments, Experiments]]:
        """Folds of the first ``samples`` samples that methods may use.

        Of all, if those give fewer folds.

        Differences between candidates that this many samples do not show are too small to matter.
        """
        whole = validation_folds(self.estimation_record)
        if len(self.estimation_record) <= samples:
            return whole
        first = validation_folds(self.estimation_record.part(0, samples))
        return first if len(first) == len(whole) else whole

    @cached_property
    def delays_samples(self) -> tuple[int, ...]:
        """Delay [samples] of each input; empty if no input is delayed."""
        if isinstance(self.delay_samples, str):
            found = estimated_delays(self.estimation_record)
            if not self.direct:  # without D the plant itself answers a sample later
                found = tuple(max(each - 1, 0) for each in found)
        else:
            found = checked_delays(self.delay_samples, self.record)
        return found if any(found) else ()

    @cached_property
    def known(self) -> Knowledge | None:
        """Known poles and gains; None if nothing is known."""
        return checked_knowledge(
            self.known_poles, self.static_gain, self.record.u.shape[1], self.record.y.shape[1],
        )  # fmt: skip

    @cached_property
    def gain_sizes(self) -> RealArray:
        """Ratios of output spread to input spread (ny, nu) in the estimation part."""
        scaling = Scaling.of(self.estimation_record)
        return np.asarray(scaling.y_spread[:, None] / scaling.u_spread)

    def holds_known(self, model: InnovationsModel) -> bool:
        """Whether a model has the known poles and gains, if any."""
        return self.known is None or self.known.holds(model, self.gain_sizes)

    @property
    def largest_radius(self) -> float:
        """Largest modulus of a pole."""
        return {"stable": 1.0, "marginal": 1 + 1 / self.estimation_samples, "any": np.inf}[
            self.poles
        ]

    # --- what methods need -----------------------------------------------------------------------

    def validate(self, fit: Fitter) -> RealArray:
        """Mean validation fits (uses, ny) [%] of a fitting function, over the folds.

        They are minus infinity if it finds no model. Without folds they are the fits that Akaike's
        final prediction error expects on a new record.
        """
        outputs = self.record.y.shape[1]
        total = np.zeros((len(USES), outputs))
        for used, left in self.folds:
            model = fit(used)
            if model is None:
                return np.full_like(total, -np.inf)
            total += self.fits_to_choose_by(model, left) / len(self.folds)
        if self.folds:
            return total
        model = fit(self.estimation_record)
        if model is None:
            return np.full_like(total, -np.inf)
        factor = final_prediction_factor(
            self._limits.parameters(model.order), len(self.estimation_record)
        )
        return 100 - factor * (100 - self.fits_to_choose_by(model, self.estimation_record))

    def fits_to_choose_by(self, model: InnovationsModel, record: Experiments) -> RealArray:
        """Validation fits (uses, ny) [%] of a model, by which orders are chosen."""
        return self._fits_of(model, model, record)

    def fits(
        self, predictor: InnovationsModel, simulator: InnovationsModel, u: RealArray, y: RealArray
    ) -> RealArray:
        """Fits (uses, ny) [%] of each output on a record u (N, nu), y (N, ny), without its washout.

        They are one-step fits of the predictor and free-run fits of the simulator.
        """
        return self._fits_of(predictor, simulator, Experiments(u, y))

    def _fits_of(
        self, predictor: InnovationsModel, simulator: InnovationsModel, record: Experiments
    ) -> RealArray:
        runs = (predictor.one_step, simulator.free_run)
        return np.array([scored_fit(run, record, self.washout_samples) for run in runs])

    @cached_property
    def nonparametric(self) -> LocalPolynomial | None:
        """Nonparametric response of the estimation part.

        None if it has gaps, several experiments, too few samples, or an input that never moves.
        """
        if len(self.estimation_record.starts) > 1 or self.estimation_record.missing:
            return None
        last = (len(self.estimation_record) + 1) // 2 - 1
        at = None
        if last > MOST_LINES:
            at = np.unique(np.linspace(1, last, MOST_LINES).round().astype(int))
        try:
            return polynomials_in_bands(self.estimation_record.u, self.estimation_record.y, at=at)
        except InputError:
            return None

    def residual_tests(self, model: InnovationsModel) -> tuple[RealArray, RealArray]:
        """`autocorrelation` and `cross_correlation` of one-step errors on the held-out samples."""
        measured, made = scored_samples(model.one_step, self.judged_record, self.washout_samples)
        inputs = np.vstack(
            [
                u[self.washout_samples :]
                for u, _ in self.judged_record.pieces()
                if len(u) > self.washout_samples
            ]
        )
        errors = np.nan_to_num(measured - made)
        lags = max(1, min(RESIDUAL_LAGS, len(errors) // 4))
        return autocorrelation(errors, lags), cross_correlation(errors, inputs, lags)
