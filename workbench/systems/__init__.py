"""Linear systems: realisations, interconnections, sampling, norms, margins of loops."""

from typing import TYPE_CHECKING

from workbench.on_demand import no_more_names
from workbench.systems.margins import (
    Margins,
    bands,
    bandwidths,
    crossings,
    loop_response,
    margins,
    modulus_margin,
    search_grid,
)

if not TYPE_CHECKING:
    __getattr__ = no_more_names(__name__)

__all__ = [
    "Margins",
    "bands",
    "bandwidths",
    "crossings",
    "loop_response",
    "margins",
    "modulus_margin",
    "search_grid",
]
