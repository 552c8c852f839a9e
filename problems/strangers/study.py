"""The base of all studies of strangers."""

from __future__ import annotations

from dataclasses import dataclass

from workbench.study import Study

from .simulators.named import STRANGERS
from .simulators.stranger import Stranger

DELAY = 1.0
"""Delay of the controller's computer [samples]: the default of `workbench init`."""


@dataclass(frozen=True, eq=False)
class StrangerStudy(Study):
    """A study of all units of one stranger, which is given by its name."""

    plant: str

    @property
    def stranger(self) -> Stranger:
        """The plant."""
        return STRANGERS[self.plant]

    @property
    def quantifier(self) -> str:
        return "for these units"
