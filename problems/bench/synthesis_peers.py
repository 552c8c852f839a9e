"""The peers of bench/synthesis, used as their documentation shows, and their claims."""

from __future__ import annotations

import math
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

import numpy as np

from workbench.errors import InputError
from workbench.systems import realisation
from workbench.types import StateSpace
from workbench.uncertainty import GeneralisedPlant

T = TypeVar("T")
ITERATIONS, ORDER = 3, 4
"""D-K iterations after the first controller, and order of the scalings, as in dkpy's example."""
AUTOMATIC_ITERATIONS, FIT_ERROR = 6, 1e-2
"""For dkpy with automatic orders: largest number of D-K iterations, and the relative error of mu
above which it raises the order.
"""
AUTOMATIC = "dkpy, automatic order"
"""Name of this way of using dkpy."""
OMEGA = np.logspace(-3, 3, 61)
"""Frequencies [rad/s] of dkpy's example."""


@dataclass(frozen=True, eq=False)
class Claimed:
    """A controller (None: none was given), and the norm or peak of mu that its maker claims.

    ``failure`` is the maker's message if there is no controller. ``rounds`` is the number of
    controllers made.
    """

    K: StateSpace | None
    claim: float
    seconds: float
    failure: str = ""
    rounds: int = 1


def hinfsyn(plant: GeneralisedPlant) -> Claimed:
    """python-control's H-infinity synthesis, SLICOT SB10AD, on the unchanged plant."""
    import control

    start = time.perf_counter()
    try:
        K, _, gamma, _ = _quiet(
            lambda: control.hinfsyn(plant.system, plant.measurements, plant.controls)
        )
    except (ArithmeticError, ValueError, np.linalg.LinAlgError) as error:
        said = " ".join(str(error).split())
        return Claimed(None, math.nan, time.perf_counter() - start, said)
    return Claimed(K, float(np.ravel(gamma)[0]), time.perf_counter() - start)


def achieved(plant: GeneralisedPlant, K: StateSpace | None) -> float:
    """The norm of the loop by SLICOT AB13DD; infinite without a stabilising controller."""
    import control

    if K is None or not all(np.isfinite(getattr(K, part)).all() for part in "ABCD"):
        return math.inf
    loop = plant.close(realisation((K.A, K.B, K.C, K.D), 0.0))
    if not (loop.poles().real < 0.0).all():
        return math.inf
    return float(_quiet(lambda: control.linfnorm(loop))[0])


def need_dkpy() -> Any:
    """The package dkpy. Raises InputError if it is not installed."""
    try:
        import dkpy
    except ModuleNotFoundError:
        raise InputError(
            "bench/synthesis needs dkpy: pip install 'robust-workbench[benchmark]', or leave that "
            "part out with distillation=false"
        ) from None
    return dkpy


def dk_iterations() -> tuple[dict[str, Claimed], StateSpace]:
    """Controllers of dkpy for its own example of the distillation column, by way; and that
    example's plant.

    One way has scalings of a fixed order, as in the example; the other finds the order by itself.
    """
    dkpy = need_dkpy()
    example = dkpy.example_skogestad2006_p325()
    parts = dkpy.HinfSynSlicot(), dkpy.SsvLmiBisection(), dkpy.DScaleFitSlicot()
    ways = {
        "dkpy": dkpy.DkIterFixedOrder(*parts, n_iterations=ITERATIONS, fit_order=ORDER),
        AUTOMATIC: dkpy.DkIterAutoOrder(
            *parts,
            max_mu_fit_error=FIT_ERROR,
            max_iterations=AUTOMATIC_ITERATIONS,
            max_fit_order=ORDER,
        ),
    }
    blocks = [dkpy.ComplexFullBlock(size, size) for size in (1, 1, 2)]
    sizes = example["n_y"], example["n_u"]
    found = {}
    for name, iteration in ways.items():
        start = time.perf_counter()
        work = partial(iteration.synthesize, example["P"], *sizes, OMEGA, blocks)
        K, _, mu, scalings, _ = _quiet(work)
        seconds = time.perf_counter() - start
        found[name] = Claimed(K, float(mu), seconds, rounds=len(scalings) + 1)
    return found, example["P"]


def _quiet(work: Callable[[], T]) -> T:
    """Run the work without the peers' warnings, since their controllers are judged
    independently.
    """
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        found: Any = work()
    return found
