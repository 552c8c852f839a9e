"""Parametric uncertainty of the actuator: nine parameters, or three that represent them (section
5.2).

The two masses of Table 3.2 with the tolerances of Tables 5.2 and 5.3. The anti-aliasing filter is
known and left out. Equation and table numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant
Control of CD-players (2003).
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from workbench.types import RealArray, StateSpace
from workbench.uncertainty import (
    Parameter,
    ParametricModel,
    block_matrix,
    left_divide,
    parametric_lft,
)

from ..drive.actuator import SERIES_RESISTANCE
from ..drive.plants import nominal_parameters, plant, total_gain
from ..drive.tables import Axis, nominal_table, reduced_tolerances

UNITS = {
    "K_total": "units/V", "R": "ohm", "Bl": "N/A", "k1": "N/m", "k2": "N/m",
    "b1": "N s/m", "b2": "N s/m", "m1": "kg", "m2": "kg",
}  # fmt: skip
COPIES = dict.fromkeys(UNITS, 1) | {"Bl": 2}
"""Number of real perturbations of each parameter. Bl has two, since it converts current into force
and speed into voltage.
"""


def two_masses(
    K_total: Any, R: Any, Bl: Any, k1: Any, k2: Any, b1: Any, b2: Any, m1: Any, m2: Any
) -> tuple[Any, Any, Any, float]:
    """A, B, C, D of eq. 3.12-3.14, u [V] -> f_en [units]; states x1, x2 and their speeds.

    M x'' + C x' + K x = g Bl i and (R + r) i = u - Bl g'x', with each parameter entered once.
    """
    lens, arm = np.eye(2)

    def element(value: Any, ends: RealArray) -> Any:
        return value * np.outer(ends, ends)

    mass = element(m1, lens) + element(m2, arm)
    damping = element(b1, arm) + element(b2, lens - arm)
    stiffness = element(k1, arm) + element(k2, lens - arm)
    current = block_matrix([[0.0, 0.0, -Bl, 0.0, 1.0]]) / (R + SERIES_RESISTANCE)
    force = block_matrix([[-stiffness, -damping, np.zeros((2, 1))]]) + lens[:, None] @ (
        Bl * current
    )
    speeds = np.eye(2, 5, k=2)
    change = block_matrix(
        [[speeds], [left_divide(mass, force)]]
    )  # rows of the states, columns of the states and u
    return change @ np.eye(5, 4), change @ np.eye(5)[:, 4:], K_total * np.eye(1, 4), 0.0


def uncertain_parameters(axis: Axis, reduced: bool = True) -> tuple[Parameter, ...]:
    """The nine parameters of Table 5.2, or the three of Table 5.3, in which R represents others."""
    table = nominal_table(axis)
    tolerances = {name: entry.tolerance for name, entry in table.items()}
    chosen = reduced_tolerances(axis) if reduced else tolerances
    return tuple(Parameter(n, table[n].nominal, chosen[n]) for n in table if n in chosen)


def parametric_plant(axis: Axis, reduced: bool = True) -> ParametricModel:
    """Uncertain model u [V] -> f_en [units] with its real perturbations, without the filter."""
    uncertain = uncertain_parameters(axis, reduced)
    names = [parameter.name for parameter in uncertain]
    certain = {n: entry.nominal for n, entry in nominal_table(axis).items() if n not in names}
    return parametric_lft(partial(two_masses, **certain), uncertain, inputs=["u"], outputs=["f_en"])


def parametric_nominal(axis: Axis) -> StateSpace:
    """Model u [V] -> f_en [units] at the nominal values of Table 5.2, without the filter."""
    return plant(nominal_parameters(axis), total_gain(axis), antialiasing=False)
