"""Known poles and static gains of sampled systems, by counting and by determinants."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from workbench._core.arrays import RealArray
from workbench.certificate import THIS_SYSTEM, Check
from workbench.executor.effort import tries

CIRCLES = (1e-5, 1e-4, 1e-3)
"""Radii of the circles around a known pole within which eigenvalues are counted."""
POINTS = 64
"""Number of points on a circle."""
COUNT_ROUNDING = 0.1
"""Largest deviation of a count that is rounding."""
GAIN_ROUNDING = 1e-5
"""Largest relative error of a gain by determinants."""


def has_known(
    system: Any,
    poles: Sequence[tuple[complex, int]],
    gain: RealArray | None,
    size: RealArray,
    name: str,
) -> Iterator[Check]:
    """Checks that a system has the known poles, with multiplicity, and static gains (ny, nu) unless
    NaN.

    Errors of gains are relative to ``size`` (ny, nu) where the gains are smaller than that.
    """
    A, B, C, D = (np.asarray(getattr(system, matrix), dtype=float) for matrix in "ABCD")
    if poles:
        lacks = [times - max(_counted(A, pole, r) for r in CIRCLES) for pole, times in poles]
        statement = "poles known there, less those counted by the integral of the resolvent's trace"
        where = f"about {poles[int(np.argmax(lacks))][0]:.6g}"
        yield Check(
            f"poles of the {name}",
            statement,
            max(lacks),
            COUNT_ROUNDING,
            where=where,
            over=THIS_SYSTEM,
        )
    if gain is not None:
        worst, where = 0.0, ""
        for o, j in np.argwhere(np.isfinite(gain)):
            found = _gain_by_determinants(A, B[:, [j]], C[[o]], D[o, j])
            error = abs(found - gain[o, j]) / max(abs(gain[o, j]), size[o, j])
            if not error <= worst:
                worst, where = error, f"from input {j + 1} to output {o + 1}"
        statement = "static gain by determinants of the pencil at z = 1 less that given, relative"
        yield Check(
            f"gain of the {name}", statement, worst, GAIN_ROUNDING, where=where, over=THIS_SYSTEM
        )


def _counted(A: RealArray, pole: complex, radius: float) -> float:
    """Number of eigenvalues within a circle around a pole, by the argument principle."""
    points = tries(POINTS)
    turns = np.exp(2j * np.pi * (np.arange(points) + 0.5) / points)
    resolvents = np.linalg.inv((pole + radius * turns)[:, None, None] * np.eye(len(A)) - A)
    return float((np.trace(resolvents, axis1=1, axis2=2) * radius * turns).mean().real)


def _gain_by_determinants(A: RealArray, b: RealArray, c: RealArray, d: float) -> float:
    """Gain c (I - A)^-1 b + d as det [[I - A, -b], [c, d]] / det (I - A)."""
    rest = np.eye(len(A)) - A
    signs, logs = zip(
        np.linalg.slogdet(np.block([[rest, -b], [c, np.array([[d]])]])),
        np.linalg.slogdet(rest),
        strict=True,
    )
    return float(signs[0] * signs[1] * np.exp(logs[0] - logs[1]))
