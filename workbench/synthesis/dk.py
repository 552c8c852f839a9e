"""D-K and (mu, D)-K iteration: scalings for the controller, a controller for the scalings.

An H-infinity controller lowers sigma_max(gamma D N D^-1). With gamma = 1 and D that makes this the
complex bound, that is D-K iteration. With gamma the mixed over the complex bound it is the mixed
bound that is lowered: the (mu, D)-K iteration of Toffner-Clausen, Andersen, Stoustrup and Niemann
(1995). Since gamma depends on K, it moves a share of the way each round.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from workbench.errors import InputError, SolverError
from workbench.executor import Context
from workbench.mu import upper_bound
from workbench.program import Claim, method
from workbench.solvers import Outcome
from workbench.structure import Structure
from workbench.synthesis.hinf_riccati import central
from workbench.synthesis.loops import frequencies_of, stability_of
from workbench.synthesis.mu_synthesis import Iterate, MuSynthesis
from workbench.synthesis.scaling_fit import Fit, worth
from workbench.synthesis.scalings import Scalings
from workbench.uncertainty.generalised import response

if TYPE_CHECKING:
    from control import StateSpace

Real = NDArray[np.float64]
ROUNDS = 30
LEVEL = 2e-3
"""Relative width of the interval in which the least level of a K step is found."""
SETTLED = 3e-4
"""Relative fall of the peak over `PATIENCE` rounds at which it counts as settled."""
PATIENCE, LONG_PATIENCE = 4, 8
BLEND = 0.4
"""Share of the way that gamma goes in a round: much less is slow, much more diverges."""
SMOOTH = 0.1
LEAST, UNIMPORTANT = 0.05, 0.05
"""Least gamma asked for, and weight of frequencies where mu is small."""
FARTHER = (1.0, 3.0, 7.0, 15.0, 31.0)
"""How much farther than it went D is tried, in shares of its last change."""
FLOOR = 0.5
"""Share of the peak below which scalings need not follow the bound."""


@dataclass(frozen=True, eq=False)
class Loop:
    """A closed loop on its own frequencies: ``omega`` (F,) [rad/s] and the response ``M``."""

    omega: Real
    M: NDArray[Any]

    @classmethod
    def of(cls, system: StateSpace) -> Loop:
        omega = frequencies_of(system)
        return cls(omega, response(system, omega))


@dataclass(frozen=True, eq=False)
class Round:
    """A round's scalings: ``D`` of each block, ``gamma`` of all but the measurements.

    ``target`` is the log of gamma that was asked for, at log frequencies ``at``.
    """

    D: tuple[Scalings, Real]
    gamma: Real
    at: Real
    target: Real


GAMMA = Scalings(1, 2)
"""Gamma of the (mu, D)-K iteration: a gain and two biquads."""


@method(MuSynthesis, "dk", optimal=False)
def _dk(program: MuSynthesis, context: Context) -> Claim:
    """D-K iteration: real scalars count as complex; scalings fitted by their effect on the loop."""
    return _iterated(program, context, 0.0)


@method(MuSynthesis, "mu-dk", optimal=False)
def _mu_dk(program: MuSynthesis, context: Context) -> Claim:
    """(mu, D)-K iteration: a scalar gamma makes the complex bound that K lowers the mixed one."""
    return _iterated(program, context, BLEND)


def _iterated(program: MuSynthesis, context: Context, blend: float) -> Claim:
    """Rounds of K and D steps; of those with a blend the peak may rise, and the best is kept."""
    history: list[Iterate] = []
    best: tuple[float, StateSpace, Round | None] | None = None
    K, level = program.start, np.nan
    before: Round | None = None
    used: Round | None = None
    said, patience = f"stopped after {ROUNDS} rounds", LONG_PATIENCE if blend else PATIENCE
    for _ in context.track(range(ROUNDS), "mu synthesis"):
        if K is None:
            try:
                K, level, used = _best_step(program, before, used)
            except (SolverError, InputError) as error:
                said, K = f"its H-infinity step failed: {error}", None
        loop = None if K is None else _loop(program, K)
        if K is None or loop is None:
            said = said if K is None else "rounding made a loop unstable"
            if best is None or best[2] is None or not blend or blend < 0.1 * BLEND:
                break
            used, blend, K = best[2], blend / 2, None  # back to where it was well, more slowly
            before = None
            continue
        mixed = upper_bound(loop.M, program.closed).value
        peak = float(mixed.max())
        last = Iterate(peak, level, K.nstates, np.nan)
        reached = program.reaching(K, peak, (*history, last))
        if reached is not None:
            return reached, Outcome.SOLVED, "reached the target"
        before = used
        used, missed = _scalings(program, loop, mixed, used, blend)
        if best is None or peak < best[0]:
            best = peak, K, used
        history.append(replace(last, fit=float(np.expm1(missed))))
        K = None
        peaks = np.minimum.accumulate([each.peak for each in history])
        if len(peaks) > patience and peaks[-1] > (1 - SETTLED) * peaks[-1 - patience]:
            said = "settled"
            break
    if best is None:
        return None, Outcome.FAILED, said
    return program.answer(best[1], tuple(history)), Outcome.SOLVED, said


def _loop(program: MuSynthesis, K: StateSpace) -> Loop | None:
    """The loop's response; None where the loop is not stable."""
    system = program.plant.close(K)
    return Loop.of(system) if stability_of(system).holds else None


def _best_step(
    program: MuSynthesis, before: Round | None, now: Round | None
) -> tuple[StateSpace, float, Round | None]:
    """The controller of least level, D as it is or farther in the direction of its last change.

    The alternation may be slow, and a K step costs little beside a D step.
    """
    candidates = [now]
    if before is not None and now is not None and before.D[0] == now.D[0]:
        scalings, x = now.D
        change = x - before.D[1]
        candidates += [replace(now, D=(scalings, x + share * change)) for share in FARTHER]
    K, level = k_step(program, now)
    best = K, level, now
    for candidate in candidates[1:]:
        try:
            K, level = k_step(program, candidate)
        except (SolverError, InputError):
            break
        if level >= best[1]:
            break
        best = K, level, candidate
    return best


def k_step(program: MuSynthesis, used: Round | None) -> tuple[StateSpace, float]:
    """The H-infinity controller of the scaled plant, and its level."""
    import control

    plant = program.plant
    system = plant.system if used is None else _scaled(program, used)
    made = central(
        system.A, system.B, system.C, system.D, plant.controls, plant.measurements, LEVEL
    )
    return control.ss(*made.K), made.gamma


def _scalings(
    program: MuSynthesis, loop: Loop, mixed: Real, before: Round | None, blend: float
) -> tuple[Round, float]:
    """The next scalings, and by how much D misses its bound.

    Gamma moves by a share ``blend`` of its logarithm to the mixed over the complex bound, smoothed.
    """
    structure, at = program.closed.complexified(), np.log(loop.omega)
    gamma, target, size = np.zeros((1, GAMMA.size)), np.zeros(len(at)), np.ones(len(at))
    if blend:
        bound = upper_bound(loop.M, structure).value
        wanted = _smoothed(at, np.log(np.maximum(mixed / bound, LEAST)))
        old = np.interp(at, before.at, before.target) if before else target
        target = (1 - blend) * old + blend * wanted
        weight = np.maximum(mixed / mixed.max(), UNIMPORTANT)
        gamma = GAMMA.follow(target[None], loop.omega, weight)
        size = np.exp(GAMMA.log_magnitude(gamma, loop.omega)[0][0])
    weighted = Loop(loop.omega, size[:, None, None] * loop.M)
    blocks = len(program.structure or ())
    D, missed = d_step(structure, weighted, blocks, before.D if before else None)
    return Round(D, gamma, at, target), missed


def _smoothed(at: Real, values: Real) -> Real:
    """A moving mean over SMOOTH of the log frequency."""
    weight = np.exp(-(((at[:, None] - at) / SMOOTH) ** 2) / 2)
    mean: Real = weight @ values / weight.sum(axis=1)
    return mean


def d_step(
    structure: Structure,
    loop: Loop,
    blocks: int,
    before: tuple[Scalings, Real] | None,
) -> tuple[tuple[Scalings, Real], float]:
    """Scalings of the first blocks, by as many biquads as are worth it, and what they miss.

    What is missed is the logarithm of the worst sigma_max(D M D^-1) over the upper bound, or over
    FLOOR of its peak where that is larger.
    """
    found = upper_bound(loop.M, structure)
    bound, D = found.value, found.D_left
    reference = np.maximum(bound, FLOOR * bound.max())
    first = [row.start for row in structure.column_slices]
    logs = np.log(np.diagonal(D, axis1=1, axis2=2).real[:, first]) / 2
    high = bound > 0.8 * bound.max()
    gains = np.median((logs[:, :blocks] - logs[:, blocks:]).T[:, high], axis=1)
    start = before or (Scalings(blocks, 0), gains[:, None])
    return worth(Fit.of(structure, loop.omega, loop.M, reference), start)


def _scaled(program: MuSynthesis, used: Round) -> StateSpace:
    """The plant with D at its perturbation's outputs, D^-1 at its inputs, gamma at all outputs."""
    import control

    assert program.structure is not None
    scalings, x = used.D
    pairs = zip(program.structure, scalings.systems(x), strict=True)
    inverses = zip(program.structure, scalings.systems(scalings.inverse(x)), strict=True)
    out = [d for block, d in pairs for _ in range(block.columns)]
    into = [d for block, d in inverses for _ in range(block.rows)]
    system = program.plant.system
    one = control.ss([], [], [], [[1.0]])
    left = control.append(*out, *[one] * (system.noutputs - len(out)))
    right = control.append(*into, *[one] * (system.ninputs - len(into)))
    found = left * system * right
    if not used.gamma.any():
        return found
    (gamma,) = GAMMA.systems(used.gamma)
    measurements = program.plant.measurements
    return (
        control.append(*[gamma] * (system.noutputs - measurements), *[one] * measurements) * found
    )
