"""Starts by rules for lags with dead time (SIMC).

The nominal plant becomes k e^(-delay s) / ((tau1 s + 1)(tau2 s + 1)) by the half rule: the largest
neglected lag is shared between the lag before it and the dead time; smaller lags and zeros right of
the axis count as dead time. The closed-loop time constant then gives the gains of a series PID
controller; several time constants are tried.

Source: S. Skogestad, Simple analytic rules for model reduction and PID controller tuning, J.
Process Control 13 (2003) 291-309. For an unstable lag, the PI controller whose loop has two equal
poles: G. P. Rotstein, D. R. Lewin, Simple PI and PID tuning for open-loop unstable systems, Ind.
Eng. Chem. Res. 30 (1991) 1864-1869.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from workbench._core.heavy_types import StateSpace
from workbench.synthesis.mu.structured.starts.search import Search
from workbench.systems.generalised_plant import response

CLOSED_LOOP_TIMES = tuple(np.geomspace(0.1, 10.0, 7))
"""Closed-loop time constants, relative to the plant's own time, which is its dead time or a tenth
of its lag.
"""
FARTHEST = 1e8
"""A zero of this size, relative to the largest pole, is a zero at infinity with rounding errors."""
AT_ZERO = 1e-9
"""Poles and zeros below this size, relative to the largest, count as 0."""
FILTER_SHARE = 0.1
"""Time constant of the derivative's filter, relative to the derivative time and to the closed-loop
time.
"""
FAST_ZERO = 0.5
"""A zero left of the axis shortens the dead time if its time constant is at most this share of the
least lag.
"""
LOW_SHARE = 1e-3
"""Frequency at which the gain is evaluated, relative to the lowest corner."""
PID_TERMS = tuple[float, float, float, float]
"""Gains P, I, D and the filter T [s]."""


@dataclass(frozen=True)
class LagModel:
    """gain e^(-delay s) / s^integrators / product of (tau s + 1), slow lags first; times in s.

    Unlike a `StateSpace`, it has the few numbers, and the delay, on which tuning rules depend.

    ``unstable``: the first lag is (tau s - 1) in place of (tau s + 1).
    """

    gain: float
    integrators: int
    lags: tuple[float, ...]
    delay: float
    unstable: bool

    def shortened(self, kept: int) -> LagModel:
        """The model with `kept` lags, by the half rule."""
        lags, delay = list(self.lags), self.delay
        if len(lags) > kept:
            half = lags[kept] / 2
            if kept:
                lags[kept - 1] += 0.0 if self.unstable and kept == 1 else half
            delay += half + sum(lags[kept + 1 :])
        return LagModel(self.gain, self.integrators, tuple(lags[:kept]), delay, self.unstable)

    @property
    def time(self) -> float:
        """The plant's own time [s]: its dead time, or a share of its largest lag."""
        return max(self.delay, 0.1 * max(self.lags, default=0.0)) or 1.0


def lag_rules(search: Search) -> Iterator[StateSpace]:
    """The members nearest to PI and PID controllers from the rules, fast and slow."""
    yield from search.members(_targets(search))


def _targets(search: Search) -> Iterator[StateSpace]:
    found = search.loops()
    if found is None:
        return
    plants, whole = found
    models = [lag_model(H) for H in plants]
    known = [model for model in models if model is not None]
    if len(known) < len(models):
        return
    for factor in CLOSED_LOOP_TIMES:
        for terms in (pi_terms, pid_terms):
            each = [terms(model, factor * model.time) for model in known]
            made = [three_term_controller(*one) for one in each if one is not None]
            if len(made) == len(known):
                yield whole(made)


def lag_model(H: StateSpace) -> LagModel | None:
    """The lags, integrators and dead time that approximate a plant; None if the plant has no such
    model.
    """
    poles, zeros = H.poles(), H.zeros()
    zeros = zeros[np.abs(zeros) <= FARTHEST * np.abs(poles).max(initial=0.0)]
    largest = float(np.abs(np.concatenate([poles, zeros])).max(initial=0.0))
    small = AT_ZERO * largest
    integrators = int((np.abs(poles) <= small).sum())
    moving, turned = poles[np.abs(poles) > small], zeros[np.abs(zeros) > small]
    right = moving[moving.real > 0]
    if (
        len(turned) < len(zeros)
        or integrators > 2
        or len(right) > 1
        or (integrators and len(right))
    ):
        return None  # no static gain, or more than the rules cover
    lags = sorted((1.0 / np.abs(moving[moving.real <= 0])).tolist(), reverse=True)
    delay = float((1.0 / np.abs(turned[turned.real >= 0])).sum())
    for zero in np.sort(1.0 / np.abs(turned[turned.real < 0]))[::-1].tolist():
        if lags and zero > FAST_ZERO * min(lags):  # the zero and the nearest lag cancel
            lags.pop(int(np.argmin(np.abs(np.log(np.array(lags) / zero)))))
        else:
            delay -= zero
    corner = float(np.abs(np.concatenate([moving, turned])).min(initial=np.inf))
    s = LOW_SHARE * (corner if np.isfinite(corner) else 1.0)
    gain = (complex(response(H, [s])[0, 0, 0]) * (1j * s) ** integrators).real
    if len(right):
        lags, gain = [1.0 / abs(right[0]), *lags], -gain
    delay = max(delay, 0.0)
    return LagModel(gain, integrators, tuple(lags), delay, bool(len(right))) if gain else None


def pi_terms(model: LagModel, closed: float) -> PID_TERMS | None:
    """Gains of the PI controller for a closed-loop time constant [s]; None without a rule."""
    if model.integrators == 2:
        return None
    short = model.shortened(1 - model.integrators)
    if short.unstable:
        (tau,) = short.lags
        wait = closed + short.delay
        Kc = (1.0 + 2.0 * tau / wait) / short.gain
        return Kc, tau / wait**2 / short.gain, 0.0, FILTER_SHARE * closed
    Kc, tau_I = _simc(short, closed)
    return Kc, Kc / tau_I, 0.0, FILTER_SHARE * closed


def pid_terms(model: LagModel, closed: float) -> PID_TERMS | None:
    """Gains of the PID controller for a closed-loop time constant [s]; None without a rule."""
    if model.unstable:
        return None
    if model.integrators == 2:
        wait = 4.0 * (closed + model.shortened(0).delay)
        Kc, tau_I, tau_D = 4.0 / (model.gain * wait**2), wait, wait
    else:
        short = model.shortened(2 - model.integrators)
        if len(short.lags) + short.integrators < 2:
            return None
        tau_D = short.lags[-1]
        Kc, tau_I = _simc(short, closed)
    # from series to parallel form
    return Kc * (1 + tau_D / tau_I), Kc / tau_I, Kc * tau_D, FILTER_SHARE * min(tau_D, closed)


def _simc(short: LagModel, closed: float) -> tuple[float, float]:
    """Gain and integral time of the series form."""
    wait = closed + short.delay
    if short.integrators:
        return 1.0 / (short.gain * wait), 4.0 * wait
    tau = short.lags[0] if short.lags else 0.0
    if tau == 0.0:  # for a pure gain, an integrator
        tau = FILTER_SHARE * wait
    return tau / (short.gain * wait), min(tau, 4.0 * wait)


def three_term_controller(P: float, I: float, D: float, T: float) -> StateSpace:  # noqa: E741
    """The controller P + I / s + D s / (T s + 1)."""
    import control

    K = control.ss([[0.0]], [[1.0]], [[I]], [[P]])
    return K + control.ss([[-1.0 / T]], [[1.0 / T]], [[-D / T]], [[D / T]]) if D else K
