"""Gain, phase, delay and modulus margins of a loop, with every crossing.

The crossings are roots of polynomials with exact coefficients, so that none is missed and none is
an effect of rounding (see `workbench.mu.loops.crossings`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from workbench._core.arrays import RealArray
from workbench.answer import Answer
from workbench.errors import InputError
from workbench.input_checks import need_sampling_time
from workbench.mu.loops.coupled_loop import CoupledLoop
from workbench.mu.loops.crossings import ExactLoop, exact_loop
from workbench.mu.loops.delayed_loop import DelayedLoop
from workbench.mu.loops.late_pair import late_pair
from workbench.mu.margins.classical_checks import (
    ClassicalChecker,
    CoupledChecker,
    DelayedChecker,
)
from workbench.systems.conversion import as_system
from workbench.systems.joints import part_of, system_of
from workbench.uncertainty.algebra.dead_time import dead_times
from workbench.uncertainty.algebra.rational_delays import rational_part
from workbench.uncertainty.algebra.system import UncertainSystem, uncertain

UNSTABLE = "the closed loop is UNSTABLE"
NOT_TOLD = "the data do not tell whether the closed loop is stable"


@dataclass(frozen=True, eq=False, repr=False)
class ClassicalMargins(Answer):
    """Every crossing of a loop that is closed with negative feedback, and the least margins.

    Unlike `LoopMargins`, it is of one loop transfer function, with all its crossings.

    ``gains`` (K, 2): gain factors that put a pole of the closed loop on the axis, each with the
    frequency [rad/s] of that pole. ``phases_deg`` (K, 2): phase margin [deg] at each frequency with
    |L| = 1; negative ones are margins against lead. ``delays`` (K, 2): the least delay [s] that
    puts a pole of the closed loop at each of these frequencies. ``modulus`` is the distance of L
    from -1, a proven lower bound; 0 if the loop is not ``stable``, or if rounding of its entries
    decides on stability. ``dt`` [s] is the sampling time, 0 in continuous time.

    Examples
    --------
    >>> import control
    >>> from workbench.mu import ClassicalMargins, loop_margins
    >>> found = loop_margins(control.tf([4], [1, 3, 3, 1])).classical["loop"]
    >>> isinstance(found, ClassicalMargins), round(found.gain[1], 6)
    (True, 2.0)
    """

    gains: RealArray
    phases_deg: RealArray
    delays: RealArray
    modulus: float
    stable: bool
    dt: float = field(default=0.0, kw_only=True)

    @property
    def gain(self) -> tuple[float, float]:
        """The nearest destabilising factors below and above 1; 0 and infinity if there is none."""
        return nearest_factors(self.gains)

    @property
    def gain_db(self) -> float:
        """The least change of the gain, up or down [dB]."""
        return least_db(self.gain)

    @property
    def phase_deg(self) -> float:
        """The least phase margin [deg]; negative against lead, infinite without a crossing."""
        return least_phase(self.phases_deg)

    @property
    def delay(self) -> float:
        """The least delay margin [s]; infinite without a crossing."""
        return least_delay(self.delays)

    def lines(self) -> list[str]:
        """The least margins with their frequencies, one per line."""
        low, high = (f"{factor:.4g}{_at(self.gains, factor)}" for factor in self.gain)
        late = delay_in_words(self.delay, self.dt)
        return [
            f"gain from {low} to {high}",
            f"phase {self.phase_deg:.4g} degrees{_at(self.phases_deg, self.phase_deg)}",
            f"delay {late}{_at(self.delays, self.delay)}",
            f"modulus {self.modulus:.4g}",
        ]

    def summary(self) -> str:
        state = "" if self.stable else f"{UNSTABLE}; "
        first, *others = self.lines()
        return "\n  ".join([f"ClassicalMargins: {state}{first}", *others])


def nearest_factors(gains: RealArray) -> tuple[float, float]:
    """The nearest factors below and above 1 in a table of crossings; 0 and infinity if none."""
    factors = gains[:, 0]
    low = factors[factors < 1].max(initial=0.0)
    return float(low), float(factors[factors > 1].min(initial=math.inf))


def least_phase(phases: RealArray) -> float:
    """The phase of least size in a table of crossings; infinite for an empty table."""
    return float(min(phases[:, 0], key=abs, default=math.inf)) + 0.0  # no -0


def least_delay(delays: RealArray) -> float:
    """The least delay in a table of crossings; infinite for an empty table."""
    return float(delays[:, 0].min(initial=math.inf))


def least_db(gain: tuple[float, float]) -> float:
    """The least change of a gain [dB], given the nearest factors below and above 1."""
    low, high = gain
    with np.errstate(divide="ignore"):
        return float(20 * min(np.log10(high), -np.log10(max(low, 0.0))))


def delay_in_words(delay: float, dt: float) -> str:
    """A delay [s] in words; for a sampled loop in samples too."""
    return f"{delay:.4g} s ({delay / dt:.4g} samples)" if dt else f"{delay:.4g} s"


def in_both_units(omega: float) -> str:
    """A frequency [rad/s] in words, in Hz too."""
    return f"{omega:.4g} rad/s ({omega / (2 * math.pi):.4g} Hz)"


def _at(rows: RealArray, value: float) -> str:
    """The frequency at which a margin of a table occurs, in words."""
    omega = rows[rows[:, 0] == value, 1]
    if not omega.size:
        return ""
    if math.isinf(omega[0]):
        return " in the limit of infinite frequency"
    return f" at {in_both_units(float(omega[0]))}"


def classical_margins(loop: Any) -> ClassicalMargins:
    """Margins of a loop of one input and one output, closed with negative feedback.

    Parameters
    ----------
    loop
        L: StateSpace or TransferFunction, in continuous or sampled time; or an object that holds
        one. Known dead time (`workbench.uncertainty.delay`) is treated exactly.

    Raises
    ------
    InputError
        L has several inputs or outputs, or is sampled without a given sampling time; or |L| with
        dead time is 1 or more at infinity.
    """
    late = _late(loop)
    if late is None:
        L = as_system(loop, "loop")
        _need_single(L)
        need_sampling_time(L.dt, "the loop")
        if L.D[0, 0] == -1.0:
            raise InputError(
                "the loop is singular through its direct term: 1 + L is 0 at infinite frequency; a "
                "lag in plant or controller removes that"
            )
        exact: ExactLoop | DelayedLoop = exact_loop(system_of(loop, "loop"), L)
        return margins_of(exact).with_checker(ClassicalChecker(exact, L))
    return margins_of_late(late_loop(late))


def _late(loop: Any) -> UncertainSystem | None:
    """The loop if it has known dead time; else None."""
    part = part_of(loop, "loop")
    return part if isinstance(part, UncertainSystem) and dead_times(part.elements) else None


def _need_single(L: Any) -> None:
    if (L.noutputs, L.ninputs) != (1, 1):
        raise InputError(
            f"loop has {L.noutputs} outputs and {L.ninputs} inputs; one of each is needed"
        )


def late_loop(loop: UncertainSystem) -> DelayedLoop | CoupledLoop:
    """The loop of one channel with known dead time, all else nominal.

    Raises
    ------
    InputError
        |L|, or the gain of an inner loop, is 1 or more at infinity with dead time.
    """
    _need_single(loop)
    names = ", ".join(dead_times(loop.elements))
    delayed, rational = rational_part(loop)
    # not in series with the rest: some path goes round the dead time, or leads back
    if delayed is None:
        return late_pair(loop, uncertain(1.0)).loops[0]
    R = rational.nominal
    if abs(R.D[0, 0]) >= 1.0:
        raise InputError(
            f"|L| is {abs(R.D[0, 0]):.6g} at infinity: with the dead time {names} the closed loop "
            "has infinitely many unstable poles, or is on the border to that; below 1 is needed"
        )
    return DelayedLoop(exact_loop(R, R), delayed)


def margins_of_late(exact: DelayedLoop | CoupledLoop) -> ClassicalMargins:
    """The margins of a loop with dead time."""
    if isinstance(exact, CoupledLoop):
        return margins_of(exact).with_checker(CoupledChecker(exact))
    return margins_of(exact).with_checker(DelayedChecker(exact, exact.rational.system))


def margins_of(exact: ExactLoop | DelayedLoop | CoupledLoop) -> ClassicalMargins:
    """The margins of a loop whose crossings are known."""
    real, unit = exact.real_crossings(), exact.unit_crossings()
    negative = [one for one in real if one.value.real < 0]
    gains = np.array([[-1.0 / one.value.real, one.omega] for one in negative]).reshape(-1, 2)
    omega = np.array([one.omega for one in unit])
    phase = np.degrees(np.angle([-one.value for one in unit]))
    delays = np.column_stack([np.radians(np.mod(phase, 360.0)) / omega, omega])
    stable = exact.stable()
    modulus = exact.modulus() if stable else 0.0
    dt = exact.period if isinstance(exact, ExactLoop) else 0.0
    return ClassicalMargins(gains, np.column_stack([phase, omega]), delays, modulus, stable, dt=dt)
