"""Random switchings: exact products of transitions, with roots proven inside the unit circle."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import flint
import numpy as np

from workbench._core.arrays import RealArray
from workbench.certificate import Check
from workbench.second_opinion import SEED
from workbench.second_opinion.switchings import switchings

PERIODS, LONGEST = 20, 400
"""Number of switchings of every plant, and the longest period [samples], since exact products grow
with it.
"""
ROOT_BITS = 256
"""Precision [bits] at which roots are enclosed."""


def exact_products(
    transitions: Sequence[RealArray], shortest: Sequence[int], longest: Sequence[int | None]
) -> list[Check]:
    """Check that no plant grows over a period of the switchings; an empty list if all are too long.

    The transition over a period is a product of doubles as exact fractions, and the roots of its
    characteristic polynomial lie in proven discs. The arguments are those of `fastest_growth`.
    """
    rng = np.random.default_rng(SEED)
    short = [
        (modes, stays)
        for modes, stays in switchings(rng, shortest, longest)
        if sum(stays) <= LONGEST
    ][:PERIODS]
    if not short:
        return []
    growing, where = 0, ""
    for plant in range(len(transitions[0])):
        matrices = [_integers(A[plant]) for A in transitions]
        for modes, stays in short:
            if not _falls(matrices, modes, stays):
                growing += 1
                where = where or f"first for plant {plant + 1}: stays {stays} in modes {modes}"
    return [
        Check(
            "exact products",
            "periods whose transition, in exact fractions, is not proven to fall",
            growing,
            0.0,
            where=where,
            over=f"for {len(short)} periodic switchings of every plant",
        )
    ]


def _falls(matrices: Sequence[tuple[Any, int]], modes: Sequence[int], stays: Sequence[int]) -> bool:
    """Whether every eigenvalue of the transition over a period is proven to be smaller than 1."""
    n = matrices[0][0].nrows()
    period, exponent = flint.fmpz_mat(np.eye(n, dtype=int).tolist()), 0
    for i, stay in zip(modes, stays, strict=True):
        whole, shift = matrices[i]
        period, exponent = whole**stay * period, exponent + stay * shift
    with flint.ctx.workprec(ROOT_BITS):
        limit = flint.arb(2) ** exponent
        roots: Any = period.charpoly().complex_roots()  # with their multiplicities
        return all(abs(root) < limit for root, _ in roots)


def _integers(A: RealArray) -> tuple[Any, int]:
    """An integer matrix and the exponent of 2 that divides it: their quotient is A exactly."""
    exact = [[Fraction(float(value)) for value in row] for row in A]
    largest = max(value.denominator for row in exact for value in row)
    whole = [[int(value * largest) for value in row] for row in exact]
    return flint.fmpz_mat(whole), largest.bit_length() - 1
