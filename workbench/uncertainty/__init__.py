"""Uncertainty models: covers of response sets, parametric models, generalised plants."""

from workbench.uncertainty import cover_methods
from workbench.uncertainty.circle_cover import CircleCover
from workbench.uncertainty.cover import CoverSteps
from workbench.uncertainty.extrapolation import widened
from workbench.uncertainty.generalised import GeneralisedPlant, generalised_plant
from workbench.uncertainty.lft import inverse, matrix, solve
from workbench.uncertainty.model import Containment, UncertaintyModel, contains
from workbench.uncertainty.orientation import (
    Orientation,
    cheapest,
    limited,
    narrowest,
    smooth,
)
from workbench.uncertainty.parameters import Parameter, levels, samples, vertices
from workbench.uncertainty.parametric import ParametricModel, parametric
from workbench.uncertainty.responses import Responses, responses_of
from workbench.uncertainty.stadium_cover import StadiumCover

__all__ = [
    "CircleCover",
    "Containment",
    "CoverSteps",
    "GeneralisedPlant",
    "Orientation",
    "Parameter",
    "ParametricModel",
    "Responses",
    "StadiumCover",
    "UncertaintyModel",
    "cheapest",
    "contains",
    "cover_methods",
    "generalised_plant",
    "inverse",
    "levels",
    "limited",
    "matrix",
    "narrowest",
    "parametric",
    "responses_of",
    "samples",
    "smooth",
    "solve",
    "vertices",
    "widened",
]
