"""How much the states of a system matter: Gramians, Hankel values, parts, minimal realisations.

Takes: linear systems, continuous or sampled, integrators included.
Gives: smaller systems and parts, with proven bounds of the difference.
Rests on: Lyapunov equations, and the H-infinity norm of the difference.
"""

from typing import TYPE_CHECKING

from workbench._core.on_demand import on_demand

if TYPE_CHECKING:
    from workbench.realisations.descriptor_form import from_descriptor
    from workbench.realisations.gramian_pair import Gramians, gramians
    from workbench.realisations.hankel import HankelValues, hankel_values
    from workbench.realisations.minimal import MinimalRealisation, minimal_realisation
    from workbench.realisations.system_parts import SystemParts, stable_part
else:
    __getattr__, __dir__ = on_demand(__name__)

__all__ = [
    "Gramians",
    "HankelValues",
    "MinimalRealisation",
    "SystemParts",
    "from_descriptor",
    "gramians",
    "hankel_values",
    "minimal_realisation",
    "stable_part",
]
