"""D-K and (mu, D)-K iteration: compute a controller for scalings and scalings for it, in turn.

An H-infinity controller lowers sigma_max(gamma D N D^-1). In D-K iteration gamma is 1, and D makes
this the complex upper bound. In the (mu, D)-K iteration of Toffner-Clausen, Andersen, Stoustrup and
Niemann (1995) gamma is the ratio of the mixed bound to the complex bound, so that the controller
lowers the mixed bound. Since gamma depends on K, it moves only part of the way to this ratio in
each round.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workbench._core.heavy_types import StateSpace
from workbench.accuracy import ANY_ACCURACY_ALIKE
from workbench.certify.stability import stability_check
from workbench.errors import InputError, SolverError, TimeLimitError
from workbench.executor import Context
from workbench.mu import UpperBound, upper_bound
from workbench.program import Claim, method
from workbench.solvers import Outcome
from workbench.synthesis.h_infinity.normalised import normalised_plant
from workbench.synthesis.h_infinity.riccati import central_above, central_of
from workbench.synthesis.h_infinity.singular_plants.regularised import on_regular
from workbench.synthesis.mu.d_step import LoopResponse, d_step
from workbench.synthesis.mu.finish import Finish
from workbench.synthesis.mu.gamma import GAMMA_FUNCTION, fitted_gamma, gaussian_mean
from workbench.synthesis.mu.mu_controller import MuController
from workbench.synthesis.mu.program import PEAK_TOLERANCE, MuSynthesis
from workbench.synthesis.mu.rounds import Iterate, packed, unpacked
from workbench.synthesis.mu.scaled_plant import Round, level_descent, scaled_plant
from workbench.synthesis.mu.scaling_fit import COARSE, FINE
from workbench.systems.standard_plant import standard_plant

MOST_ROUNDS = 30
"""Largest number of rounds of an iteration."""
LEVEL_TOLERANCE = 2e-3
"""Relative width of the interval that contains the least level of a K step."""
SETTLED_FALL = PEAK_TOLERANCE
"""An iteration is settled if the peak falls by less than this share over `PATIENCE` rounds, which
is less than the width of the interval that certifies it.
"""
PATIENCE, LONG_PATIENCE = 4, 8
"""Number of rounds over which a peak must settle, for D-K and for (mu, D)-K iteration."""
GAMMA_SHARE = 0.4
"""Part of the way that gamma moves in a round. A much smaller part is slow, a much larger one
diverges.
"""
ENOUGH_SHARE = 0.99
"""A descent of the level ends at this share of the target, since the peak of the loop is close to
the level.
"""
LEAST_GAMMA, LEAST_WEIGHT = 0.05, 0.05
"""Least wanted gamma, and least weight of a frequency in the fit of gamma."""
TARGET_REACHED = "reached the target"
"""Message of an iteration that ends at its target."""
NOTHING_ACTS = "nothing acts on the performance"
"""Message of an iteration that ends with a bound of zero, to which no scalings can be fitted."""


@dataclass(eq=False)
class DKState:
    """State of an iteration after a number of rounds.

    ``used`` are the scalings fitted to the last loop, and ``well`` those fitted to the loop of the
    best controller. ``blend`` is the part of the way that gamma moves in a round.
    """

    blend: float
    tried: int = 0
    history: list[Iterate] = field(default_factory=list)
    used: Round | None = None
    well: Round | None = None

    def arrays(self) -> dict[str, NDArray[Any]]:
        """The whole state as named arrays, for a checkpoint."""
        found = {"blend": np.array(self.blend), "tried": np.array(self.tried)}
        for name in ("used", "well"):
            one: Round | None = getattr(self, name)
            if one is not None:
                found |= {f"{name}_{part}": value for part, value in one.arrays().items()}
        return found | packed(self.history)

    @classmethod
    def restored(cls, arrays: Mapping[str, NDArray[Any]]) -> DKState:
        """The state from the arrays that `arrays` returned."""
        rounds: list[Round | None] = []
        for name in ("used", "well"):
            parts = {
                key.removeprefix(f"{name}_"): array
                for key, array in arrays.items()
                if key.startswith(f"{name}_")
            }
            rounds.append(Round.restored(parts) if parts else None)
        return cls(float(arrays["blend"]), int(arrays["tried"]), unpacked(arrays), *rounds)


@method(MuSynthesis, "mu-dk", optimal=False, accuracy=ANY_ACCURACY_ALIKE)
def _mu_dk(program: MuSynthesis, context: Context) -> Claim:
    """(mu, D)-K iteration: a scalar function gamma turns the complex bound into the mixed bound."""
    return iterated(program, context, GAMMA_SHARE)


def iterated(program: MuSynthesis, context: Context, blend: float, reduces: bool = True) -> Claim:
    """Iterate K and D steps and return the best controller.

    With `blend` > 0 gamma moves by this part of the way in each round, and the peak may rise
    meanwhile."""
    kept = context.checkpoint.load()
    now = DKState(blend) if kept is None else DKState.restored(kept)
    finish = Finish(program, context, partial(scaled_plant, program.plant) if reduces else None)
    try:
        finish.resume(now.history)
        ended = _rounds(program, context, now, finish, program.start if kept is None else None)
    except TimeLimitError as error:
        ended = finish.late(error)
    if isinstance(ended, MuController):
        return ended, Outcome.SOLVED, TARGET_REACHED
    return finish.claim(now.history, ended)


def _rounds(
    program: MuSynthesis, context: Context, now: DKState, finish: Finish, K: StateSpace | None
) -> MuController | str:
    """Run the rounds from a controller, if there is one, and return the reason why they ended.

    A controller that reaches the target is the answer.
    """
    level = np.nan
    patience = LONG_PATIENCE if now.blend else PATIENCE
    for tried in context.rounds(MOST_ROUNDS, "mu synthesis", first=now.tried):
        said = "rounding made a loop unstable"
        if K is None:
            try:
                K, level, now.used = _best_step(program, now.used)
            except (SolverError, InputError) as error:
                said, K = f"its H-infinity step failed: {error}", None
            proven = None if K is None else _proven_answer(program, now, K, level)
            if proven is not None:
                return proven
        loop = None if K is None else _loop(program, K)
        if K is None or loop is None:
            if now.well is None or now.blend < 0.1 * GAMMA_SHARE:
                return said
            # go back to the scalings of the best controller and continue more slowly
            now.used, now.blend, K = now.well, now.blend / 2, None
            continue
        mixed = upper_bound(loop.M, program.closed_structure)
        peak = float(mixed.value.max())
        here = Iterate(peak, level, math.nan, K, scalings=now.used.parameters if now.used else {})
        reached = program.answer_within_target(K, peak, (*now.history, here))
        if reached is not None:
            return reached
        finish.offer(here)
        if peak == 0.0:  # the bound is zero, so there is nothing to fit
            now.history.append(here)
            return NOTHING_ACTS
        now.used, missed = _scalings(program, loop, mixed, now.used, now.blend)
        if not now.history or peak < min(each.peak for each in now.history):
            now.well = now.used
        fit = float(np.expm1(missed))
        now.history.append(replace(here, fit=fit, scalings=now.used.parameters))
        context.record(now.history[-1].row(len(now.history)))
        K = None
        peaks = np.minimum.accumulate([each.peak for each in now.history])
        if len(peaks) > patience and peaks[-1] > (1 - SETTLED_FALL) * peaks[-1 - patience]:
            return "settled"
        now.tried = tried + 1
        context.checkpoint.save(now.arrays())
    return context.stopped or f"stopped after {MOST_ROUNDS} rounds"


def _proven_answer(
    program: MuSynthesis, now: DKState, K: StateSpace, level: float
) -> MuController | None:
    """The answer for a controller with a level below the target, proven by the scalings of its
    design.

    None without a target, or if the scalings include gamma of the (mu, D)-K iteration.
    """
    used, target = now.used, program.target
    if target is None or used is None or used.gamma.any() or not level < target:
        return None
    upper = min(target, (1.0 + PEAK_TOLERANCE) * level)
    scalings, x = used.D
    answer = program.scaled_answer(K, scalings.functions(x), upper)
    if answer is None:
        return None
    last = Iterate(upper, level, math.nan, answer.K, scalings=used.parameters)
    return replace(answer, history=(*now.history, last))


def _loop(program: MuSynthesis, K: StateSpace) -> LoopResponse | None:
    """The response of the loop; None if the loop is not stable."""
    system = program.plant.close(K)
    return LoopResponse.of(system) if stability_check(system).holds else None


def _best_step(program: MuSynthesis, now: Round | None) -> tuple[StateSpace, float, Round | None]:
    """The controller with the least level, its level and its scalings.

    A descent of the level from the fit to the last loop gives D. If the descent leads to scalings
    that are too ill-conditioned, the fit itself is used.
    """
    if now is not None:
        lower = level_descent(program.plant, now, ENOUGH_SHARE * (program.target or 0.0))
        try:
            return *k_step(program, lower), lower
        except (SolverError, InputError):  # too ill-conditioned: use the fit itself
            now = replace(now, level=math.nan)
    return *k_step(program, now), now


def k_step(program: MuSynthesis, used: Round | None) -> tuple[StateSpace, float]:
    """The H-infinity controller of the scaled plant at a level just above the least one, and its
    level.
    """
    import control

    plant = scaled_plant(program.plant, {} if used is None else used.parameters)
    if used is None or math.isnan(used.level):
        made = on_regular(plant, lambda normal: central_of(normal, LEVEL_TOLERANCE))
    else:
        made = central_above(normalised_plant(standard_plant(plant)), used.level, LEVEL_TOLERANCE)
    return control.ss(*made.K), made.gamma


def _scalings(
    program: MuSynthesis, loop: LoopResponse, mixed: UpperBound, before: Round | None, blend: float
) -> tuple[Round, float]:
    """The next scalings, and the logarithm of the factor by which D misses its bound.

    The logarithm of gamma moves a part ``blend`` of the way towards that of the smoothed ratio of
    mixed to complex bound.
    """
    structure, at = program.closed_structure.complexified(), np.log(loop.omega)
    gamma, target = np.zeros((1, GAMMA_FUNCTION.size)), np.zeros(len(at))
    bound = mixed if structure == program.closed_structure else upper_bound(loop.M, structure)
    if blend:
        wanted = gaussian_mean(at, np.log(np.maximum(mixed.value / bound.value, LEAST_GAMMA)))
        old = np.interp(at, before.at, before.target) if before else target
        target = (1 - blend) * old + blend * wanted
        weight = np.maximum(mixed.value / mixed.value.max(), LEAST_WEIGHT)
        gamma = fitted_gamma(target, loop.omega, weight)
        size = np.exp(GAMMA_FUNCTION.log_magnitude(gamma, loop.omega)[0][0])
        loop = LoopResponse(loop.omega, size[:, None, None] * loop.M)
        bound = upper_bound(loop.M, structure)
    blocks = len(program.structure or ())
    # With a target the first scalings need not be exact, since the descent of the level is then
    # fast.
    near = program.target is not None and before is None
    fit, D, missed = d_step(
        structure, loop, bound, blocks, before.D if before else None, COARSE if near else FINE
    )
    level = fit.peak * math.exp(missed)  # that of the loop
    return Round(D, gamma, at, target, level, fit.curvature(*D)), missed
