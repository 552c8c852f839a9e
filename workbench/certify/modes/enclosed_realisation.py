"""Realisations in continuous time with errors, of sampled systems and in other coordinates."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from workbench.arrays import RealArray
from workbench.certify.modes.bilinear import bilinear_enclosures
from workbench.certify.modes.modal_form import (
    PRECISIONS,
    Enclosures,
    form_in_basis,
    real_balls,
    real_doubles,
)
from workbench.certify.rounding import Enclosure, exact
from workbench.errors import InputError
from workbench.systems.balancing import balancing

LARGEST_BLUR = 1e-8
"""Largest error of an entry of modal coordinates, relative to the largest entry of its matrix. The
basis of a cluster of many poles, as of a Laguerre filter, proves where they are, and no more."""
FEWEST_DOUBLES = 20
"""Fewest states of a sampled realisation that doubles transform; fewer take no time in balls."""

Realised = tuple[RealArray, RealArray, RealArray, RealArray]
"""A, B, C and D."""
Coordinates = Callable[[RealArray, RealArray, RealArray], RealArray | None]
"""Proposes other states of A, B and C in continuous time, as columns (n, n); None: it has none."""


def realised_balls(given: Realised, period: float, bits: int) -> tuple[Any, Any, Any, Any]:
    """A realisation in balls, of a sampled system that of s = 2 / T (z - 1) / (z + 1).

    Raises ZeroDivisionError for a pole that cannot be told from z = -1.
    """
    import flint

    A, B, C, D = (real_balls(part) for part in given)
    n = len(given[0])
    if not (period and n):
        return A, B, C, D
    with flint.ctx.workprec(bits):
        one, rate = real_balls(np.eye(n)), flint.arb(2) / flint.arb(period)
        shifted = A + one
        back, moved = shifted.solve(B), shifted.solve(A - one)
        return moved * rate, back * (2 * rate), C * shifted.inv(), D - C * back


def in_coordinates(given: Realised, period: float, coordinates: Coordinates) -> Enclosures | None:
    """A, B and C in proposed coordinates; None without any, or where they blur too much."""
    try:
        balls = realised_balls(given, period, PRECISIONS[0])[:3]
    except ZeroDivisionError:
        return None
    basis = coordinates(*(real_doubles(part).mid for part in balls))
    if basis is None:
        return None
    found = scaled_states(form_in_basis(balls, basis, PRECISIONS[0]))
    return found if found and is_sharp(found) else None


def in_continuous_time(given: Realised, period: float) -> tuple[Enclosures, Enclosure]:
    """A, B and C, and D, in doubles."""
    if not period:
        A, B, C, D = map(exact, given)
        return (A, B, C), D
    try:
        found = bilinear_enclosures(given, period) if len(given[0]) >= FEWEST_DOUBLES else None
        A, B, C, D = found or map(real_doubles, realised_balls(given, period, PRECISIONS[-1]))
    except ZeroDivisionError:
        raise InputError(
            "the system has a pole that cannot be told from z = -1, half the sampling rate: filter "
            "it or sample at another rate"
        ) from None
    scaled = scaled_states((A, B, C))
    assert scaled is not None
    return scaled, D


def scaled_states(parts: Enclosures | None) -> Enclosures | None:
    """The realisation with balanced states; None for none.

    Modes of a cluster of poles come with entries of very different size.
    """
    return parts and with_balanced_states(*parts)


def with_balanced_states(A: Enclosure, B: Enclosure, C: Enclosure) -> Enclosures:
    """The realisation with its states scaled by powers of two, exactly, to entries of like size."""
    n, outputs, inputs = len(A.mid), len(C.mid), B.mid.shape[1]
    whole = np.block([[A.mid, B.mid], [C.mid, np.zeros((outputs, inputs))]])
    scale = balancing(np.abs(whole), n)[0][:n]
    return (
        A.scaled(scale, 1 / scale),
        B.scaled(scale, np.ones(inputs)),
        C.scaled(np.ones(outputs), 1 / scale),
    )


def is_sharp(parts: Enclosures) -> bool:
    """Whether modal coordinates are known well enough to work with."""
    return all(
        part.rad.max(initial=0.0) <= LARGEST_BLUR * np.abs(part.mid).max(initial=0.0)
        for part in parts
    )
