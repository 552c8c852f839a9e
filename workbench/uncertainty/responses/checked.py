"""Checks of the parts of responses: frequencies, values, known plants, variances."""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench._core.arrays import RealArray
from workbench.errors import InputError
from workbench.fitting.rational import Rational
from workbench.input_checks import need_numbers
from workbench.uncertainty.responses.plane import plane_function

KNOWN_RESPONSE_TOLERANCE = 1e-6
"""Largest distance of a given response from that of the known plant, relative to the plant's."""


def as_omega(omega: Any, frequency: Any) -> RealArray:
    """Angular frequencies (F,) [rad/s] from omega or frequency; raises `InputError` for other
    data.
    """
    if (omega is None) == (frequency is None):
        raise InputError("give the frequencies once: omega= in rad/s, or frequency_hz= in Hz")
    name, unit = ("omega", "rad/s") if frequency is None else ("frequency_hz", "Hz")
    try:
        given = np.asarray(omega if frequency is None else frequency, dtype=float)
    except Exception:  # an object that is no array may raise any error
        raise InputError(f"{name} must be real numbers of shape (F,)") from None
    if given.ndim != 1 or given.size < 2:
        raise InputError(
            f"{name} of shape {given.shape}: two frequencies or more are needed, shape (F,)"
        )
    bad = ~(np.isfinite(given) & (given > 0))
    if bad.any():
        raise InputError(f"{name}[{bad.argmax()}] is {given[bad.argmax()]}; it must be positive")
    steps = np.diff(given) <= 0
    if steps.any():
        k = int(steps.argmax())
        kind = "repeated" if given[k] == given[k + 1] else "not increasing"
        raise InputError(
            f"{name}[{k}] = {given[k]:.6g} and {name}[{k + 1}] = {given[k + 1]:.6g} {unit} are "
            f"{kind}: sort the frequencies and keep each once"
        )
    return given if frequency is None else 2 * np.pi * given


def plain_values(values: Any) -> Any:
    """The values, if they are arrays. Raises `InputError` for systems; the message says where these
    go.
    """
    each = values if isinstance(values, list | tuple) else [values]
    if any(hasattr(one, "frdata") for one in each):
        raise InputError("values are frequency responses of python-control: Responses.from_frd")
    if any(hasattr(one, "radius") and hasattr(one, "variance") for one in each):
        raise InputError("values are estimates of responses: Any.from_estimates")
    return values


def need_below_nyquist(omega: RealArray, dt: Any) -> None:
    """Raise InputError for an invalid sampling time [s], or for frequencies [rad/s] above half the
    sampling rate.
    """
    need_numbers(dt=dt)
    if dt < 0:
        raise InputError(f"dt is {dt}; it must be the sampling time [s], or 0")
    if dt and omega[-1] * dt >= np.pi:
        raise InputError(
            f"the frequencies go up to {omega[-1] / (2 * np.pi):.6g} Hz; half the sampling rate is "
            f"{0.5 / dt:.6g} Hz"
        )


def known_functions(responses: Any, known: tuple[Any, ...]) -> tuple[Rational | None, ...]:
    """The known plants as functions; raises `InputError` for plants that do not agree with the
    responses.
    """
    plants = responses.plants
    if known and len(known) != len(plants):
        raise InputError(f"{len(known)} known systems for {len(plants)} plants")
    found = tuple(
        None if plant is None else plane_function(plant, f"plant {name}", responses.dt)
        for name, plant in zip(plants, known, strict=False)
    )
    for i, plant in enumerate(found):
        if plant is None:
            continue
        if not plant.is_stable:
            raise InputError(
                f"plant {plants[i]} is unstable: no set of a stable nominal and stable weights "
                "contains it"
            )
        apart = np.abs(plant.response(responses.axis) / responses.values[:, i] - 1)
        apart = np.where(responses.present[:, i], apart, 0.0)
        k = int(np.argmax(np.where(np.isnan(apart), np.inf, apart)))
        if not apart[k] <= KNOWN_RESPONSE_TOLERANCE:
            raise InputError(
                f"the known plant {plants[i]} has another response at {responses.place(k)}: "
                f"it is {apart[k]:.3g} off, relative"
            )
    return found


def variances(responses: Any, variance: Any, degrees: Any) -> tuple[RealArray | None, RealArray]:
    """Variances (F, N) and degrees of freedom (N,), or an `InputError`."""
    shape = responses.values.shape
    freedom = np.broadcast_to(np.asarray(degrees, float), (shape[1],)).copy()
    if not (freedom > 0).all():
        raise InputError(f"degrees is {degrees!r}; it must be positive")
    if variance is None:
        return None, freedom
    try:
        found = np.broadcast_to(np.asarray(variance, float), shape).copy()
    except ValueError:
        raise InputError(
            f"variance of shape {np.shape(variance)} does not fit responses of shape {shape}"
        ) from None
    bad = responses.present & ~(np.isfinite(found) & (found >= 0))
    if bad.any():
        k, i = (int(j) for j in np.argwhere(bad)[0])
        raise InputError(
            f"the variance of plant {responses.plants[i]} is {found[k, i]} at "
            f"{responses.place(k)}; it must be finite and not negative"
        )
    if responses.known_plants:
        raise InputError("a plant that is known has no variance: give known or variance")
    return found, freedom
