"""Weights for synthesis from three numbers: the gains at both ends, and the crossover."""

from __future__ import annotations

import math

import numpy as np

from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError
from workbench.input_checks import is_real, need_count, need_positive
from workbench.systems.realisation import Matrices, in_series, realisation


def weight(
    *, dc: float, crossover: float, high: float, order: int = 1, dt: float = 0.0
) -> StateSpace:
    """A stable weight from its gains at low and high frequencies and its crossover frequency.

    It is (h s + a d) / (s + a) to the power `order`, where d and h are the order-th roots of both
    gains. Its gain changes monotonically from one end to the other.

    Parameters
    ----------
    dc
        Gain at zero frequency; ``inf`` for an integrator.
    crossover
        Frequency [rad/s] at which the gain is 1.
    high
        Gain at high frequencies, in sampled time at half the sampling rate.
    order
        Number of states: with more states the gain changes more steeply around the crossover.
    dt
        Sampling time [s]; 0: continuous time. The gains at both ends and at the crossover are kept.

    Raises
    ------
    InputError
        A gain is negative, `high` is infinite, or both lie on one side of 1, where no gain between
        them is 1; the crossover is not below half the sampling rate.

    Examples
    --------
    >>> from workbench.synthesis import weight
    >>> W = weight(dc=100.0, crossover=10.0, high=0.5)
    >>> [round(float(abs(W(1j * omega))), 6) for omega in (0.0, 10.0, 1e9)]
    [100.0, 1.0, 0.5]

    References
    ----------
    S. Skogestad, I. Postlethwaite, Multivariable Feedback Control, 2nd ed., Wiley 2005, section
    2.8.2, has it for sensitivities, with poles and zeros that are repeated like these.
    """
    need_positive(crossover, "crossover")
    need_count("order", order)
    _need_gains(dc, high)
    if dt:
        need_positive(dt, "dt")
        if not crossover * dt < math.pi:
            raise InputError(
                f"crossover is {crossover:.6g} rad/s; it must be below half the sampling rate, "
                f"{math.pi / dt:.6g} rad/s"
            )
    one = _lag(dc ** (1.0 / order), float(crossover), high ** (1.0 / order), float(dt))
    found = one
    for _ in range(order - 1):
        found = in_series(found, one)
    return realisation(found, float(dt))


def _need_gains(dc: float, high: float) -> None:
    """Raise InputError unless 1 lies between both gains and `high` is finite."""
    for name, gain in (("dc", dc), ("high", high)):
        if not (is_real(gain) and gain >= 0.0):
            raise InputError(f"{name} is {gain!r}; it must be a gain, a number of at least 0")
    if math.isinf(high):
        raise InputError(
            "high is inf; a weight with a gain that rises without end is improper: give the gain "
            "at which it may level off"
        )
    if not min(dc, high) < 1.0 < max(dc, high):
        raise InputError(
            f"dc is {dc:g} and high is {high:g}; the gain is 1 at a crossover only where one of "
            "them is above 1 and the other below"
        )


def _lag(d: float, crossover: float, h: float, dt: float) -> Matrices:
    """h + a (d - h) / (s + a), with gain 1 at the crossover; for infinite d, h + b / s."""
    # a^2 (d^2 - 1) = crossover^2 (1 - h^2), in factors that neither cancel nor overflow
    slow = math.sqrt(abs(1.0 - h)) * math.sqrt(1.0 + h)
    ratio = slow if math.isinf(d) else slow / (math.sqrt(abs(d - 1.0)) * math.sqrt(d + 1.0))
    corner = 0.0 if math.isinf(d) else ratio
    gain = ratio if math.isinf(d) else ratio * (d - h)
    if not dt:
        pole, gain, direct = -corner * crossover, gain * crossover, h
    else:
        # s = k (z - 1) / (z + 1), where k belongs to the crossover
        k = 1.0 / math.tan(crossover * dt / 2.0)
        pole, rest = (k - corner) / (k + corner), gain / (k + corner)
        gain, direct = rest * 2.0 * k / (k + corner), h + rest
    root = math.sqrt(abs(gain))
    A, B = np.array([[pole]]), np.array([[root]])
    return A, B, np.array([[math.copysign(root, gain)]]), np.array([[direct]])
