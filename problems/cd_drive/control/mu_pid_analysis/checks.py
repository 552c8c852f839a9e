"""Checks of the mu-PID's analysis: closed forms, sampled plants, and order of the
four conditions.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import product

import numpy as np

from workbench import Check
from workbench.certificate import EVERY_PERTURBATION, worst_value
from workbench.mu import rank_one_mu
from workbench.types import Dataset, RealArray
from workbench.uncertainty import cover_function, vertex_deltas

from ...drive.plants import ANTIALIASING, controller
from ...drive.tables import Axis
from ...uncertainty.parametric.checks import plants
from ...uncertainty.parametric_model import uncertain_parameters
from ..control_problem import control_weight, optical_gain, performance_weight

DENSE = 20_000
"""Number of frequencies at which the closed form must stay below a certified peak."""
MU_ROUNDING = 1e-6
"""Largest relative distance of the closed form outside the bounds of mu."""


def mu_pid_checks(
    axis: Axis, covers: Mapping[tuple[str, str], Dataset], answer: Dataset
) -> list[Check]:
    """Check that no closed form and no sampled plant is outside the bounds.

    `covers` holds the dataset of each cover, by its form and gain variant.
    """
    frequency = answer["frequency"].values
    dense = np.geomspace(frequency[0] / 100, 100 * frequency[-1], DENSE)
    outside, above = {}, {}
    for case in product(
        answer["gain"].values,
        answer["speed"].values,
        answer["single"].values,
        ("circle", "stadium"),
    ):
        gain, speed, single, form = case
        cover = covers[form, gain]
        at = {"gain": gain, "speed": speed, "channel": single, "form": form}
        lower, upper = answer["mu"].sel(at).values
        exact = _closed_form(axis, cover, speed, single, frequency)
        outside[case] = np.maximum(lower / exact, exact / upper).max() - 1
        peak = answer["peak"].sel(at).sel(condition="robust performance", bound="upper")
        above[case] = _closed_form(axis, cover, speed, single, dense).max() / float(peak) - 1
    checks = [
        _largest(
            "closed form",
            "distance of rank-one mu from its bounds, relative",
            outside,
            MU_ROUNDING,
        ),
        replace(
            _largest("peaks", "rank-one mu over the peak, less 1", above, 0.0),
            over=f"at {DENSE:,} frequencies",
        ),
    ]
    sampled = {speed: _sampled(axis, speed, answer) for speed in answer["speed"].values}
    checks.append(
        replace(
            _largest("sampled plants", "|W_p S| of plants over the peak, less 1", sampled, 0),
            over="for the vertices and 200 random plants of the parametric set",
        )
    )
    lower, upper = (answer["peak"].sel(bound=bound).values for bound in ("lower", "upper"))
    crossed, _ = worst_value(lower / upper - 1, str)
    statement = "lower over upper bound of every peak, less 1"
    checks.append(Check("bounds", statement, crossed, 0.0, over=EVERY_PERTURBATION))
    return checks


def _closed_form(
    axis: Axis, cover: Dataset, speed: float, single: str, frequency: RealArray
) -> RealArray:
    """Mu of robust performance from L = K G AAF and the weights, without a generalised plant."""
    s = 2j * np.pi * frequency
    G, W_c, W_r = (cover_function(cover, name) for name in ("nominal", "W_c", "W_r"))
    assert G is not None and W_c is not None
    omega = 2 * np.pi * frequency
    K = controller(axis)(s)
    L = K * G.response(omega) / (1 + s / ANTIALIASING)
    T, S = L / (1 + L), 1 / (1 + L)
    if single == "disturbance":
        weighted = performance_weight(axis, speed)(s) * S
    else:
        into = K * optical_gain(axis) / (1 + s / ANTIALIASING)  # e [m] to u [V]
        weighted = control_weight(axis)(s) * into * S
    # The sign of c_r does not matter, since delta_r may have either sign.
    real = np.zeros_like(T) if W_r is None else -T * W_r.response(omega)
    return rank_one_mu(real, np.abs(T * W_c.response(omega)) + np.abs(weighted))


def _sampled(axis: Axis, speed: float, answer: Dataset) -> float:
    """Largest |W_p S| of the vertices and of random plants in the box of parameters, over the
    bound.

    The bound beta of mu holds beta >= |W_p S| for perturbations up to 1 / beta.
    """
    box = uncertain_parameters(axis)
    rng = np.random.default_rng(0)
    peak = float(
        answer["peak"].sel(
            gain="own", speed=speed, channel="disturbance", form="parametric",
            condition="robust performance", bound="upper",
        )
    )  # fmt: skip
    deltas = np.vstack([vertex_deltas(box), rng.uniform(-1, 1, (200, len(box)))]) / peak
    frequency = answer["frequency"].values
    s = 2j * np.pi * frequency
    L = controller(axis)(s) * plants(axis, deltas, box, frequency)
    S = 1 / (1 + L / (1 + s / ANTIALIASING))
    return float(np.abs(performance_weight(axis, speed)(s) * S).max()) / peak - 1


def _largest(name: str, statement: str, found: dict, limit: float) -> Check:
    case = max(found, key=lambda key: found[key])
    return Check(name, statement, float(found[case]), limit, where=f"at {case}")
