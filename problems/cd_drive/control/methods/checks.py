"""Checks of the methods' comparison: loops by other equations, optimality of each, sampled plants.

Nothing here uses the generalised plants on which controllers are judged, except for the two
criteria that are defined by such a plant.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from workbench import Check
from workbench.certificate import EVERY_FREQUENCY, worst_value
from workbench.synthesis import DesignTask
from workbench.systems import response
from workbench.types import ComplexArray, Dataset, RealArray, StateSpace
from workbench.uncertainty import ParametricModel, UncertaintyModel, vertex_deltas

from ...drive.plants import ANTIALIASING
from ...drive.tables import Axis
from ...uncertainty.parametric.checks import plants
from ...uncertainty.parametric_model import uncertain_parameters

ControllersByName = dict[str, "StateSpace"]
UncertainModel = UncertaintyModel | ParametricModel
HERTZ = np.geomspace(0.01, 1e5, 5000)
"""Frequencies at which criteria are evaluated [Hz]."""
WIDE_FREQUENCIES = np.geomspace(1e-6, 1e8, 8000)
"""Frequencies over which mean squares are integrated [Hz]."""
QUADRATURE = 1e-4
"""Largest relative error of that integral."""
LEVEL_EXCESS = 2e-3
"""Largest accepted excess of a controller over the least level, relative; they are made for 1e-3
above it.
"""
SEARCHED_EXCESS = 2.5e-2
"""The same for a controller whose level was searched on a grid of signal sizes."""
POLE_AND_BOUND_ROUNDING = 1e-6
"""Rounding error of poles [rad/s] and of ratios of certified bounds."""
COMPLEX_GROWTH = 1.01
"""Robust stability is certified with 1 % of complex uncertainty added to real scalars."""
RANDOM_PLANTS = 100
"""Number of random plants."""


def method_checks(
    axis: Axis,
    uncertain: UncertainModel,
    task: DesignTask,
    controllers: ControllersByName,
    answer: Dataset,
) -> list[Check]:
    """Check that all loops are stable, that peaks are in order, and that each method is best at its
    own aim.
    """
    names = list(controllers)
    poles = [rightmost_pole(task, K) for K in controllers.values()]
    right, where = worst_value(poles, lambda i: names[i[0]])
    statement = "rightmost pole of G K / (1 + G K) [rad/s]"
    stable = Check("nominal stability", statement, right, -POLE_AND_BOUND_ROUNDING, where=where)
    found = [replace(stable, over="for nominal loops")]
    found += [*_order(answer), _sampled(axis, uncertain, task, controllers, answer)]
    criteria = {
        "LQG": (_mean_squares, QUADRATURE, "mean square"),
        "mixed sensitivity": (
            _stacks,
            LEVEL_EXCESS,
            "eq. 5.6",
        ),
        "full block": (
            _full_blocks,
            SEARCHED_EXCESS,
            "norm",
        ),
    }
    for name, (criterion, slack, quantity) in criteria.items():
        if name in controllers:
            values = criterion(task, controllers)
            others = min(value for each, value in values.items() if each != name)
            excess = values[name] / others - 1
            statement = f"its {quantity} over the least of the others, less 1"
            best = Check(f"{name} is best at its own", statement, excess, slack)
            found.append(replace(best, over=f"at {len(HERTZ)} frequencies, for these controllers"))
    if "loop shaping" in controllers:
        statement = "1 less its margin over the largest, by the Hankel norm"
        missed = _margin_missed(task, controllers["loop shaping"])
        found.append(Check("loop shaping is best at its own", statement, missed, LEVEL_EXCESS))
    return found


def rightmost_pole(task: DesignTask, K: StateSpace) -> float:
    """Largest real part of the roots of den G den K + num G num K."""
    import control

    return float(control.feedback(task.nominal * K, 1).poles().real.max())


def _order(answer: Dataset) -> list[Check]:
    """Check that the peak is larger with more uncertainty or more channels."""
    peak, names = answer["peak"], answer["design"].values
    statements = [
        ("nominal performance", "robust performance", 1.0),
        ("disturbance alone", "robust performance", 1.0),
        ("robust stability", "complex scalars", COMPLEX_GROWTH),
        ("robust performance", "complex scalars", 1.0),
        ("complex scalars", "full block", 1.0),
    ]
    found = []
    for small, large, factor in statements:
        lower = peak.sel(condition=small, bound="lower").values
        ratio = lower / (factor * peak.sel(condition=large, bound="upper").values)
        value, where = worst_value(ratio - 1, lambda i: str(names[i[0]]))
        statement = f"lower bound of {small} over the upper one of {large}, less 1"
        over = f"{EVERY_FREQUENCY}, for these controllers"
        name = f"{small} below {large}"
        found.append(Check(name, statement, value, POLE_AND_BOUND_ROUNDING, where=where, over=over))
    return found


def _mean_squares(task: DesignTask, controllers: ControllersByName) -> dict[str, float]:
    """The H2 norm for which LQG is made, by quadrature over the logarithm of frequency."""
    omega = 2 * np.pi * WIDE_FREQUENCIES

    def size(K: StateSpace) -> float:
        square = (abs(response(task.quadratic.close(K), omega)) ** 2).sum(axis=(1, 2))
        return math.sqrt(float(np.trapezoid(square * omega, np.log(omega))) / np.pi)

    return {name: size(K) for name, K in controllers.items()}


def _stacks(task: DesignTask, controllers: ControllersByName) -> dict[str, float]:
    """The largest of [W_p S; W_u K_optn K S] at frequencies."""
    omega = 2 * np.pi * HERTZ
    G, W_p = response(task.nominal, omega)[:, 0, 0], response(task.W_S, omega)[:, 0, 0]

    def size(K: StateSpace) -> float:
        k = response(K, omega)[:, 0, 0]
        S = 1 / (1 + G * k)
        return float(np.hypot(abs(W_p * S), abs(task.W_KS * k * S)).max())

    return {name: size(K) for name, K in controllers.items()}


def _full_blocks(task: DesignTask, controllers: ControllersByName) -> dict[str, float]:
    """Largest gain over the frequencies, with the scaling of the perturbation's signals that is
    best for the controller made against a full block.
    """
    omega = 2 * np.pi * HERTZ
    structure = task.structure
    loops = {
        name: response(task.full_block_plant(1.0).close(K), omega)
        for name, K in controllers.items()
    }

    def norm(N: ComplexArray, size: float) -> float:
        left, right = np.ones(N.shape[1]), np.ones(N.shape[2])
        left[: structure.columns], right[: structure.rows] = size, 1 / size
        scaled = left[:, None] * N * right
        return float(np.linalg.norm(scaled, 2, axis=(1, 2)).max())

    best = min(task.sizes, key=lambda size: norm(loops["full block"], size))
    return {name: norm(N, best) for name, N in loops.items()}


def _margin_missed(task: DesignTask, K: StateSpace) -> float:
    """1 - b / b_opt of the shaped plant for which K was made; of several shapes, the one with the
    least value.

    b = inf |1 + G_s C| / sqrt((1 + |G_s|^2) (1 + |C|^2)), C = K / W_1, and b_opt by the Hankel norm
    of normalised coprime factors.
    """
    omega = 2 * np.pi * HERTZ
    G, k = response(task.nominal, omega)[:, 0, 0], response(K, omega)[:, 0, 0]
    missed = []
    for gain in task.gains:
        program = task.shaped(gain=gain)
        W = response(program.W1, omega)[:, 0, 0]
        size = np.sqrt((1 + abs(G * W) ** 2) * (1 + abs(k / W) ** 2))
        missed.append(1 - float((abs(1 + G * k) / size).min()) / program.epsilon_max)
    return min(missed, key=abs)


def _sampled(
    axis: Axis,
    uncertain: UncertainModel,
    task: DesignTask,
    controllers: ControllersByName,
    answer: Dataset,
) -> Check:
    """The bound beta of mu holds beta >= |(z_p, z_u)| for perturbations up to 1 / beta."""
    upper = answer["peak"].sel(condition="robust performance", bound="upper")
    excess = []
    hertz = answer["frequency"].values
    omega = 2 * np.pi * hertz
    filtered = ANTIALIASING / (1j * omega + ANTIALIASING)
    W_p = response(task.W_S, omega)[:, 0, 0]
    W_u = task.W_KS * filtered
    for name, K in controllers.items():
        beta = float(upper.sel(design=name))
        k = response(K, omega)[:, 0, 0]
        S = 1 / (1 + k * filtered * _plants(axis, uncertain, 1 / beta, hertz))
        excess.append(float(np.hypot(abs(W_p * S), abs(W_u * k * S)).max()) / beta - 1)
    names = list(controllers)
    value, where = worst_value(excess, lambda i: names[i[0]])
    statement = "gain of sampled plants over the peak of robust performance, less 1"
    over = f"for {RANDOM_PLANTS} plants of the set drawn, at {len(hertz)} frequencies"
    return Check("sampled plants", statement, value, 0.0, where=where, over=over)


def _plants(axis: Axis, uncertain: UncertainModel, size: float, hertz: RealArray) -> ComplexArray:
    """Responses f_en / u (N, F), without the filter, of plants with perturbations of this size."""
    rng = np.random.default_rng(0)
    if isinstance(uncertain, ParametricModel):
        box = uncertain_parameters(axis)
        deltas = np.vstack([vertex_deltas(box), rng.uniform(-1, 1, (RANDOM_PLANTS, len(box)))])
        return plants(axis, size * deltas, box, hertz)
    model, omega = uncertain, 2 * np.pi * hertz
    turned = np.exp(2j * np.pi * rng.uniform(size=(RANDOM_PLANTS, len(hertz))))
    away = size * turned * model.W_c.response(omega)
    if model.W_r is not None:
        away = away + size * rng.choice([-1, 1], (RANDOM_PLANTS, 1)) * model.W_r.response(omega)
    nominal = model.nominal.response(omega)
    return nominal * (1 + away) if model.form == "multiplicative" else nominal + away
