"""A plant in a closed loop, of which an excitation from outside was recorded too."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError
from workbench.identification.closed_loop.explained import (
    explained_part,
    refuse_other_period,
    steady_fit,
)
from workbench.identification.experiments.several import Experiments, as_experiments
from workbench.identification.innovations.model import InnovationsModel
from workbench.identification.state_space.facts import facts_of
from workbench.identification.state_space.folds import scored_fit
from workbench.identification.state_space.identified import IdentifiedModels
from workbench.identification.state_space.program import StateSpaceFit
from workbench.input_checks import need_count

SAME_TIME = 1e-6
"""Largest relative difference of the sampling times of controller and record."""


@dataclass(frozen=True, eq=False)
class ClosedLoopFit(StateSpaceFit):
    """Models of a plant in a loop u = r - C y, from a record of r, u and y.

    Feedback carries the noise of y into u, so that methods for open loops are biased. Those of this
    Program are not, each under an assumption of its own, which its help says. Orders are chosen,
    and free runs judged, by what the excitation explains of u and y: from the measured u to the
    measured y the least errors are those of a model that is pulled towards -1/C.

    Parameters
    ----------
    excitation
        What was added to the plant's input from outside, or any signal that depends on it alone:
        an array with as many samples as u and y. It must not depend on the noise.
    controller
        The controller C from y to -u, sampled as the record; method "indirect" needs it.
    period_samples
        Samples of a period of the excitation, where it repeats itself throughout the record. What
        it explains is then found without a model, line by line. Without a period it is found by
        impulse responses of at most 70 samples: sample no faster than they can follow the loop.

    The others are those of `StateSpaceFit`.

    Raises
    ------
    InputError
        As for `StateSpaceFit`, of the excitation too; several experiments; a controller in
        continuous time, or with other channels than the record; an excitation that does not repeat
        itself with the period.

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
        """A system of python-control in states; raises `InputError` for what is none."""
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
    def _explained(self) -> dict[int, tuple[Experiments, Experiments | None]]:
        return {}

    def explained(self, record: Experiments) -> Experiments | None:
        """A part of the record as its excitation explains it; None where the part is too short."""
        if id(record) not in self._explained:  # the part is kept, so that its id stays its own
            self._explained[id(record)] = record, explained_part(record, self.period_samples)
        return self._explained[id(record)][1]

    def _fits_of(
        self, predictor: InnovationsModel, simulator: InnovationsModel, record: Experiments
    ) -> RealArray:
        clean = None if record.excitation is None else self.explained(record)
        if clean is None:
            return super()._fits_of(predictor, simulator, record)
        return np.array(
            [scored_fit(predictor.one_step, record, self.washed), self._run_fit(simulator, clean)]
        )

    def _run_fit(self, model: InnovationsModel, clean: Experiments) -> RealArray:
        """Fits (ny,) [%] of a free run to what an excitation explains of u and y."""
        if self.period_samples is None:
            return scored_fit(model.free_run, clean, self.washed)
        return steady_fit(model, clean, self.period_samples)

    def facts(self, answer: IdentifiedModels) -> list[str]:
        where = "standard deviations depend on the method: closed_loop_deviations tells them"
        return [*facts_of(self, answer, self.tasks), where]

    def deviations(self, answer: IdentifiedModels, cycles_per_sample: RealArray) -> None:
        """None: they depend on the method; see `closed_loop_deviations`."""

    def misfit(self, model: InnovationsModel, clean: Experiments) -> float:
        """Relative error of a free run on what an excitation explains, by which starts are chosen.

        Infinite for one that overflows.
        """
        found = float(100 * len(clean.y.T) - self._run_fit(model, clean).sum())
        return found if np.isfinite(found) else np.inf
