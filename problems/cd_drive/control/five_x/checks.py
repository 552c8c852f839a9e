"""Checks of the study at 5X: closed forms, loops that obey the bounds, and proofs done again."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from workbench import Check
from workbench.arrays import ComplexArray, RealArray
from workbench.heavy_types import Dataset, StateSpace, TransferFunction
from workbench.mu import rank_one_mu
from workbench.program import worst
from workbench.synthesis import SetsAt

from ...drive.plants import ANTIALIASING
from ..control_problem import control_weight, optical_gain, performance_weight
from ..loop_weights import BASIS
from .uncertain_loop import UncertainLoop

LOWEST, HIGHEST = BASIS.band
DENSE = 20_000
"""Number of frequencies at which the closed form must stay below a certified peak."""
PROOF_FREQUENCIES = 1501
"""Frequencies at which a proof is checked; they differ from those it was found on."""
SAMPLES = 4000
"""Number of random T that must lie in the sets of a proof."""
MU_ROUNDING = 1e-4
"""Largest relative error of mu by rounding, in loops of fifty states over nine decades."""
QUADRATURE = 1e-4
"""Largest error of the trapezoidal rule for an integral that is zero, over that of |T h|."""


def five_x_checks(
    uncertain: UncertainLoop,
    controllers: Mapping[str, TransferFunction | StateSpace],
    answer: Dataset,
) -> list[Check]:
    """Check that no closed form lies outside the bounds, and that the proofs hold.

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
            "closed form", "distance of rank-one mu from its bounds, relative", outside, MU_ROUNDING
        ),
        _largest("peaks", "rank-one mu at 20,000 frequencies over the peak, less 1", above, 0.0),
        _largest(
            "least mu", "bound over a controller's mu at a frequency, less 1", beaten, MU_ROUNDING
        ),
    ]
    lower, upper = (answer["peak"].sel(bound=bound).values for bound in ("lower", "upper"))
    crossed, _ = worst(lower / upper - 1, str)
    checks.append(Check("bounds", "lower over upper bound of every peak, less 1", crossed, 0.0))
    best = float(answer["peak"].sel(channel="both", bound="upper").min())
    wide = np.geomspace(LOWEST, HIGHEST, DENSE)
    T = {name: _loop(uncertain, K(2j * np.pi * wide), wide)[0] for name, K in controllers.items()}
    reached = {"nominal": float(answer["nominal_norm"]), "dynamic": best}
    for name, sets in uncertain.sets.items():
        level = float(answer["proven_level"].sel(proof=name))
        if np.isnan(level):
            continue
        x = answer["proof_coefficients"].sel(proof=name).values
        poles = -answer["pole"].values
        label = f"{name} bound"
        statement = "level that none reaches over one that a controller has, less 1"
        checks.append(Check(label, statement, level / reached[name] - 1, 0.0))
        statement = "integral of the largest Re(T h), on other frequencies"
        checks.append(Check(f"{name} proof", statement, _integral(sets, level, x, poles), 0.0))
        statement = "integral of Re(T h) over that of |T h|, of stable loops"
        left = {key: _cauchy(loop, _h(x, poles, 2 * np.pi * wide), wide) for key, loop in T.items()}
        checks.append(_largest(f"{name} analytic", statement, left, QUADRATURE))
        statement = "random T within the level: how far outside their set"
        sampled = _sampled(uncertain, sets, name == "nominal", level)
        checks.append(Check(f"{name} sets", statement, sampled, MU_ROUNDING))
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
    # The sign of c_r does not matter: delta_r may have either.
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
    """Sum of x 2 a / (s + a) times all-passes of the poles before, from the last one on."""
    s, h = 1j * omega, np.zeros(omega.shape, complex)
    for a, each in zip(poles[::-1], x[::-1], strict=True):
        h = (2 * a * each + (s - a) * h) / (s + a)
    return h


def _integral(sets: SetsAt, level: float, x: RealArray, poles: RealArray) -> float:
    """By trapezoids in the logarithm of omega."""
    omega = 2 * np.pi * np.geomspace(LOWEST, HIGHEST, PROOF_FREQUENCIES)
    largest = sets(omega, level).support(_h(x, poles, omega))
    return float(np.trapezoid(largest * omega, np.log(omega)))


def _cauchy(T: ComplexArray, h: ComplexArray, frequency: RealArray) -> float:
    product, logs = T * h * frequency, np.log(frequency)
    whole = np.trapezoid(np.abs(product), logs)
    return float(abs(np.trapezoid(product.real, logs)) / whole)


def _sampled(uncertain: UncertainLoop, sets: SetsAt, nominal: bool, level: float) -> float:
    """Largest distance outside the sets of random T that a level allows, in random directions."""
    rng = np.random.default_rng(0)
    omega = 2 * np.pi * np.exp(rng.uniform(np.log(LOWEST), np.log(HIGHEST), SAMPLES))
    s = 1j * omega
    W_p = np.abs(performance_weight(uncertain.axis, uncertain.speed)(s))
    actuator = uncertain.model.nominal(s) / optical_gain(uncertain.axis)
    W_u = np.abs(control_weight(uncertain.axis)(s) / actuator)
    # About 1 with |W_p (1 - T)|, and about 0 with |W_u T / ACT|, up to the level.
    ball = np.sqrt(rng.uniform(size=SAMPLES)) * np.exp(2j * np.pi * rng.uniform(size=SAMPLES))
    T = np.where(W_p > W_u, 1 + ball * level / W_p, ball * level / W_u)
    others = np.hypot(W_p * np.abs(1 - T), W_u * np.abs(T))
    real = np.zeros_like(T)
    if not nominal:
        others = others + np.abs(uncertain.model.W_c(s) * T)
        real = real if uncertain.model.W_r is None else uncertain.model.W_r(s) * T
    within = rank_one_mu(real, others) <= level
    direction = np.exp(2j * np.pi * rng.uniform(size=SAMPLES))
    outside = (T * direction).real - sets(omega, level).support(direction)
    return float(outside[within].max(initial=-np.inf))


def _largest(name: str, statement: str, found: dict, limit: float) -> Check:
    case = max(found, key=lambda key: found[key])
    return Check(name, statement, float(found[case]), limit, f"at {case}")
