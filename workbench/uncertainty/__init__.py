"""Uncertainty models: covers of response sets, parametric models, generalised plants.

Takes: responses of several plants, or models with uncertain parameters.
Gives: a nominal with weights whose set contains every plant (at the frequencies of the responses;
    known plants also between them); linear fractional forms.
Rests on: smallest sets at each frequency and minimax fits above them.
"""

from typing import TYPE_CHECKING

from workbench._core.on_demand import on_demand

if TYPE_CHECKING:
    from workbench.systems.connection import generalised_plant
    from workbench.systems.generalised_plant import GeneralisedPlant
    from workbench.uncertainty.algebra.coefficients import ss, tf
    from workbench.uncertainty.algebra.connections import append, block, feedback, series
    from workbench.uncertainty.algebra.interconnect import interconnect
    from workbench.uncertainty.algebra.lft import block_matrix, inverse, left_divide
    from workbench.uncertainty.algebra.rational_delays import dead_time_approximation
    from workbench.uncertainty.algebra.system import UncertainSystem
    from workbench.uncertainty.algebra.uncertain_elements import (
        complex_scalar,
        delay,
        dynamics,
        real,
    )
    from workbench.uncertainty.covers.circle_cover import CircleCover
    from workbench.uncertainty.covers.everywhere import containment_check
    from workbench.uncertainty.covers.front.cover_front import cover_front
    from workbench.uncertainty.covers.front.points import CoverFront
    from workbench.uncertainty.covers.limits.least_inflation import (
        LeastInflation,
        least_inflation,
    )
    from workbench.uncertainty.covers.model import Containment, UncertaintyModel, contains
    from workbench.uncertainty.covers.of_estimate import cover_of_estimate
    from workbench.uncertainty.covers.orientation import (
        Orientation,
        cheapest_orientation,
        limited_orientation,
        narrowest_angles,
        smooth_orientation,
    )
    from workbench.uncertainty.covers.sets import CoverForm
    from workbench.uncertainty.covers.stadium_cover import StadiumCover
    from workbench.uncertainty.covers.steps import CoverSteps
    from workbench.uncertainty.covers.storage import cover_function, cover_sets
    from workbench.uncertainty.matrix_covers.cover import MatrixCover
    from workbench.uncertainty.matrix_covers.forms import MatrixForm
    from workbench.uncertainty.matrix_covers.model import MatrixModel
    from workbench.uncertainty.matrix_covers.nominal import central_nominal
    from workbench.uncertainty.matrix_covers.responses import MatrixResponses
    from workbench.uncertainty.matrix_covers.sets.shapes import WeightShape
    from workbench.uncertainty.parametric_models.estimate_region import EstimateRegion
    from workbench.uncertainty.parametric_models.factorial import factorial_response
    from workbench.uncertainty.parametric_models.members import members
    from workbench.uncertainty.parametric_models.model import ParametricModel, parametric_lft
    from workbench.uncertainty.parametric_models.parameters import (
        Parameter,
        level_deltas,
        random_deltas,
        vertex_deltas,
    )
    from workbench.uncertainty.responses.between_lines import refined_responses
    from workbench.uncertainty.responses.extrapolation import widened_responses
    from workbench.uncertainty.responses.plants import Responses
    from workbench.uncertainty.responses.smoothed import smoothed_responses
else:
    __getattr__, __dir__ = on_demand(__name__)

__all__ = [
    "CircleCover",
    "Containment",
    "CoverForm",
    "CoverFront",
    "CoverSteps",
    "EstimateRegion",
    "GeneralisedPlant",
    "LeastInflation",
    "MatrixCover",
    "MatrixForm",
    "MatrixModel",
    "MatrixResponses",
    "Orientation",
    "Parameter",
    "ParametricModel",
    "Responses",
    "StadiumCover",
    "UncertainSystem",
    "UncertaintyModel",
    "WeightShape",
    "append",
    "block",
    "block_matrix",
    "central_nominal",
    "cheapest_orientation",
    "complex_scalar",
    "containment_check",
    "contains",
    "cover_front",
    "cover_function",
    "cover_of_estimate",
    "cover_sets",
    "dead_time_approximation",
    "delay",
    "dynamics",
    "factorial_response",
    "feedback",
    "generalised_plant",
    "interconnect",
    "inverse",
    "least_inflation",
    "left_divide",
    "level_deltas",
    "limited_orientation",
    "members",
    "narrowest_angles",
    "parametric_lft",
    "random_deltas",
    "real",
    "refined_responses",
    "series",
    "smooth_orientation",
    "smoothed_responses",
    "ss",
    "tf",
    "vertex_deltas",
    "widened_responses",
]
