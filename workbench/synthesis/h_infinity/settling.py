"""A method's controller for a given plant, which is perturbed, if needed, until the norm settles.

A method needs a scaled plant that meets the assumptions. If the given plant does not meet them, the
method gets perturbed plants. Each controller is judged only by its loop with the given plant, so no
perturbation enters the answer.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from workbench._core.heavy_types import StateSpace
from workbench.certify.norms import NORM_TOLERANCE, certified_norm
from workbench.certify.stability import stability_check
from workbench.errors import InputError
from workbench.executor import Context
from workbench.program import Claim
from workbench.solvers import Outcome
from workbench.synthesis.h_infinity.levels import (
    CANCELLED_SHARE,
    NEGLIGIBLE_LEVEL,
    without_control,
)
from workbench.synthesis.h_infinity.normalised import Scaled, normalised_plant
from workbench.synthesis.h_infinity.program import CLAIM_TOLERANCE, HinfController, HinfSynthesis
from workbench.synthesis.h_infinity.singular_plants.fast_poles import without_fast_poles
from workbench.synthesis.h_infinity.singular_plants.known_states import (
    informed_level,
    static_controller,
)
from workbench.synthesis.h_infinity.singular_plants.perturbed import made_regular, wholly_perturbed
from workbench.synthesis.h_infinity.singular_plants.regularised import narrowly_regularised
from workbench.synthesis.h_infinity.singular_plants.single_frequencies import (
    single_frequency_level,
)
from workbench.systems.bilinear import continuous, to_sampled
from workbench.systems.norms import hinf_norm
from workbench.systems.realisation import Matrices, realisation
from workbench.systems.standard_plant import StandardPlant, standard_plant

NEGLIGIBLE_NORM = 1e-3
"""A norm of the loop below this share of its level is a rounding error."""
CANCELLED_CLAIM = 1e-8
"""Norm that is claimed if K cancels w -> z up to rounding, relative to w -> z without K."""
SIZES = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)
"""Sizes of perturbations, tried one after another."""
SETTLED_CHANGE = 1e-3
"""The norm is settled if the next smaller perturbation changes it by at most this share ..."""
SETTLED_DISTANCE = 1e-2
"""... and the perturbed loop's level is at most this share above it."""


class Made(NamedTuple):
    """Result of a method for a scaled plant: a controller of the plant in its own units, or None.

    Unlike an `HinfController`, it has arrays and numbers that are not certified yet.

    ``size`` is the norm of the loop, ``gamma`` the level, ``least`` a level that no controller
    reaches, and ``said`` the message so far.
    """

    K: Matrices | None
    size: float = math.nan
    gamma: float = math.nan
    least: float = math.nan
    outcome: Outcome = Outcome.SOLVED
    said: str = ""


Step = Callable[[Scaled], Made]
"""Function: scaled plant -> result of the method."""


def answered(program: HinfSynthesis, context: Context, step: Step) -> Claim:
    """The claim of a method for the plant, or for perturbed plants if it must be perturbed."""
    normal = program.scaled
    return settled(program, context, step) if normal is None else claimed(program, step(normal))


def claimed(program: HinfSynthesis, made: Made) -> Claim:
    """The claim for a controller of the unperturbed plant; no answer unless it stabilises the
    plant.
    """
    K, size, gamma, least, outcome, said = made
    if K is None:
        return None, outcome, said
    if not np.isfinite(size):
        return None, Outcome.FAILED, f"{said}; the controller found does not stabilise the plant"
    # If signals cancel, the remaining norm is a rounding error, which cannot be claimed.
    open_loop = without_control(program.scaled.plant) if program.scaled else 0.0
    if program.gamma is None and size < NEGLIGIBLE_NORM * gamma:
        size = gamma
    elif size < CANCELLED_SHARE * open_loop:
        size = min(gamma, CANCELLED_CLAIM * open_loop)
    try:
        K_found = _in_plant_time(program, K)
    except np.linalg.LinAlgError:
        return None, Outcome.FAILED, f"{said}; the sampled controller found is not causal"
    # The loop of the realised controller may differ from the scaled loop that gave `size`. The
    # kernel computes its norm.
    proven = _certified_norm_of(program, K_found)
    if np.isfinite(proven) and proven > (1 + CLAIM_TOLERANCE) * size:
        size, gamma = proven, max(gamma, proven)
    if least > (1 + CLAIM_TOLERANCE) * size:
        said, least = f"{said}; its least level {least:.6g} is refuted by this loop", math.nan
    return HinfController(K_found, size, gamma, least=least), Outcome.SOLVED, said


def settled(program: HinfSynthesis, context: Context, step: Step) -> Claim:
    """The claim for the best controller of perturbed plants, by its loop with the plant itself."""
    tried: list[Made] = []
    said = "no perturbation was tried"
    for number in context.rounds(len(SIZES), "sizes of the perturbation"):
        size = SIZES[number]
        found, said = _best_for_size(program, step, size)
        if found is None:
            if tried:
                break
            continue
        context.record({"perturbation": size, "norm": found.size, "level": found.gamma})
        tried.append(found)
        if program.gamma is not None or _is_settled(program, tried):
            break
    best = _best_proven(program, tried)
    if best is None:
        return None, Outcome.FAILED, f"the perturbed plant has no controller: {said}"
    return _with_least_level(program, best), Outcome.SOLVED, "the plant was perturbed"


def _with_least_level(program: HinfSynthesis, found: HinfController) -> HinfController:
    """The controller with a level that no controller reaches, if the plant itself gives one.

    The perturbed plants do not give such a level, since their least levels are larger.
    """
    if program.gamma is not None:
        return found
    return replace(found, least=level_of_more_known(program, found.norm))


def level_of_more_known(program: HinfSynthesis, reached: float) -> float:
    """A level that no controller reaches, not even one that measures or moves all states, or that
    may have any response at a single frequency; NaN if none is known.

    ``reached`` is the norm of a loop, an upper bound on the least level.
    """
    given = _given_plant(program)
    levels = [informed_level(side, reached, SETTLED_CHANGE / 2) for side in (given, given.dual)]
    known = [level for level in (*levels, single_frequency_level(given)) if level > 0.0]
    return max(known, default=math.nan)


def _is_settled(program: HinfSynthesis, tried: list[Made]) -> bool:
    """Whether the last perturbation changed the norm little, or the norm is negligible."""
    *others, last = tried
    whole = normalised_plant(wholly_perturbed(_given_plant(program), SIZES[0])).plant
    if last.size <= NEGLIGIBLE_LEVEL * without_control(whole):
        return True
    near = last.gamma <= (1.0 + SETTLED_DISTANCE) * last.size
    if not (near and others):
        return False
    before = min(each.size for each in others)
    return abs(last.size - before) <= SETTLED_CHANGE * before


def _given_plant(program: HinfSynthesis) -> StandardPlant:
    """The plant itself, in continuous time."""
    return continuous(standard_plant(program.absorbed.plant))


def _perturbed_plants(program: HinfSynthesis, size: float) -> Iterator[StandardPlant]:
    """The plant with perturbations of a size, in continuous time; perturbations of low order come
    first.

    Which one is best depends on the plant. Noise at low frequencies is bad for integrating weights.
    A plant perturbed only where needed may have Riccati equations that rounding spoils.
    """
    given = _given_plant(program)
    yield made_regular(given, size)
    singular = program.scaled is None
    yield continuous(standard_plant(narrowly_regularised(program.absorbed.plant, size, singular)))
    yield wholly_perturbed(given, size)


def _best_for_size(program: HinfSynthesis, step: Step, size: float) -> tuple[Made | None, str]:
    """The best controller of the plant with perturbations of a size, and a message.

    The norm is that of the controller's loop with the plant itself.
    """
    best: Made | None = None
    said, given = "", _given_plant(program)
    for plant in _perturbed_plants(program, size):
        if plant.D.shape == given.D.shape:  # regular, so it is not perturbed and was tried
            continue
        try:
            made = step(normalised_plant(plant))
            if made.K is None:
                said = made.said
                continue
            reached = hinf_norm(given.close(made.K), NORM_TOLERANCE)
        except (InputError, ArithmeticError, np.linalg.LinAlgError) as error:
            said = " ".join(str(error).split())
            continue
        if not reached <= (program.gamma or sys.float_info.max):
            said = f"the loop of a perturbed plant of level {made.gamma:.6g} has norm {reached:.6g}"
        elif best is None or reached < (1.0 - SETTLED_CHANGE) * best.size:
            best = made._replace(size=reached)
    return best, said


def _best_proven(program: HinfSynthesis, tried: list[Made]) -> HinfController | None:
    """The controller with the least norm that the kernel proves for the plant itself.

    Its fast poles are left out if this raises the norm by no more than the share that counts as
    settled.
    """
    given, best = _given_plant(program), None
    for made in sorted(tried, key=lambda each: each.size):
        allowed = program.gamma or (1.0 + SETTLED_CHANGE) * made.size
        for K in _fewer_poles(made, given, allowed):
            try:
                found = _in_plant_time(program, K)
            except np.linalg.LinAlgError:  # not causal
                continue
            proven = _certified_norm_of(program, found)
            if np.isfinite(proven) and (best is None or proven < best.norm):
                best = HinfController(found, proven, program.gamma or max(proven, made.gamma))
            if proven <= (1.0 + CLAIM_TOLERANCE) * allowed:
                return best
    return best


def _fewer_poles(made: Made, given: StandardPlant, allowed: float) -> Iterator[Matrices]:
    """A static controller or one without fast poles, if its norm is as allowed, and then the
    controller itself.
    """

    def good(K: Matrices) -> bool:
        try:
            return hinf_norm(given.close(K), NORM_TOLERANCE) <= allowed
        except (ArithmeticError, np.linalg.LinAlgError):
            return False

    level = (1.0 + SETTLED_CHANGE / 2) * made.size or made.gamma
    for size in SIZES:
        static = static_controller(given, level, size)
        if static is not None and good(static):
            yield static
            return
    if made.K is not None:
        yield without_fast_poles(made.K, good)
        yield made.K


def _in_plant_time(program: HinfSynthesis, K: Matrices) -> StateSpace:
    """A controller found in continuous time, transformed to the plant's time and with its names."""
    plant = program.absorbed.plant
    dt = float(plant.system.dt or 0.0)
    return plant.named(realisation(to_sampled(K) if dt else K, dt))


def _certified_norm_of(program: HinfSynthesis, K: StateSpace) -> float:
    """The certified norm of the loop; infinite if the loop is not stable."""
    loop = program.absorbed.plant.close(K)
    return certified_norm(loop) if stability_check(loop).holds else math.inf
