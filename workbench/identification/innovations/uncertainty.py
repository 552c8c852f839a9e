"""Uncertainty of a model, given the record: deviations of poles, static gains and responses.

Source: L. Ljung, System Identification, 2nd ed., 1999, sections 9.4 and 9.5 (the covariance of
parameters, and Gauss's approximation for functions of them).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import Array, ComplexArray, RealArray
from workbench.errors import InputError
from workbench.identification.experiments.several import Experiments
from workbench.identification.innovations.criterion import Criterion
from workbench.identification.innovations.curvature import (
    estimates_of,
    largest_deviations,
    response_along,
    slope_along,
)
from workbench.identification.innovations.distortion import distortion_of
from workbench.identification.innovations.knowledge import Knowledge
from workbench.identification.innovations.model import InnovationsModel
from workbench.identification.record_tests.excitation import sines
from workbench.input_checks import as_array, need_kind

NO_NOISE = 1e-9
"""Noise that drives a mode, relative to the inputs, up to which it counts as none."""


@dataclass(frozen=True, eq=False)
class ModelDeviations:
    """Poles (n,) and static gains (ny, nu), with standard deviations of moduli and of gains.

    An integrator has an infinite static gain with infinite standard deviation. Quantities that the
    record does not determine, such as the gains of two equal inputs, have an infinite standard
    deviation too; so has everything where a mode slower than the record has no noise of its own.
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
    """Uncertainty of a model of experiments, from the curvature of its prediction errors.

    Poles and gains that are ``known`` have no deviation.
    """
    if known is not None:
        model = known.exact(model) or model
    estimates = estimates_of(model, record, direct, known)
    untold = _untold_inputs(model, record, direct, known)
    poles = np.linalg.eigvals(model.A).astype(complex)
    pole_deviations = largest_deviations(estimates, _modulus_slopes, poles)
    if len(untold) == record.u.shape[1]:
        pole_deviations = np.full(poles.shape, np.inf)
    gains = static_gain(model)
    if np.isfinite(gains).all():
        gain_deviations = largest_deviations(
            estimates,
            lambda criterion, theta, step: slope_along(
                lambda t: static_gain(criterion.model(t)), theta, step
            ),
            gains,
        )
        beyond = distortion_of(model, record, direct, known)
        if beyond is not None and beyond.found:
            gain_deviations = np.maximum(
                gain_deviations, of_magnitudes(beyond.moves([0.0]), gains)[0]
            )
        gain_deviations[:, list(untold)] = np.inf
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

    They come from the curvature of the prediction errors, so they are valid if these are white: the
    model must have the order of plant and noise. If squares and cubes of the model's output, or
    past inputs, tell these errors, the plant is distorted or of higher order: then deviations are
    about its best linear approximation, and count the scatter over thirty parts of the record, and
    how far a larger model would be from this one. Otherwise they are computed from the scatter over
    records that the model makes, and with an
    autoregression of the errors of its free run as noise; the larger count. ``direct`` says
    whether D is free. A response that the record does not determine, such as that of one of two
    equal inputs, has an infinite deviation. For models of `impulse_response` use
    `impulse_response_deviations`.

    Raises
    ------
    InputError
        Model, record or frequencies are invalid, or the channels of model and record differ.

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
    cycles_per_sample = _checked_frequencies(model, record, cycles_per_sample)
    found = largest_deviations(
        estimates_of(model, record, direct, None),
        lambda criterion, theta, step: response_along(criterion, theta, step, cycles_per_sample),
        model.response(cycles_per_sample),
    )
    beyond = distortion_of(model, record, direct, None)
    if beyond is not None and beyond.found:
        total = np.sqrt(np.sum(np.abs(beyond.moves(cycles_per_sample)) ** 2, axis=0))
        found = np.maximum(found, total)
    untold = _untold_inputs(model, record, direct, None)
    return _infinite_apart(found, cycles_per_sample, untold, record)


def magnitude_deviations(
    model: InnovationsModel,
    record: Experiments,
    frequency: ArrayLike,
    direct: bool = True,
    known: Knowledge | None = None,
) -> RealArray:
    """Standard deviations (F, ny, nu) of |G| to first order; see `response_deviations`.

    Poles and gains that are ``known`` do not vary.
    """
    response = model.response(frequency)
    unit = _unit(response)

    def along(criterion: Criterion, theta: RealArray, step: RealArray) -> RealArray:
        change = response_along(criterion, theta, step, frequency)
        return np.asarray((change * unit.conj()).real)

    found = largest_deviations(estimates_of(model, record, direct, known), along, response)
    beyond = distortion_of(model, record, direct, known)
    if beyond is not None and beyond.found:
        found = np.maximum(found, of_magnitudes(beyond.moves(frequency), response))
    return _infinite_apart(found, frequency, _untold_inputs(model, record, direct, known), record)


def _untold_inputs(
    model: InnovationsModel, record: Experiments, direct: bool, known: Knowledge | None
) -> dict[int, RealArray]:
    """Inputs whose response the record tells at some frequencies [cycles/sample] alone, or at none.

    These are sums of too few sines for the model's order: a response of order n has 2 n numbers,
    one more with a direct term, and a sine tells two. With a hidden offset no input tells anything.
    What is ``known`` may stand for what the record does not tell, so no input counts then.
    """
    if known is not None:
        return {}
    if _offset_is_hidden(model, record):
        return dict.fromkeys(range(record.u.shape[1]), np.zeros(0))
    most = (2 * model.order + direct - 1) // 2
    longest = max((u for u, _ in record.pieces()), key=len)
    found = {j: sines(u, most) for j, u in enumerate(longest.T)} if most > 0 else {}
    return {j: lines for j, lines in found.items() if lines.size}


def _offset_is_hidden(model: InnovationsModel, record: Experiments) -> bool:
    """Whether a mode that is slower than the record sums up the offset of an input.

    The offset is known as the mean of the record only. Its error makes a ramp in the free run, and
    other parameters follow it. Where noise drives the mode too, the predictor forgets the ramp.
    """
    values, left = np.linalg.eig(model.A.T)
    longest = max(len(u) for u, _ in record.pieces())
    slow = left.T[(1 - np.abs(values)) * longest < 1]
    noise = np.abs(slow @ model.K).max(axis=1, initial=0.0)
    driven = np.abs(slow @ model.B).max(axis=1, initial=0.0)
    return bool((noise < NO_NOISE * driven).any())


def _infinite_apart(
    deviations: RealArray,
    frequency: ArrayLike,
    untold: dict[int, RealArray],
    record: Experiments,
) -> RealArray:
    """Deviations (F, ny, nu), made infinite where a record does not determine an input's response.

    ``untold`` has the inputs that move at few frequencies only, with these frequencies.
    """
    for j, told in untold.items():
        distance = np.abs(np.reshape(frequency, (-1, 1)) - told).min(axis=1, initial=np.inf)
        deviations[distance > 1 / len(record), :, j] = np.inf
    return deviations


def of_magnitudes(changes: Iterable[ComplexArray], response: Array) -> RealArray:
    """Standard deviations (F, ny, nu) of |G| from independent changes of a response G.

    Each change (F, ny, nu) is one standard deviation along one direction.
    """
    unit = _unit(response)
    total = np.zeros(unit.shape)
    for change in changes:
        total = total + (change * unit.conj()).real ** 2
    return np.sqrt(total)


def _unit(response: Array) -> Array:
    """A response divided by its magnitude."""
    return np.asarray(response / np.maximum(np.abs(response), np.finfo(float).tiny))


def _checked_frequencies(
    model: InnovationsModel, record: Experiments, frequency: ArrayLike
) -> RealArray:
    """Frequencies (F,) as numbers; raises `InputError` for invalid ones, model or record."""
    need_kind(model, InnovationsModel, "model")
    need_kind(record, Experiments, "record")
    shape = (record.y.shape[1], record.u.shape[1])
    if model.D.shape != shape:
        raise InputError(
            f"the model has {model.D.shape[0]} outputs and {model.D.shape[1]} inputs, and the "
            f"record {shape[0]} and {shape[1]}"
        )
    values = np.atleast_1d(as_array(frequency, "cycles_per_sample"))
    if values.ndim > 1 or not np.isfinite(values).all():
        raise InputError("cycles_per_sample must be finite numbers (F,)")
    return values


def response_slopes(
    model: InnovationsModel, frequency: ArrayLike, direct: bool = True
) -> ComplexArray:
    """Derivatives (F, ny, nu, P) of the response by the entries of A, B, C and, if free, D."""
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
    """Static gains (ny, nu); infinite if A has a pole at 1."""
    rest = np.eye(model.order) - model.A
    if model.order and np.linalg.cond(rest) > 1 / np.finfo(float).eps:
        return np.full(model.D.shape, np.inf)
    return np.asarray(model.C @ np.linalg.solve(rest, model.B) + model.D)


def _modulus_slopes(criterion: Criterion, theta: RealArray, step: RealArray) -> RealArray:
    """Derivatives of the moduli of the poles along one standard deviation."""
    left, right = np.linalg.eig(criterion.model(theta).A)
    inverse = np.linalg.pinv(right)
    small = 1e-4
    change = (criterion.model(theta + small * step).A - criterion.model(theta).A) / small
    slopes = np.einsum("ij,jk,ki->i", inverse, change, right)
    size = np.maximum(np.abs(left), np.finfo(float).tiny)
    return np.asarray((slopes * left.conj()).real / size)
