"""The ill-conditioned distillation column with uncertain inputs.

    G = 1 / (75 s + 1) [[87.8, -86.4], [108.2, -109.6]],   u -> (I + w_I delta) u,   e = w + G u

The weight w_I allows an input error of 20 % at low frequencies and more above 1 rad/min. The
performance output is z = w_P e, where w_P has a pole at -1e-6 rad/min in place of an integrator. K
acts on -e. Time is in minutes. Data: S. Skogestad, M. Morari, J. Doyle, Robust control of
ill-conditioned plants, IEEE Trans. Automatic Control 33 (1988) 1092-1105.
"""

from __future__ import annotations

import numpy as np

from workbench.structure import Complex
from workbench.uncertainty import GeneralisedPlant, generalised_plant

GAINS = np.array([[87.8, -86.4], [108.2, -109.6]])
TIME_CONSTANT = 75.0
"""Time constant of the column [min]."""
NEAR_INTEGRATOR = 1e-6
"""Magnitude of the performance weight's pole, which stands in place of an integrator [rad/min]."""


def distillation_column() -> GeneralisedPlant:
    """The plant with a complex scalar at each of its two inputs and a 2-by-2 performance block."""
    import control

    column = control.ss(-np.eye(2) / TIME_CONSTANT, np.eye(2), GAINS / TIME_CONSTANT, 0.0)
    uncertain = control.tf([1.0, 0.2], [0.5, 1.0])
    performance = control.tf([0.5, 0.05], [1.0, NEAR_INTEGRATOR])
    return generalised_plant(
        [
            (column, ["v1", "v2"], ["g1", "g2"]),
            (uncertain, "u1", "y1"),
            (uncertain, "u2", "y2"),
            (performance, "e1", "z1"),
            (performance, "e2", "z2"),
        ],
        {
            "v1": "u1 + d1",
            "v2": "u2 + d2",
            "e1": "w1 + g1",
            "e2": "w2 + g2",
            "m1": "- e1",
            "m2": "- e2",
        },
        perturbation=[
            (Complex(1, name="input 1"), "y1", "d1"),
            (Complex(1, name="input 2"), "y2", "d2"),
        ],
        exogenous=["w1", "w2"],
        control=["u1", "u2"],
        performance=["z1", "z2"],
        measurement=["m1", "m2"],
    )
