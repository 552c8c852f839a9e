"""The least leakage of a fault filter for a relative error: convex in the filter.

With T = F S of the nominal loop and p = S_nominal / S over the set, each plant estimates T / p of a
defect, and lets as much of the disc and of the noise through. Over a basis of T, for all p,

    min   E + 3 rms     |p - T| <= r |p|   above FAST,        |T| max|1/p| <= MOST  everywhere,
                        |T| max|1/p| W_d <= E  below SLOW,    ||T max|1/p||| = rms

with the noise white to 1750 Hz, 0.15 um rms (section 7.3). Second-order cones on a grid; the answer
is certified elsewhere.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from workbench.arrays import ComplexArray, RealArray
from workbench.errors import SolverError
from workbench.executor import Context
from workbench.fitting.rational import Rational, paired
from workbench.heavy_types import StateSpace
from workbench.solvers import Outcome, conic_solvers, solve_conic
from workbench.systems.generalised_plant import response
from workbench.systems.realisation import realisation

from ...laboratory.bench_setup import NOISE, RATE
from .loop import FAST, MOST, SLOW, FaultLoop, disc_weight

BAND = 1750.0
"""Of the measurement's noise [Hz]."""
MARGIN = 0.01
"""By which limits are tightened, relative: between grid points and boundary points is a little
more."""
CORNER = 2 * np.pi * 600.0
"""Poles of the Laguerre basis [rad/s]."""
RESONANT = (15.0, 60.0)
"""Where the drives have their first resonances, and the set's sensitivities narrow peaks [Hz]."""
MICRO = 1e-6
"""Unit of length [m]."""


@dataclass(frozen=True)
class Point:
    """A filter of the front: coefficients, relative error, envelope part and noise [m]."""

    coefficients: RealArray
    error: float
    leakage: float
    noise: float

    @property
    def total(self) -> float:
        return self.leakage + 3 * self.noise


class FaultFront:
    """Filters F over a basis, for a loop's set of plants or (`nominal`) for its nominal one.

    Those of given poles are looked at about each resonance of these as well.
    """

    def __init__(
        self, loop: FaultLoop, nominal: bool = False, poles: ComplexArray | None = None
    ) -> None:
        self.loop = loop
        self.frequency = grid(loop) if poles is None else about(loop, poles)
        self.omega = loop.warped(self.frequency)
        L = loop.open_loop(self.omega)
        self.back = 1 + L  # 1 / S
        one = np.ones((len(L), 1), complex)
        self.p = one if nominal else loop.differences(self.omega)
        self.worst = np.ones(len(L)) if nominal else loop.amplification(self.omega)
        self.disc = np.abs(response(disc_weight(loop.axis), self.omega)[:, 0, 0])

    def estimate(self, F: StateSpace) -> ComplexArray:
        """T (F,) of a filter."""
        return np.asarray(response(F, self.omega)[:, 0, 0] / self.back)

    def of_filter(self, F: StateSpace) -> ComplexArray:
        """Basis of T (F, n + 1) of the filters with the poles and the input matrix of one."""
        n = F.nstates
        states = realisation((F.A, F.B, np.eye(n), np.zeros((n, 1))), 0.0)
        columns = [response(states, self.omega)[:, :, 0], np.ones((len(self.omega), 1))]
        return np.asarray(np.hstack(columns) / self.back[:, None], complex)

    def judged(self, T: ComplexArray) -> tuple[float, float, float]:
        """Relative error, leakage and noise [m] of T, on the grid."""
        f, size = self.frequency, np.abs(T) * self.worst
        error = np.abs(1 - T[:, None] / self.p).max(axis=1)
        leakage = (size * self.disc)[f <= SLOW].max()
        noise = NOISE[self.loop.axis] * np.sqrt((self._shares * size**2).sum())
        return float(error[f >= FAST].max()), float(leakage), float(noise)

    @property
    def _shares(self) -> RealArray:
        """Of the noise's power, per frequency."""
        inside = np.minimum(self.frequency, BAND)
        edges = np.concatenate([[0.0], (inside[1:] + inside[:-1]) / 2, [inside[-1]]])
        return np.diff(edges) / BAND

    def least(self, basis: ComplexArray, error: float, leakage: float | None = None) -> Point:
        """The filter with the least leakage and noise for a relative error, over T = basis @ x.

        basis (F, n). A limit on the envelope part [m] alone may be added. Raises SolverError where
        there is none.
        """
        import cvxpy as cp

        f, tight = self.frequency, 1 - MARGIN
        scale = np.abs(basis).max(axis=0)
        basis = basis / scale
        x, E, rms = cp.Variable(basis.shape[1]), cp.Variable(), cp.Variable()
        size = self.worst / MICRO
        slow, fast = f <= SLOW, f >= FAST
        power = np.sqrt(self._shares) * NOISE[self.loop.axis]
        limits = [
            cp.abs(_rows(basis, size * self.disc)[slow] @ x) <= tight * E,
            cp.abs(_rows(basis, self.worst) @ x) <= tight * MOST,
            cp.norm(_rows(basis, size * power) @ x) <= rms,
        ]
        for p in self.p[fast].T:
            rest = p / np.abs(p) - _rows(basis[fast], 1 / np.abs(p)) @ x
            limits.append(cp.abs(rest) <= tight * error)
        if leakage is not None:
            limits.append(leakage >= E * MICRO)
        problem = cp.Problem(cp.Minimize(E + 3 * rms), limits)
        said = solved(problem)
        if x.value is None:
            raise SolverError(f"no filter of this basis has a relative error of {error:g}: {said}")
        T = basis @ x.value
        return Point(x.value / scale, *self.judged(T))


def solved(problem: Any) -> str:
    """Solve a cone program in place, without values where that fails; what the solver says."""
    context = Context()
    outcome, said = solve_conic(problem, conic_solvers()[0], context.options, context)
    if outcome not in (Outcome.SOLVED, Outcome.INACCURATE):
        for variable in problem.variables():
            variable.value = None
    return said


def grid(loop: FaultLoop) -> RealArray:
    """Frequencies [Hz], those where the drives resonate and where requirements end among them."""
    ends = [SLOW, FAST, BAND]
    resonances = [np.geomspace(*RESONANT, 80), np.geomspace(350.0, 700.0, 30)]
    top = 0.999 * RATE / 2 if loop.delay is not None else 1e5
    return np.unique(np.concatenate([np.geomspace(0.02, top, 220), *resonances, ends]))


def about(loop: FaultLoop, poles: ComplexArray) -> RealArray:
    """The grid, finer where drives resonate, and frequencies [Hz] about poles [rad/s], the nearer
    the less they are damped."""
    known = np.union1d(grid(loop), np.geomspace(*RESONANT, 400))
    upper = poles[poles.imag > 0.0]
    near = (upper.imag[:, None] + upper.real[:, None] * np.linspace(-3.0, 3.0, 13)).ravel()
    found = np.interp(near, loop.warped(known), known)
    return np.union1d(known, found)


def laguerre(loop: FaultLoop, order: int, omega: RealArray) -> ComplexArray:
    """Basis of T (F, order): zero where the loop integrates, then all-pass factors."""
    s = 1j * omega[:, None]
    zero = (s + _slowest(loop)) / (s + CORNER)
    return np.asarray(zero * ((s - CORNER) / (s + CORNER)) ** np.arange(order), complex)


def full_filter(loop: FaultLoop, coefficients: RealArray) -> StateSpace:
    """F = T / S of the Laguerre basis, its zero cancelling what integrates in 1 / S."""
    root, n = np.sqrt(2 * CORNER), len(coefficients) - 1
    # z_k = (s - a) / (s + a) z_(k-1) = z_(k-1) - sqrt(2 a) x_k.
    A = -CORNER * (np.eye(n) + 2 * np.tril(np.ones((n, n)), -1))
    left = np.cumsum(coefficients[::-1])[::-1]
    C, D = -root * left[1:][None, :], np.array([[left[0]]])
    ladder = realisation((A, root * np.ones((n, 1)), C, D), 0.0)
    return ladder * _inverse_sensitivity(loop).state_space()


def _inverse_sensitivity(loop: FaultLoop) -> Rational:
    """(1 + L) (s + slowest pole) / (s + CORNER)."""
    L = loop.G * loop.K
    direct = 1.0 + float(L.D[0, 0])
    zeros = np.linalg.eigvals(L.A - L.B @ L.C / direct)
    poles = np.concatenate([loop.K.poles(), loop.G.poles()])
    poles[np.argmin(np.abs(poles))] = -CORNER
    return Rational(paired(zeros), paired(poles), direct)


def _slowest(loop: FaultLoop) -> float:
    poles = np.concatenate([loop.K.poles(), loop.G.poles()])
    return float(-poles[np.argmin(np.abs(poles))].real)


def _rows(basis: ComplexArray, weight: RealArray) -> ComplexArray:
    return basis * weight[:, None]
