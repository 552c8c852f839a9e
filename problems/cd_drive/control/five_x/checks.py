"""Checks of the study at 5X: closed forms, loops that obey the bounds, and proofs
verified again.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from workbench import Check
from workbench.certificate import EVERY_PERTURBATION, worst_value
from workbench.mu import rank_one_mu
from workbench.synthesis import (
    AnalyticBasis,
    DualCertificate,
    LoopFunctions,
    LoopWeights,
    least_mu,
)
from workbench.synthesis.limits.allowed_sets import largest_projections
from workbench.synthesis.limits.rational_bounds import FrequencyCells
from workbench.types import ComplexArray, Dataset, RealArray, StateSpace, TransferFunction

from ...drive.plants import ANTIALIASING
from ..control_problem import control_weight, optical_gain, performance_weight
from ..loop_weights import BASIS
from ..mu_pid_analysis.checks import DENSE
from .uncertain_loop import UncertainLoop

LOWEST, HIGHEST = BASIS.band_hz
PROOF_FREQUENCIES = 1501
"""Number of frequencies of the integral that is compared with the proven bound."""
EDGE_RAYS, EDGE_HALVINGS = 90, 20
"""For that integral: number of rays on which the sets' edges are searched, and of halvings on each.
"""
SAMPLES = 4000
"""Number of random T that must lie in the sets of a proof."""
LARGE_LOOP_MU_ROUNDING = 1e-4
"""Largest relative error of mu by rounding, in loops with fifty states over nine decades."""
INTEGRAL_ERROR = 1e-4
"""Largest error of the trapezoidal rule for an integral that is zero, over that of |T h|."""


def five_x_checks(
    uncertain: UncertainLoop,
    controllers: Mapping[str, TransferFunction | StateSpace],
    answer: Dataset,
) -> list[Check]:
    """Check that no closed form is outside the bounds, and that the proofs hold.

    `controllers` are those of the answer, by its names.
    """
    frequency = answer["frequency"].values
    dense = np.geomspace(frequency[0] / 100, 100 * frequency[-1], DENSE)
    outside, above, beaten = {}, {}, {}
    for name, K in controllers.items():
        at_curve, at_dense = K(2j * np.pi * frequency), K(2j * np.pi * dense)
        for channel in answer["channel"].values.tolist():
            case = name, channel
            at = {"controller": name, "channel": channel}
            lower, upper = answer["mu"].sel(at).values
            exact = _closed_form(uncertain, at_curve, channel, frequency)
            outside[case] = np.maximum(lower / exact, exact / upper).max() - 1
            peak = float(answer["peak"].sel(at).sel(bound="upper"))
            above[case] = _closed_form(uncertain, at_dense, channel, dense).max() / peak - 1
            if channel in answer["bounded"].values:
                least = answer["least_mu"].sel(bounded=channel, bound="lower").values
                beaten[case] = (least / exact).max() - 1
    checks = [
        _largest(
            "closed form",
            "distance of rank-one mu from its bounds, relative",
            outside,
            LARGE_LOOP_MU_ROUNDING,
        ),
        replace(
            _largest("peaks", "rank-one mu over the peak, less 1", above, 0.0),
            over=f"at {DENSE:,} frequencies",
        ),
        _largest(
            "least mu",
            "bound over a controller's mu at a frequency, less 1",
            beaten,
            LARGE_LOOP_MU_ROUNDING,
        ),
    ]
    lower, upper = (answer["peak"].sel(bound=bound).values for bound in ("lower", "upper"))
    crossed, _ = worst_value(lower / upper - 1, str)
    statement = "lower over upper bound of every peak, less 1"
    checks.append(Check("bounds", statement, crossed, 0.0, over=EVERY_PERTURBATION))
    best = float(answer["peak"].sel(channel="both", bound="upper").min())
    wide = np.geomspace(LOWEST, HIGHEST, DENSE)
    T = {name: _loop(uncertain, K(2j * np.pi * wide), wide)[0] for name, K in controllers.items()}
    reached = {"nominal": float(answer["nominal_norm"]), "dynamic": best}
    at_one = answer[["pointwise_bound", "pointwise_frequency"]].sel(bounded="both")
    numbers = (float(at_one[name]) for name in ("pointwise_bound", "pointwise_frequency"))
    checks.append(
        Check(
            "pointwise proof",
            "whether any T at all, of whatever controller, is allowed at the pointwise bound",
            float(_any_allowed(uncertain.loops["dynamic"], *numbers)),
            0.0,
        )
    )
    for name, loop in uncertain.loops.items():
        level = float(answer["proven_level"].sel(proof=name))
        if np.isnan(level):
            continue
        x = answer["proof_coefficients"].sel(proof=name).values
        poles = -answer["pole"].values
        label = f"{name} bound"
        statement = "level that none reaches over one that a controller has, less 1"
        checks.append(Check(label, statement, level / reached[name] - 1, 0.0))
        proven = DualCertificate(level, x, AnalyticBasis(poles, BASIS.band_hz)).excess(loop)
        statement = (
            "no stabilising LTI controller: bound on the integral of the largest Re(T h) that the "
            "level allows, over all frequencies, tails and rounding included; zero for each T"
        )
        checks.append(Check(f"{name} proof", statement, proven, -np.finfo(float).tiny))
        statement = "integral of Re(T h) over that of |T h|, of stable loops"
        left = {key: _cauchy(each, _h(x, poles, 2 * np.pi * wide), wide) for key, each in T.items()}
        checks.append(_largest(f"{name} analytic", statement, left, INTEGRAL_ERROR))
        statement = "random T within the level: how far outside their set"
        sampled = _sampled(uncertain, loop, name == "nominal", level)
        checks.append(Check(f"{name} sets", statement, sampled, LARGE_LOOP_MU_ROUNDING))
        statement = "the integral by trapezoids over T found on rays, less the proven bound on it"
        second = _integral(uncertain, name == "nominal", level, x, poles) - proven
        checks.append(Check(f"{name} second opinion", statement, second, INTEGRAL_ERROR))
    return checks


def _closed_form(
    uncertain: UncertainLoop, K: ComplexArray, channel: str, frequency: RealArray
) -> RealArray:
    """Mu of robust performance by transfer functions, those of K given (F,)."""
    s = 2j * np.pi * frequency
    sensor = optical_gain(uncertain.axis) / (1 + s / ANTIALIASING)  # e [m] to f_en
    T, S = _loop(uncertain, K, frequency)
    outputs = {
        "disturbance": performance_weight(uncertain.axis, uncertain.speed)(s) * S,
        "control": control_weight(uncertain.axis)(s) * K * sensor * S,
    }
    chosen = list(outputs.values()) if channel == "both" else [outputs[channel]]
    W_c, W_r = uncertain.model.W_c(s), uncertain.model.W_r
    # The sign of c_r does not matter, since delta_r may have either sign.
    real = np.zeros_like(T) if W_r is None else T * W_r(s)
    return rank_one_mu(real, np.abs(T * W_c) + np.linalg.norm(chosen, axis=0))


def _loop(
    uncertain: UncertainLoop, K: ComplexArray, frequency: RealArray
) -> tuple[ComplexArray, ComplexArray]:
    """T and S of the nominal plant."""
    s = 2j * np.pi * frequency
    L = K * uncertain.model.nominal(s) / (1 + s / ANTIALIASING)
    return L / (1 + L), 1 / (1 + L)


def _h(x: RealArray, poles: RealArray, omega: RealArray) -> ComplexArray:
    """Sum of x 2 a / (s + a) times the all-passes of the previous poles, evaluated from the last
    term.
    """
    s, h = 1j * omega, np.zeros(omega.shape, complex)
    for a, each in zip(poles[::-1], x[::-1], strict=True):
        h = (2 * a * each + (s - a) * h) / (s + a)
    return h


def _any_allowed(loop: LoopFunctions, level: float, frequency: float) -> bool:
    """Whether some complex number K keeps mu at or below a level at a frequency [Hz]."""
    omega = np.array([2 * np.pi * frequency])
    weights, one = loop.over(FrequencyCells(omega, omega)), np.ones((1, 1), complex)
    return bool(largest_projections(weights, level, one, np.zeros(1)).max() > -np.inf)


def _integral(
    uncertain: UncertainLoop, nominal: bool, level: float, x: RealArray, poles: RealArray
) -> float:
    """Integral of Re(T h) by trapezoids in log omega, with the best T on the sets' edges.

    The edges are found by bisection of mu on rays from the T with the least mu.
    """
    omega = 2 * np.pi * np.geomspace(LOWEST, HIGHEST, PROOF_FREQUENCIES)
    W_p, W_u, W_c, W_r = _weights(uncertain, omega, nominal)
    inside = least_mu(LoopWeights(W_p, W_u, W_c, W_r)).T
    ray = np.exp(2j * np.pi * np.arange(EDGE_RAYS)[:, None] / EDGE_RAYS)
    low = np.zeros((EDGE_RAYS, len(omega)))
    high = low + 2.0 * np.minimum(1.0 + level / W_p, level / W_u)
    for _ in range(EDGE_HALVINGS):
        r = (low + high) / 2
        T = inside + r * ray
        others = np.hypot(W_p * np.abs(1 - T), W_u * np.abs(T)) + W_c * np.abs(T)
        within = rank_one_mu(W_r * T, others) <= level
        low, high = np.where(within, r, low), np.where(within, high, r)
    largest = ((inside + low * ray) * _h(x, poles, omega)).real.max(axis=0)
    return float(np.trapezoid(largest * omega, np.log(omega)))


def _cauchy(T: ComplexArray, h: ComplexArray, frequency: RealArray) -> float:
    product, logs = T * h * frequency, np.log(frequency)
    whole = np.trapezoid(np.abs(product), logs)
    return float(abs(np.trapezoid(product.real, logs)) / whole)


def _sampled(uncertain: UncertainLoop, loop: LoopFunctions, nominal: bool, level: float) -> float:
    """Largest distance outside the sets of random T that a level allows, in random directions."""
    rng = np.random.default_rng(0)
    omega = 2 * np.pi * np.exp(rng.uniform(np.log(LOWEST), np.log(HIGHEST), SAMPLES))
    W_p, W_u, W_c, W_r = _weights(uncertain, omega, nominal)
    # Discs about 1 with |W_p (1 - T)| and about 0 with |W_u T / ACT|, both up to the level.
    ball = np.sqrt(rng.uniform(size=SAMPLES)) * np.exp(2j * np.pi * rng.uniform(size=SAMPLES))
    T = np.where(W_p > W_u, 1 + ball * level / W_p, ball * level / W_u)
    others = np.hypot(W_p * np.abs(1 - T), W_u * np.abs(T)) + W_c * np.abs(T)
    within = rank_one_mu(W_r * T, others) <= level
    direction = np.exp(2j * np.pi * rng.uniform(size=SAMPLES))
    sets, slack = loop.over(FrequencyCells(omega, omega)), np.full(SAMPLES, LARGE_LOOP_MU_ROUNDING)
    bound = largest_projections(sets, level, direction[:, None], slack)[:, 0]
    return float(((T * direction).real - bound)[within].max(initial=-np.inf))


def _weights(
    uncertain: UncertainLoop, omega: RealArray, nominal: bool
) -> tuple[RealArray, RealArray, RealArray, ComplexArray]:
    """|W_p|, |W_u / ACT|, |W_c| and W_r at frequencies [rad/s] (F,), by transfer functions."""
    s = 1j * omega
    actuator = uncertain.model.nominal(s) / optical_gain(uncertain.axis)
    W_r = None if nominal else uncertain.model.W_r
    return (
        np.abs(performance_weight(uncertain.axis, uncertain.speed)(s)),
        np.abs(control_weight(uncertain.axis)(s) / actuator),
        np.zeros(omega.shape) if nominal else np.abs(uncertain.model.W_c(s)),
        np.zeros(omega.shape, complex) if W_r is None else W_r(s),
    )


def _largest(name: str, statement: str, found: dict, limit: float) -> Check:
    case = max(found, key=lambda key: found[key])
    return Check(name, statement, float(found[case]), limit, where=f"at {case}")
