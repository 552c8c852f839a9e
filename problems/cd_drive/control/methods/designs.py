"""Controllers of a CD drive by each synthesis method of Table 5.1, all for the same plant.

Equation, section and table numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from workbench.errors import SolverError
from workbench.executor import Context
from workbench.program import Program, solve
from workbench.synthesis import HinfSynthesis, LoopShaping, MixedSensitivity, MuSynthesis
from workbench.synthesis.hinf.riccati import central
from workbench.systems.norms import norm
from workbench.uncertainty import GeneralisedPlant, ParametricModel, UncertaintyModel

from ...drive.plants import ANTIALIASING, controller, nominal_parameters, plant, total_gain
from ...drive.tables import Axis
from ..control_problem import control_weight, generalised, optical_gain, performance_weight
from ..design import synthesis_plant

if TYPE_CHECKING:
    from control import StateSpace

CHANNELS = ("z_p", "z_u")
GAINS = np.geomspace(0.5, 4.0, 13)
"""Factors on eq. 6.12 that are tried as the shape of the loop."""
SIZES = np.geomspace(1e-8, 1e2, 31)
"""Sizes of the perturbation's signals that are tried."""


@dataclass(frozen=True, eq=False)
class Setting:
    """What all methods are given: an axis and its uncertainty of u [V] -> f_en [units]."""

    axis: Axis
    uncertain: UncertaintyModel | ParametricModel

    @cached_property
    def plant(self) -> GeneralisedPlant:
        """What controllers are judged on: w_p to (z_p, z_u)."""
        return generalised(self.axis, self.uncertain).channel(CHANNELS, "w_p")

    @cached_property
    def synthesis(self) -> GeneralisedPlant:
        """What they are made for: the same, with a little noise."""
        return synthesis_plant(self.axis, self.uncertain)

    @cached_property
    def G(self) -> StateSpace:
        """Nominal plant u [V] -> f_en [units], with the anti-aliasing filter."""
        import control

        if isinstance(self.uncertain, ParametricModel):
            return plant(nominal_parameters(self.axis), total_gain(self.axis))
        filtered = control.ss(-ANTIALIASING, ANTIALIASING, 1.0, 0.0)
        return filtered * self.uncertain.systems()["G"]

    @property
    def W_p(self) -> StateSpace:
        return performance_weight(self.axis)

    @property
    def W_KS(self) -> float:
        """W_u behind f_en [units] in place of e [m]."""
        return float(control_weight(self.axis).D[0, 0]) * optical_gain(self.axis)

    @cached_property
    def quadratic(self) -> GeneralisedPlant:
        """What LQG is made for: of the nominal plant, with w_p white up to the filter's corner.

        Without that limit z_p, which W_p lets through at every frequency, had infinite variance.
        """
        import control

        limit = control.ss(-ANTIALIASING, ANTIALIASING, 1.0, 0.0)
        return self.synthesis.nominal().weighted(exogenous=[limit])


def reference(setting: Setting, context: Context) -> StateSpace:
    """The reference controller, eq. 6.12 or its radial variant, made by hand after reduction."""
    import control

    return control.ss(controller(setting.axis))


def lqg(setting: Setting, context: Context) -> StateSpace:
    """The least mean square of (z_p, z_u), uncertainty as additive noise (SLICOT SB10HD)."""
    import control

    quadratic = setting.quadratic
    return control.h2syn(quadratic.system, quadratic.measurements, quadratic.controls)


def mixed_sensitivity(setting: Setting, context: Context) -> StateSpace:
    """The least norm of [W_p S; W_u K_optn K S], eq. 5.6: the nominal plant alone."""
    program = MixedSensitivity(setting.G, W_S=setting.W_p, W_KS=setting.W_KS)
    K: StateSpace = _answer(program, context).K
    return K


def loop_shaping(setting: Setting, context: Context) -> StateSpace:
    """The largest margin of normalised coprime factors, eq. 5.7, of a loop shaped by eq. 6.12.

    The shape is the designer's, and the method has no weight for performance: W_1 is eq. 6.12, an
    integral and a lead as positioning servos have, at the gain with the best nominal performance.
    """
    nominal = setting.plant.nominal()
    tried = []
    for gain in context.track(list(GAINS), "loop shapes"):
        program = shaped(setting, gain)
        K = program.controller(_answer(program, context))
        loop = nominal.close(K)
        tried.append((norm((loop.A, loop.B, loop.C, loop.D)), gain, K))
    best: StateSpace = min(tried, key=lambda each: each[:2])[2]
    return best


def shaped(setting: Setting, gain: float = 1.0) -> LoopShaping:
    """Loop shaping with that multiple of eq. 6.12 before the plant."""
    import control

    return LoopShaping(setting.G, W1=gain * control.ss(controller(setting.axis)))


def full_block(setting: Setting, context: Context) -> StateSpace:
    """The least norm against one full block of uncertainty: H-infinity with a constant D.

    The perturbation's signals are scaled together, to the size at which that norm is least.
    """

    def level(size: float) -> float:
        try:
            part = full_block_plant(setting, size)
            system = part.system
            return central(system.A, system.B, system.C, system.D, 1, 1, 1e-2).gamma
        except SolverError:
            return math.inf

    sizes = context.track(list(SIZES), "sizes of the full block")
    best = min((level(float(size)), float(size)) for size in sizes)[1]
    K: StateSpace = _answer(HinfSynthesis(full_block_plant(setting, best)), context).K
    return K


def full_block_plant(setting: Setting, size: float) -> GeneralisedPlant:
    """The plant for one full block, its signals `size` times as large."""
    structure = setting.synthesis.structure
    assert structure is not None
    out, into = [size] * structure.columns, [1.0 / size] * structure.rows
    return setting.synthesis.unstructured().weighted(out, into)


def dk(setting: Setting, context: Context) -> StateSpace:
    """D-K iteration: real scalars count as complex ones, of which it lowers the peak of mu."""
    structure = setting.synthesis.structure
    assert structure is not None
    program = MuSynthesis(setting.synthesis, structure.complexified())
    K: StateSpace = _answer(program, context, "dk").K
    return K


def mu_dk(setting: Setting, context: Context) -> StateSpace:
    """(mu, D)-K iteration: real scalars count as what they are."""
    K: StateSpace = _answer(MuSynthesis(setting.synthesis), context, "mu-dk").K
    return K


def fixed(setting: Setting, context: Context) -> StateSpace:
    """Mixed mu lowered directly over controllers of order 3, from eq. 6.12 on."""
    program = MuSynthesis(setting.synthesis, start=reference(setting, context))
    K: StateSpace = _answer(program, context, "fixed").K
    return K


DESIGNS: dict[str, Callable[[Setting, Context], StateSpace]] = {
    "reference": reference,
    "LQG": lqg,
    "mixed sensitivity": mixed_sensitivity,
    "loop shaping": loop_shaping,
    "full block": full_block,
    "D-K": dk,
    "(mu,D)-K": mu_dk,
    "fixed order": fixed,
}
"""Methods by the names of tables; the first and the last are not in Table 5.1, nor is LQG."""
FULL_ORDER = ("LQG", "mixed sensitivity", "loop shaping", "full block", "D-K", "(mu,D)-K")


def _answer(program: Program, context: Context, method: str | None = None) -> Any:
    """What a method answers, certified; its rounds and checkpoints are its own.

    Raises SolverError where it has no valid answer.
    """
    own = Context(context.options, context.progress, started=context.started)
    solution = solve(program, method, context=own)
    if solution.certificate is None or not solution.certificate.valid:
        failed = solution.certificate.failures if solution.certificate else (solution.message,)
        raise SolverError(f"{type(program).__name__}: {'; '.join(failed)}")
    return solution.answer
