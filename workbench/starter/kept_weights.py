"""The first bandwidth that a certified controller of the study keeps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from workbench.bench.problem import import_file
from workbench.certificate import told_apart
from workbench.errors import InputError, SolverError
from workbench.solution import solve
from workbench.solvers import Options
from workbench.starter.first_choices import FirstChoices
from workbench.synthesis import MuSynthesis

STEP, TRIES = 1.6, 8
"""Factor between the bandwidths that are tried, and their number."""
TARGET = 0.95
"""Certified peak of mu at which a bandwidth is kept: some room is left for fewer states."""
SECONDS = 60.0
"""Time limit [s] of each try; a try that needs longer counts by the peak that it has reached."""


def kept_weights(
    design: Path, chosen: FirstChoices, lower: Callable[[float], FirstChoices]
) -> FirstChoices:
    """The choices with the largest tried bandwidth at which the certified peak of mu is below 1.

    Parameters
    ----------
    design
        The written ``design.py`` of the study, whose cover and weights are taken.
    chosen
        What is tried first.
    lower
        The choices with a bandwidth [Hz] of at most its argument; raises InputError where there
        are none.

    Returns
    -------
    FirstChoices
        With its ``peak``. Where no bandwidth is kept, the one with the least peak.

    Raises
    ------
    SolverError
        No certified cover of the plants is found.
    """
    study = import_file(design.parents[1], design)
    covered = solve(study.cover(), options=Options())
    if covered.certificate is None or not covered.certificate.valid:
        raise SolverError(f"no certified cover of the plants was found: {covered.message}")
    asked = chosen.bandwidth
    tried: list[FirstChoices] = []
    for _ in range(TRIES):
        plant = study.weighted(covered.answer.model, chosen.bandwidth, chosen.effort)
        found = solve(MuSynthesis(plant, target=TARGET), options=Options(time_limit=SECONDS)).answer
        peak = float("inf") if found is None else float(found.upper)
        tried.append(replace(chosen, peak=peak))
        if peak < 1:
            break
        try:
            chosen = lower(chosen.bandwidth / STEP)
        except InputError:
            break
    best = min(tried, key=lambda one: one.peak)
    if best.peak < 1 and len(tried) > 1:
        best.reasons["bandwidth"] = (
            f"the first of {', '.join(f'{one.bandwidth:g}' for one in tried)} Hz at which a "
            f"certified peak of mu is below 1, {told_apart(best.peak, 1.0, digits=3)[0]}; at "
            f"{asked:g} Hz it is {told_apart(tried[0].peak, 1.0, digits=3)[0]}"
        )
    return best
