"""A first design whose weights are kept: the bandwidth is lowered until a controller proves it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

from workbench.bench.problem import import_file
from workbench.certificate import told_apart
from workbench.errors import InputError, SolverError
from workbench.solution import solve
from workbench.solvers import Options
from workbench.starter.first_choices import FirstChoices
from workbench.synthesis import MuController, MuSynthesis
from workbench.synthesis.mu.finish import with_few_states
from workbench.synthesis.mu.program import PEAK_TOLERANCE

Structure = Literal["free", "pi", "pid"]
"""Structures of a controller: the fewest states that keep the weights, or three terms and fewer."""
STEP, TRIES = 1.6, 8
"""Factor between the bandwidths that are tried, and their number."""
TARGET = 0.95
"""Certified peak of mu at which a bandwidth is kept: some room is left for fewer states."""
KEPT = 0.98
"""Peak up to which states are left out to find the largest order."""
SECONDS = 300.0
"""Time limit [s] of each try; a try that needs longer counts by the peak that it has reached. On a
busy computer a first try may compile loops for a minute or two."""


def kept_weights(
    design: Path,
    chosen: FirstChoices,
    lower: Callable[[float], FirstChoices] | None,
    structure: Structure = "free",
) -> FirstChoices:
    """The choices with the largest tried bandwidth at which the certified peak of mu is below 1.

    Parameters
    ----------
    design
        The written ``design.py`` of the study, whose cover, weights and synthesis are taken.
    chosen
        What is tried first.
    lower
        The choices with a bandwidth [Hz] of at most its argument; raises InputError where there
        are none. None: the bandwidth was asked for, and only that is tried.
    structure
        Of the controller.

    Returns
    -------
    FirstChoices
        With its ``peak`` and ``states``. Where no bandwidth is kept, the one with the least peak.

    Raises
    ------
    SolverError
        No certified cover of the plants is found.
    """
    study = import_file(design.parents[1], design)
    covered = solve(study.cover(), options=Options())
    if covered.certificate is None or not covered.certificate.valid:
        raise SolverError(f"no certified cover of the plants was found: {covered.message}")
    asked = chosen.bandwidth_hz
    tried: list[tuple[FirstChoices, MuController | None, Any]] = []
    for _ in range(TRIES):
        plant = study.weighted(covered.answer.model, chosen.bandwidth_hz, chosen.effort)
        wanted = {} if structure == "free" else {"family": study.FAMILIES[structure]}
        task = MuSynthesis(plant, target=TARGET, integral=True, **wanted)
        found = solve(task, options=Options(time_limit=SECONDS)).answer
        peak = float("inf") if found is None else float(found.upper)
        tried.append((replace(chosen, peak=peak), found, plant))
        if peak < 1 or lower is None:
            break
        try:
            chosen = lower(chosen.bandwidth_hz / STEP)
        except InputError:
            break
    best, found, plant = min(tried, key=lambda one: one[0].peak)
    if best.peak < 1 and len(tried) > 1:
        best.reasons["bandwidth_hz"] = (
            f"the first of {', '.join(f'{one.bandwidth_hz:g}' for one, _, _ in tried)} Hz at "
            "which a "
            f"certified peak of mu is below 1, {told_apart(best.peak, 1.0, digits=3)[0]}; at "
            f"{asked:g} Hz it is {told_apart(tried[0][0].peak, 1.0, digits=3)[0]}"
        )
    if found is None:
        return best
    if structure == "free":
        return fewest_states(best, plant, found)
    return replace(best, states=int(found.K.nstates))


def fewest_states(best: FirstChoices, plant: Any, found: MuController) -> FirstChoices:
    """The choices with the fewest states that keep the weights, and the peak with them.

    Small orders come first, answered as the written study does it; the last one is that to which
    the controller of full order can be truncated.
    """
    most = max(KEPT, (1 + PEAK_TOLERANCE) * found.upper)
    last = int(with_few_states(MuSynthesis(plant, integral=True), found.K, most).nstates)
    tried: list[FirstChoices] = []
    for states in range(1, last + 1):
        task = MuSynthesis(plant, order=states, integral=True)
        done = solve(task, method="fixed", options=Options())
        if done.answer is not None:
            tried.append(replace(best, states=states, peak=float(done.answer.upper)))
            if tried[-1].peak < 1:
                break
    return min(tried, key=lambda one: one.peak, default=replace(best, states=last))
