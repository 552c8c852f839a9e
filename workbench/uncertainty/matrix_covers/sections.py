"""Logarithms of the diagonal weights of one side, which are stable with stable inverses.

Each weight is a `FactoredRational`. A side stacks the parameters of its weights in one vector, and
leaves out their gains.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from workbench._core.arrays import Array, RealArray
from workbench.fitting.factored import FactoredRational
from workbench.fitting.rational import Rational


class SideOfWeights:
    """The weights of one side at frequencies of the bilinear plane.

    Their parameters are the logarithms of coefficients of monic factors. The gains stay fixed,
    because the cover scales one of the two sides afterwards.
    """

    def __init__(
        self, omega: RealArray, band: tuple[float, float], fits: Sequence[Rational]
    ) -> None:
        self.omega = omega
        self.forms = [
            FactoredRational.of(fit, fit.zeros.size, band, True, True, monic=True) for fit in fits
        ]
        starts = [form.start[:-1] for form in self.forms]
        self.start = np.concatenate(starts)
        self.ends = np.cumsum([start.size for start in starts])[:-1]

    def _each(self, x: RealArray) -> Iterator[tuple[FactoredRational, RealArray]]:
        """Each weight as a form, with its parameters."""
        for form, part in zip(self.forms, np.split(x, self.ends), strict=True):
            yield form, np.append(part, form.gain)

    def logs(self, x: RealArray) -> tuple[RealArray, Array]:
        """Logarithms of the weights' sizes (F, channels), and slopes (F, channels, d) by x."""
        logs = np.empty((self.omega.size, len(self.forms)))
        slopes = np.zeros((*logs.shape, x.size))
        places = np.split(np.arange(x.size), self.ends)
        for number, (form, vector) in enumerate(self._each(x)):
            logs[:, number], slope = form.log_magnitude(vector, self.omega)
            slopes[:, number, places[number]] = slope[:, :-1]
        return logs, slopes

    def fits(self, x: RealArray) -> list[Rational]:
        """The weights with these parameters."""
        return [form.rational(vector) for form, vector in self._each(x)]
