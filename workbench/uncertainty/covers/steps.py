"""The answer of a cover: the fitted model and the sets of each step."""

from __future__ import annotations

from dataclasses import dataclass

from workbench.answer import ProgramAnswer
from workbench.geometry import Circle, Stadium
from workbench.uncertainty.covers.model import UncertaintyModel


@dataclass(frozen=True, repr=False)
class CoverSteps(ProgramAnswer):
    """The fitted model of a cover, and the sets of each step.

    ``first`` lies in the Nyquist plane. ``second`` and ``third`` are centred on the nominal, in
    units of the weights. For circles the third set equals the second.

    Examples
    --------
    >>> import numpy as np
    >>> import workbench as wb
    >>> from workbench.uncertainty import CircleCover, Responses
    >>> omega = np.geomspace(1, 100, 20)
    >>> plants = Responses(
    ...     omega=omega, values=np.array(
    ...         [gain / (1j * omega / 30 + 1) for gain in (0.9, 1.0, 1.1)]
    ...     ).T
    ... )
    >>> steps = wb.solve(CircleCover(plants, order=1, complex_order=1)).answer
    >>> steps.first.radius.shape, steps.model.lti.noutputs > 0
    ((20,), True)
    """

    model: UncertaintyModel
    first: Circle | Stadium
    second: Stadium
    third: Stadium

    def summary(self) -> str:
        return (
            f"CoverSteps at {self.second.radius.size} frequencies: sets about the nominal have a "
            f"radius up to {self.second.radius.max():.4g}, a half-length up to "
            f"{self.second.half_length.max():.4g}\n  {self.model!r}"
        )

    @property
    def lti(self) -> UncertaintyModel:
        """The model, for functions that need a system."""
        return self.model
