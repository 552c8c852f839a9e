"""Checks of the crossings of a loop: each claimed one is a crossing, and none is missed."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from workbench._core.arrays import EPS, RealArray
from workbench._core.heavy_types import StateSpace
from workbench.certificate import THIS_SYSTEM, Check, Checker
from workbench.mu.loops.coupled_loop import CoupledLoop
from workbench.mu.loops.crossings import ExactLoop
from workbench.mu.loops.delayed_loop import DelayedLoop
from workbench.second_opinion.margins.coupled import TriedLoop
from workbench.second_opinion.margins.dead_times import counted_poles, tried_distance
from workbench.second_opinion.powers import growth
from workbench.second_opinion.responses import plain_response, tried_frequencies
from workbench.systems.realisation import realisation

CROSSING_ROUNDING = 1e-6
"""A response counts as -1, or as lying on the unit circle, if its distance is at most this.
Crossings of close roots are known to about half of the digits of a double, 1e-8, and their
responses to less. With half of it a true margin of such a loop may be contradicted; with double of
it a difference of 2e-6 is overlooked.
"""
TRIED_GAINS = 7
"""Number of gains between the least and the largest at which the closed loop is tried. The loop is
stable between two crossings if it is so at one gain between them, so they only have to meet wrong
crossings by chance. With half of them fewer wrong margins are found; double costs time.
"""
POLE_STEP = 1e-9
"""Relative step away from the frequencies of poles. The response there is about 1e9 of its usual
size, which a double holds with seven digits left. Half or double changes nothing but those digits.
"""
RANGE_MARGIN = 1e-3
"""Share of the logarithmic range of gains that is left out at either end. At the ends a pole is on
the axis, and rounding decides. With half of it a true margin may be contradicted where poles move
slowly with gain; double tries a little less.
"""
LARGEST_FACTOR = 1e3
"""Largest gain factor tried. Gains farther from 1 than 60 dB are of no use to a designer. Half or
double tries less or more of an infinite margin.
"""


def closed(L: StateSpace, gain: float = 1.0) -> StateSpace | None:
    """1 / (1 + gain L); None where the loop is singular."""
    direct = 1.0 + gain * float(L.D[0, 0])
    if direct == 0.0:
        return None
    A, B, C = L.A - gain * L.B @ L.C / direct, L.B / direct, -gain * L.C / direct
    return realisation((A, B, C, np.array([[1.0 / direct]])), L.dt or 0.0)


@dataclass(frozen=True, eq=False)
class CrossingChecker(Checker):
    """Checks the `ClassicalMargins` of a loop whose responses and crossings are exact."""

    exact: ExactLoop | DelayedLoop | CoupledLoop

    @property
    def quantifier(self) -> str:
        return "for this one loop, at its crossings"

    def checks(self, answer: Any, tolerance: float) -> list[Check]:
        factor, at = answer.gains.T
        phase, omega = answer.phases_deg.T
        L = self.exact.response(omega)
        turned = np.angle(-L * np.exp(-1j * np.radians(phase)))
        delay = np.radians(np.mod(phase, 360.0)) / np.maximum(omega, 1e-300)
        late = np.abs(answer.delays[:, 0] - delay) * omega
        stable = self.exact.stable()
        proven = not answer.stable or self.exact.exceeds(answer.modulus)
        gains = 1.0 + factor * self.exact.response(at)
        return [
            _crossing("gains", "distance of the loop with a factor from -1", np.abs(gains)),
            _crossing("unit gain", "distance of |L| from 1", np.abs(np.abs(L) - 1.0)),
            _crossing("phases", "phase beyond the one claimed [rad]", np.abs(turned)),
            _crossing("delays", "phase of a delay beyond the one claimed [rad]", late),
            Check("stability", "whether it is not as claimed", float(stable != answer.stable), 0.0),
            Check(
                "modulus",
                "whether L is not proven to be as far from -1 as claimed",
                float(not proven),
                0.0,
                over="at every frequency",
                proven=True,
            ),
        ]


@dataclass(frozen=True, eq=False)
class ClassicalChecker(CrossingChecker):
    """Checks the `ClassicalMargins` of a loop of one channel."""

    exact: ExactLoop | DelayedLoop
    loop: StateSpace

    def second_opinion(self, answer: Any) -> list[Check]:
        found = [self._missed(answer.phases_deg[:, 1])]
        if answer.stable:
            found.append(self._between(*answer.gain))
        return found

    def _missed(self, crossings: RealArray) -> Check:
        """Check that a crossing lies between any two frequencies between which |L| passes 1."""
        loop = closed(self.loop)
        every = [np.linalg.eigvals(one.A) for one in (self.loop, loop) if one is not None]
        omega = tried_frequencies(np.concatenate(every), dt=self.loop.dt)
        # Beside undamped poles (also at z = 1), where the response is infinite.
        least = POLE_STEP / float(self.loop.dt) if self.loop.dt else 0.0
        omega = omega[(omega > least) & np.isfinite(omega)] * (1.0 + POLE_STEP)
        above = self._sizes(omega) - 1.0
        known = np.abs(above) > CROSSING_ROUNDING
        passed = (above[1:] * above[:-1] < 0) & known[1:] & known[:-1]
        inside = np.histogram(crossings, omega)[0] > 0 if omega.size > 1 else passed
        apart = np.flatnonzero(passed & ~inside)
        missed = [k for k in apart if self._certain(omega[k : k + 2], above[k : k + 2])]
        where = f"the first above {omega[missed[0]]:.6g} rad/s" if missed else ""
        statement = "number of crossings of the unit circle that are missed"
        over = f"between {omega.size} frequencies"
        return Check("missed", statement, float(len(missed)), 0.0, where=where, over=over)

    def _sizes(self, omega: RealArray) -> RealArray:
        """|L| in doubles; infinite at a pole."""
        try:
            found: RealArray = np.abs(plain_response(self.loop, omega)[:, 0, 0])
        except np.linalg.LinAlgError:
            half = len(omega) // 2
            if not half:
                return np.array([math.inf])
            return np.concatenate([self._sizes(omega[:half]), self._sizes(omega[half:])])
        return found

    def _certain(self, omega: RealArray, above: RealArray) -> bool:
        """Whether the sign of |L| - 1 in doubles is certain in spite of rounding of L's entries."""
        L, n = self.loop, self.loop.nstates
        points = np.exp(1j * omega * float(L.dt)) if L.dt else 1j * omega
        for s, value in zip(points, above, strict=True):
            entries = np.abs(L.A) + abs(s) * np.eye(n)
            unit = math.ldexp(1.0, math.frexp(float(entries.max(initial=0.0)))[1] - 1)
            R = np.abs(np.linalg.inv((s * np.eye(n) - L.A) / unit)) / unit
            spread = float((np.abs(L.C) @ (R @ entries @ R + R) @ np.abs(L.B)).item())
            if not abs(value) > n * EPS * (spread + abs(L.D[0, 0])):
                return False
        return True

    def _between(self, low: float, high: float) -> Check:
        """Check that the loop is stable for gains between the nearest factors."""
        ends = np.log([max(low, 1 / LARGEST_FACTOR), min(high, LARGEST_FACTOR)])
        room = RANGE_MARGIN * (ends[1] - ends[0])
        fastest = -math.inf
        for gain in np.exp(np.linspace(ends[0] + room, ends[1] - room, TRIED_GAINS)):
            loop = closed(self.loop, float(gain))
            rate, rounding = (math.inf, 0.0) if loop is None else growth(loop.A, loop.dt)
            if loop is None or rate < rounding or not self._within_rounding(loop, float(gain)):
                fastest = max(fastest, rate - rounding)
        statement = "logarithmic growth of a loop per sample, less its rounding"
        over = f"for {TRIED_GAINS} gains between the nearest factors"
        return Check("stable between", statement, fastest, 0.0, over=over)

    def _within_rounding(self, loop: StateSpace, gain: float) -> bool:
        """Whether rounding of L's entries decides on stability with this gain."""
        poles = np.linalg.eigvals(loop.A)
        omega = np.abs(np.angle(poles) / float(loop.dt) if loop.dt else poles.imag)
        return any(self.exact.may_be_unstable(float(w), gain) for w in omega)


@dataclass(frozen=True, eq=False)
class DelayedChecker(ClassicalChecker):
    """Checks the `ClassicalMargins` of a loop with dead time; ``loop`` is its rational part."""

    def second_opinion(self, answer: Any) -> list[Check]:
        """Crossings of |L| are checked as those of |R|; poles of the closed loop are counted by
        turns.
        """
        assert isinstance(self.exact, DelayedLoop)
        T = float(self.exact.delay)
        found = [self._missed(answer.phases_deg[:, 1])]
        if not answer.stable:
            return found
        counts = [counted_poles(self.loop, T, gain) for gain in _tried(*answer.gain)]
        return [*found, *_late_checks(answer, counts, tried_distance(self.loop, T))]


@dataclass(frozen=True, eq=False)
class CoupledChecker(CrossingChecker):
    """Checks the `ClassicalMargins` of one of several channels, or of a loop with dead time in
    inner loops.
    """

    exact: CoupledLoop

    def second_opinion(self, answer: Any) -> list[Check]:
        """Responses in doubles must cross |L| = 1 where claimed; turns count the poles of the
        closed loop.
        """
        tried = tried_loop(self.exact)
        missed, count = tried.missed(answer.phases_deg[:, 1])
        statement = "number of crossings of the unit circle that are missed"
        over = f"between {count} frequencies"
        found = [Check("missed", statement, float(missed), 0.0, over=over)]
        if not answer.stable:
            return found
        counts = [tried.counted_poles(gain) for gain in _tried(*answer.gain)]
        return [*found, *_late_checks(answer, counts, tried.least_distance())]


def tried_loop(exact: CoupledLoop) -> TriedLoop:
    """The loop, rebuilt from its entries alone."""
    late = exact.whole.channels
    return TriedLoop(late.Q, late.states, np.array(late.delays, dtype=float), exact.channel)


def _late_checks(answer: Any, counts: list[int], nearest: float) -> list[Check]:
    """Checks of the number of unstable poles for gains between the nearest factors, and of the
    least distance.
    """
    claimed = "number of closed-loop poles right of the axis, by the argument principle"
    over = f"for {TRIED_GAINS} gains between the nearest factors"
    excess = answer.modulus / nearest - 1.0 if nearest else math.inf
    statement = "share by which |1 + L| is smaller than claimed where it is tried"
    return [
        Check("encirclements", claimed, float(max(map(abs, counts))), 0.0, over=over),
        Check("distance", statement, excess, CROSSING_ROUNDING),
    ]


def _tried(low: float, high: float) -> RealArray:
    """Gains between two factors, with 1 among them."""
    ends = np.log([max(low, 1 / LARGEST_FACTOR), min(high, LARGEST_FACTOR)])
    room = RANGE_MARGIN * (ends[1] - ends[0])
    gains: RealArray = np.exp(np.linspace(ends[0] + room, ends[1] - room, TRIED_GAINS))
    return np.append(gains, 1.0)


def _crossing(name: str, statement: str, distance: RealArray) -> Check:
    """Check of the largest distance of a claimed crossing from a true one."""
    largest = float(distance.max(initial=0.0))
    return Check(name, statement, largest, CROSSING_ROUNDING, over=THIS_SYSTEM)
