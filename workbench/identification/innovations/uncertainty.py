"""What a record leaves uncertain of a model: deviations of poles, static gains and responses.

Source: L. Ljung, System Identification, 2nd ed., 1999, sections 9.4 and 9.5 (the covariance of
parameters, and Gauss's approximation for what is computed from them).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import Array, BoolArray, ComplexArray, RealArray
from workbench.errors import InputError
from workbench.identification.experiments.several import Experiments
from workbench.identification.innovations.criterion import Criterion
from workbench.identification.innovations.gain_surface import GainSurface
from workbench.identification.innovations.knowledge import Knowledge
from workbench.identification.innovations.model import InnovationsModel
from workbench.input_checks import as_array, need_kind

HESSIAN_ROUNDING = 1e-11
"""Curvature, relative to the largest, below which the record tells nothing of a direction."""
OPEN = 1e-3
"""Change along such a direction, over the deviation by all others, that is no rounding.

One that only changes the basis of states changes no pole and no response."""
KNOWN_ROUNDING = 1e-7
"""The same over the value itself: what is known exactly has no deviation."""


@dataclass(frozen=True, eq=False)
class ModelDeviations:
    """Poles (n,) and static gains (ny, nu), with standard deviations of moduli and of gains.

    A static gain of an integrator is infinite, and its standard deviation is too. So is that of
    what the record leaves open, such as the gains of two equal inputs.
    """

    poles: ComplexArray
    pole_deviations: RealArray
    gains: RealArray
    gain_deviations: RealArray


def model_deviations(
    model: InnovationsModel,
    record: Experiments,
    direct: bool = True,
    known: Knowledge | None = None,
) -> ModelDeviations:
    """Uncertainty of a model of experiments, by the curvature of its prediction errors.

    Poles and gains that are ``known`` have no deviation.
    """
    if known is not None:
        model = known.exact(model) or model
    estimates = _estimates(model, record, direct, known)
    criterion, theta = estimates.criterion, estimates.theta
    poles = np.linalg.eigvals(model.A).astype(complex)
    pole_deviations = estimates.deviations(lambda step: _moved(criterion, theta, step), poles)
    gains = static_gain(model)
    if np.isfinite(gains).all():
        gain_deviations = estimates.deviations(
            lambda step: _slope(lambda t: static_gain(criterion.model(t)), theta, step), gains
        )
    else:
        gain_deviations = np.full(gains.shape, np.inf)
    return ModelDeviations(poles, pole_deviations, gains, gain_deviations)


def response_deviations(
    model: InnovationsModel,
    record: Experiments,
    cycles_per_sample: ArrayLike,
    *,
    direct: bool = True,
) -> RealArray:
    """Standard deviations (F, ny, nu) of |G - truth| at frequencies (F,) [cycles/sample].

    They are those of the curvature of the prediction errors, so they hold where these are white:
    the model must have the order of the plant and of the noise. ``direct`` says whether D is free.
    What the record leaves open, such as the responses to two equal inputs, has an infinite one.
    For models of `impulse_response` take `impulse_response_deviations`.

    Raises
    ------
    InputError
        Model, record or frequencies are none, or the channels of model and record differ.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.identification import arx, as_experiments, response_deviations
    >>> rng = np.random.default_rng(0)
    >>> u = rng.standard_normal(1000)
    >>> y = control.forced_response(control.tf([0.5], [1, -0.5], 1.0), inputs=u).outputs
    >>> record = as_experiments(u, y + 0.1 * rng.standard_normal(1000))
    >>> found = response_deviations(arx(record, order=1), record, [0.1, 0.2])
    >>> found.shape, bool((found < 0.02).all())
    ((2, 1, 1), True)
    """
    cycles_per_sample = _checked(model, record, cycles_per_sample)
    estimates = _estimates(model, record, direct, None)
    return estimates.deviations(
        lambda step: np.abs(
            response_along(estimates.criterion, estimates.theta, step, cycles_per_sample)
        ),
        model.response(cycles_per_sample),
    )


def magnitude_deviations(
    model: InnovationsModel,
    record: Experiments,
    frequency: ArrayLike,
    direct: bool = True,
    known: Knowledge | None = None,
) -> RealArray:
    """Standard deviations (F, ny, nu) of |G|, to first order; as `response_deviations`.

    Poles and gains that are ``known`` do not vary.
    """
    estimates = _estimates(model, record, direct, known)
    response = model.response(frequency)
    unit = _unit(response)

    def along(step: RealArray) -> RealArray:
        change = response_along(estimates.criterion, estimates.theta, step, frequency)
        return np.asarray((change * unit.conj()).real)

    return estimates.deviations(along, response)


def of_magnitudes(changes: Iterable[ComplexArray], response: Array) -> RealArray:
    """Standard deviations (F, ny, nu) of |G| from independent changes of a response G.

    Each change (F, ny, nu) is one by a standard deviation.
    """
    unit = _unit(response)
    total = np.zeros(unit.shape)
    for change in changes:
        total = total + (change * unit.conj()).real ** 2
    return np.sqrt(total)


def _unit(response: Array) -> Array:
    """A response over its magnitude."""
    return np.asarray(response / np.maximum(np.abs(response), np.finfo(float).tiny))


def _checked(model: InnovationsModel, record: Experiments, frequency: ArrayLike) -> RealArray:
    """Frequencies (F,) as numbers; raises `InputError` for what is none, no model or no record."""
    need_kind(model, InnovationsModel, "model")
    need_kind(record, Experiments, "record")
    shape = (record.y.shape[1], record.u.shape[1])
    if model.D.shape != shape:
        raise InputError(
            f"the model has {model.D.shape[0]} outputs and {model.D.shape[1]} inputs, and the "
            f"record {shape[0]} and {shape[1]}"
        )
    values = np.atleast_1d(as_array(frequency, "frequency"))
    if values.ndim > 1 or not np.isfinite(values).all():
        raise InputError("frequency must be finite numbers (F,) [cycles/sample]")
    return values


@dataclass(frozen=True, eq=False)
class _Estimates:
    """Estimated parameters of a criterion, and how well it tells them.

    Each column of ``root`` is a change by one standard deviation. What changes along the columns of
    ``untold`` the record does not see.
    """

    criterion: Criterion
    theta: RealArray
    root: RealArray
    untold: RealArray

    def deviations(self, along: Callable[[RealArray], RealArray], values: Array) -> RealArray:
        """Standard deviations of values that change so ``along`` a step of the parameters.

        They are infinite where these change along what the record does not see.
        """
        total = np.sqrt(np.sum([along(step) ** 2 for step in self.root.T], axis=0))
        rounding = OPEN * total + KNOWN_ROUNDING * np.abs(values)
        for step in self.untold.T:
            total = np.where(np.abs(along(step)) > rounding, np.inf, total)
        return np.asarray(total)


def _estimates(
    model: InnovationsModel, record: Experiments, direct: bool, known: Knowledge | None
) -> _Estimates:
    """Criterion, parameters, and what its curvature tells of them."""
    if known is None:
        entries: BoolArray | None = _of_structure(model)
    else:
        model = known.exact(model) or model
        entries = known.free_entries(model)
    criterion = Criterion(model, record, 0.0, direct, entries)
    theta = criterion.start(model)
    hessian = criterion.expand(theta)[2]
    along = np.eye(len(theta))
    if known is not None and known.gain is not None:
        scale = np.sqrt(np.diag(hessian))
        scale[scale == 0] = 1.0
        along = GainSurface(criterion, known).tangent(theta, scale) / scale[:, None]
    told, untold = _curved(along.T @ hessian @ along)
    return _Estimates(criterion, theta, along @ told, along @ untold)


def _of_structure(model: InnovationsModel) -> BoolArray:
    """Which entries of A, B, C, D and K are free: those that no structure keeps at zero.

    A polynomial model has states of the plant and states of the noise, which stay apart. A gain
    that is zero as a whole is that of a simulator, and is free.
    """
    gain = model.K if model.K.any() else np.ones_like(model.K)
    parts = (model.A, model.B, model.C, np.ones_like(model.D), gain)
    return np.concatenate([part.ravel() != 0 for part in parts])


def response_along(
    criterion: Criterion, theta: RealArray, step: RealArray, frequency: ArrayLike
) -> ComplexArray:
    """Change (F, ny, nu) of the response for a small step of the parameters, to first order."""
    return _slope(lambda t: criterion.model(t).response(frequency), theta, step)


def response_slopes(
    model: InnovationsModel, frequency: ArrayLike, direct: bool = True
) -> ComplexArray:
    """Derivatives (F, ny, nu, P) of the response by the entries of A, B, C and, if direct, D."""
    z = np.exp(2j * np.pi * np.asarray(frequency, dtype=float))[:, None, None]
    resolvent = np.linalg.inv(z * np.eye(model.order) - model.A)
    states, seen = resolvent @ model.B, model.C @ resolvent
    outputs, inputs = np.eye(len(model.C)), np.eye(model.B.shape[1])
    one = np.ones_like(z)
    found = [
        np.einsum("foi,fju->fouij", seen, states),
        np.einsum("foi,ju->fouij", seen, inputs),
        np.einsum("oi,fju->fouij", outputs, states),
        np.einsum("f,oi,ju->fouij", one[:, 0, 0], outputs, inputs),
    ]
    flat = [each.reshape(*each.shape[:3], -1) for each in found[: 4 if direct else 3]]
    late = z ** -np.asarray(model.delay_samples or (0,), dtype=float)
    return np.concatenate(flat, axis=-1) * late[..., None]


def static_gain(model: InnovationsModel) -> RealArray:
    """Static gains (ny, nu); infinite where A has a pole at 1."""
    rest = np.eye(model.order) - model.A
    if model.order and np.linalg.cond(rest) > 1 / np.finfo(float).eps:
        return np.full(model.D.shape, np.inf)
    return np.asarray(model.C @ np.linalg.solve(rest, model.B) + model.D)


def root_of_inverse(hessian: RealArray) -> RealArray:
    """Matrix R with R R' the inverse of a Hessian, where it has curvature."""
    return _curved(hessian)[0]


def _curved(hessian: RealArray) -> tuple[RealArray, RealArray]:
    """A root of the inverse of a Hessian, where it has curvature, and directions where it has none.

    The latter have the length of a standard deviation of the parameters, one by one.
    """
    scale = np.sqrt(np.diag(hessian))
    scale[scale == 0] = 1.0
    values, vectors = np.linalg.eigh(hessian / np.outer(scale, scale))
    kept = values > HESSIAN_ROUNDING * values[-1]
    vectors = vectors / scale[:, None]
    return vectors[:, kept] / np.sqrt(values[kept]), vectors[:, ~kept]


def _slope(function: Callable[[RealArray], Array], theta: RealArray, step: RealArray) -> Array:
    """Derivative of a function along one standard deviation, by central differences."""
    small = 1e-4
    return np.asarray((function(theta + small * step) - function(theta - small * step)) / 2 / small)


def _moved(criterion: Criterion, theta: RealArray, step: RealArray) -> RealArray:
    """Derivatives of the moduli of the poles along one standard deviation."""
    left, right = np.linalg.eig(criterion.model(theta).A)
    inverse = np.linalg.pinv(right)
    small = 1e-4
    change = (criterion.model(theta + small * step).A - criterion.model(theta).A) / small
    slopes = np.einsum("ij,jk,ki->i", inverse, change, right)
    size = np.maximum(np.abs(left), np.finfo(float).tiny)
    return np.asarray((slopes * left.conj()).real / size)
