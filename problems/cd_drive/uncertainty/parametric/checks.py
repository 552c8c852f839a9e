"""Checks of the parametric uncertainty by the actuator's own equations, without any LFT."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from workbench import Check
from workbench.certificate import worst_value
from workbench.types import ComplexArray, Dataset, RealArray
from workbench.uncertainty import Parameter, ParametricModel, random_deltas, vertex_deltas

from ...drive.actuator import specific_model, stack
from ...drive.plants import nominal_response
from ...drive.tables import ActuatorParameters, Axis, nominal_table
from ..parametric_model import COPIES, UNITS, parametric_plant, uncertain_parameters

MODELS = ("nine", "reduced")
PLANT_RESPONSE_ROUNDING = 1e-9
"""Largest relative difference of two responses that rounding can explain."""
CHECK_STRIDE = 20
"""Slow checks use every CHECK_STRIDE-th frequency."""


def pulled_out(axis: Axis) -> dict[str, ParametricModel]:
    """The parametric models, by name of the set."""
    return {name: parametric_plant(axis, reduced=name == "reduced") for name in MODELS}


def boxes(axis: Axis) -> dict[str, tuple[Parameter, ...]]:
    """Uncertain parameters of each set of plants."""
    nine, three = (uncertain_parameters(axis, reduced) for reduced in (False, True))
    return {"nine": nine, "without gain": nine[1:], "reduced": three}


def plants(
    axis: Axis, deltas: RealArray, box: Sequence[Parameter], frequency: RealArray
) -> ComplexArray:
    """Responses f_en / u [units/V] (N, F) at deltas (N, P) of a set, without the anti-aliasing
    filter.
    """
    table = {name: entry.nominal for name, entry in nominal_table(axis).items()}
    gains, actuators = [], []
    for row in deltas:
        values = table | {p.name: float(p.at(d)) for p, d in zip(box, row, strict=True)}
        gains.append(values.pop("K_total"))
        actuators.append(specific_model(ActuatorParameters(**values)))
    return np.array(gains)[:, None] * stack(actuators).response(frequency)


def spread_checks(axis: Axis, answer: Dataset) -> list[Check]:
    """Checks that the models agree with the actuator, and that the deviations found are the
    largest.
    """
    hertz, models = answer["frequency"].values, pulled_out(axis)
    copies = answer["copies"].sel(stage="after reduction").values
    wanted = [[COPIES[n] * (n in m.repetitions) for n in UNITS] for m in models.values()]
    claimed, claim = worst_value(_claims(axis, answer), lambda p: f"at {hertz[p[1]]:.6g} Hz")
    missed, miss = worst_value(
        _missed(axis, answer.isel(frequency=slice(None, None, CHECK_STRIDE))),
        lambda p: f"at {hertz[CHECK_STRIDE * p[1]]:.6g} Hz",
    )
    return [
        Check(
            "pulled out",
            "relative distance of the models from the actuator's equations at random deltas",
            max(_disagreement(axis, model, hertz[::CHECK_STRIDE]) for model in models.values()),
            PLANT_RESPONSE_ROUNDING,
        ),
        Check(
            "repetitions",
            "number of repetitions that differ from one of each parameter and two of Bl",
            float(abs(copies - wanted).sum()),
            0.0,
        ),
        Check(
            "well posed",
            "least det(I - M11 Delta) of the vertices, its sign changed",
            -min(map(_least_determinant, models.values())),
            -PLANT_RESPONSE_ROUNDING,
        ),
        Check(
            "largest deviations",
            "largest difference of a deviation from that of its plant, relative to the nominal",
            claimed,
            PLANT_RESPONSE_ROUNDING,
            where=claim,
        ),
        Check(
            "vertices",
            "excess of a vertex over the largest deviation, relative to the nominal",
            missed,
            PLANT_RESPONSE_ROUNDING,
            where=miss,
        ),
    ]


def _disagreement(axis: Axis, model: ParametricModel, hertz: RealArray) -> float:
    """Largest relative difference between a model and the actuator's equations at random deltas."""
    deltas = random_deltas(model.parameters, 20, np.random.default_rng(1))
    found = model.response(2 * np.pi * hertz, deltas)[..., 0, 0]
    return float(abs(found / plants(axis, deltas, model.parameters, hertz) - 1).max())


def _least_determinant(model: ParametricModel) -> float:
    """Least det(I - M11 Delta) over the vertices of the set."""
    copies = [block.rows for block in model.structure]
    delta = np.repeat(vertex_deltas(model.parameters), copies, axis=-1)
    loops = np.eye(sum(copies)) - model.lft.blocks[0] * delta[:, None, :]
    return float(np.linalg.det(loops).min())


def _claims(axis: Axis, answer: Dataset) -> RealArray:
    """Difference (4, F) between each largest deviation and that of the plant which
    should have it.
    """
    hertz, nominal = answer["frequency"].values, answer["nominal"].values
    sets = boxes(axis)
    claims = [(sets[n], answer["delta"].sel(set=n), answer["deviation"].sel(set=n)) for n in sets]
    claims.append((sets["nine"], answer["sought_delta"], answer["sought"]))
    result = []
    for box, deltas, deviation in claims:
        rows = deltas.sel(parameter=[p.name for p in box]).values
        which, back = np.unique(rows, axis=0, return_inverse=True)
        chosen = plants(axis, which, box, hertz)[back.ravel(), np.arange(len(hertz))]
        inside = np.where(abs(rows).max(axis=1) <= 1.0, 0.0, np.inf)
        result.append(abs(abs(chosen / nominal - 1) - deviation.values) + inside)
    return np.array(result)


def _missed(axis: Axis, answer: Dataset) -> RealArray:
    """Excess (3, F) of the largest deviation over the vertices above the one that was found."""
    hertz = answer["frequency"].values
    nominal = nominal_response(axis, hertz, antialiasing=False)
    corners = [plants(axis, vertex_deltas(box), box, hertz) for box in boxes(axis).values()]
    most = np.array([abs(each / nominal - 1).max(axis=0) for each in corners])
    return most - answer["deviation"].values
