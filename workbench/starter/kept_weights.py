"""A first design that meets its weights: the bandwidth is lowered until a certificate proves it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal, NamedTuple, Protocol, TypeVar

from workbench.bench.problem import import_file
from workbench.certificate import distinct_texts
from workbench.errors import InputError, SolverError
from workbench.solution import solve
from workbench.starter.first_choices import FirstChoices, Shape
from workbench.synthesis import MuController, MuSynthesis
from workbench.synthesis.mu.finish import with_few_states
from workbench.synthesis.mu.program import PEAK_TOLERANCE
from workbench.uncertainty.covers.sets import CoverForm

Structure = Literal["free", "pi", "pid"]
"""Structures of a controller: free, with the fewest states that meet the weights; PI; PID."""
STEP, TRIES = 1.6, 8
"""Factor between the bandwidths that are tried, and how many are tried."""
Cover = tuple[Shape, CoverForm]
"""A shape of sets, and whether they are relative to the nominal."""
COVERS: tuple[Cover, ...] = (
    ("circle", "multiplicative"),
    ("circle", "additive"),
    ("stadium", "multiplicative"),
)
"""Shapes and forms that are tried. Plants with many resonances differ little in absolute terms
where they are small, as about an antiresonance, and by more than all of their size in relative
ones."""
WEIGHT_ORDERS = (4, 6, 8)
"""Orders of the complex weight that are tried. Beside a resonance, a weight of too low an order is
far too large.
"""
TIGHT = 1.2
"""Rms radius of a cover over that of the smallest sets, up to which no higher order is tried."""
HALVINGS = 3
"""Halvings, in logarithm, of the gap between the bandwidth that is kept and the next."""
TARGET = 0.95
"""Peak of mu at which a synthesis stops; the rest up to 1 leaves room for fewer states."""
KEPT = 0.98
"""Peak of mu below which a bandwidth is taken, and up to which the controller of full order is
truncated to find the largest order that is tried."""


def kept_weights(
    design: Path,
    chosen: FirstChoices,
    lower: Callable[[float], FirstChoices] | None,
    structure: Structure = "free",
) -> FirstChoices:
    """The choices with the largest tried bandwidth whose certified peak of mu is below 1.

    Several covers are tried: which of them suits a controller is seen by the peak of mu. Each try
    ends by the counts of its method, at the target, where the peak settles, or after a number of
    rounds, and not by a clock: a busy computer gives the same study.

    Parameters
    ----------
    design
        The generated ``design.py`` of the study; its cover, weights and synthesis are used.
    chosen
        The choices that are tried first.
    lower
        Returns choices with a bandwidth [Hz] of at most its argument; raises InputError if there
        are none. None: the user asked for the bandwidth, and only that one is tried.
    structure
        Structure of the controller.

    Returns
    -------
    FirstChoices
        With ``peak`` and ``states`` filled in. If no bandwidth succeeds, the one with the least
        peak.

    Raises
    ------
    SolverError
        No certified cover of the plants was found.
    """
    study = import_file(design.parents[1], design)
    models = _covers(study)

    def rung(chosen: FirstChoices, covers: Iterable[Cover]) -> list[Tried]:
        """Controllers of a bandwidth."""
        return [_tried(study, chosen, cover, *models[cover], structure) for cover in covers]

    every = rung(chosen, models)
    while lower and _best(every).peak >= KEPT and len(every) < TRIES * len(models):
        try:
            slower = lower(every[-1].choices.bandwidth_hz / STEP)
        except InputError:
            break
        every += rung(slower, models)
    best = _best(every)
    shapes = _told_covers(every, best)
    if lower and best.peak < KEPT and len(every) > len(models):
        cover, too_fast = best.cover, every[-len(models) - 1].bandwidth_hz
        best, more = halved_gap(best, too_fast, lambda most: rung(lower(most), [cover])[0], KEPT)
        every += more
    told = replace(best.choices, reasons=best.choices.reasons | {"shape": shapes})
    if best.peak < 1 and len(every) > len(models):
        told.reasons["bandwidth_hz"] = bandwidth_reason(every, best, _best(every[: len(models)]))
    if best.found is None:
        return told
    if structure == "free":
        return fewest_states(told, best.plant, best.found)
    return replace(told, states=int(best.found.K.nstates))


class Trial(Protocol):
    """A bandwidth [Hz] that was tried, and its certified peak of mu."""

    @property
    def bandwidth_hz(self) -> float: ...

    @property
    def peak(self) -> float: ...


T = TypeVar("T", bound=Trial)


def halved_gap(
    best: T, too_fast: float, tried: Callable[[float], T], kept: float
) -> tuple[T, list[T]]:
    """The fastest trial with a peak below ``kept`` between the best and a bandwidth [Hz] that is
    too fast, and all trials between them.
    """
    every = []
    for _ in range(HALVINGS):
        middle = tried(math.sqrt(best.bandwidth_hz * too_fast))
        every.append(middle)
        if middle.peak < kept:
            best = middle
        else:
            too_fast = middle.bandwidth_hz
    return best, every


def bandwidth_reason(every: Sequence[Trial], best: Trial, first: Trial) -> str:
    """Why the bandwidth of the best trial is taken."""
    frequencies = dict.fromkeys(f"{one.bandwidth_hz:g}" for one in every)
    return (
        f"the largest of {', '.join(frequencies)} Hz at which a certified peak of mu is below 1, "
        f"{distinct_texts(best.peak, 1.0, digits=3)[0]}; at {first.bandwidth_hz:g} Hz it is "
        f"{distinct_texts(first.peak, 1.0, digits=3)[0]}"
    )


class Tried(NamedTuple):
    """Choices that were tried, with their peak; the controller that was found, and its plant."""

    choices: FirstChoices
    found: MuController | None
    plant: Any

    @property
    def cover(self) -> Cover:
        """Shape and form of the cover."""
        return self.choices.shape, self.choices.form

    @property
    def bandwidth_hz(self) -> float:
        """The bandwidth [Hz] that was tried."""
        return self.choices.bandwidth_hz

    @property
    def peak(self) -> float:
        """The certified peak of mu; infinite where no controller was found."""
        return self.choices.peak


def _best(every: Sequence[Tried]) -> Tried:
    return min(every, key=lambda one: one.peak)


def _covers(study: Any) -> dict[Cover, tuple[int, Any]]:
    """Order of the weight and model of a certified cover, of each shape and form that has one."""
    models: dict[Cover, tuple[int, Any]] = {}
    said = ""
    for shape, form in COVERS:
        for order in WEIGHT_ORDERS:
            try:
                task = study.cover(shape=shape, form=form, weight_order=order)
            except InputError:
                if (shape, form) not in models:
                    raise
                break  # few frequencies determine no weight of higher order
            covered = solve(task)
            if covered.certificate is None or not covered.certificate.valid:
                said = covered.message
                continue
            models[shape, form] = order, covered.answer.model
            if task.inflation(covered.answer).rms <= TIGHT:
                break
    if not models:
        raise SolverError(f"no certified cover of the plants was found: {said}")
    return models


def _tried(
    study: Any, chosen: FirstChoices, cover: Cover, order: int, model: Any, structure: Structure
) -> Tried:
    """A controller for a bandwidth and a cover."""
    plant = study.weighted(model, chosen.bandwidth_hz, chosen.effort)
    wanted = {} if structure == "free" else {"family": study.FAMILIES[structure]}
    task = MuSynthesis(plant, target=TARGET, integral=True, **wanted)
    found = solve(task).answer
    peak = math.inf if found is None else float(found.upper)
    shape, form = cover
    told = replace(chosen, shape=shape, form=form, weight_order=order, peak=peak)
    return Tried(told, found, plant)


def _told_covers(every: Sequence[Tried], best: Tried) -> str:
    """The peaks of mu with each cover at the bandwidth of the best."""
    beside = [one for one in every if one.choices.bandwidth_hz == best.choices.bandwidth_hz]
    peaks = "; ".join(f"{one.cover[1]} {one.cover[0]}s {one.peak:.3g}" for one in beside)
    return f"the certified peak of mu at {best.choices.bandwidth_hz:g} Hz is, with {peaks}"


def fewest_states(best: FirstChoices, plant: Any, found: MuController) -> FirstChoices:
    """The choices with the fewest states that meet the weights, and the peak that results.

    Orders are tried from small to large, with the synthesis of the generated study. The last one is
    the order to which the controller of full order can be truncated.
    """
    most = max(KEPT, (1 + PEAK_TOLERANCE) * found.upper)
    last = int(with_few_states(MuSynthesis(plant, integral=True), found.K, most).nstates)
    tried: list[FirstChoices] = []
    for states in range(1, last + 1):
        task = MuSynthesis(plant, order=states, integral=True)
        done = solve(task, method="fixed")
        if done.answer is not None:
            tried.append(replace(best, states=states, peak=float(done.answer.upper)))
            if tried[-1].peak < 1:
                break
    return min(tried, key=lambda one: one.peak, default=replace(best, states=last))
