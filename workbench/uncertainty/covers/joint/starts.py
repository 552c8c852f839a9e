"""Starts for the search for a small model. The search has many local minima, in particular for
stadiums.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from workbench._core.arrays import ComplexArray
from workbench.errors import InputError, SolverError
from workbench.executor import Context
from workbench.fitting.magnitude.program import MagnitudeFit
from workbench.fitting.rational import Rational
from workbench.fitting.response.least_peak import worst_error
from workbench.fitting.response.program import ResponseFit
from workbench.fitting.response.vector_fitting import relocated_fits
from workbench.geometry import Circle, Stadium
from workbench.program import methods
from workbench.uncertainty.covers.cover import RADIUS_ROUNDING, UncertaintyCover
from workbench.uncertainty.covers.everywhere import rounded_radius
from workbench.uncertainty.covers.joint.search import FoundModel, ModelSize
from workbench.uncertainty.covers.nominal import (
    STARTING_MIN_RELATIVE_SIZE,
    mean_response,
    nominal_fit,
)
from workbench.uncertainty.covers.stadium_cover import StadiumCover
from workbench.uncertainty.covers.weights import (
    beyond,
    held,
    lasting,
    share_of_size,
    unwrapped,
)

STARTING_HALF_LENGTH_SHARE = 0.1
"""Factor of a stadium's half-length in the size used to weight the errors of a starting weight. It
starts with narrow sets, whose length the search then settles. With half of it lengths are fitted
more closely at first; with double of it widths are. Half or double changes the start only.
"""
STARTING_CIRCLES = ("sk", "sb10yd")
"""Methods of the magnitude fit that give starts for the complex weight."""
STARTING_POWER = 8
"""Power of the norm that compares starts. It is the first of `SEARCH_POWERS`. Half or double may
choose another start.
"""

Start = tuple[str, FoundModel | None, str]
"""Name of a start, the model, and the reason if there is no model."""


def starts(program: UncertaintyCover, context: Context) -> Iterator[Start]:
    """Models from which a search may start, for each nominal and each real weight."""
    for name, (response, sizes) in nominals(program).items():
        try:
            nominal = program.nominal
            if nominal is None:
                nominal = nearest_fit(nominal_fit(response, sizes, program), context)
            away = program.deviations_from(
                nominal, program.points
            )  # raises InputError if the nominal passes through zero
            weights: dict[str, Rational | None] = {"": None}
            if isinstance(program, StadiumCover):
                weights = real_weights(program, away, context)
        except (InputError, SolverError) as error:
            yield name, None, str(error)
            continue
        for kind, W_r in weights.items():
            model, failure = _with_circle(program, nominal, away, W_r, context)
            yield name + kind, model, failure
        if program.nominal is not None:
            return


def real_weights(
    program: StadiumCover, away: ComplexArray, context: Context
) -> dict[str, Rational | None]:
    """Real weights fitted to the third set of deviations (F, N): one of the given order, and a
    constant.

    The constant gets the same order by equal poles and zeros, which the search separates.
    """
    third = program.third_set(away)
    end = unwrapped(third.half_length * np.exp(1j * third.angle))
    size = third.radius + STARTING_HALF_LENGTH_SHARE * third.half_length
    weight = 1 / np.maximum(size, STARTING_MIN_RELATIVE_SIZE * (size.max() or 1.0))
    omega, order = program.responses.axis, program.real_order
    mean = float(np.sqrt(program.responses.shares @ third.half_length**2))
    roots = -np.geomspace(omega[0], omega[-1], order + 2)[1:-1].astype(complex)
    return {
        "": nearest_fit(held(omega, end, weight, order, program.minimum_phase), context),
        ", constant real weight": Rational(roots, roots.copy(), mean),
    }


def _with_circle(
    program: UncertaintyCover,
    nominal: Rational,
    away: ComplexArray,
    W_r: Rational | None,
    context: Context,
) -> tuple[FoundModel | None, str]:
    """The smallest model with W_c fitted to the radii of deviations (F, N), or the reason why there
    is none.
    """
    omega = program.responses.axis
    radius = rounded_radius(omega, away, nominal, W_r, program.form, RADIUS_ROUNDING)
    share = share_of_size(radius, np.maximum(np.abs(away).max(axis=1), radius))
    order = program.complex_order
    fit = MagnitudeFit(beyond(omega), lasting(radius), order, weight=lasting(share), cover=True)
    found, said = [], []
    for method in STARTING_CIRCLES:
        try:
            W_c, _, _ = methods(fit)[method].answer(fit, context)
        except (ArithmeticError, ValueError, SolverError) as error:
            said.append(f"{method}: {error}")
            continue
        size = ModelSize.of(program, FoundModel(nominal, W_r, W_c))
        found.append(FoundModel(nominal, W_r, W_c, size(size.start, STARTING_POWER)[0]))
    best = min(found, key=lambda model: (np.isnan(model.size), model.size), default=None)
    return best, "; ".join(said)


def nominals(program: UncertaintyCover) -> dict[str, tuple[ComplexArray, Circle | Stadium]]:
    """Starting responses of the nominal and the sets whose sizes weight the errors, by name."""
    first = program.first_set(program.points)
    centres = first.center
    return {
        "the centres": (centres, first),
        "the centres, evenly weighted": (centres, Circle(centres, np.abs(centres))),
        "the plants' mean": (mean_response(program.responses.points), first),
    }


def nearest_fit(fit: ResponseFit, context: Context) -> Rational:
    """The best fit by pole relocation only, since the search refines it."""
    return min(relocated_fits(fit, context), key=lambda found: worst_error(fit, found))
