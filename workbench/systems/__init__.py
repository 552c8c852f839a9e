"""Linear systems: realisations, interconnections, sampling, norms, crossings of loops.

Takes: systems of python-control, arrays, and names of signals.
Gives: connected systems, generalised plants, responses, crossings.
Rests on: state-space algebra; Gramians and Hamiltonian matrices for norms.
"""

from typing import TYPE_CHECKING

from workbench._core.on_demand import no_more_names
from workbench.systems.bilinear import bilinear_continuous, bilinear_sampled
from workbench.systems.generalised_plant import response
from workbench.systems.margins import (
    bandwidths,
    crossings,
    loop_response,
    modulus_margin,
    positive_bands,
)
from workbench.systems.realisation import modal_form, realisation
from workbench.systems.storage import restored_system, stored_system

if not TYPE_CHECKING:
    __getattr__ = no_more_names(__name__)

__all__ = [
    "bandwidths",
    "bilinear_continuous",
    "bilinear_sampled",
    "crossings",
    "loop_response",
    "modal_form",
    "modulus_margin",
    "positive_bands",
    "realisation",
    "response",
    "restored_system",
    "stored_system",
]
