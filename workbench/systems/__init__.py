"""Linear systems: realisations, interconnections, sampling, norms, crossings of loops.

Takes: systems of python-control, arrays, and names of signals.
Gives: connected systems, generalised plants, responses, crossings.
Rests on: state-space algebra; Gramians and Hamiltonian matrices for norms.
"""

from typing import TYPE_CHECKING

from workbench._core.on_demand import no_more_names
from workbench.systems.margins import (
    bands,
    bandwidths,
    crossings,
    loop_response,
    modulus_margin,
    search_grid,
)

if not TYPE_CHECKING:
    __getattr__ = no_more_names(__name__)

__all__ = [
    "bands",
    "bandwidths",
    "crossings",
    "loop_response",
    "modulus_margin",
    "search_grid",
]
