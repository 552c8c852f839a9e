"""Readers for problems in other formats: SDPA, CBF, and plants from MATLAB files.

Takes: files of public collections.
Gives: conic programs and generalised plants.
Rests on: the definitions of these formats; no theorem is needed.
"""

from typing import TYPE_CHECKING

from workbench._core.on_demand import no_more_names
from workbench.collections.cbf import read_cbf
from workbench.collections.matlab_plants import read_plant
from workbench.collections.sdpa import read_sdpa

if not TYPE_CHECKING:
    __getattr__ = no_more_names(__name__)

__all__ = ["read_cbf", "read_plant", "read_sdpa"]
