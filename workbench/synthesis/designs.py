"""Controllers of one plant by every synthesis method of the room, to be judged by one analysis.

    made = {name: design(task, context) for name, design in DESIGNS.items()}

Source: E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003), Table 5.1.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError, SolverError
from workbench.executor import Context
from workbench.program import Program
from workbench.solution import solve
from workbench.structure import Structure
from workbench.synthesis.h_infinity.loop_shaping import LoopShaping
from workbench.synthesis.h_infinity.mixed_sensitivity import MixedSensitivity
from workbench.synthesis.h_infinity.program import HinfSynthesis
from workbench.synthesis.h_infinity.riccati import central_controller
from workbench.synthesis.mu.program import MuSynthesis
from workbench.systems.generalised_plant import GeneralisedPlant
from workbench.systems.norms import hinf_norm

DESIGN_GAINS = tuple(np.geomspace(0.5, 4.0, 13))
"""Gains that multiply the reference controller in loop shaping."""


@dataclass(frozen=True, eq=False)
class DesignTask:
    """One plant in the form that each method needs.

    Parameters
    ----------
    plant
        Plant on which all controllers are judged. Loop shaping chooses the gain with the best
        nominal performance on it.
    regular
        Plant for which H-infinity and mu controllers are designed: the same plant, made regular by
        `regularise`.
    quadratic
        Plant for which LQG is designed: it has no perturbation, and its noise has finite variance
        in the outputs.
    nominal
        Nominal plant of the loop with negative feedback, StateSpace.
    W_S, W_KS
        Weights of mixed sensitivity, as in `MixedSensitivity`.
    reference
        A stabilising controller: it stabilises G with negative feedback, and `plant` with u = K y.
        It is the shape for loop shaping, and the start of the fixed-order method.
    sizes
        Factors on the perturbation's signals, tried in the design against one full block.
    gains
        Factors on `reference`, tried as the shape of the loop.

    Raises
    ------
    InputError
        `plant` or `regular` has no perturbation.

    Examples
    --------
    >>> import control
    >>> from workbench.executor import Context
    >>> from workbench.structure import Complex
    >>> from workbench.synthesis import DESIGNS, DesignTask, regularise
    >>> from workbench.uncertainty import generalised_plant
    >>> G = control.tf([1.0], [1.0, 1.0])
    >>> parts = [
    ...     (G, "v", "y"),
    ...     (control.ss([], [], [], [[0.2]]), "u", "z"),
    ...     (control.tf([0.4], [1.0, 0.01]), "e", "z_e"),
    ... ]
    >>> sums = {"v": "u + d", "e": "r - y"}
    >>> uncertain = [(Complex(1), "z", "d")]
    >>> plant = generalised_plant(
    ...     parts,
    ...     sums,
    ...     perturbation=uncertain,
    ...     exogenous=["r"],
    ...     performance=["z_e"],
    ...     control=["u"],
    ...     measurement="e",
    ... )
    >>> K = control.ss([[-0.01]], [[1.0]], [[1.0]], [[1.0]])
    >>> regular = regularise(plant, 0.1)
    >>> task = DesignTask(
    ...     plant,
    ...     regular,
    ...     regular.nominal(),
    ...     control.ss(G),
    ...     W_S=control.tf([0.4], [1.0, 0.01]),
    ...     W_KS=0.1,
    ...     reference=K,
    ...     sizes=[0.1, 1.0, 10.0],
    ... )
    >>> DESIGNS["reference"](task, Context()) is K
    True
    """

    plant: GeneralisedPlant
    regular: GeneralisedPlant
    quadratic: GeneralisedPlant
    nominal: StateSpace
    W_S: Any
    W_KS: Any
    reference: StateSpace
    sizes: Sequence[float]
    gains: Sequence[float] = field(default=DESIGN_GAINS, kw_only=True)

    def __post_init__(self) -> None:
        if self.plant.structure is None or self.regular.structure is None:
            raise InputError(
                "the plant has no perturbation, but the methods are compared by their robustness "
                "against one"
            )

    @property
    def structure(self) -> Structure:
        """Uncertainty structure of the perturbation."""
        assert self.regular.structure is not None
        return self.regular.structure

    def shaped(self, *, gain: float = 1.0) -> LoopShaping:
        """Loop shaping with `gain` times the reference controller in series with the plant."""
        return LoopShaping(self.nominal, W1=gain * self.reference)

    def full_block_plant(self, size: float) -> GeneralisedPlant:
        """The regular plant for one full block, with the perturbation's signals scaled by
        `size`.
        """
        out, into = [size] * self.structure.columns, [1.0 / size] * self.structure.rows
        return self.regular.unstructured().weighted(performance=out, exogenous=into)


def reference(task: DesignTask, context: Context) -> StateSpace:
    """The reference controller."""
    return task.reference


def lqg_design(task: DesignTask, context: Context) -> StateSpace:
    """LQG: the controller with the least mean square of the quadratic plant's outputs (SLICOT
    SB10HD).
    """
    import control

    quadratic = task.quadratic
    return control.h2syn(quadratic.system, quadratic.measurements, quadratic.controls)


def mixed_sensitivity(task: DesignTask, context: Context) -> StateSpace:
    """The controller with the least norm of [W_S S; W_KS K S] for the nominal plant, without
    uncertainty.
    """
    K: StateSpace = _answer(
        MixedSensitivity(task.nominal, W_S=task.W_S, W_KS=task.W_KS), context
    ).lti
    return K


def loop_shaping(task: DesignTask, context: Context) -> StateSpace:
    """Largest margin against normalised coprime factor uncertainty, for a loop shaped by the
    reference.

    The designer chooses the shape, since the method has no weight for performance. Of the gains
    tried, the one with the best nominal performance is taken.
    """
    nominal = task.plant.nominal()
    tried = []
    for gain in context.track(list(task.gains), "loop shapes"):
        program = task.shaped(gain=gain)
        K = program.controller(_answer(program, context))
        loop = nominal.close(K)
        tried.append((hinf_norm((loop.A, loop.B, loop.C, loop.D)), gain, K))
    best: StateSpace = min(tried, key=lambda each: each[:2])[2]
    return best


def full_block(task: DesignTask, context: Context) -> StateSpace:
    """H-infinity controller against one full block of uncertainty, with a constant scaling D.

    One factor scales all of the perturbation's signals; the factor with the least norm is taken.
    """

    def level(size: float) -> float:
        try:
            part = task.full_block_plant(size)
            P = part.system
            return central_controller(
                P.A, P.B, P.C, P.D, part.controls, part.measurements, 1e-2
            ).gamma
        except SolverError:
            return math.inf

    sizes = context.track(list(task.sizes), "sizes of the full block")
    best = min((level(float(size)), float(size)) for size in sizes)[1]
    K: StateSpace = _answer(HinfSynthesis(task.full_block_plant(best)), context).lti
    return K


def dk(task: DesignTask, context: Context) -> StateSpace:
    """D-K iteration: it lowers the peak of complex mu, so real scalars count as complex ones."""
    program = MuSynthesis(task.regular, task.structure.complexified())
    K: StateSpace = _answer(program, context, "dk").lti
    return K


def mu_dk(task: DesignTask, context: Context) -> StateSpace:
    """(mu, D)-K iteration: it lowers mixed mu, so real scalars count as real."""
    K: StateSpace = _answer(MuSynthesis(task.regular), context, "mu-dk").lti
    return K


def fixed_order(task: DesignTask, context: Context) -> StateSpace:
    """Direct descent of mixed mu over controllers of the reference's order, starting from the
    reference.
    """
    K: StateSpace = _answer(MuSynthesis(task.regular, start=task.reference), context, "fixed").lti
    return K


DESIGNS: dict[str, Callable[[DesignTask, Context], StateSpace]] = {
    "reference": reference,
    "LQG": lqg_design,
    "mixed sensitivity": mixed_sensitivity,
    "loop shaping": loop_shaping,
    "full block": full_block,
    "D-K": dk,
    "(mu,D)-K": mu_dk,
    "fixed order": fixed_order,
}
"""Synthesis methods by the names that tables print."""


def _answer(program: Program, context: Context, method: str | None = None) -> Any:
    """Certified answer of a method. Its iterations and checkpoints stay apart from other methods'.

    Raises SolverError where the method has no valid answer.
    """
    own = Context(options=context.options, progress=context.progress, started=context.started)
    solution = solve(program, method=method, context=own)
    if solution.certificate is None or not solution.certificate.valid:
        failed = solution.certificate.failures if solution.certificate else (solution.message,)
        raise SolverError(f"{type(program).__name__}: {'; '.join(failed)}")
    return solution.answer
