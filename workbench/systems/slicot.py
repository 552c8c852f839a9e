"""Routines of SLICOT by name, and what is said where slycot is not installed.

slycot is the one dependency that some platforms lack. Everything imports without it; methods that
are SLICOT's own are unfit, and say why; a function that needs a routine stops with an error.
"""

from __future__ import annotations

from functools import cache
from importlib.util import find_spec
from typing import Any

from workbench.errors import SolverError

ADVICE = "slycot is not installed: pip install slycot, or conda install -c conda-forge slycot"
"""What is said, and what to do."""


@cache
def slycot_missing() -> str | None:
    """Why SLICOT cannot be asked; None where it can."""
    return None if find_spec("slycot") is not None else ADVICE


def slicot_routine(name: str) -> Any:
    """A routine of SLICOT, such as "ab13dd".

    Raises
    ------
    SolverError
        slycot is not installed.
    """
    if slycot_missing() is not None:
        raise SolverError(f"SLICOT's {name.upper()} is needed here; {ADVICE}")
    import slycot

    return getattr(slycot, name)
