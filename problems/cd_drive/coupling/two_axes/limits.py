"""The largest couplings with which both loops keep their performance."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np

from workbench.mu import Peak, peak, skew_bounds
from workbench.systems import response
from workbench.types import ComplexArray, RealArray, StateSpace

from ..paths import Coupling, TwoAxes
from .performance import CLOSED, PERFORMANCE, Place, largest_gain, performance_system

GUESSED = Coupling(electrical=0.01, magnetic=0.0175, springs=0.1, tilt=0.0087, optical=0.01)
"""Sizes of a drive that was put together with usual care. The thesis prints none. They are guesses:
-40 dB of crosstalk, coils turned by 1 degree, one arm of four stiffer by 10 %, a tilt of half a
degree, and 1 % of one error in the other.
"""
TOGETHER = "together"
PATHS = (*asdict(GUESSED), TOGETHER)
"""Single paths, and all of them in the proportions of GUESSED."""
CERTIFIED_SHARE = 0.9
"""Share of a coupling that loses the performance up to which it is certified to be kept."""
SEARCHED = np.geomspace(100.0, 2000.0, 40)
"""Frequencies [Hz] at which a coupling that loses the performance is searched for; that a smaller
one keeps it is certified at all frequencies.
"""
PEAK_TOLERANCE = 1e-2
"""Relative width of the interval that certifies a peak of mu."""
SMALLEST, LARGEST, LARGEST_SPRINGS = 1e-4, 0.5, 0.95
"""Sizes of a path between which its limit is searched; beyond it a spring would be negative."""
BISECTIONS = 12


@dataclass(frozen=True, eq=False)
class Limit:
    """Size of any coupling at one place with which the performance is certified to be kept, and one
    of another size with which it is lost.

    kept: with every coupling of at most this gain mu is below 1, as `mu` proves. worst (2,): gains
    from radial to focus, and from focus to radial, that lose it at omega [rad/s].
    """

    kept: float
    mu: Peak
    worst: ComplexArray
    omega: float


def any_coupling(two: TwoAxes, place: Place) -> Limit:
    """The limit for couplings of every kind that act at a place."""
    system, omega = performance_system(two, place), 2 * np.pi * SEARCHED
    found = skew_bounds(response(system, omega), CLOSED, [PERFORMANCE])
    first = int(found.lower.argmax())
    kept = CERTIFIED_SHARE / float(found.lower[first])
    mu = peak(sized(system, kept), CLOSED, tolerance=PEAK_TOLERANCE)
    return Limit(kept, mu, np.diag(found.Delta[first])[:2], float(omega[first]))


def sized(system: StateSpace, size: float) -> StateSpace:
    """System whose coupling of size 1 is one of this size."""
    return system * np.diag([size, size, 1.0, 1.0])


def gain_with(two: TwoAxes, place: Place, worst: ComplexArray, omega: float) -> float:
    """Largest singular value from d to z at omega [rad/s], with gains (2,) of a coupling."""
    N = response(performance_system(two, place), np.array([omega]))[0]
    coupling = np.diag(worst)
    closed = np.linalg.solve(np.eye(2) - N[:2, :2] @ coupling, N[:2, 2:])
    return float(np.linalg.norm(N[2:, 2:] + N[2:, :2] @ coupling @ closed, 2))


def path_limit(drive: str, path: str, sign: float, omega: RealArray) -> float:
    """Size of one path, with this sign, at which the performance is lost at frequencies [rad/s]
    (F,); that of TOGETHER is a factor on GUESSED. Infinite beyond the range of the search.
    """
    most = LARGEST_SPRINGS if path == "springs" else LARGEST
    low, high = np.log([SMALLEST, most / 0.1 if path == TOGETHER else most])
    if largest_gain(of_path(drive, path, sign * float(np.exp(high))), omega) < 1.0:
        return np.inf
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        gain = largest_gain(of_path(drive, path, sign * float(np.exp(middle))), omega)
        low, high = (middle, high) if gain < 1.0 else (low, middle)
    return float(np.exp(high))


def of_path(drive: str, path: str, size: float) -> TwoAxes:
    """A drive with one path of this size, or with GUESSED times this."""
    if path == TOGETHER:
        return TwoAxes(drive, Coupling(**{n: size * one for n, one in asdict(GUESSED).items()}))
    return TwoAxes(drive, Coupling.alone(path, size))


def relative_coupling(two: TwoAxes, omega: RealArray) -> RealArray:
    """Share of each control voltage that acts on the other axis, at frequencies [rad/s] (F,): from
    radial to focus and from focus to radial (F, 2).

    What diodes see of the other error is not part of it.
    """
    G = two.response(omega)
    found: RealArray = np.abs(G[:, [0, 1], [1, 0]] / G[:, [0, 1], [0, 1]])
    return found
