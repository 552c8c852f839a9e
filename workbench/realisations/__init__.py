"""What the states of a system are worth: Gramians and Hankel values, proven."""

from typing import TYPE_CHECKING

from workbench.on_demand import on_demand

if TYPE_CHECKING:
    from workbench.realisations.gramian_pair import Gramians, gramians
    from workbench.realisations.hankel import HankelValues, hankel_values
    from workbench.realisations.system_parts import SystemParts, stable_part
else:
    __getattr__, __dir__ = on_demand(__name__)

__all__ = [
    "Gramians",
    "HankelValues",
    "SystemParts",
    "gramians",
    "hankel_values",
    "stable_part",
]
