"""The answer of a cover of matrices, and its form in a dataset."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import Dataset, StateSpace
from workbench.answer import ProgramAnswer
from workbench.systems.storage import restored_system, stored_system
from workbench.uncertainty.matrix_covers.forms import MatrixForm
from workbench.uncertainty.matrix_covers.model import MatrixModel
from workbench.uncertainty.matrix_covers.responses import MatrixResponses
from workbench.uncertainty.matrix_covers.sets.program import FoundSets

SYSTEMS = ("nominal", "W_1", "W_2")
"""Systems of a stored model."""


@dataclass(frozen=True, eq=False, repr=False)
class FoundCover(ProgramAnswer):
    """A model, and the smallest sets at each frequency that are possible with weights of any
    order.
    """

    model: MatrixModel
    least: FoundSets

    def summary(self) -> str:
        return repr(self.model)

    @property
    def lti(self) -> StateSpace:
        """The nominal system."""
        return self.model.nominal


def stored_cover(
    responses: MatrixResponses,
    model: MatrixModel,
    norms: RealArray,
    radii: RealArray,
    sets: Dataset,
) -> Dataset:
    """A model with norms of Delta (F, N), radii (F,) and the stored smallest sets."""
    import xarray as xr

    parts: dict[str, Any] = {}
    for name in SYSTEMS:
        parts |= stored_system(name, getattr(model, name))
    text = {"units": "1", "long_name": "norm of Delta"}
    parts["delta_norm"] = (("frequency", "sample"), norms, text)
    text = {"units": "1", "long_name": "radius of the model"}
    parts["radius"] = ("frequency", radii, text)
    omega = ("frequency", responses.omega, {"units": "rad/s", "long_name": "frequency"})
    plants = ("sample", list(responses.plants))
    return xr.Dataset(parts | dict(sets.data_vars), coords={"omega": omega, "plant": plants})


def restored_matrix_model(data: Dataset, form: MatrixForm) -> MatrixModel:
    """The model of a form in a dataset."""
    systems = {name: restored_system(data, name) for name in SYSTEMS}
    return MatrixModel(**systems, form=form)
