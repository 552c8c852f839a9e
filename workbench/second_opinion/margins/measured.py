"""Margins of measured loops by the chords between the data, and by redrawn data."""

from __future__ import annotations

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray

DRAWS = 400
"""Number of times that data are redrawn."""


def lies_on_chord(omega: RealArray, L: ComplexArray, at: float, *, on_circle: bool) -> float:
    """Distance of a claimed crossing from the chord's own crossing, as a share of the chord.

    The crossing is one of the unit circle or of the negative real axis; infinite if the chord has
    none.
    """
    k = int(np.clip(np.searchsorted(omega, at, side="right") - 1, 0, omega.size - 2))
    if at == omega[k] and k:  # on a datum: either chord will do
        return min(_from_chord(omega, L, at, j, on_circle) for j in (k - 1, k))
    return _from_chord(omega, L, at, k, on_circle)


def _from_chord(omega: RealArray, L: ComplexArray, at: float, k: int, on_circle: bool) -> float:
    a, b = L[k], L[k + 1]
    share = np.log(at / omega[k]) / np.log(omega[k + 1] / omega[k])
    if on_circle:
        d = b - a
        roots = np.roots([abs(d) ** 2, 2 * (a.conjugate() * d).real, abs(a) ** 2 - 1.0])
        real = roots.real[np.abs(roots.imag) < 1e-9]
    else:
        real = np.array([a.imag / (a.imag - b.imag)]) if a.imag != b.imag else np.zeros(0)
    inside = real[(real >= -1e-9) & (real <= 1 + 1e-9)]
    return float(np.abs(inside - share).min()) if inside.size else np.inf


def chords_that_cross(L: ComplexArray) -> tuple[int, int]:
    """Numbers of chords that cross the unit circle, and that cross the negative real axis; chords
    are joined end to end.
    """
    circle = np.diff(np.abs(L) >= 1.0).sum()
    a, b = L[:-1], L[1:]
    apart = (a.imag >= 0) != (b.imag >= 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        real = a.real + (b.real - a.real) * a.imag / (a.imag - b.imag)
    return int(circle), int((apart & (real < 0)).sum())


def redrawn_spread(
    omega: RealArray, L: ComplexArray, variance: RealArray, crossings: RealArray
) -> RealArray:
    """Standard deviations [deg] of the phase margins of data redrawn around the measured ones.

    For each crossing of |L| = 1, the nearest crossing of the redrawn chords is used; NaN if few
    redrawn chords cross.
    """
    rng = np.random.default_rng(0)
    found = np.full(len(crossings), np.nan)
    for place, at in enumerate(crossings):
        k = int(np.clip(np.searchsorted(omega, at, side="right") - 1, 0, omega.size - 2))
        near = slice(max(k - 2, 0), k + 4)
        scale = np.sqrt(variance[near] / 2)
        noise = rng.standard_normal((DRAWS, 2, scale.size)) * scale
        margins = [_phase(L[near] + one[0] + 1j * one[1]) for one in noise]
        known = [m for m in margins if np.isfinite(m)]
        if len(known) > DRAWS // 2:
            middle = np.angle(np.exp(1j * np.array(known)).mean())
            away = np.angle(np.exp(1j * (np.array(known) - middle)))
            found[place] = np.degrees(away.std())
    return found


def _phase(L: ComplexArray) -> float:
    """Phase [rad] from -1 at the first crossing of |L| = 1 between data; NaN if there is none."""
    above = np.log(np.abs(L))
    passed = np.flatnonzero(above[1:] * above[:-1] <= 0)
    if passed.size != 1:
        return float("nan")
    k = passed[0]
    t = above[k] / (above[k] - above[k + 1])
    turned = np.angle(L[k + 1] / L[k])
    return float(np.angle(-L[k] * np.exp(1j * t * turned)))
