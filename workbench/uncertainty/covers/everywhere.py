"""Covers that hold at every frequency, for plants that are known as systems.

Responses say nothing between their frequencies, where a resonance may lie. A plant that is known as
a system is contained at every frequency, and the certificate says so.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench.certificate import Check
from workbench.certify.known_plants.containment import Excess, escapes, largest_excess
from workbench.certify.stable_system import angular_frequency
from workbench.errors import SolverError
from workbench.executor import Context
from workbench.fitting.magnitude.gain import COVER_GAIN_MARGIN
from workbench.fitting.rational import Rational
from workbench.geometry.enclosing_shape import CONTAINMENT_TOLERANCE
from workbench.second_opinion.responses import plain_response, tried_frequencies
from workbench.uncertainty.covers.checks import REALISED_SUPPORT_TOLERANCE, excess_over_radius
from workbench.uncertainty.covers.model import UncertaintyModel
from workbench.uncertainty.covers.sets import CoverForm
from workbench.uncertainty.covers.weights import (
    between,
    complex_weight,
    needed_radius,
)
from workbench.uncertainty.responses.plane import from_plane
from workbench.uncertainty.responses.plants import Responses

SMALL_EXCESS = 1e-3
"""Excess of a known plant, relative to the radius, that may be removed by a larger gain of W_c.
Frequencies with a larger excess are added to the fit. A larger gain widens every set by that share,
while a frequency more in the fit costs time. With half of it more rounds are made; with double of
it sets are up to 0.2 % too wide.
"""
MOST_ROUNDS = 8
"""Largest number of fits of W_c. Each one adds the frequencies at which plants left the previous
sets. Rounds end earlier once no plant leaves. With half of them the gain is raised more at the end;
double costs time only.
"""
BEYOND_BAND = 1e3
"""Factor from the first and last frequency to the frequencies used for 0 and infinity in a fit.
There a weight has come near to its values at 0 and infinity, which lasting constants ask for two
decades out. Half or double changes a fit by little.
"""
SAMPLED_FREQUENCIES = 1000
"""Number of frequencies of the second opinion on a logarithmic scale; more are added near poles.
The proof is made elsewhere, for every frequency. With half of them a wrong one is found less
surely; double costs time.
"""

Share = Callable[[RealArray, RealArray, RealArray], RealArray]
"""Function: frequencies [rad/s], radii and extents (F,) -> weight (F,) of an excess of the
radius.
"""


def covering_weight(
    responses: Responses,
    away: ComplexArray,
    nominal: Rational,
    W_r: Rational | None,
    form: CoverForm,
    order: int,
    share: Share,
    rounding: float,
    everywhere: bool,
    context: Context,
) -> Rational:
    """Complex weight that covers the remaining distance of deviations from a real weight's
    segments.

    Parameters
    ----------
    away
        Deviations (F, N) to cover at the frequencies of the responses.
    share
        Weight of the excess.
    rounding
        Amount added to radii for rounding of responses, relative to plants plus nominal.
    everywhere
        Whether the known plants are covered at every frequency. Otherwise W_c is fitted at the
        given frequencies, with straight lines between them.

    Raises
    ------
    SolverError
        No weight covers a known plant, because its deviation is unbounded.
    """

    def needed(omega: RealArray, deviations: ComplexArray) -> tuple[RealArray, RealArray]:
        """Radii and extents (F,) of deviations (F, N), including their rounding errors."""
        radius = rounded_radius(omega, deviations, nominal, W_r, form, rounding)
        return radius, np.maximum(np.abs(deviations).max(axis=1), radius)

    omega = responses.axis
    radius, extent = needed(omega, away)
    plants = list(responses.known_plants.values())
    if not everywhere or not plants:
        return complex_weight(omega, radius, share(omega, radius, extent), order, context)

    def fit(grid: RealArray) -> Rational:
        """W_c for the radii that known plants need on a grid, and other plants at their
        frequencies.
        """
        G = nominal.response(grid)[:, None]
        known = np.stack([plant.response(grid) for plant in plants], axis=1)
        radii, extents = needed(grid, known / G - 1 if form == "multiplicative" else known - G)
        if len(plants) < len(responses.plants):
            log, logs = np.log(grid), np.log(omega)
            radii = np.maximum(radii, np.exp(np.interp(log, logs, np.log(radius))))
            extents = np.maximum(extents, np.exp(np.interp(log, logs, np.log(extent))))
        else:
            at = np.searchsorted(grid, omega)  # the given responses may have rounding errors
            radii[at] = np.maximum(radii[at], radius)
            extents[at] = np.maximum(extents[at], extent)
        return complex_weight(grid, radii, share(grid, radii, extents), order, context)

    sets = (plants, nominal)
    multiplicative = form == "multiplicative"
    grid = np.union1d(omega, between(omega))
    for _ in context.track(range(MOST_ROUNDS), "every frequency"):
        W_c = fit(grid)
        left = escapes(*sets, W_c, W_r, SMALL_EXCESS, multiplicative=multiplicative)
        found = np.union1d(grid, np.clip(left, omega[0] / BEYOND_BAND, omega[-1] * BEYOND_BAND))
        if found.size == grid.size:
            break
        grid = found
    return reaching_known(responses, nominal, W_c, W_r, form)


def rounded_radius(
    omega: RealArray,
    away: ComplexArray,
    nominal: Rational,
    W_r: Rational | None,
    form: CoverForm,
    rounding: float,
) -> RealArray:
    """Radius (F,) that deviations (F, N) need around the real weight, including their rounding
    errors.

    The rounding errors are relative to the plants, not to the deviations.
    """
    radius = needed_radius(away, None if W_r is None else W_r.response(omega))
    plants = 1.0 if form == "multiplicative" else np.abs(nominal.response(omega))
    return np.asarray(radius + rounding * (np.abs(away).max(axis=1) + 2 * plants))


def reaching_known(
    responses: Responses, nominal: Rational, W_c: Rational, W_r: Rational | None, form: CoverForm
) -> Rational:
    """The complex weight, scaled so that the known plants are covered at every frequency.

    Raises
    ------
    SolverError
        No gain covers a known plant, because its deviation is unbounded.
    """
    plants = list(responses.known_plants.values())
    if not plants:
        return W_c
    excess = largest_excess(plants, nominal, W_c, W_r, multiplicative=form == "multiplicative")
    if not np.isfinite(excess.value):
        name, place = list(responses.known_plants)[excess.plant], _place(excess, responses.dt)
        raise SolverError(
            f"no weight covers plant {name} {place}, where its deviation is unbounded: "
            "the nominal needs as many poles more than zeros as the plants have, and no zero "
            "on the imaginary axis"
        )
    return W_c.scaled((1 + max(excess.value, 0.0)) * (1 + COVER_GAIN_MARGIN))


def containment_check(model: UncertaintyModel, responses: Responses) -> Check:
    """Check that the known plants of responses lie in a model's sets at every frequency.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> import workbench as wb
    >>> from workbench.uncertainty import CircleCover, Responses, containment_check
    >>> omega = np.geomspace(0.1, 10.0, 20)
    >>> known = [control.tf([gain], [1.0, 1.0]) for gain in (0.9, 1.0, 1.2)]
    >>> values = np.array([plant(1j * omega) for plant in known]).T
    >>> responses = Responses(omega=omega, values=values, known=known)
    >>> model = wb.solve(CircleCover(responses, order=1)).answer.model
    >>> containment_check(model, responses).holds
    True
    """
    plants = responses.known_plants
    parts = (list(plants.values()), model.nominal, model.W_c, model.W_r)
    excess = largest_excess(*parts, multiplicative=model.form == "multiplicative")
    return Check(
        "containment everywhere",
        "proven bound on the distance of a plant beyond its set, relative to the radius",
        excess.value,
        CONTAINMENT_TOLERANCE,
        where=f"{_place(excess, responses.dt)}, by {list(plants)[excess.plant]}",
        over=f"at every frequency, for these {len(plants)} plants",
        proven=True,
    )


def sampled_containment(model: UncertaintyModel, responses: Responses) -> Check:
    """Second opinion on `containment_check`: realisations on a dense grid, by support functions."""
    systems, known = model.systems(), responses.known_plants
    plants = {name: from_plane(plant, responses.dt) for name, plant in known.items()}
    functions = [model.nominal, model.W_c, *([] if model.W_r is None else [model.W_r])]
    poles = [function.poles for function in (*functions, *known.values())]
    dense = tried_frequencies(np.concatenate([*poles, model.nominal.zeros]))
    spread = np.geomspace(responses.axis[0] / 10, responses.axis[-1] * 10, SAMPLED_FREQUENCIES)
    axis = np.union1d(dense[(dense > 0) & np.isfinite(dense)], spread)
    omega = angular_frequency(axis, responses.dt)
    values = np.stack([plain_response(plant, omega)[:, 0, 0] for plant in plants.values()], axis=1)
    excess = excess_over_radius(systems, model.form, omega, values)
    excess = np.where(np.isnan(excess), np.inf, excess)
    k, i = np.unravel_index(int(np.argmax(excess)), excess.shape)
    return Check(
        "support between",
        "how far a realised plant reaches beyond the realised set, over the radius",
        float(excess[k, i]),
        REALISED_SUPPORT_TOLERANCE,
        where=f"at {omega[k] / (2 * np.pi):.6g} Hz, by {list(plants)[i]}",
        over=f"at {omega.size} frequencies of a dense grid, for these {len(plants)} plants",
    )


def _place(excess: Excess, dt: float) -> str:
    omega = angular_frequency(excess.omega, dt)
    return "at infinite frequency" if np.isinf(omega) else f"at {omega / (2 * np.pi):.6g} Hz"
