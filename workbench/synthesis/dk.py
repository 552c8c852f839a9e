"""D-K iteration: scalings for the controller, a controller for the scalings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from workbench.errors import InputError, SolverError
from workbench.executor import Context
from workbench.mu import upper_bound
from workbench.mu.sweep import starting_grid
from workbench.program import Claim, method
from workbench.solvers import Outcome
from workbench.structure import Structure
from workbench.synthesis.hinf_riccati import central
from workbench.synthesis.mu_synthesis import Iterate, MuSynthesis
from workbench.synthesis.scalings import SPREAD, Scalings
from workbench.uncertainty.generalised import response

if TYPE_CHECKING:
    from control import StateSpace

Real = NDArray[np.float64]
ROUNDS = 20
LEVEL = 2e-3
"""Relative width of the interval in which the least level of a K step is found."""
SETTLED = 3e-4
"""Relative fall of the peak over `PATIENCE` rounds at which it counts as settled."""
PATIENCE = 3
MOST_BIQUADS = 4
GOOD = 0.002
"""By how much fitted scalings may miss the bound where more biquads are not worth it, relative."""
FLOOR = 0.5
"""Share of the peak below which scalings need not follow the bound."""


@dataclass(frozen=True, eq=False)
class Loop:
    """A closed loop on its own frequencies: ``omega`` (F,) [rad/s] and the response ``M``."""

    omega: Real
    M: NDArray[Any]

    @classmethod
    def of(cls, system: StateSpace) -> Loop:
        omega = starting_grid(system.poles())
        omega = omega[(omega > 0) & np.isfinite(omega)]
        return cls(omega, response(system, omega))


@method(MuSynthesis, "dk", optimal=False)
def _dk(program: MuSynthesis, context: Context) -> Claim:
    """D-K iteration: real scalars count as complex; scalings fitted by their effect on the loop."""
    structure = program.closed.complexified()
    K, found = program.start, None
    history: list[Iterate] = []
    best: tuple[float, StateSpace] | None = None
    said, level = "settled", np.nan
    for _ in context.track(range(ROUNDS), "D-K iteration"):
        if K is None:
            try:
                K, level = k_step(program, found)
            except (SolverError, InputError) as error:
                said = f"ended by its H-infinity step: {error}"
                break
        system = program.plant.close(K)
        if system.poles().real.max() >= 0:
            said = "ended by a loop that rounding made unstable"
            break
        loop = Loop.of(system)
        bound = upper_bound(loop.M, structure).value
        peak = float(upper_bound(loop.M, program.closed).value.max())
        if best is None or peak < best[0]:
            best = peak, K
        found, missed = d_step(structure, loop, bound, len(program.structure or ()), found)
        history.append(Iterate(peak, level, K.nstates, float(np.expm1(missed))))
        K = None
        peaks = np.minimum.accumulate([each.peak for each in history])
        if len(peaks) > PATIENCE and peaks[-1] > (1 - SETTLED) * peaks[-1 - PATIENCE]:
            break
    else:
        said = f"stopped after {ROUNDS} rounds"
    if best is None:
        return None, Outcome.FAILED, said
    return program.answer(best[1], tuple(history)), Outcome.SOLVED, said


def k_step(program: MuSynthesis, found: tuple[Scalings, Real] | None) -> tuple[StateSpace, float]:
    """The H-infinity controller of the scaled plant, and its level."""
    import control

    plant = program.plant
    system = plant.system if found is None else _scaled(program, *found)
    made = central(
        system.A, system.B, system.C, system.D, plant.controls, plant.measurements, LEVEL
    )
    return control.ss(*made.K), made.gamma


def d_step(
    structure: Structure,
    loop: Loop,
    bound: Real,
    blocks: int,
    before: tuple[Scalings, Real] | None,
) -> tuple[tuple[Scalings, Real], float]:
    """Scalings of the first blocks, by as many biquads as are worth it, and what they miss.

    ``bound`` (F,) is the upper bound at the loop's frequencies. What is missed is the logarithm of
    the worst sigma_max(D M D^-1) over the bound, or over FLOOR of its peak where that is larger.
    """
    reference = np.maximum(bound, FLOOR * bound.max())
    D = upper_bound(loop.M, structure).D_left
    first = [row.start for row in structure.column_slices]
    logs = np.log(np.diagonal(D, axis1=1, axis2=2).real[:, first]) / 2
    high = bound > 0.8 * bound.max()
    gains = np.median((logs[:, :blocks] - logs[:, blocks:]).T[:, high], axis=1)
    middle = float(np.log(loop.omega[np.argmax(bound)]))
    best: tuple[tuple[Scalings, Real], float] | None = None
    for biquads in range(MOST_BIQUADS + 1):
        scalings = Scalings(blocks, biquads)
        starts = [scalings.guess(gains, middle, spread) for spread in SPREAD]
        if before is not None and before[0] == scalings:
            starts.append(before[1])
        fits = [scalings.fit(loop.M, structure, loop.omega, reference, x) for x in starts]
        x, missed = min(fits, key=lambda fit: fit[1])
        if best is None or missed < best[1] - GOOD:
            best = (scalings, x), missed
        if missed < GOOD:
            break
    assert best is not None
    return best


def _scaled(program: MuSynthesis, scalings: Scalings, x: Real) -> StateSpace:
    """The plant with D at its perturbation's outputs and D^-1 at its inputs."""
    import control

    assert program.structure is not None
    pairs = list(zip(program.structure, scalings.systems(x), strict=True))
    inverses = zip(program.structure, scalings.systems(scalings.inverse(x)), strict=True)
    out = [d for block, d in pairs for _ in range(block.columns)]
    into = [d for block, d in inverses for _ in range(block.rows)]
    system = program.plant.system
    one = control.ss([], [], [], [[1.0]])
    left = control.append(*out, *[one] * (system.noutputs - len(out)))
    right = control.append(*into, *[one] * (system.ninputs - len(into)))
    return left * system * right
