"""Plants that behave as integrators down to the lowest measured frequency."""

from __future__ import annotations

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench.uncertainty import Responses
from workbench.uncertainty.responses.regions import region_radius

SPAN, FEWEST_LINES = 4.0, 4
"""Lines up to this multiple of the lowest frequency are used, and at least so many."""
CONFIDENCE = 0.99
"""Probability of the regions in which an integrator's response must lie, as for covers."""
TOLD = 0.5
"""Largest radius of a region, relative to the response, that tells an integrator from a lag."""
EXACT = 1e-4
"""Least relative radius of a region."""


def integrates_down_to(responses: Responses) -> float | None:
    """Lowest frequency [Hz] of plants that all behave as integrators there; None for other plants.

    For each plant a response 1 / (b s + c s^2) with real b and c is fitted at the lowest lines. Its
    gain falls by 20 dB per decade at low frequencies, and its phase is -90 degrees. It must lie
    within the region of the measured response at each of these lines. A slower pole may be hidden
    in the regions: records do not tell it from an integrator.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.starter.integrator import integrates_down_to
    >>> from workbench.uncertainty import Responses
    >>> s = 1j * np.geomspace(1.0, 100.0, 30)[:, None]
    >>> gains = np.array([0.9, 1.1])
    >>> found = integrates_down_to(Responses(omega=s.imag[:, 0], values=gains / (0.02 * s**2 + s)))
    >>> round(found, 4)
    0.1592
    >>> lags = Responses(omega=s.imag[:, 0], values=gains / (s + 0.1))
    >>> integrates_down_to(lags) is None
    True
    """
    omega, radius = responses.axis, region_radius(responses, CONFIDENCE)
    radius = np.maximum(radius, EXACT * np.abs(responses.values))
    used = slice(0, max(FEWEST_LINES, int((omega <= SPAN * omega[0]).sum())))
    if omega.size < FEWEST_LINES or not responses.present[used].all():
        return None
    for values, own in zip(responses.values[used].T, radius[used].T, strict=True):
        if (own > TOLD * np.abs(values)).any() or _excess(omega[used], values, own) > 1.0:
            return None
    return float(responses.frequency_hz[0])


def _excess(omega: RealArray, values: ComplexArray, radius: RealArray) -> float:
    """Largest distance of the nearest integrator from responses (F,), over their radii (F,)."""
    weight = values / radius  # 1 - values / fitted, over the relative radius
    columns = np.stack([1j * omega, -(omega**2)], axis=1) * (weight * values)[:, None]
    matrix = np.concatenate([columns.real, columns.imag])
    scale = np.linalg.norm(matrix, axis=0)
    target = np.concatenate([weight.real, weight.imag])
    b, c = np.linalg.lstsq(matrix / scale, target, rcond=None)[0] / scale
    fitted = 1 / (1j * omega * b - omega**2 * c)
    return float((np.abs(fitted - values) / radius).max())
