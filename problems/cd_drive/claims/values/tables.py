"""Table 5.2 from Tables A.1 to A.3 (chapter 5)."""

from __future__ import annotations

from workbench import Run

from ...drive.tables import AXES, Axis, nominal_table
from .registry import value


@value
def convention(run: Run, axis: Axis) -> float:
    """5 % of the middle value of b [N s/m]."""
    return 0.05 * _range(run, axis, "b")[0]


@value
def masses_apart(run: Run) -> float:
    """Difference of the nominal m1 of focus and of radial loops [kg]."""
    focus, radial = (_range(run, axis, "m1")[0] for axis in AXES)
    return abs(focus - radial)


@value
def reduced_tolerance(run: Run, factor: float) -> float:
    """Tolerance of R in Table 5.3, over that of Table 5.2."""
    return factor * float(run.data["tolerance"].sel(model="nine", parameter="R"))


@value
def combinations(run: Run, levels: int) -> float:
    """Number of plants with each parameter at one of some levels."""
    return float(levels) ** run.data.sizes["parameter"]


@value
def half_range(run: Run, axis: Axis, parameter: str) -> float:
    """Half of the range of twelve drives, over its middle."""
    return _range(run, axis, parameter)[1]


@value
def nominals_off(run: Run, axis: Axis, names: list[str]) -> float:
    """Largest relative difference of a nominal value of Table 5.2 from the midrange."""
    table = nominal_table(axis)
    return max(abs(_range(run, axis, name)[0] / table[name].nominal - 1) for name in names)


@value
def tolerances_off(run: Run, axis: Axis, names: list[str]) -> float:
    """Largest difference of a tolerance of Table 5.2 from the half-range."""
    table = nominal_table(axis)
    return max(abs(_range(run, axis, name)[1] - table[name].tolerance) for name in names)


def _range(run: Run, axis: Axis, parameter: str) -> tuple[float, float]:
    every = run.data["parameters"].sel(axis=axis, parameter=parameter)
    low, high = float(every.min()), float(every.max())
    return (high + low) / 2, (high - low) / (high + low)
