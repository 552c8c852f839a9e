"""Models from physics whose parameters are estimated from a record: grey-box models.

The parameters minimise the simulation error on the record. A physical model has no model of its
noise, so its predictions are its simulations, if these are stable.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from workbench._core.arrays import RealArray
from workbench.errors import InputError
from workbench.identification.experiments.several import Experiments
from workbench.identification.innovations.model import InnovationsModel
from workbench.identification.parameters.least_squares import FittedParameter
from workbench.identification.state_space.selection import allowed
from workbench.systems.conversion import as_system
from workbench.systems.sampling import held_input_matrices

MOST_STEPS = 100
"""Largest number of steps of the search."""
FAR = 1e6
"""Error, relative to the output's spread, that is assigned to a simulation that overflows."""


@dataclass(frozen=True, eq=False)
class PhysicalModel:
    """A model from physics with unknown parameters.

    Unlike a `StateSpace`, it is a function of parameters that are not known yet.

    Parameters
    ----------
    model
        Function of the parameters by name. It returns matrices A, B, C, D in continuous time, or a
        StateSpace or TransferFunction; one in discrete time has the record's sampling time.
    parameters
        Each a `FittedParameter`, by name: the start of its search and its bounds.

    Raises
    ------
    InputError
        There is no parameter, or the model at the start is not a linear system.

    Examples
    --------
    A motor with unknown gain and time constant, as a candidate among all other kinds of models:

    >>> import control
    >>> import numpy as np
    >>> import workbench as wb
    >>> from workbench.identification import FittedParameter, PhysicalModel, StateSpaceFit
    >>> u = np.random.default_rng(0).standard_normal(300)
    >>> time = 0.1 * np.arange(300)
    >>> y = control.forced_response(control.tf([3.0], [1, 2.0]), time, u, interpolate=False).outputs
    >>> motor = PhysicalModel(
    ...     lambda p: ([[-p["a"]]], [[p["k"]]], [[1.0]], [[0.0]]),
    ...     {"a": FittedParameter(1.0, lower=0.0), "k": FittedParameter(1.0)},
    ... )
    >>> fit = StateSpaceFit(u, y, dt=0.1, orders=[1], physical={"motor": motor})
    >>> sorted(motor.estimated(fit.estimation_record))
    ['a', 'k']
    """

    model: Callable[[Mapping[str, float]], Any]
    parameters: Mapping[str, FittedParameter]

    def __post_init__(self) -> None:
        if not self.parameters:
            raise InputError("a physical model without parameters leaves nothing to estimate")
        for name, one in self.parameters.items():
            if not isinstance(one, FittedParameter):
                raise InputError(f"parameter {name!r} must be a FittedParameter, not {one!r}")
        self.sampled({name: one.start for name, one in self.parameters.items()}, 1.0)

    def sampled(self, values: Mapping[str, float], dt: float) -> tuple[RealArray, ...]:
        """Matrices A, B, C, D for parameter values, sampled with inputs held between samples."""
        import control

        given = self.model(values)
        if isinstance(given, tuple | list):
            try:
                given = control.ss(*given)
            except (TypeError, ValueError) as error:
                raise InputError(f"the physical model at {dict(values)}: {error}") from None
        system = as_system(given, "the physical model")
        A, B = (system.A, system.B) if system.dt else held_input_matrices(system.A, system.B, dt)
        return A, B, system.C, system.D

    def states(self, record: Experiments) -> int:
        """Number of states; raises InputError for other numbers of channels than the record's."""
        start = {name: one.start for name, one in self.parameters.items()}
        A, B, C, _ = self.sampled(start, record.dt)
        shape, own = (record.u.shape[1], record.y.shape[1]), (B.shape[1], len(C))
        if own != shape:
            raise InputError(
                f"the physical model has {own[0]} inputs and {own[1]} outputs, the record has "
                f"{shape[0]} and {shape[1]}"
            )
        return len(A)

    def estimated(
        self, record: Experiments, *, delay_samples: tuple[int, ...] = ()
    ) -> dict[str, float]:
        """Parameter values that minimise the simulation error on experiments.

        ``delay_samples`` [samples]: the delay of each input.
        """
        names = list(self.parameters)
        limits = [(one.lower, one.upper) for one in self.parameters.values()]
        scale = np.array([one.scale for one in self.parameters.values()])
        spread = np.nanstd(record.y, axis=0)

        def errors(theta: RealArray) -> RealArray:
            values = dict(zip(names, theta * scale, strict=True))
            model = _without_gain(self.sampled(values, record.dt), record, delay_samples)
            with np.errstate(all="ignore"):
                found = _simulation_errors(model, record)
                found = (found - np.nanmean(found, axis=0)) / spread
            found = np.nan_to_num(found, nan=0.0, posinf=FAR, neginf=-FAR)
            return np.asarray(np.clip(found, -FAR, FAR).ravel())

        low, high = (np.array(ends) / scale for ends in zip(*limits, strict=True))
        start = np.array([one.start for one in self.parameters.values()]) / scale
        inside = np.clip(start, low + 1e-9, high - 1e-9)
        found = least_squares(errors, inside, bounds=(low, high), max_nfev=MOST_STEPS)
        return dict(zip(names, (found.x * scale).tolist(), strict=True))

    def fitted(
        self,
        record: Experiments,
        *,
        delay_samples: tuple[int, ...] = (),
        direct: bool = True,
        largest_radius: float = np.inf,
    ) -> InnovationsModel | None:
        """The model with the parameters estimated from experiments.

        ``delay_samples`` [samples]: how much later the inputs act.
        None if inputs act at once although that is excluded, or if a pole is beyond the largest
        radius.
        """
        values = self.estimated(record, delay_samples=delay_samples)
        model = _without_gain(self.sampled(values, record.dt), record, delay_samples)
        outside = model.radius > largest_radius * (1 + 1e-12)
        if outside or (model.D.any() and not direct):
            return None
        with np.errstate(all="ignore"):
            level = np.nanmean(_simulation_errors(model, record), axis=0)
        if not np.isfinite(level).all():
            return None
        level += model.y_offset
        return allowed(replace(model, y_offset=level), record, direct, largest_radius)


def _without_gain(
    matrices: tuple[RealArray, ...], record: Experiments, delay: tuple[int, ...]
) -> InnovationsModel:
    """An innovations model without a gain, with the record's means as offsets."""
    A, B, C, D = (np.asarray(one, dtype=float) for one in matrices)
    means = record.u.mean(axis=0), np.nanmean(record.y, axis=0)
    return InnovationsModel(
        *(A, B, C, D, np.zeros((len(A), len(C))), *means),
        delay_samples=delay,
        **record.labels,
    )


def _simulation_errors(model: InnovationsModel, record: Experiments) -> RealArray:
    """Errors (N, ny) of free runs, each from the initial state that fits its first samples."""
    runs = [y - model.free_run(u, y, len(y)) for u, y in record.pieces()]
    return np.vstack(runs)
