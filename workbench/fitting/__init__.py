"""Rational fits: magnitudes, also as covers, and complex responses.

Takes: a magnitude or response at frequencies, an order, and which roots may be unstable.
Gives: a rational function and its error; a cover lies above the data, also between frequencies.
Rests on: differential correction (global minimax fit of a magnitude), vector fitting, descent.
"""

from typing import TYPE_CHECKING

from workbench._core.on_demand import on_demand

if TYPE_CHECKING:
    from workbench.fitting.fitted_system import FittedSystem
    from workbench.fitting.magnitude.program import MagnitudeFit, fit_magnitude
    from workbench.fitting.rational import Rational, rational_of_system
    from workbench.fitting.response.matrix_fit import fit_matrix_response
    from workbench.fitting.response.program import ResponseFit, fit_response
    from workbench.fitting.storage import rational_variables, restored_rational
else:
    __getattr__, __dir__ = on_demand(__name__)

__all__ = [
    "FittedSystem",
    "MagnitudeFit",
    "Rational",
    "ResponseFit",
    "fit_magnitude",
    "fit_matrix_response",
    "fit_response",
    "rational_of_system",
    "rational_variables",
    "restored_rational",
]
