"""From files and experiments to models: records, responses with confidence, parameters.

Takes: records of inputs and outputs, from files or arrays, and prior knowledge of the plant.
Gives: reports of records, responses with regions, models with deviations, experiments.
Rests on: the asymptotic laws of least squares, prediction errors and subspaces; Fieller's regions
    for loops; sign perturbation for finite records.
"""

from typing import TYPE_CHECKING

from workbench._core.on_demand import on_demand

if TYPE_CHECKING:
    from workbench.identification.closed_loop.deviations import (
        closed_loop_covariance,
        closed_loop_deviations,
    )
    from workbench.identification.closed_loop.program import ClosedLoopFit
    from workbench.identification.experiments.crest_factor import CrestFactor, schroeder_phases
    from workbench.identification.experiments.design import DesignedSpectrum, ExperimentDesign
    from workbench.identification.experiments.distortion import (
        LineDistortion,
        harmonic_distortion,
        line_distortion,
        total_harmonic_distortion,
    )
    from workbench.identification.experiments.measured_responses import read_response
    from workbench.identification.experiments.multisine import (
        Multisine,
        line_amplitudes,
        odd_lines,
        random_multisine,
    )
    from workbench.identification.experiments.quality import (
        IdentificationWarning,
        as_record,
        saturation,
    )
    from workbench.identification.experiments.records import read_record
    from workbench.identification.experiments.reports import record_report
    from workbench.identification.experiments.several import Experiments, as_experiments
    from workbench.identification.experiments.stepped_sine import SteppedSine, sine_fit
    from workbench.identification.files.variables import read_variables
    from workbench.identification.innovations.impulse_responses import (
        impulse_response,
        impulse_response_deviations,
    )
    from workbench.identification.innovations.model import InnovationsModel
    from workbench.identification.innovations.uncertainty import response_deviations
    from workbench.identification.parameters.least_squares import FittedParameter
    from workbench.identification.parameters.measured import MeasuredRecord, MeasuredResponse
    from workbench.identification.parameters.program import (
        ParameterEstimate,
        ParameterFit,
        fit_parameters,
    )
    from workbench.identification.polynomials.regressions import arx
    from workbench.identification.rational_models.estimate import (
        RationalModelEstimate,
        fit_rational_model,
    )
    from workbench.identification.rational_models.model import CommonPoleModel
    from workbench.identification.rational_models.program import RationalModelFit
    from workbench.identification.rational_models.sign_perturbed import SignPerturbedRegion
    from workbench.identification.rational_models.storage import RationalModels
    from workbench.identification.rational_models.uncertainty import ModelUncertainty
    from workbench.identification.record_tests.finding import Finding, TestedAssumption
    from workbench.identification.record_tests.report import RecordReport
    from workbench.identification.recursive.armax import RecursiveARMAX
    from workbench.identification.recursive.arx import RecursiveARX
    from workbench.identification.responses.assumptions import Assumptions
    from workbench.identification.responses.linear_approximation import (
        LinearApproximation,
        best_linear_approximation,
    )
    from workbench.identification.responses.local_polynomial import (
        LocalPolynomial,
        local_polynomial,
    )
    from workbench.identification.responses.local_rational import local_rational
    from workbench.identification.responses.local_response import local_response
    from workbench.identification.responses.of_excitation import DrivenResponse, driven_response
    from workbench.identification.responses.periodic import (
        PeriodicResponse,
        ResponseEstimate,
        periodic_response,
    )
    from workbench.identification.responses.periodic_local import (
        PeriodicLocalResponse,
        PeriodicStream,
        periodic_local_polynomial,
        periodic_local_rational,
    )
    from workbench.identification.responses.spectral import SpectralResponse, spectral_response
    from workbench.identification.responses.step import step_response
    from workbench.identification.state_space.physical import PhysicalModel
    from workbench.identification.state_space.program import StateSpaceFit
    from workbench.identification.transfer_functions.estimate import TransferFunctionEstimate
    from workbench.identification.transfer_functions.record import SampledRecord
    from workbench.identification.transfer_functions.regression import (
        filtered_least_squares,
        output_error,
        refined_instruments,
    )
else:
    __getattr__, __dir__ = on_demand(__name__)

__all__ = [
    "Assumptions",
    "ClosedLoopFit",
    "CommonPoleModel",
    "CrestFactor",
    "DesignedSpectrum",
    "DrivenResponse",
    "ExperimentDesign",
    "Experiments",
    "Finding",
    "FittedParameter",
    "IdentificationWarning",
    "InnovationsModel",
    "LineDistortion",
    "LinearApproximation",
    "LocalPolynomial",
    "MeasuredRecord",
    "MeasuredResponse",
    "ModelUncertainty",
    "Multisine",
    "ParameterEstimate",
    "ParameterFit",
    "PeriodicLocalResponse",
    "PeriodicResponse",
    "PeriodicStream",
    "PhysicalModel",
    "RationalModelEstimate",
    "RationalModelFit",
    "RationalModels",
    "RecordReport",
    "RecursiveARMAX",
    "RecursiveARX",
    "ResponseEstimate",
    "SampledRecord",
    "SignPerturbedRegion",
    "SpectralResponse",
    "StateSpaceFit",
    "SteppedSine",
    "TestedAssumption",
    "TransferFunctionEstimate",
    "arx",
    "as_experiments",
    "as_record",
    "best_linear_approximation",
    "closed_loop_covariance",
    "closed_loop_deviations",
    "driven_response",
    "filtered_least_squares",
    "fit_parameters",
    "fit_rational_model",
    "harmonic_distortion",
    "impulse_response",
    "impulse_response_deviations",
    "line_amplitudes",
    "line_distortion",
    "local_polynomial",
    "local_rational",
    "local_response",
    "odd_lines",
    "output_error",
    "periodic_local_polynomial",
    "periodic_local_rational",
    "periodic_response",
    "random_multisine",
    "read_record",
    "read_response",
    "read_variables",
    "record_report",
    "refined_instruments",
    "response_deviations",
    "saturation",
    "schroeder_phases",
    "sine_fit",
    "spectral_response",
    "step_response",
    "total_harmonic_distortion",
]
