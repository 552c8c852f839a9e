"""Conversion of covers to labelled arrays, and back."""

from __future__ import annotations

import numpy as np
import xarray as xr

from workbench.fitting.rational import Rational
from workbench.fitting.storage import rational_variables, restored_rational
from workbench.geometry import Circle, Stadium
from workbench.uncertainty.covers.steps import CoverSteps
from workbench.uncertainty.responses.plants import Responses

PARTS = {
    "center": "centre",
    "radius": "radius",
    "half_length": "half-length",
    "angle": "angle",
}
"""Arrays of a set, each with its name in words."""


def cover_dataset(responses: Responses, answer: CoverSteps) -> xr.Dataset:
    """Dataset of the responses, the sets of every step, the sets of the model, and its roots.

    The responses are only for inspection, in single precision; the task has them in full precision.
    """
    model = answer.model
    plane = responses.unit
    deviation = "1" if model.form == "multiplicative" else plane
    measured = responses.labelled_points()
    data = xr.Dataset(
        {
            "response": (
                measured.dims,
                np.where(responses.present, responses.values, 0).astype(np.complex64),
                {"units": plane, "long_name": "response of a plant, 0 where missing, rounded"},
            ),
            "present": (
                measured.dims,
                responses.present.astype("int8"),
                {"units": "1", "long_name": "1 where the plant was measured"},
            ),
        },
        coords=measured.coords,
    )
    sets: dict[str, tuple[Circle | Stadium, str, str]] = {
        "first": (answer.first, plane, "first set"),
        "second": (answer.second, deviation, "second set"),
        "third": (answer.third, deviation, "third set"),
        "fitted": (model.shapes(responses.omega), plane, "set of the fitted model"),
    }
    for name, (each, unit, long_name) in sets.items():
        for part, text in PARTS.items():
            units = "rad" if part == "angle" else unit
            data[f"{name}_{part}"] = (
                "frequency",
                np.asarray(getattr(each, part)),
                {"units": units, "long_name": f"{text} of the {long_name}"},
            )
    for name, of in {"nominal": model.nominal, "W_c": model.W_c, "W_r": model.W_r}.items():
        if of is None:
            continue
        data = data.assign(rational_variables(of, name, prefix=f"{name}_"))
    return data


def cover_sets(data: xr.Dataset, name: str) -> Stadium:
    """The sets that a cover's dataset holds under the name of a step, such as "first".

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> import workbench as wb
    >>> from workbench.uncertainty import CircleCover, Responses, cover_sets
    >>> omega = np.geomspace(0.1, 10.0, 20)
    >>> known = [control.tf([gain], [1.0, 1.0]) for gain in (0.9, 1.0, 1.2)]
    >>> values = np.array([plant(1j * omega) for plant in known]).T
    >>> cover = CircleCover(Responses(omega=omega, values=values, known=known), order=1)
    >>> cover_sets(cover.to_dataset(wb.solve(cover).answer), "first").radius.shape
    (20,)
    """
    return Stadium(*(data[f"{name}_{part}"].values for part in PARTS))


def cover_function(data: xr.Dataset, name: str) -> Rational | None:
    """The nominal or a weight, by its name in a cover's dataset; None if it does not have it.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> import workbench as wb
    >>> from workbench.uncertainty import CircleCover, Responses, cover_function
    >>> omega = np.geomspace(0.1, 10.0, 20)
    >>> known = [control.tf([gain], [1.0, 1.0]) for gain in (0.9, 1.0, 1.2)]
    >>> values = np.array([plant(1j * omega) for plant in known]).T
    >>> cover = CircleCover(Responses(omega=omega, values=values, known=known), order=1)
    >>> data = cover.to_dataset(wb.solve(cover).answer)
    >>> cover_function(data, "nominal").zeros.size, cover_function(data, "W_r") is None
    (0, True)
    """
    if f"{name}_gain" not in data:
        return None
    return restored_rational(data, prefix=f"{name}_")
