"""Search for plants that deviate more than all combinations of minimum, nominal and maximum."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from workbench.types import ComplexArray, RealArray
from workbench.uncertainty import Parameter

from ...drive.actuator import SERIES_RESISTANCE
from ...drive.plants import nominal_response
from ...drive.tables import Axis, nominal_table
from ...drive.two_masses import lens

TRIED_DELTAS = np.linspace(-1.0, 1.0, 41)
"""Values of a delta that are tried."""
MOST_PARAMETER_SWEEPS = 200
"""Largest number of sweeps over all parameters. Stiffness and mass of the arm trade off along a
narrow ridge, which is climbed in many small steps."""


def climbed(
    axis: Axis, box: Sequence[Parameter], frequency: RealArray, start: RealArray
) -> tuple[RealArray, RealArray]:
    """Relative deviations (F,) from the nominal, not less than at `start`, and their deltas (F, P).

    At each frequency one delta after the other is set to the best of 41 values while the others
    stay fixed, until none changes. Each result is a plant of the set, so the true largest deviation
    of the set may be still larger.
    """
    nominal = nominal_response(axis, frequency, antialiasing=False)[:, None]
    delta, rows = start, np.arange(len(frequency))
    deviation = np.zeros(len(frequency))
    for _ in range(MOST_PARAMETER_SWEEPS):
        before = deviation
        for place in range(len(box)):
            trial = np.repeat(delta[:, None], len(TRIED_DELTAS) + 1, axis=1)
            trial[:, 1:, place] = (
                TRIED_DELTAS  # the first value is the present one, so no deviation decreases
            )
            away = abs(_plants(axis, box, frequency[:, None], trial) / nominal - 1)
            best = away.argmax(axis=1)
            delta, deviation = trial[rows, best], away[rows, best]
        if np.array_equal(deviation, before):
            break
    return deviation, delta


def _plants(
    axis: Axis, box: Sequence[Parameter], frequency: RealArray, delta: RealArray
) -> ComplexArray:
    """f_en / u [units/V] at deltas (..., P) and frequencies that broadcast against them."""
    values = {name: entry.nominal for name, entry in nominal_table(axis).items()}
    values |= {p.name: p.at(delta[..., i]) for i, p in enumerate(box)}
    moved = lens(values, 2j * np.pi * frequency, values["R"] + SERIES_RESISTANCE)
    response: ComplexArray = values["K_total"] * moved
    return response
