"""Storage of systems as variables of a dataset."""

from __future__ import annotations

from typing import Any

from workbench._core.heavy_types import Dataset, StateSpace
from workbench.systems.realisation import realisation


def stored_system(name: str, system: StateSpace) -> dict[str, Any]:
    """The system as variables of a dataset, under a name; `restored_system` reads them back.

    Examples
    --------
    >>> import control
    >>> import xarray as xr
    >>> from workbench.systems import restored_system, stored_system
    >>> data = xr.Dataset(stored_system("controller", control.ss(-1.0, 1.0, 2.0, 0.0)))
    >>> restored_system(data, "controller").C.tolist()
    [[2.0]]
    """
    state, output, entering = (f"{name}_{kind}" for kind in ("state", "output", "input"))
    dims = {
        "A": (state, f"{state}_"),
        "B": (state, entering),
        "C": (output, state),
        "D": (output, entering),
    }
    parts: dict[str, Any] = {
        f"{name}_{part}": (
            place,
            getattr(system, part),
            {"long_name": f"{part} of the {name}'s realisation"},
        )
        for part, place in dims.items()
    }
    about = {"units": "s", "long_name": f"sampling time of the {name}, 0: continuous"}
    return parts | {f"{name}_dt": ((), float(system.dt or 0.0), about)}


def restored_system(data: Dataset, name: str) -> StateSpace:
    """The system that `stored_system` put into the dataset under this name.

    Examples
    --------
    >>> import control
    >>> import xarray as xr
    >>> from workbench.systems import restored_system, stored_system
    >>> data = xr.Dataset(stored_system("plant", control.ss(-1.0, 1.0, 2.0, 0.0, 0.1)))
    >>> restored_system(data, "plant").dt
    0.1
    """
    A, B, C, D = (data[f"{name}_{part}"].values for part in "ABCD")
    return realisation((A, B, C, D), float(data[f"{name}_dt"]))
