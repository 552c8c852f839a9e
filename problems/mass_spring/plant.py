"""Two masses and an uncertain spring: a benchmark of mixed-mu synthesis.

    wall --(k2, b2)-- m2 --(k1, b1)-- m1 <-- f1        f2 --> m2

The force on m1 must quieten m2, on which the disturbance acts, through the uncertain spring k1:

    m1 z1'' = f1 - k1 (z1 - z2) - b1 (z1' - z2')
    m2 z2'' = f2 + k1 (z1 - z2) + b1 (z1' - z2') - k2 z2 - b2 z2'
    f1 = (1 + W_m delta) u,   f2 = W_d d,   y = z2 + W_n n,   z_p = W_p z2,   z_u = W_u u

Data: D. Barros, S. Fekri, M. Athans, Robust mixed-mu synthesis performance for mass-spring system
with stiffness uncertainty, Mediterranean Conference on Control and Automation (2005). There the
wall holds m2, and K closes the loop with positive feedback, u = K y.
"""

from __future__ import annotations

from typing import Any

from workbench.structure import Complex
from workbench.types import StateSpace, TransferFunction
from workbench.uncertainty import GeneralisedPlant, Parameter, generalised_plant, parametric_lft

M1, M2 = 1.0, 2.0
"""Masses m1 and m2 [kg]."""
K2, B1, B2 = 1.0, 0.05, 0.05
"""Spring to the wall [N/m]; dampers between the masses and to the wall [N s/m]."""
SPRING = Parameter("k1", 2.0, 0.4)
"""Spring between the masses [N/m]: 2 + 0.8 delta."""
GAIN, CORNER = 0.005, 0.1
"""Gain [N/m] and corner frequency [rad/s] of the simple controller u = GAIN s / (s + CORNER) y."""


def weights() -> dict[str, TransferFunction]:
    """The weights W_p of z2, W_u of u, W_d of d, W_n of n, and W_m of the unmodelled dynamics.

    |W_m| exceeds |exp(-s tau) - 1| for delays tau up to 0.058 s. The paper means it to cover
    0.06 s; for that delay it is up to 1.5 % too small, from 28 to 46 rad/s.
    """
    import control

    return {
        "W_p": control.tf(8.0, [1.0, 0.1]),
        "W_u": control.tf([10.0, 100.0], [1.0, 1000.0]),
        "W_d": control.tf(0.25, [1.0, 0.25]),
        "W_n": control.tf(0.001, 1.0),
        "W_m": control.tf([2.6, 0.0], [1.0, 40.0]),
    }


def masses(k1: Any) -> tuple[Any, Any, Any, Any]:
    """A, B, C, D from (f1, f2) to z2, with the states z1, z2, z1', z2'; k1 is a number or
    uncertain.
    """
    A = [
        [0.0, 0.0, 1.0, 0.0],
        [0.0, 0.0, 0.0, 1.0],
        [-k1 / M1, k1 / M1, -B1 / M1, B1 / M1],
        [k1 / M2, -(k1 + K2) / M2, B1 / M2, -(B1 + B2) / M2],
    ]
    B = [[0.0, 0.0], [0.0, 0.0], [1 / M1, 0.0], [0.0, 1 / M2]]
    return A, B, [[0.0, 1.0, 0.0, 0.0]], [[0.0, 0.0]]


def two_mass_plant() -> GeneralisedPlant:
    """The generalised plant (d, n, u) -> (z_p, z_u, y), Delta = diag(dynamics, k1).

    Delta has a complex scalar and a real one; `structure.with_performance(2, 2)` closes the
    performance. K maps y to u.
    """
    W = weights()
    return generalised_plant(
        [
            parametric_lft(masses, [SPRING], inputs=("f1", "f2"), outputs=("z2",)),
            (W["W_m"], "u", "y_m"),
            (W["W_d"], "d", "f2"),
            (W["W_n"], "n", "v"),
            (W["W_p"], "z2", "z_p"),
            (W["W_u"], "u", "z_u"),
        ],
        {"f1": "u + u_m", "y": "z2 + v"},
        perturbation=[(Complex(1, name="dynamics"), "y_m", "u_m")],
        exogenous=("d", "n"),
        control="u",
        performance=("z_p", "z_u"),
        measurement="y",
    )


def simple_controller() -> StateSpace:
    """The controller u = 0.005 s / (s + 0.1) y, for analysis only: it hardly moves the masses.

    The nominal loop is stable with either sign of this controller, and with the wall at either
    mass. Stability alone cannot tell these readings of the paper apart, so the wall and the sign
    are taken as printed.
    """
    import control

    return control.ss(control.tf([GAIN, 0.0], [1.0, CORNER]), inputs="y", outputs="u")
