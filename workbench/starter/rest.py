"""The working point of records, and a condition that rules out one controller for all plants."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from workbench._core.heavy_types import Dataset
from workbench.errors import InputError
from workbench.synthesis import WorkingPoint
from workbench.uncertainty import Responses
from workbench.uncertainty.responses.regions import region_radius

NEAR_ZERO = 1e-3
"""A mean below this fraction of the signal's range counts as zero."""
APART = 0.2
"""Distance between the records' mean inputs, relative to the input's range, above which the user is
told.
"""
REAL = 0.7
"""Least |cos(phase)| of a response at a low frequency that reveals the sign of the static gain."""
SIGN_CONFIDENCE = 0.95
"""Probability of the regions by which the sign of a gain is judged."""


def working_point(records: Sequence[Dataset]) -> tuple[WorkingPoint, tuple[str, ...]]:
    """The means of input and output of all records, and notes about peculiarities."""
    rest, units = {}, {}
    for name in ("u", "y"):
        values = [np.asarray(record[name].values, dtype=float).ravel() for record in records]
        size = max(map(np.max, values)) - min(map(np.min, values))
        means = np.array([one.mean() for one in values])
        mean = float(means.mean())
        rest[name] = 0.0 if abs(mean) < NEAR_ZERO * size else float(f"{mean:.5g}")
        units[name] = str(records[0][name].attrs.get("units", "1"))
        if name == "u":
            apart = float(np.ptp(means)), means, size
    notes = []
    if apart[0] > APART * apart[2]:
        notes.append(
            f"the records rest at inputs from {apart[1].min():.4g} to {apart[1].max():.4g}; the "
            f"working point is their mean, {rest['u']:g}, and a linear model may hold less far"
        )
    return WorkingPoint(rest["u"], rest["y"], u_unit=units["u"], y_unit=units["y"]), tuple(notes)


def refuse_opposite_gains(responses: Responses, files: Sequence[str]) -> None:
    """Raise InputError if two plants clearly have static gains of opposite sign.

    If the controller n_K / d_K has a pole at s = 0, the loop's characteristic polynomial has the
    value n_K(0) n(0) there, which must be positive for stability. For plants with equally many
    unstable poles the sign of n(0) is that of the static gain. So no fixed linear controller with
    an integrator stabilises two such plants (internal stability; see also the sign condition of M.
    Morari, E. Zafiriou, Robust Process Control, 1989, on integral controllability).
    """
    lowest, radius = responses.values[0], region_radius(responses, SIGN_CONFIDENCE)[0]
    clear = responses.present[0] & (radius < 0.5 * np.abs(lowest))
    cosine = np.where(clear, lowest.real / np.maximum(np.abs(lowest), 1e-300), 0.0)
    up, down = np.flatnonzero(cosine > REAL), np.flatnonzero(cosine < -REAL)
    if not (up.size and down.size):
        return
    gains = [f"{files[k]}: {lowest[k].real:.3g}" for k in (up[0], down[0])]
    raise InputError(
        f"at {responses.frequency_hz[0]:.4g} Hz two plants have gains of opposite sign "
        f"({'; '.join(gains)}). With an integrator the characteristic polynomials of their loops "
        "have opposite signs at s = 0 if they have equally many unstable poles, so no fixed linear "
        "controller with integral action stabilises both: is a sensor or an actuator connected "
        "the other way round? Leave one out, or turn its sign"
    )
