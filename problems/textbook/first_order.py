"""An unstable plant of first order: G = 1 / (s - 1), uncertain at its input.

v = (1 + W_I delta) u,   e = w + G v,   z = W_P e;   K acts on -e
"""

from __future__ import annotations

from workbench.structure import Complex
from workbench.uncertainty import GeneralisedPlant, generalised_plant


def unstable_first_order() -> GeneralisedPlant:
    """The plant with one complex scalar, W_I = 0.25 (s/2 + 1)/(s/32 + 1), and its sensitivity
    weighted by W_P = (s/4 + 0.6)/(s + 0.006)."""
    import control

    return generalised_plant(
        [
            (control.tf(1.0, [1.0, -1.0]), "v", "g"),
            (control.tf([0.125, 0.25], [1 / 32, 1.0]), "u", "y"),
            (control.tf([0.25, 0.6], [1.0, 0.006]), "e", "z"),
        ],
        {"v": "u + d", "e": "w + g", "m": "- e"},
        perturbation=[(Complex(1, name="dynamics"), "y", "d")],
        exogenous="w",
        control="u",
        performance="z",
        measurement="m",
    )
