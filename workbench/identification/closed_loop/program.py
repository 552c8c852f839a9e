"""Models of a plant in a closed loop whose external excitation was recorded too."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError
from workbench.identification.closed_loop.distortion import distortion_in_loop
from workbench.identification.closed_loop.explained import (
    explained_part,
    noise_shares,
    refuse_other_period,
    steady_fit,
)
from workbench.identification.experiments.several import Experiments, as_experiments
from workbench.identification.innovations.model import InnovationsModel
from workbench.identification.state_space.facts import (
    distortion_told,
    facts_of,
    is_tested,
    not_white,
)
from workbench.identification.state_space.folds import scored_fit
from workbench.identification.state_space.identified import IdentifiedModels
from workbench.identification.state_space.program import StateSpaceFit
from workbench.input_checks import need_count

SAME_TIME = 1e-6
"""Largest relative difference of the sampling times of controller and record."""

SETTLED = 10
"""A mode slower than this fraction of the record (1/10) acts as an integrator of the unknown
offset.
"""
ENDLESS = (
    "the responses to the excitation have not died out where their estimates end: models of "
    "methods two-stage and indirect may be biased, and their deviations are infinite; take "
    "instrumental-variables, a longer record, or a periodic excitation with period_samples"
)
"""Message if the explained part lacks the effect of the excitation long before."""
DRIFTS = (
    "sums up the unknown offset of the input for more than a tenth of the record: models of all "
    "methods but direct may be biased, and their deviations are infinite; take direct, or a "
    "periodic excitation with period_samples"
)
"""Message about a pole near the unit circle."""
WEAK = (
    "of what the excitation explains of the input is noise, which the controller fed back: models "
    "of all methods but direct lean to the controller's negative inverse, and their deviations are "
    "infinite; excite more, or longer"
)
"""Message about an excitation that is weak beside the noise."""
FAINT = (
    "of what the excitation explains of the output is noise: models of all methods but direct may "
    "have poles far from the plant's, and their deviations are infinite; excite more, or longer"
)
"""Message about a response to the excitation that noise hides."""
LARGEST_NOISE = 0.01
"""Largest share of noise in the explained part of the input.

The noise was fed back by the controller, so models of this part lean to its negative inverse. With
one percent the bias is about as large as the standard deviations."""
LARGEST_NOISE_OF_OUTPUT = 0.1
"""Largest share of noise in the explained part of the output.

Deviations are of first order. Beyond a tenth, searches end far from the plant, where they do not
hold: about an integrator, errors of up to 27 deviations were seen."""


@dataclass(frozen=True, eq=False)
class ClosedLoopFit(StateSpaceFit):
    """Models of a plant in a loop u = r - C y, from a record of r, u and y.

    Feedback carries the noise of y into u, so that methods for open loops are biased. The signal
    added to the plant's input from outside, or any signal that depends only on it: an array with as
    many samples as u and y. It must not depend on the noise.

    Parameters
    ----------
    excitation
        What was added to the plant's input from outside, or any signal that depends on it alone:
        an array with as many samples as u and y. It must not depend on the noise.
    controller
        The controller C from y to -u, sampled as the record; method "indirect" needs it.
    period_samples
        Period of the excitation [samples], if it is periodic throughout the record. Then its
        explained part is found without a model, line by line. Without a period it is found from
        impulse responses. They are at most 560 samples long, and at most a sixth of the record
        (both for one excitation). Where the loop takes longer to respond, models of methods
        "two-stage" and "indirect" may be biased, and where the plant integrates, those of
        "instrumental-variables" too; the certificate says so, and their deviations are infinite.
        So they are, with a period too, where more than a hundredth of what the excitation explains
        of the input is noise, since such models lean to the controller's negative inverse, or more
        than a tenth of what it explains of the output.

    The other parameters are those of `StateSpaceFit`.

    Raises
    ------
    InputError
        As for `StateSpaceFit`, for the excitation too; several experiments; a controller in
        continuous time, or with other channels than the record; an excitation that is not periodic
        with the given period.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> import workbench as wb
    >>> from workbench.identification import ClosedLoopFit
    >>> G, C = control.tf([0.5], [1, -0.5], 1.0), control.ss([], [], [], [[0.4]], 1.0)
    >>> r = np.random.default_rng(0).standard_normal(200)
    >>> u = control.forced_response(control.feedback(1, G * C), inputs=r).outputs
    >>> y = control.forced_response(G, inputs=u).outputs
    >>> program = ClosedLoopFit(u, y, orders=[1], direct=False, excitation=r, controller=C)
    >>> wb.solve(program, method="two-stage").certificate.valid
    True
    """

    methods_in: ClassVar[tuple[str, ...]] = ("workbench.identification.closed_loop.methods",)

    excitation: Any = field(default=None, kw_only=True)
    controller: StateSpace | None = field(default=None, kw_only=True)
    period_samples: int | None = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.period_samples is not None:
            need_count("period_samples", self.period_samples)
            refuse_other_period(np.asarray(self.record.excitation), self.period_samples)
        if self.controller is None:
            return
        controller = self._in_states(self.controller)
        object.__setattr__(self, "controller", controller)
        nu, ny = self.record.u.shape[1], self.record.y.shape[1]
        if (controller.noutputs, controller.ninputs) != (nu, ny):
            raise InputError(
                f"the controller has {controller.ninputs} inputs and {controller.noutputs} "
                f"outputs; it takes the {ny} outputs of the plant and gives its {nu} inputs"
            )
        if not controller.isdtime(strict=True):
            raise InputError("the controller is in continuous time; sample it as the record is")
        told = self.dt is not None or self.record.dt != 1.0
        apart = controller.dt is not True and not np.isclose(
            controller.dt, self.record.dt, rtol=SAME_TIME, atol=0
        )
        if told and apart:
            raise InputError(
                f"the controller is sampled every {controller.dt:.6g} s and the record every "
                f"{self.record.dt:.6g} s; sample it as the record is"
            )

    @staticmethod
    def _in_states(controller: Any) -> StateSpace:
        """A system of python-control as a StateSpace; raises `InputError` for anything else."""
        import control

        if not isinstance(controller, control.StateSpace | control.TransferFunction):
            raise InputError(
                f"controller is a {type(controller).__name__}; give a StateSpace or "
                "TransferFunction of python-control"
            )
        return control.ss(controller)

    @cached_property
    def record(self) -> Experiments:
        """The record, with its excitation."""
        plain = as_experiments(self.u, self.y, dt=self.dt, samples=self.samples, assume=self.assume)
        if self.excitation is None:
            raise InputError(
                "excitation is missing: give what was added to the loop from outside and recorded, "
                "such as the set-point. Without it no method tells the plant from the controller: "
                "open the loop, or add an excitation, and record anew"
            )
        driven = plain.driven_by(self.excitation, samples=self.samples)
        if len(driven.starts) > 1:
            raise InputError(
                "one experiment without gaps in u and in the excitation is needed; cut the record"
            )
        return driven

    @cached_property
    def _explained(self) -> dict[int, tuple[Experiments, Experiments | None, bool]]:
        return {}

    def explained_part(self, record: Experiments) -> Experiments | None:
        """The explained part of a piece of the record; None if the piece is too short."""
        return self._explained_of(record)[0]

    def doubts(self, model: InnovationsModel, method: str) -> list[str]:
        """Reasons why a method's model may be biased by more than its deviations.

        With a periodic excitation, its lines tell neither offset nor initial state.
        """
        if method == "direct":
            return []
        of_input, of_output = self._noise_shares
        reasons = [] if of_input <= LARGEST_NOISE else [f"{of_input:.2g} {WEAK}"]
        if of_output > LARGEST_NOISE_OF_OUTPUT:
            reasons.append(f"{of_output:.2g} {FAINT}")
        if self.period_samples is not None:
            return reasons
        if method != "instrumental-variables" and not self._explained_of(self.estimation_record)[1]:
            reasons.append(ENDLESS)
        if (1 - model.radius) * len(self.estimation_record) < SETTLED:
            reasons.append(f"a pole of modulus {model.radius:.6g} {DRIFTS}")
        return reasons

    @cached_property
    def _noise_shares(self) -> tuple[float, float]:
        return noise_shares(self.estimation_record, self.period_samples)

    def _explained_of(self, record: Experiments) -> tuple[Experiments | None, bool]:
        # the piece is stored, so that no other object gets its id
        if id(record) not in self._explained:
            self._explained[id(record)] = record, *explained_part(record, self.period_samples)
        return self._explained[id(record)][1:]

    def _fits_of(
        self, predictor: InnovationsModel, simulator: InnovationsModel, record: Experiments
    ) -> RealArray:
        clean = None if record.excitation is None else self.explained_part(record)
        if clean is None:
            return super()._fits_of(predictor, simulator, record)
        return np.array(
            [
                scored_fit(predictor.one_step, record, self.washout_samples),
                self._run_fit(simulator, clean),
            ]
        )

    def _run_fit(self, model: InnovationsModel, clean: Experiments) -> RealArray:
        """Fits (ny,) [%] of a free run to the explained parts of u and y."""
        if self.period_samples is None:
            return scored_fit(model.free_run, clean, self.washout_samples)
        return steady_fit(model, clean, self.period_samples)

    def facts(self, answer: IdentifiedModels) -> list[str]:
        where = (
            "standard deviations depend on the method: closed_loop_deviations tells them; those of "
            "direct hold only if its states suffice for plant and noise, which few records tell"
        )
        found = [*facts_of(self, answer, self.tasks), where, self._distortion(answer.simulator)]
        found += self.doubts(answer.simulator, "two-stage")
        white = not_white(self, answer.predictor, "predictor")
        if white:
            found.append(f"{white}: those of method direct are infinite; take more states")
        return found

    def _distortion(self, model: InnovationsModel) -> str:
        """A sentence on distortion of the plant, which the explained part of the record shows."""
        record, beyond = self.estimation_record, None
        clean = self.explained_part(record)
        if clean is not None and is_tested(model):
            beyond = distortion_in_loop(
                model, record, clean.u, self.direct, self.washout_samples, self.period_samples
            )
        return distortion_told(beyond, "simulator")

    def deviations(self, answer: IdentifiedModels, cycles_per_sample: RealArray) -> None:
        """None, because they depend on the method; see `closed_loop_deviations`."""

    def misfit(self, model: InnovationsModel, clean: Experiments) -> float:
        """Relative error of a free run on the explained record; it ranks the starts of a search.

        Infinite if the run overflows.
        """
        found = float(100 * len(clean.y.T) - self._run_fit(model, clean).sum())
        return found if np.isfinite(found) else np.inf
