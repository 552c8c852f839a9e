"""State-space models of a record: one for prediction and one for simulation.

Prediction and simulation are two uses of a model. If a record is not quite linear, no model of low
order is best at both: one-step prediction can treat slow errors of the plant model as noise, a
simulation cannot. So each use has its own model, estimated by the criterion of that use, with the
order that validates best in it. Both are chosen in the first part of the record and judged on the
rest.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import Dataset, Figure
from workbench._core.tables import markdown_table
from workbench.certificate import THIS_SYSTEM, Check
from workbench.errors import InputError
from workbench.identification.experiments.several import Experiments
from workbench.identification.innovations.model import InnovationsModel
from workbench.identification.state_space import datasets
from workbench.identification.state_space import figures as drawn
from workbench.identification.state_space.control_weight import control_fit, need_bandwidth
from workbench.identification.state_space.facts import (
    deviations_told,
    facts_of,
    simulator_deviations,
)
from workbench.identification.state_space.identified import MODELS, USES, IdentifiedModels
from workbench.identification.state_space.known import known_checks
from workbench.identification.state_space.physical import PhysicalModel
from workbench.identification.state_space.question import RecordedQuestion
from workbench.identification.state_space.validation import nrmse_fit, share_outside
from workbench.program import Program
from workbench.second_opinion.fits import decays
from workbench.second_opinion.known_plants import has_known
from workbench.second_opinion.records import convolved

AS_TOLD = "These fits are as the method told them: other orders are not stored, and not checked."
"""What stands below tables of fits that chose an order."""
CONVOLUTION_ROUNDING = 1e-6
"""Largest difference between the free-run error by convolution and by simulation."""
RUN_ROUNDING = 1e-13
"""Difference between two runs, relative to the largest output, that counts as rounding.

Once an output has settled, this rounding may be all that remains of the errors.
"""
CONVOLVED = 20_000
"""Most held-out samples of each experiment that are simulated by convolution."""
CHANCE = 3.0
"""Standard errors by which noise alone may exceed its own size if no input moves."""


@dataclass(frozen=True, eq=False)
class StateSpaceFit(RecordedQuestion, Program):
    """Linear models of a record in innovations form: one for prediction, one for simulation.

    The predictor has the order of the best one-step fit in validation, the simulator that of the
    best free-run fit. The prediction-error method weights free-run errors only for the simulator.
    One-step fits are always those of the predictor, free-run fits those of the simulator.

    Methods may use only the first `estimation` samples, to estimate and to choose the orders; the
    remaining samples are used once, to judge the answer. Wherever a model is judged, its initial
    state is estimated from the first `washout` samples, which do not count in the score.

    If no part of the estimation samples can be held back, since an input moves only once, orders
    are chosen by Akaike's final prediction error. An input that never moves is taken as a step from
    rest at the first sample.

    Parameters
    ----------
    u, y
        Inputs and outputs in any form that `as_experiments` accepts, such as arrays (N, channels)
        or (channels, N), labelled arrays, tables, and lists with one of these for each experiment.
        NaN marks a missing sample.
    estimation
        Number of samples that methods may use; None: two thirds of them.
    orders
        Numbers of states to choose from; None: some up to 8 that the record determines.
    washout
        Number of samples from which an initial state is estimated; None: at most 50.
    title
        Title of figures.
    dt
        Sampling time of the record [s]; None: that of its labels, or 1.
    samples
        Axis of the samples in plain arrays, if their shapes do not show it: "rows" or "columns".
    direct
        Whether inputs may act within the sample, through D. In a loop without a delay they must
        not.
    delay_samples
        Delay [samples] of the inputs, one number or one for each; "estimate" searches delays up to
        100, or up to N / (4 (nu + ny)) - 4 for N estimation samples if that is less; and longer
        delays, up to an eighth of those samples, if the response is clear.
    poles
        "stable": inside the unit circle. "marginal": not so far outside that a mode grows more than
        e-fold over the estimation part, as integrators and undamped modes need. "any": also for an
        unstable plant, whose record comes from a closed loop; its free run is not judged.
    known_poles
        Known poles of the plant in discrete time: values of z, complex ones with their conjugates,
        each repeated by its multiplicity. An integrator is the pole 1; a pole s [rad/s] in
        continuous time is exp(s dt). Both models have them exactly. An unstable one needs
        ``poles="any"``.
    static_gain
        Known static gains (ny, nu), NaN where unknown; a number for one input and one output. Both
        models have them exactly.
    bandwidth_hz
        Bandwidth [Hz] of a loop to be designed with the simulator, or None. The simulator's order
        and kind are then chosen by weighted free-run errors, with the weight S T = (s / omega_b) /
        (1 + s / omega_b)^2 of such a loop, which is largest at the bandwidth.
    physical
        Models from physics by name, each a `PhysicalModel`: further candidates of the methods
        "best" and "averaged". Their predictions are their simulations.
    assume
        Assumptions about the record that you vouch for although its report rejects them, such as
        "open loop"; the certificate says so. See `record_report`.

    Raises
    ------
    InputError
        The data are not a record, or are faulty, or a finding of the record's report forbids its
        use (`record_report`). The record is too short for the washout or the orders. The bandwidth
        is not below half the sampling frequency. Known poles are unpaired, more than an order, or
        excluded by ``poles``. Gains have a wrong shape, or are given together with a known pole at
        1.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> import workbench as wb
    >>> from workbench.identification import StateSpaceFit
    >>> u = np.random.default_rng(0).standard_normal(200)
    >>> y = control.forced_response(control.tf([0.5], [1, -0.5], 1.0), inputs=u).outputs
    >>> solution = wb.solve(StateSpaceFit(u, y, orders=[1]), method="n4sid")
    >>> solution.certificate.valid
    True

    With a known pole, here that of an integrator:

    >>> y = control.forced_response(control.tf([0.5], [1, -1], 1.0), inputs=u).outputs
    >>> solution = wb.solve(StateSpaceFit(u, y, orders=[1], known_poles=[1.0]), method="subspace")
    >>> float(solution.answer.simulator.A[0, 0])
    1.0
    """

    bandwidth_hz: float | None = field(default=None, kw_only=True)
    physical: Mapping[str, PhysicalModel] = field(default_factory=dict, kw_only=True)

    default_method: ClassVar[str] = "prediction-error"
    methods_in: ClassVar[tuple[str, ...]] = (
        "workbench.identification.state_space.methods",
        "workbench.identification.polynomials.methods",
        "workbench.identification.state_space.moesp",
        "workbench.identification.choice.methods",
    )
    headline: ClassVar[str] = "fit_free_run_y1"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.bandwidth_hz is not None:
            need_bandwidth(self.bandwidth_hz, self.record.dt)
        for name, model in self.physical.items():
            if not isinstance(model, PhysicalModel):
                raise InputError(
                    f"physical[{name!r}] must be a PhysicalModel, not {type(model).__name__}"
                )
            model.states(self.record)  # refuses a model with other channels than the record's

    def fits_to_choose_by(self, model: InnovationsModel, record: Experiments) -> RealArray:
        found = super().fits_to_choose_by(model, record)
        if self.bandwidth_hz is not None:
            found[USES.index("free_run")] = control_fit(
                model, record, self.washout_samples, self.bandwidth_hz
            )
        return found

    @property
    def tasks(self) -> tuple[str, str]:
        """The purposes for which predictor and simulator are chosen, in words."""
        if self.bandwidth_hz is None:
            return "predict", "simulate"
        return "predict", f"design a loop of {self.bandwidth_hz:g} Hz"

    @property
    def problem_size(self) -> float:
        """Number of output samples that methods may use.

        There is no objective: the answer is two models, each with its own criterion.
        """
        return float(self.estimation_samples * self.record.y.shape[1])

    # --- certificate -----------------------------------------------------------------------------

    @property
    def held_out(self) -> str:
        """Quantifier of the scores."""
        return f"for the last {len(self.judged_record)} samples of this record"

    def checks(self, answer: IdentifiedModels, tolerance: float) -> list[Check]:
        missed = 1 - self._fits(answer, self.judged_record) / 100
        # If no input moves, measured outputs are noise, and a correct model errs as much as their
        # mean.
        still = len(self.judged_record.still_inputs()) == self.record.u.shape[1]
        limit = 1.0 + (CHANCE / np.sqrt(2 * len(self.judged_record)) if still else 0.0)
        judged = dict(zip(USES, missed, strict=True))
        if self.poles == "any":
            del judged["free_run"]
        return [
            *self._radii(answer),
            *(
                check
                for name in MODELS
                if self.known is not None
                for check in known_checks(self.known, getattr(answer, name), name, self.gain_sizes)
            ),
            *(
                Check(
                    use.replace("_", " "),
                    "error on the samples held out, over that of the mean",
                    float(np.max(row)),
                    limit,
                    where=f"of {self.record.outputs[int(np.argmax(row))]}",
                    over=self.held_out,
                )
                for use, row in judged.items()
            ),
        ]

    def _radii(self, answer: IdentifiedModels) -> list[Check]:
        """Checks of the poles of both models and of their predictors."""
        found = []
        for name in MODELS:
            model = getattr(answer, name)
            limits = [("A - K C", model.predictor_radius, 1.0)]
            if self.poles != "any":
                limits.insert(0, ("A", model.radius, self.largest_radius))
            found += [
                Check(
                    f"stable {name}, {matrix}", "spectral radius", radius, limit, over=THIS_SYSTEM
                )
                for matrix, radius, limit in limits
            ]
        return found

    def second_opinion(self, answer: IdentifiedModels) -> list[Check]:
        name = "convolution"
        statement = "largest difference of a relative error by convolution from that by recursion"
        opinions = []
        if self.poles != "any":
            apart = max(
                self._simulation_difference(answer.simulator, u, y)
                for u, y in self._judged_pieces()
            )
            opinions.append(Check(name, statement, apart, CONVOLUTION_ROUNDING, over=self.held_out))
        for use in MODELS:
            model = getattr(answer, use)
            closed = replace(model, A=model.A - model.K @ model.C, delay_samples=())
            opinions.append(decays(closed.system(), f"errors of the {use} decay"))
            if self.poles != "any":
                check = decays(model.system(), f"{use} decays")
                opinions.append(replace(check, limit=float(np.log(self.largest_radius))))
            if self.known is not None:
                opinions += has_known(
                    model.system(), self.known.groups(), self.known.gain, self.gain_sizes, use
                )
        return opinions

    def _judged_pieces(self) -> list[tuple[RealArray, RealArray]]:
        return [
            (u[:CONVOLVED], y[:CONVOLVED])
            for u, y in self.judged_record.pieces()
            if len(u) > self.washout_samples
        ]

    def _simulation_difference(self, m: InnovationsModel, u: RealArray, y: RealArray) -> float:
        """Difference between a simulation's relative errors by convolution and by recursion."""
        washout, runs = self.washout_samples, []
        for one in m.members or (m,):
            drive, measured = one.driven_part(u, y)
            matrices, left = (one.A, one.B, one.C, one.D), washout - one.longest_delay_samples
            run = convolved(matrices, drive - one.u_offset, measured - one.y_offset, left)
            runs.append(run[left:] + one.y_offset)
        again, plain = np.mean(runs, axis=0), m.free_run(u, y, washout)[washout:]
        judged = y[washout:]
        apart = np.abs(nrmse_fit(judged, again) - nrmse_fit(judged, plain)) / 100
        rounded = np.abs(again - plain).max(axis=0) <= RUN_ROUNDING * np.nanmax(np.abs(y), axis=0)
        return float(np.max(np.where(rounded, 0.0, apart)))

    def facts(self, answer: IdentifiedModels) -> list[str]:
        return facts_of(self, answer, self.tasks) + deviations_told(self, answer)

    def deviations(
        self, answer: IdentifiedModels, cycles_per_sample: RealArray
    ) -> RealArray | None:
        """Standard deviations (F, ny, nu) of the simulator's magnitudes at frequencies (F,).

        None if none are known. They are valid if the prediction errors are white: the
        order is right, and the method's model of the noise. Where noise is slow and a plant lightly
        damped, "box-jenkins" holds them on short records, and "prediction-error" does not.
        """
        return simulator_deviations(self, answer, cycles_per_sample)

    # --- what is shown ---------------------------------------------------------------------------

    def metrics(self, answer: IdentifiedModels) -> dict[str, float]:
        numbers: dict[str, float] = {}
        for part, used in (("", self.judged_record), ("estimation_", self.estimation_record)):
            for use, row in zip(USES, self._fits(answer, used), strict=True):
                numbers |= {f"{part}fit_{use}_y{i + 1}": float(v) for i, v in enumerate(row)}
        if self.bandwidth_hz is not None:
            row = control_fit(
                answer.simulator, self.judged_record, self.washout_samples, self.bandwidth_hz
            )
            numbers |= {f"fit_control_y{i + 1}": float(v) for i, v in enumerate(row)}
        own, crossed = self.residual_tests(answer.predictor)
        lags = len(own)
        return numbers | {
            "order": float(answer.predictor.order),
            "order_free_run": float(answer.simulator.order),
            "residual_autocorrelations_outside": share_outside(own),
            "residual_input_correlations_outside": share_outside(crossed[lags:]),
        }

    def _fits(self, answer: IdentifiedModels, part: Experiments) -> RealArray:
        """Fits (uses, ny) [%] of the answer on a part of the record."""
        return self._fits_of(answer.predictor, answer.simulator, part)

    def tables(self, answer: IdentifiedModels) -> dict[str, str]:
        outputs = self.record.outputs
        fits = [f"{use.replace('_', ' ')} {of} [%]" for use in USES for of in (*outputs, "mean")]
        rows = [
            [order, *(f"{x:.2f}" for row in score for x in (*row, row.mean()))]
            for order, score in zip(self.orders or (), answer.scores.swapaxes(0, 1), strict=True)
        ]
        choice = answer.candidates
        found = {"validation": markdown_table(["order", *fits], rows)}
        found |= {} if choice is None else {"candidates": choice.table()}
        return {name: f"{table}\n{AS_TOLD}\n" for name, table in found.items()}

    def figures(self, answer: IdentifiedModels) -> dict[str, Figure]:
        data = self.to_dataset(answer)
        return {
            "held-out": drawn.held_out_figure(data, self.title, self.record.output_units),
            "response": drawn.two_responses_figure(
                data, self.title, answer.simulator, lambda at: self.deviations(answer, at)
            ),
            "residuals": drawn.residuals_figure(data),
            "validation": drawn.validation_figure(data),
        }

    def to_dataset(self, answer: IdentifiedModels) -> Dataset:
        return datasets.to_dataset(self, answer)

    def from_dataset(self, data: Dataset) -> IdentifiedModels:
        predictor, simulator = (datasets.innovations_model_of(self, data, name) for name in MODELS)
        scores = data["validation_fit"].values
        candidates = datasets.stored_candidates(data)
        return IdentifiedModels(predictor, simulator, scores, self.record.dt, candidates=candidates)
