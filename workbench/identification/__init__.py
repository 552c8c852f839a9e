"""From experiments to models: excitation, responses with confidence, physical parameters."""

from workbench.identification import crest_factor_methods, parameter_methods
from workbench.identification.assumptions import Assumptions
from workbench.identification.crest_factor import CrestFactor, schroeder_phases
from workbench.identification.distortion import (
    LineDistortion,
    line_distortion,
    total_harmonic_distortion,
)
from workbench.identification.excitation import SteppedSine, sine_fit
from workbench.identification.innovations import InnovationsModel
from workbench.identification.least_squares import Parameter
from workbench.identification.local_polynomial import LocalPolynomial, local_polynomial
from workbench.identification.measured import MeasuredRecord, MeasuredResponse
from workbench.identification.multisine import (
    Multisine,
    line_amplitudes,
    odd_lines,
    random_multisine,
)
from workbench.identification.parameters import ParameterEstimate, ParameterFit, fit_parameters
from workbench.identification.quality import IdentificationWarning, as_record, saturation
from workbench.identification.records import read_record, read_response
from workbench.identification.response import PeriodicResponse, ResponseEstimate, from_periods
from workbench.identification.spectral import SpectralResponse, spectral_response
from workbench.identification.state_space import StateSpaceFit
from workbench.identification.variables import read_variables

__all__ = [
    "Assumptions",
    "CrestFactor",
    "IdentificationWarning",
    "InnovationsModel",
    "LineDistortion",
    "LocalPolynomial",
    "MeasuredRecord",
    "MeasuredResponse",
    "Multisine",
    "Parameter",
    "ParameterEstimate",
    "ParameterFit",
    "PeriodicResponse",
    "ResponseEstimate",
    "SpectralResponse",
    "StateSpaceFit",
    "SteppedSine",
    "as_record",
    "crest_factor_methods",
    "fit_parameters",
    "from_periods",
    "line_amplitudes",
    "line_distortion",
    "local_polynomial",
    "odd_lines",
    "parameter_methods",
    "random_multisine",
    "read_record",
    "read_response",
    "read_variables",
    "saturation",
    "schroeder_phases",
    "sine_fit",
    "spectral_response",
    "total_harmonic_distortion",
]
