"""A loop of any plant for tests of fixed structures: tracking, effort, uncertain input."""

import control

from workbench.structure import Complex
from workbench.uncertainty import generalised_plant

S = control.tf("s")


def dead_time(seconds, order=3):
    """A Pade approximation of a dead time."""
    return control.tf(*control.pade(seconds, order))


def tracking(G, speed, gain=1.0, apart=False):
    """G with 10 % at its input; e = r - y behind 0.5 (s + speed) / (s + 1e-4 speed); 0.01 gain u.

    apart: r and y are measured in place of e, and a disturbance enters at the input.
    """
    error = control.tf([0.5, 0.5 * speed], [1.0, 1e-4 * speed])
    return generalised_plant(
        [
            (control.ss(G), "v", "g"),
            (0.1, "u", "y_d"),
            (control.ss(error), "e", "z_e"),
            (0.01 * gain, "u", "z_u"),
        ],
        {"v": "u + d + q" if apart else "u + d", "e": "r - g", "s": "r", "y": "g"},
        perturbation=[(Complex(1), "y_d", "d")],
        exogenous=["r", "q"] if apart else "r",
        control="u",
        performance=["z_e", "z_u"],
        measurement=["s", "y"] if apart else "e",
    )
