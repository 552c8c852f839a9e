"""Playability measured objectively: the balloon of section 2.6 over an ensemble of discs.

Figure and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from workbench import Run, problem, ref
from workbench.errors import InputError
from workbench.synthesis import discretise
from workbench.types import StateSpace

from ...drive.shared_parameters import TABLES
from ...drive.tables import AXES, Axis
from ...laboratory.bench_setup import PERIOD
from ..tactics import STRATEGIES
from .runs import chosen
from .study import Playability

Count = Annotated[int, Field(ge=1, le=100_000)]
DriveCount = Annotated[int, Field(ge=1, le=12)]
Workers = Annotated[int, Field(ge=1, le=256)]
StrategyNames = "reference,A,B,C,K_prime"


SLOWER = {str(axis): ref(f"cd/{axis}/lower-bandwidth") for axis in AXES}
"""Problems that design K' of both axes."""


@problem("cd/playability", slow=True, needs=SLOWER, data=(*TABLES, "data/red_book.csv"))
def playability(
    focus: Run,
    radial: Run,
    scenarios: Count = 28,
    drives: DriveCount = 3,
    strategies: str = StrategyNames,
    tuned: str = "reference",
    training: Count = 21,
    trials: Annotated[int, Field(ge=4, le=500)] = 14,
    duration: Annotated[float, Field(gt=0.5, le=60)] = 1.0,
    workers: Workers = 2,
) -> Playability:
    """Playability of every strategy, by the true error over an ensemble (section 2.6).

    Discs and circumstances are drawn from `ensemble.Spread`: deviation, harmonics, rotation,
    reflectivity, loop gain, shocks, defects. Every strategy runs in each of them on every drive, in
    focus and radially, with the same noise. A run is scored by the share of time out of spec (2 um,
    0.2 um), the number of losses of focus or track, and the longest burst compared with the 2.5 mm
    that the error correction repairs. The balloon has an arm for every cause; smaller is better.
    Intervals are bootstrapped over circumstances. One strategy's gain, quality threshold and
    repetitive corner are optimised on training discs and half of the drives, with |S| of all drives
    at most 2, and tested on the others.

    scenarios: number of circumstances for each axis. drives: how many of the twelve, evenly spread.
    strategies: names separated by commas. tuned: the strategy that is optimised. training: number
    of circumstances for that. trials: number of parameter sets tried. duration: of a run [s], of
    which 0.4 s are for settling. workers: number of threads; the answer does not depend on it.
    """
    return Playability(
        slower(focus, radial),
        scenarios,
        chosen(drives),
        named(strategies),
        tuned,
        training,
        trials,
        duration,
        workers,
    )


def slower(focus: Run, radial: Run) -> dict[Axis, StateSpace]:
    """Discrete K' of both axes."""
    return {
        "focus": discretise(focus.answer.K, PERIOD),
        "radial": discretise(radial.answer.K, PERIOD),
    }


def named(names: str) -> tuple[str, ...]:
    """Split a list at commas. Raises InputError for no name, an unknown name, or a
    repeated name.
    """
    every = tuple(name.strip() for name in names.split(",") if name.strip())
    unknown = [name for name in every if name not in STRATEGIES]
    if not every or unknown or len(set(every)) < len(every):
        raise InputError(
            f"strategies are {names!r}; name some of {', '.join(STRATEGIES)}, each once"
        )
    return every
