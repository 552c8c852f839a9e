"""Linear systems: realisations, interconnections, sampling, norms, margins of loops."""

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
