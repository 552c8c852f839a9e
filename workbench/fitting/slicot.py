"""SLICOT's routine SB10YD: the fit that other mu tools use, as a method and for comparison."""

from __future__ import annotations

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench.errors import SolverError
from workbench.fitting.rational import Rational, rational_of_system
from workbench.solvers import slicot_routine


def sb10yd(omega: RealArray, response: ComplexArray, order: int, minimum_phase: bool) -> Rational:
    """SB10YD's fit of a given order to a complex response (F,) at ``omega`` [rad/s] (F,).

    With ``minimum_phase`` the fit is stable and minimum phase: unstable roots are mirrored.

    Raises
    ------
    SolverError
        SLICOT fails; the message is its own.
    """
    import control

    sb10yd_routine = slicot_routine("sb10yd")

    scale = float(np.sqrt(omega[0] * omega[-1]))  # time; SB10YD works on the unit circle
    size = float(np.exp(np.mean(np.log(np.abs(response)))))
    try:
        _, a, b, c, d = sb10yd_routine(
            0, int(minimum_phase), omega.size,
            response.real / size, response.imag / size, omega / scale, order, 0.0,
        )  # fmt: skip
    except Exception as error:  # slycot raises exception classes of its own
        raise SolverError(f"SB10YD: {' '.join(str(error).split())}") from None
    return rational_of_system(control.ss(a * scale, b * scale, c * size, d * size))
