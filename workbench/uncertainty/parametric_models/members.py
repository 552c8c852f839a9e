"""Members of a parametric set as known plants, for covers that contain them at every frequency."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from workbench._core.arrays import RealArray
from workbench.errors import InputError
from workbench.uncertainty.parametric_models.model import ParametricModel
from workbench.uncertainty.responses.plants import Responses


def members(
    model: ParametricModel,
    omega: RealArray,
    deltas: RealArray,
    *,
    names: Sequence[str] | None = None,
) -> Responses:
    """Responses of some plants of a parametric set, together with these plants as systems.

    A cover of them is certified at every frequency for these plants, for example the vertices and
    samples of the set. It claims nothing about other plants of the set.

    Parameters
    ----------
    model
        Model with one input and one output.
    omega
        Frequencies [rad/s] (F,).
    deltas
        Normalised deviations (N, P) of the parameters; see `vertex_deltas`, `level_deltas` and
        `random_deltas`.
    names
        Names of the N plants; with None they are numbered.

    Raises
    ------
    InputError
        The model is not SISO, the deltas have another shape, or `Responses` refuses the plants, for
        example unstable ones.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.uncertainty import Parameter, members, parametric_lft, vertex_deltas
    >>> def spring(k):
    ...     '''A, B, C, D of a mass on a spring.'''
    ...     return [[0.0, 1.0], [-k, -0.5]], [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]]
    ...
    >>> model = parametric_lft(spring, [Parameter("k", 4.0, 0.25)], inputs=["f"], outputs=["x"])
    >>> plants = members(model, np.geomspace(0.1, 10, 20), vertex_deltas(model.parameters))
    >>> plants.values.shape
    (20, 2)
    """
    if (len(model.inputs), len(model.outputs)) != (1, 1):
        raise InputError(f"a SISO model is needed, not {len(model.outputs)} x {len(model.inputs)}")
    rows = np.asarray(deltas, dtype=float)
    if rows.ndim != 2:
        raise InputError(f"deltas have shape {rows.shape}; give (N, P), a row for each plant")
    values = model.response(omega, rows)[..., 0, 0].T
    return Responses(
        omega=omega, values=values, plants=names, known=[model.at(row) for row in rows]
    )
