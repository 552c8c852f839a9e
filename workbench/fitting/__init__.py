"""Rational fits: magnitudes, also as covers, and complex responses."""

from workbench.fitting.magnitude import best as magnitude_best
from workbench.fitting.magnitude import conic as magnitude_conic
from workbench.fitting.magnitude import minimax
from workbench.fitting.magnitude import nonlinear as magnitude_nonlinear
from workbench.fitting.magnitude import sanathanan_koerner as magnitude_sk
from workbench.fitting.magnitude import sb10yd as magnitude_sb10yd
from workbench.fitting.magnitude.program import MagnitudeFit, fit_magnitude
from workbench.fitting.rational import Rational
from workbench.fitting.response import best as response_best
from workbench.fitting.response import conic as response_conic
from workbench.fitting.response import nonlinear as response_nonlinear
from workbench.fitting.response import vector_fitting
from workbench.fitting.response.matrix_fit import fit_matrix_response
from workbench.fitting.response.program import ResponseFit, fit_response

__all__ = [
    "MagnitudeFit",
    "Rational",
    "ResponseFit",
    "fit_magnitude",
    "fit_matrix_response",
    "fit_response",
    "magnitude_best",
    "magnitude_conic",
    "magnitude_nonlinear",
    "magnitude_sb10yd",
    "magnitude_sk",
    "minimax",
    "response_best",
    "response_conic",
    "response_nonlinear",
    "vector_fitting",
]
