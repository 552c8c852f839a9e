"""Checks of a loop around a `MatrixModel`; a cover can minimise the mu of such a loop."""

from __future__ import annotations

from typing import Any

from workbench.errors import InputError
from workbench.structure import Full
from workbench.systems.realisation import worst_pole
from workbench.uncertainty.algebra.system import UncertainSystem


def need_loop_around(given: Any, size: tuple[int, int], dt: float) -> None:
    """Raise InputError unless the loop is stable and is closed by one block of the given size."""
    if not isinstance(given, UncertainSystem):
        raise InputError(f"loop must be an uncertain system, not {type(given).__name__}")
    blocks = list(given.structure) if given.elements else []
    fits = len(blocks) == 1 and isinstance(blocks[0], Full)
    if not fits or (blocks[0].rows, blocks[0].columns) != size:
        raise InputError(
            f"loop must contain one full block of {size[0]} x {size[1]}, that of "
            f"MatrixModel.unweighted(nominal, form=form), once; it has {blocks or 'none'}"
        )
    system = given.system
    if float(system.dt or 0.0) != dt:
        raise InputError(f"loop has dt = {system.dt}, the responses {dt}")
    pole, beyond = worst_pole(system)
    if beyond >= 0:
        raise InputError(f"the loop around the nominal is unstable: it has a pole at {pole:.6g}")
