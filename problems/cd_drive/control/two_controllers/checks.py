"""Checks of the two controllers: gains by formula, sampled plants, and that all obey the bounds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from workbench import Check
from workbench.certificate import EVERY_PERTURBATION, quantified_checks, worst_value
from workbench.systems import response
from workbench.types import ComplexArray, Dataset, StateSpace
from workbench.uncertainty import vertex_deltas

from ...drive.plants import ANTIALIASING, controller
from ...uncertainty.parametric.checks import plants
from ...uncertainty.parametric_model import uncertain_parameters
from ..methods.checks import LEVEL_EXCESS, POLE_AND_BOUND_ROUNDING, RANDOM_PLANTS
from ..trade_off import SPLIT, TradeOff

HERTZ = np.geomspace(0.01, 1e6, 8000)
"""Frequencies at which gains are evaluated [Hz]."""
GRID_SHORTFALL = 1e-3
"""Largest accepted shortfall of the gains at these frequencies below the certified ones, relative.
"""


def two_controllers_checks(
    trade: TradeOff, front: list[StateSpace], answer: Dataset
) -> list[Check]:
    """Check that all stabilise with c <= 1, have the stated gains, and obey every bound."""
    import control

    omega = 2 * np.pi * HERTZ
    gains = answer["gain"].values
    reference = control.ss(controller(trade.axis))
    every = [*front, *(gain * reference for gain in gains)]
    names = [f"share {share:.3g}" for share in answer["share"].values]
    names += [f"reference x {gain:.3g}" for gain in gains]

    def named(place: tuple[int, ...]) -> str:
        return names[place[0]]

    poles = [float(control.feedback(trade.G * K, 1).poles().real.max()) for K in every]
    right, unstable = worst_value(poles, named)
    by_formula = np.array([abs(_channels(trade, K, omega)).max(axis=1) for K in every])
    certified = np.concatenate([answer["nominal"].values, answer["reference_nominal"].values])
    above, place = worst_value(by_formula / certified - 1, named)
    missed, spot = worst_value(1 - by_formula / certified, named)
    effort, most = worst_value(answer["nominal"].sel(channel="z_u").values, named)
    bounds = np.concatenate([answer["worst"].values, answer["reference_worst"].values])
    sampled, plant = worst_value(
        [_sampled(trade, K, bounds[i, :, 1]) for i, K in enumerate(every)], named
    )
    crossed, where = worst_value(bounds[..., 0] / bounds[..., 1] - 1, named)
    statement = "rightmost pole of G K / (1 + G K) [rad/s]"
    return [
        Check("nominal stability", statement, right, -POLE_AND_BOUND_ROUNDING, where=unstable),
        *quantified_checks(
            f"at {len(HERTZ)} frequencies",
            [
                Check(
                    "gains", "largest gain over the certified one, less 1", above, 0.0, where=place
                ),
                Check(
                    "gains reached",
                    "1 less the largest gain over the certified one",
                    missed,
                    GRID_SHORTFALL,
                    where=spot,
                ),
            ],
        ),
        Check("effort", "c of the controllers of the front", effort, 1.0, where=most),
        replace(
            Check(
                "sampled plants",
                "largest gain of a plant over the certified worst one, less 1",
                sampled,
                0.0,
                where=plant,
            ),
            over="for the vertices and random plants of the parametric set",
        ),
        replace(
            Check(
                "worst cases",
                "lower over upper bound, less 1",
                crossed,
                POLE_AND_BOUND_ROUNDING,
                where=where,
            ),
            over=EVERY_PERTURBATION,
        ),
        _front(answer),
        *_bounds(answer, certified, names),
        _filters(answer, omega),
    ]


def _channels(trade: TradeOff, K: StateSpace, omega: np.ndarray) -> ComplexArray:
    """W_p S, W_sd T and W_u K_optn K S (3, F), by formula."""
    k, G, W_p, W_sd = (
        response(system, omega)[:, 0, 0] for system in (K, trade.G, trade.W_p, trade.W_sd)
    )
    S = 1 / (1 + G * k)
    return np.array([W_p * S, W_sd * (1 - S), trade.W_KS * k * S])


def _sampled(trade: TradeOff, K: StateSpace, upper: np.ndarray) -> float:
    """|W_p S| and |W_sd T| of vertices and random plants over their bounds, minus 1."""
    box = uncertain_parameters(trade.axis)
    rng = np.random.default_rng(0)
    deltas = np.vstack([vertex_deltas(box), rng.uniform(-1, 1, (RANDOM_PLANTS, len(box)))])
    hertz = np.geomspace(1.0, 2e4, 400)
    omega = 2 * np.pi * hertz
    k, W_p, W_sd = (response(system, omega)[:, 0, 0] for system in (K, trade.W_p, trade.W_sd))
    L = k * plants(trade.axis, deltas, box, hertz) * ANTIALIASING / (1j * omega + ANTIALIASING)
    S = 1 / (1 + L)
    gains = [abs(W_p * S).max(), abs(W_sd * (1 - S)).max()]
    return float((np.array(gains) / upper).max()) - 1


def _front(answer: Dataset) -> Check:
    """Check that no controller of the front has both a and b smaller than another one."""
    a, b = (answer["nominal"].sel(channel=z).values for z in ("z_p", "z_sd"))
    better = np.minimum(a[:, None] / a, b[:, None] / b) - 1
    value, where = worst_value(better, lambda p: f"at share {float(answer['share'][p[0]]):.3g}")
    statement = "excess of a controller's a and b over those of another, less 1"
    return Check("front", statement, value, LEVEL_EXCESS, where=where)


def _bounds(answer: Dataset, certified: np.ndarray, names: list[str]) -> list[Check]:
    """Check that no controller with c <= 1 is below a level that is stated to be out of reach."""
    shares, levels = answer["share"].values, answer["excluded"].values
    a, b, c = certified.T
    allowed = c <= 1.0
    reached = np.maximum(a[:, None], b[:, None] * shares)[allowed] / levels
    kept = [name for name, stays in zip(names, allowed, strict=True) if stays]
    beaten, where = worst_value(1 - reached, lambda p: f"{kept[p[0]]} at share {shares[p[1]]:.3g}")
    return [Check("bounds", "1 less max(a, share b) over its bound", beaten, 0.0, where=where)]


def _filters(answer: Dataset, omega: np.ndarray) -> Check:
    """Check that the squares of the bounds' filters sum to at most 1, and that zeta is within the
    bound.
    """
    excess = []
    for (split, upper, zeta), level in zip(
        np.exp(answer["filters"].values), answer["excluded"].values, strict=True
    ):
        low, high = ((omega / corner) ** (2 * SPLIT) for corner in (split, upper))
        above = low / (1 + low)
        total = 1 / (1 + low) + above / (1 + high) + above * high / (1 + high)
        excess.append(max(float(total.max()) - 1, zeta / level - 1))
    value, where = worst_value(excess, lambda p: f"at share {float(answer['share'][p[0]]):.3g}")
    statement = "squares of a bound's filters, and zeta over the bound, less 1"
    return Check("filters", statement, value, POLE_AND_BOUND_ROUNDING, where=where)
