"""Controllers between disturbances and surface defects, and limits for every controller.

A surface defect shifts the measured error by f_sd [m], and the lens follows it by -T f_sd. A
disturbance w [m] of the disc leaves the error S w. Three channels of one loop,

    z_p = W_p S w       z_sd = W_sd T w       z_u = W_u K_optn K S w,

have the largest gains a, b and c. The last is the control effort, with c <= 1 as in section 6.3. S
and T do not depend on the place of the anti-aliasing filter within the loop. Here it stands before
the place where w enters: then no noise is needed to make the problem regular. Equation and section
numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.optimize import brentq, minimize
from scipy.signal import butter

from workbench.errors import SolverError
from workbench.fitting import Rational
from workbench.synthesis import known_disturbance_bound
from workbench.synthesis.h_infinity.riccati import central_controller
from workbench.systems.norms import hinf_norm
from workbench.types import RealArray, StateSpace
from workbench.uncertainty import GeneralisedPlant, generalised_plant

from ..drive.disc import VELOCITY
from ..drive.plants import ANTIALIASING, nominal_parameters, plant, total_gain
from ..drive.tables import Axis
from ..uncertainty.parametric_model import parametric_plant
from .control_problem import control_weight, optical_gain, performance_weight

CHANNELS = ("z_p", "z_sd", "z_u")
SHOCK_SIZE = 5.0
"""Size of shocks at the lens relative to w, at the frequency of the actuator's largest gain."""
LEAST_SIGMA, LARGEST_SIGMA = 0.01, 30.0
"""Range of the search for the weight sigma of the control channel that gives c = 1."""
EFFORT, RAISES = 0.99, 20
"""Target of c, which is still below 1 after rounding, and how often sigma may be raised to reach
it.
"""
SPLIT = 3
"""Order of the filters that divide the frequencies among the channels of a bound."""
FILTER_CORNERS = (10.0, 3e4)
"""Least and largest corner of these filters [Hz] in the search."""
OUTSIDE = 5.0
"""Penalty for zeta above the bound in that search, per unit."""
TRIALS = 60
"""Number of filters tried for a bound."""
SIGNALS, FEW, MANY = (3.0, 3e4), 20, 40
"""Lowest and highest rate [Hz] of the exponentials in the bound's disturbance, and their numbers.
"""


def defect_weight(length: float) -> StateSpace:
    """W_sd, f_sd [m] -> [m]: (s / (s + w_d))^3, w_d = 2 pi v / length, at most 1.

    A defect of this length [m] passes in length / v. A false displacement that swings once up and
    down in that time has its spectrum around v / length; a shorter defect has it above. Eq. 7.32
    has the same order and nearly this corner, 690 Hz, but rises to 250, so that everything that is
    not a disturbance counts as a defect. Here W_sd is 1 at the frequencies of defects, so |W_sd T|
    is the share of a defect that the lens follows. The default length is the one that eq. 7.32
    allows according to section 7.3.2.
    """
    corner = 2 * np.pi * VELOCITY / length
    return Rational(np.zeros(3, complex), np.full(3, -corner, complex), 1.0).state_space()


@dataclass(frozen=True, eq=False)
class TradeOff:
    """The three channels of an axis, for defects up to a length [m]."""

    axis: Axis
    length: float

    @cached_property
    def G(self) -> StateSpace:
        """Nominal plant u [V] -> f_en [units], with the anti-aliasing filter."""
        return plant(nominal_parameters(self.axis), total_gain(self.axis))

    @cached_property
    def W_p(self) -> StateSpace:
        return performance_weight(self.axis)

    @cached_property
    def W_sd(self) -> StateSpace:
        return defect_weight(self.length)

    @cached_property
    def W_KS(self) -> float:
        """W_u acting on f_en [units] instead of e [m]."""
        return float(control_weight(self.axis).D[0, 0]) * optical_gain(self.axis)

    @cached_property
    def uncertain(self) -> GeneralisedPlant:
        """System from w, v to (z_p, z_sd, z_u) with parametric uncertainty; v [1] is a shock."""
        K_optn = optical_gain(self.axis)
        return generalised_plant(
            [
                (parametric_plant(self.axis), "u_act", "f"),
                (_first_order(ANTIALIASING, 1 / K_optn), "f", "x"),
                (self.W_p, "e", "z_p"),
                (self.W_sd, "x", "z_sd"),
                (control_weight(self.axis), "u", "z_u"),
                (_gain(K_optn), "e", "f_en"),
                (_gain(SHOCK_SIZE / self._resonance), "v", "shock"),
            ],
            {"e": "w - x", "u_act": "u + shock"},
            exogenous=["w", "v"],
            control="u",
            performance=CHANNELS,
            measurement="f_en",
        )

    @cached_property
    def _resonance(self) -> float:
        """The largest gain of the actuator, u [V] -> x [m]."""
        size: float = hinf_norm((self.G.A, self.G.B, self.G.C, self.G.D))
        return size / optical_gain(self.axis)

    @cached_property
    def nominal(self) -> GeneralisedPlant:
        """System from w to (z_p, z_sd, z_u) without uncertainty."""
        return self.uncertain.channel(performance=CHANNELS, exogenous="w").nominal()

    def effort(self, K: StateSpace) -> float:
        """Control effort c of the nominal loop."""
        loop = self.nominal.channel(performance="z_u").close(K)
        return hinf_norm((loop.A, loop.B, loop.C, loop.D))

    def design(self, share: float) -> tuple[float, StateSpace]:
        """Sigma, and the controller with the least norm of [z_p; share z_sd; sigma z_u] and c
        nearly 1.

        Exogenous signals are w and the shock v, on which that norm hardly depends. Without v the
        best controllers cancel the lightly damped resonance, which is at a different frequency in
        each drive.

        Raises SolverError if no sigma is found.
        """
        shocked = self.uncertain.nominal()

        def made(sigma: float) -> StateSpace:
            import control

            system = shocked.weighted(performance=[1.0, share, sigma]).system
            parts = (system.A, system.B, system.C, system.D)
            return control.ss(*central_controller(*parts, shocked.controls, shocked.measurements).K)

        def excess(log_sigma: float) -> float:
            return math.log(self.effort(made(math.exp(log_sigma))) / EFFORT)

        sigma = LEAST_SIGMA
        if excess(math.log(LEAST_SIGMA)) > 0:
            sigma = math.exp(
                brentq(excess, math.log(LEAST_SIGMA), math.log(LARGEST_SIGMA), xtol=1e-3)
            )
        for _ in range(RAISES):  # levels are accurate to 1e-3 only, and c jumps with them
            K = made(sigma)
            if self.effort(K) < (1 + EFFORT) / 2:
                return sigma, K
            sigma *= 1.01
        raise SolverError(f"no weight of the control channel makes c = 1 with share = {share:g}")

    def bound(self, share: float, *starts: RealArray) -> tuple[float, RealArray]:
        """A lower bound on max(a, share b) of every controller with c <= 1.

        For filters with |h_1|^2 + |h_2|^2 + |h_3|^2 = 1 at every frequency, [h_1 z_p; h_2 share
        z_sd; h_3 zeta z_u] of any controller has at most the norm max(a, share b, zeta c). So if
        zeta is below a lower bound of that norm, this is also a lower bound of max(a, share b).
        Searches over the corners of the filters and over zeta make it large. They begin at
        ``starts``, the logarithms of corners [rad/s]; the corners found are returned, too.
        """

        def level(x: RealArray, count: int) -> float:
            rates = 2 * np.pi * np.geomspace(*SIGNALS, count)
            try:
                return known_disturbance_bound(self.shared(share, x), rates).lower
            except SolverError:
                return 0.0

        def missing(x: RealArray) -> float:
            bound = level(x, FEW)
            return OUTSIDE * max(0.0, math.exp(x[2]) - bound) - bound

        ends = np.log(2 * np.pi * np.array(FILTER_CORNERS))
        box = [tuple(ends), tuple(ends), (None, None)]
        options = {"maxfev": TRIALS}
        best, at = 0.0, np.zeros(3)
        for start in starts:
            x = minimize(missing, start, method="Nelder-Mead", bounds=box, options=options).x
            bound = level(x, MANY)
            while math.exp(x[2]) > bound > best:
                x[2] = math.log(0.999 * bound)
                bound = level(x, MANY)
            if bound > best:
                best, at = bound, x
        return best, at

    def shared(self, share: float, x: RealArray) -> GeneralisedPlant:
        """The channels from w behind the filters of a bound; x as the start of `bound`."""
        split, upper, zeta = np.exp(x)
        above = _butterworth(split, "high")
        rows = [
            _butterworth(split, "low"),
            share * above * _butterworth(upper, "low"),
            zeta * above * _butterworth(upper, "high"),
        ]
        return self.nominal.weighted(performance=rows)


def _butterworth(corner: float, kind: str) -> StateSpace:
    """Low-pass and high-pass filter with one corner; the squares of their magnitudes
    add up to 1.
    """
    zeros, poles, gain = butter(SPLIT, corner, kind, analog=True, output="zpk")
    return Rational(zeros, poles, float(gain)).state_space()


def _first_order(corner: float, gain: float) -> StateSpace:
    import control

    return control.ss(-corner, corner, gain, 0.0)


def _gain(value: Any) -> StateSpace:
    import control

    return control.ss([], [], [], [[value]])
