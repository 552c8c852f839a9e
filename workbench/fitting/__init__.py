"""Rational fits: magnitudes, also as covers, and complex responses."""

from workbench.fitting import (
    magnitude_best,
    magnitude_conic,
    magnitude_nonlinear,
    magnitude_sb10yd,
    magnitude_sk,
    minimax,
    response_best,
    response_conic,
    response_nonlinear,
    vector_fitting,
)
from workbench.fitting.magnitude import MagnitudeFit, fit_magnitude
from workbench.fitting.rational import Rational
from workbench.fitting.response import ResponseFit, fit_response

__all__ = [
    "MagnitudeFit",
    "Rational",
    "ResponseFit",
    "fit_magnitude",
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
