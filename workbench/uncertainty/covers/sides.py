"""A warning for responses of unstable plants, since a stable cover of these is useless."""

from __future__ import annotations

import warnings

import numpy as np

from workbench.executor import Context
from workbench.fitting.response.least_peak import worst_error
from workbench.fitting.response.program import ResponseFit
from workbench.fitting.response.vector_fitting import relocated_fits, vector_fits
from workbench.identification.experiments.quality import IdentificationWarning
from workbench.uncertainty.covers.cover import UncertaintyCover
from workbench.uncertainty.covers.nominal import mean_response

TRIED = (1, 2)
"""Tried numbers of poles right of the axis. More of them need a model that the user states. Half or
double asks the question of other plants: of none with one such pole, or of four.
"""
FAR_BETTER = 0.2
"""The plants seem unstable if the error of an unstable fit is below this share of the stable fit's
error. Two more free roots alone may halve an error. With half of it fewer users are asked; with
double of it also those whose stable plants need a higher order.
"""
POOR = 0.1
"""A stable fit with a relative error above this is poor. With half of it the question is asked of
more stable plants that the order cannot follow; with double of it unstable poles of small residues
are not asked about.
"""


def warn_of_unstable(program: UncertaintyCover, context: Context) -> None:
    """Warn where a nominal with poles right of the axis fits the plants' mean far better."""
    if program.nominal is not None or program.unstable_poles or not program.order:
        return
    omega, mean = program.responses.axis, mean_response(program.responses.points)

    def fit(count: int) -> ResponseFit:
        """The fit with `count` poles right of the axis."""
        return ResponseFit(omega, mean, program.order, zeros=program.zeros, unstable_poles=count)

    def error(count: int) -> float:
        """Largest relative error of the best fit with `count` poles right of the axis."""
        return worst_error(fit(count), vector_fits(fit(count), context)[0])

    # A refinement can only lower the error.
    if any(worst_error(fit(0), one) < POOR for one in relocated_fits(fit(0), context)):
        return
    stable = error(0)
    if stable < POOR:
        return
    found = {count: error(count) for count in TRIED if count <= program.order}
    count = min(found, key=lambda one: found[one])
    if np.isfinite(found[count]) and found[count] < FAR_BETTER * stable:
        poles = "a pole" if count == 1 else f"{count} poles"
        warnings.warn(
            f"the responses seem to belong to plants with {poles} right of the axis: their mean is "
            f"fitted to {100 * found[count]:.2g} % so, and to {100 * stable:.2g} % by a stable "
            f"function of order {program.order}; if so, say unstable_poles={count}",
            IdentificationWarning,
            stacklevel=2,
        )
