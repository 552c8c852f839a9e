"""Uncertainty models: covers of response sets, parametric models, generalised plants."""

from workbench.uncertainty import cover_methods
from workbench.uncertainty.circle_cover import CircleCover
from workbench.uncertainty.cover import CoverSteps
from workbench.uncertainty.extrapolation import widened
from workbench.uncertainty.model import Containment, UncertaintyModel, contains
from workbench.uncertainty.orientation import (
    Orientation,
    cheapest,
    limited,
    narrowest,
    smooth,
)
from workbench.uncertainty.responses import Responses, responses_of
from workbench.uncertainty.stadium_cover import StadiumCover

__all__ = [
    "CircleCover",
    "Containment",
    "CoverSteps",
    "Orientation",
    "Responses",
    "StadiumCover",
    "UncertaintyModel",
    "cheapest",
    "contains",
    "cover_methods",
    "limited",
    "narrowest",
    "responses_of",
    "smooth",
    "widened",
]
