"""(D, G)-K iteration, and D-K iteration with a full D for repeated scalars.

D-K iteration treats real scalars as complex. D and G together give the upper bound on mixed mu. The
plant absorbs both as multipliers (see `scaled_plant`), and a controller is designed for this plant.
P. Young, Controller design with mixed uncertainties, American Control Conference (1994).

The (D, G)-K iteration is an independent answer, compared only if it is named: with 10 s for each
cell it has no controller for the CD drives, and elsewhere none below that of D-K iteration
(docs/study.md).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import StateSpace
from workbench.accuracy import ANY_ACCURACY_ALIKE
from workbench.certify.stability import stability_check
from workbench.errors import InputError, SolverError, TimeLimitError
from workbench.executor import Context
from workbench.mu import upper_bound
from workbench.program import Claim, method
from workbench.solvers import Outcome
from workbench.structure import Full, Structure
from workbench.synthesis.mu.biquads import Biquads, FrequencyRange
from workbench.synthesis.mu.dk import (
    MOST_ROUNDS,
    NOTHING_ACTS,
    PATIENCE,
    SETTLED_FALL,
    TARGET_REACHED,
    iterated,
)
from workbench.synthesis.mu.finish import Finish
from workbench.synthesis.mu.mu_controller import MuController
from workbench.synthesis.mu.multipliers.dg_step import (
    FittedMultipliers,
    dg_step,
    extended_loop,
    without_G,
)
from workbench.synthesis.mu.multipliers.functions import Multipliers
from workbench.synthesis.mu.multipliers.k_step import dgk_k_step
from workbench.synthesis.mu.multipliers.scaled_plant import scaled_by_D
from workbench.synthesis.mu.program import MuSynthesis
from workbench.synthesis.mu.rounds import Iterate, packed, unpacked
from workbench.synthesis.mu.scaled_plant import scaled_plant
from workbench.systems.generalised_plant import GeneralisedPlant
from workbench.systems.realisation import realisation

ENDS = TARGET_REACHED, NOTHING_ACTS
"""Messages of D-K iteration after which there is nothing to improve."""
EXTRAPOLATIONS = (1.0, 3.0, 7.0, 15.0, 31.0)
"""Multiples of the last change of the multipliers, tried as a further change in the same
direction.
"""


@method(MuSynthesis, "dk", optimal=False, accuracy=ANY_ACCURACY_ALIKE)
def _dk(program: MuSynthesis, context: Context) -> Claim:
    """D-K iteration with real scalars taken as complex; scalings are fitted to their bound."""
    structure = program.closed_structure.complexified()
    repeated = any(block.rows > 1 for block in structure if not isinstance(block, Full))
    return _from_dk(program, context, structure if repeated else None)


@method(MuSynthesis, "dgk", optimal=False, accuracy=ANY_ACCURACY_ALIKE, by_name=True)
def _dgk(program: MuSynthesis, context: Context) -> Claim:
    """(D, G)-K iteration: D-K iteration, followed by rounds in which real scalars also have G."""
    real = program.closed_structure != program.closed_structure.complexified()
    return _from_dk(program, context, program.closed_structure if real else None)


def _from_dk(program: MuSynthesis, context: Context, structure: Structure | None) -> Claim:
    """D-K iteration with one function per block, then rounds with the multipliers of a structure.

    If the structure is None, the second part is left out.
    """
    kept = context.checkpoint.load()
    finish = Finish(program, context, partial(_scaled, program.plant, structure))
    if structure is not None and kept is not None and "multipliers" in kept:
        now = DGKState.restored(structure, kept)
        return iterated_with_multipliers(program, context, structure, now, finish)
    begun = iterated(program, context, 0.0)
    answer, _, said = begun
    if answer is None or structure is None or said in ENDS or context.stopped:
        return begun
    finish.sure = answer
    now = DGKState(list(answer.history))
    return iterated_with_multipliers(program, context, structure, now, finish)


def _scaled(
    plant: GeneralisedPlant, structure: Structure | None, parameters: Mapping[str, RealArray]
) -> GeneralisedPlant:
    """The plant with D of a round at its perturbation channels, without G."""
    x = parameters.get("multipliers")
    if x is None or structure is None:
        return scaled_plant(plant, parameters)
    multipliers = Multipliers(Structure(structure.blocks[:-1]), Biquads.of(x).biquads)
    return replace(plant, system=realisation(scaled_by_D(plant, multipliers, x), 0.0))


@dataclass(eq=False)
class DGKState:
    """State of the rounds with multipliers.

    ``history`` has all rounds; the first ``first`` of them are those of D-K iteration. ``used`` are
    the last multipliers and ``before`` those before them. Corners lie ``within`` frequencies
    [rad/s]. ``tried`` is the number of rounds tried.
    """

    history: list[Iterate]
    first: int = 0
    within: FrequencyRange | None = None
    before: FittedMultipliers | None = None
    used: FittedMultipliers | None = None
    tried: int = field(default=0)

    def __post_init__(self) -> None:
        self.first = self.first or len(self.history)

    def arrays(self) -> dict[str, NDArray[Any]]:
        """The whole state as arrays by name, for a checkpoint."""
        assert self.used is not None and self.within is not None
        found = packed(self.history) | {
            "first": np.array(self.first),
            "tried": np.array(self.tried),
            "within": np.array(self.within),
            "multipliers": self.used[1],
            "biquads": np.array(self.used[0].biquads),
        }
        if self.before is not None:
            found |= {"before": self.before[1], "before_biquads": np.array(self.before[0].biquads)}
        return found

    @classmethod
    def restored(cls, structure: Structure, arrays: Any) -> DGKState:
        """The state that `arrays` gave."""
        blocks = Structure(structure.blocks[:-1])

        def pair(x: str, biquads: str) -> FittedMultipliers | None:
            return (Multipliers(blocks, int(arrays[biquads])), arrays[x]) if x in arrays else None

        low, high = arrays["within"].tolist()
        return cls(
            unpacked(arrays),
            int(arrays["first"]),
            (low, high),
            pair("before", "before_biquads"),
            pair("multipliers", "biquads"),
            int(arrays["tried"]),
        )


def iterated_with_multipliers(
    program: MuSynthesis, context: Context, structure: Structure, now: DGKState, finish: Finish
) -> Claim:
    """Iterate K and D steps with multipliers of a structure and return the best controller.

    The first round starts with the best controller so far.
    """
    try:
        if finish.sure is None:  # these rounds were made before an interruption
            finish.resume(now.history)
        ended = _rounds(program, context, structure, now, finish)
    except TimeLimitError as error:
        ended = finish.late(error)
    if isinstance(ended, MuController):
        return ended, Outcome.SOLVED, TARGET_REACHED
    return finish.claim(now.history, ended)


def _rounds(
    program: MuSynthesis, context: Context, structure: Structure, now: DGKState, finish: Finish
) -> MuController | str:
    """Run the rounds and return why they ended; a controller that reaches the target ends them.

    The first round starts with the best controller so far.
    """
    begun = min(now.history, key=lambda each: each.peak)
    K = begun.K if now.used is None else None
    level = np.nan
    for tried in context.rounds(MOST_ROUNDS, "multipliers", first=now.tried):
        if K is None:
            assert now.used is not None
            try:
                K, level, now.used = _best_step(program, now.before, now.used, now.history[-1].peak)
            except (SolverError, InputError) as error:
                return f"its H-infinity step failed: {error}"
        system = program.plant.close(K)
        if not stability_check(system).holds:
            return "rounding made a loop unstable"
        loop, corners = extended_loop(system)
        peak = float(upper_bound(loop.M, program.closed_structure).value.max())
        now.within = now.within or corners
        start = now.used or without_G(structure, loop, begun.scalings["D"])
        now.before = now.used
        now.used, missed = dg_step(structure, loop, now.within, start)
        fit = float(np.expm1(missed))
        last = Iterate(peak, level, fit, K, scalings={"multipliers": now.used[1]})
        reached = program.answer_within_target(K, peak, (*now.history, last))
        if reached is not None:
            return reached
        finish.offer(last)
        now.history.append(last)
        context.record(last.row(len(now.history)))
        K = None
        if _has_settled([each.peak for each in now.history[now.first :]]):
            return "settled"
        now.tried = tried + 1
        context.checkpoint.save(now.arrays())
    return context.stopped or f"stopped after {MOST_ROUNDS} rounds"


def _has_settled(peaks: Sequence[float]) -> bool:
    """Whether the least peak has not decreased for `PATIENCE` rounds and does not decrease now."""
    least = np.minimum.accumulate(peaks)
    falls = len(peaks) > 1 and peaks[-1] < (1 - SETTLED_FALL) * peaks[-2]
    return bool(
        len(peaks) > PATIENCE
        and least[-1] > (1 - SETTLED_FALL) * least[-1 - PATIENCE]
        and not falls
    )


def _best_step(
    program: MuSynthesis,
    before: FittedMultipliers | None,
    now: FittedMultipliers,
    near: float,
) -> tuple[StateSpace, float, FittedMultipliers]:
    """The controller with the least bound, this bound, and its multipliers.

    Multipliers are tried as they are, and moved farther in the direction of their last change.
    """
    multipliers, x = now
    K, level = dgk_k_step(program, multipliers, x, near)
    best = K, level, now
    if before is None or before[0] != multipliers:
        return best
    for share in EXTRAPOLATIONS:
        candidate = x + share * (x - before[1])
        try:
            K, level = dgk_k_step(program, multipliers, candidate, near)
        except (SolverError, InputError):
            break
        if level >= best[1]:
            break
        best = K, level, (multipliers, candidate)
    return best
