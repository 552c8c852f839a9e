"""Problems from elsewhere, from files that users bring: SDPA, CBF, plants of MATLAB."""

from workbench.collections.cbf import read_cbf
from workbench.collections.matlab_plants import read_plant
from workbench.collections.sdpa import read_sdpa

__all__ = ["read_cbf", "read_plant", "read_sdpa"]
