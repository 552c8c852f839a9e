"""The four conditions of a loop: nominal and robust stability, nominal and robust performance.

N = F_l(P, K) is partitioned into perturbation (1) and performance (2) channels (Vidal Sanchez,
Robust and Fault Tolerant Control of CD-players (2003), section 6.2):

    nominal stability     N is stable
    nominal performance   sup sigma_max(N_22) < 1
    robust stability      sup mu_Delta(N_11) < 1
    robust performance    sup mu(N) < 1, a full block closing the performance
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass
from typing import Any

import numpy as np

from workbench._core.arrays import Array
from workbench._core.heavy_types import StateSpace
from workbench.answer import Answer, PartsChecker
from workbench.certificate import Check
from workbench.certify.agreement import SINGULAR_PROVEN, need_agreement
from workbench.certify.stability import stability_check
from workbench.mu.frequency.peak import INTERVALS_COVER, peak
from workbench.mu.frequency.peak_bounds import Peak
from workbench.mu.robust.margin_bounds import reciprocal
from workbench.second_opinion import loops
from workbench.second_opinion.peaks import one_unstable
from workbench.structure import Full, Real, Structure
from workbench.systems.conversion import need_plant
from workbench.systems.generalised_plant import GeneralisedPlant, Signals

COMPLEX_PART = 0.01
"""Default complex part, as a share of real scalars, for structures with real scalars only; without
it mu is not continuous in frequency. Bounds are then about 1 % too large, less than a model errs.
With half of it narrow peaks take longer; with double of it bounds are 2 % too large.
"""
CONDITIONS = ("nominal_performance", "robust_stability", "robust_performance")


@dataclass(frozen=True, eq=False, repr=False)
class Conditions(Answer):
    """The four conditions of a loop; each peak is certified between grid points.

    ``pole`` is the rightmost pole of the nominal loop [rad/s], for a sampled loop the pole of
    largest size (None: the loop has no states). For an unstable loop all peaks are None. Without a
    perturbation ``robust_stability`` is None; without performance channels both performances are
    None. ``dt`` is the sampling time [s], 0 for continuous time.

    Examples
    --------
    >>> import control
    >>> from workbench.mu import conditions
    >>> from workbench.structure import Complex
    >>> from workbench.uncertainty import generalised_plant
    >>> G = control.tf([1.0], [1.0, 1.0])
    >>> parts = [
    ...     (G, "v", "y"),
    ...     (control.tf([0.2], [1.0]), "u", "z"),
    ...     (control.tf([0.4], [1.0]), "e", "z_e"),
    ... ]
    >>> plant = generalised_plant(
    ...     parts,
    ...     {"v": "u + d", "e": "r - y"},
    ...     perturbation=[(Complex(1), "z", "d")],
    ...     exogenous="r",
    ...     performance="z_e",
    ...     control="u",
    ...     measurement="e",
    ... )
    >>> K = control.tf([2.0], [1.0])
    >>> found = conditions(plant, K)
    >>> found.met, bool(found.stability_margin[0] > 1)
    (True, True)
    """

    pole: complex | None
    nominal_performance: Peak | None
    robust_stability: Peak | None
    robust_performance: Peak | None
    _: KW_ONLY
    dt: float = 0.0

    @property
    def nominal_stability(self) -> bool:
        """Whether the nominal loop is stable."""
        if self.pole is None:
            return True
        return abs(self.pole) < 1.0 if self.dt else self.pole.real < 0.0

    @property
    def met(self) -> bool:
        """Whether the nominal loop is stable and every peak is proven to be below 1."""
        peaks = (self.nominal_performance, self.robust_stability, self.robust_performance)
        return self.nominal_stability and all(p is None or p.upper < 1 for p in peaks)

    def summary(self) -> str:
        lines = [
            f"Conditions: {'met' if self.met else 'NOT met'}; nominal pole {self.pole:.5g}"
            if self.pole is not None
            else f"Conditions: {'met' if self.met else 'NOT met'}"
        ]
        for name in ("nominal_performance", "robust_stability", "robust_performance"):
            found = getattr(self, name)
            if found is not None:
                bounds = f"{found.lower:.5g} to {found.upper:.5g}"
                lines.append(f"  {name.replace('_', ' ')}: mu from {bounds}")
        return "\n".join(lines)

    @property
    def stability_margin(self) -> tuple[float, float] | None:
        """Factors by which the uncertainty may grow: 1 / upper and 1 / lower of the peak.

        With a margin of 1.3 the loop is stable for all uncertainty that is 30 % larger. Stability
        is proven below the first factor. At the second factor a destabilising perturbation is
        known; it is infinite where none was found. None where there is no peak.
        """
        return _margin(self.robust_stability)

    @property
    def performance_margin(self) -> tuple[float, float] | None:
        """Factors as `stability_margin`, by which uncertainty and performance may grow together.

        With a margin of 1.3 the uncertainty may grow by 30 % while the worst-case gain of the
        channel stays below 1 / 1.3. For performance alone see `worst_case_gain`.
        """
        return _margin(self.robust_performance)


@dataclass(frozen=True, eq=False)
class ConditionsChecker(PartsChecker):
    """Checks the `Conditions` of a nominal loop."""

    loop: StateSpace

    @property
    def quantifier(self) -> str:
        return "for the loop of the nominal plant"

    def parts(self, answer: Conditions) -> Mapping[str, Peak | None]:
        return {
            "nominal performance": answer.nominal_performance,
            "robust stability": answer.robust_stability,
            "robust performance": answer.robust_performance,
        }

    def checks(self, answer: Conditions, tolerance: float) -> list[Check]:
        if answer.nominal_stability:
            return [stability_check(self.loop)]
        peaks = [one for one in self.parts(answer).values() if one is not None]
        return [Check("unstable", "number of peaks claimed of it", float(len(peaks)), 0.0)]

    def second_opinion(self, answer: Conditions) -> list[Check]:
        if answer.nominal_stability:
            return [loops.powers_fall(self.loop.A, self.loop.dt)]
        return [one_unstable([self.loop])]


def conditions(
    plant: GeneralisedPlant,
    controller: Any,
    *,
    performance: Signals = None,
    exogenous: Signals = None,
    tolerance: float = 1e-3,
    complex_part: float = COMPLEX_PART,
) -> Conditions:
    """Nominal and robust stability and performance of a plant closed by a controller.

    Parameters
    ----------
    controller
        StateSpace or TransferFunction.
    performance, exogenous
        The performance channel, as in `GeneralisedPlant.channel`; a single w_p -> z_p gives a
        1-by-1 block.
    tolerance
        As in `peak`.
    complex_part
        As in `peak`, for robust stability if all scalars are real. It is not added anywhere else.

    Raises
    ------
    InputError, UnknownNameError
        As `GeneralisedPlant.channel`, `GeneralisedPlant.close` and `peak`.
    ContradictionError
        A lower bound is above an upper one, of the same peak or of one that cannot be larger.

    Examples
    --------
    >>> import control
    >>> from workbench.mu import conditions
    >>> from workbench.structure import Complex
    >>> from workbench.uncertainty import generalised_plant
    >>> G = control.tf([1.0], [1.0, 1.0])
    >>> parts = [
    ...     (G, "v", "y"),
    ...     (control.tf([0.2], [1.0]), "u", "z"),
    ...     (control.tf([0.4], [1.0]), "e", "z_e"),
    ... ]
    >>> plant = generalised_plant(
    ...     parts,
    ...     {"v": "u + d", "e": "r - y"},
    ...     perturbation=[(Complex(1), "z", "d")],
    ...     exogenous="r",
    ...     performance="z_e",
    ...     control="u",
    ...     measurement="e",
    ... )
    >>> K = control.tf([2.0], [1.0])
    >>> found = conditions(plant, K)
    >>> (
    ...     found.nominal_stability,
    ...     round(found.robust_stability.upper, 2),
    ... )  # 0.2 * 2 / 3 at most of K S
    (True, 0.13)
    """

    need_plant(plant)
    chosen = plant.channel(performance=performance, exogenous=exogenous)
    N = chosen.close(controller)
    poles = N.poles()
    dt = float(N.dt or 0.0)
    out = np.abs(poles) - 1.0 if dt else poles.real
    pole = complex(poles[np.argmax(out)]) if len(poles) else None
    if pole is not None and out.max() >= 0:
        return Conditions(pole, None, None, None, dt=dt).with_checker(ConditionsChecker(N))

    structure = plant.structure
    found: dict[str, Peak | None] = dict.fromkeys(CONDITIONS)
    for name, (part, blocks) in condition_systems(chosen, controller).items():
        real = name == "robust_stability" and all(isinstance(one, Real) for one in blocks)
        found[name] = peak(
            part, blocks, tolerance=tolerance, complex_part=complex_part if real else 0.0
        )
    nominal, stability, robust = (found[name] for name in CONDITIONS)
    if robust is not None and structure is not None:
        # Both are peaks over smaller sets of perturbations: one of the two blocks is 0.
        real = all(isinstance(block, Real) for block in structure)
        for smaller, word in ((nominal, "performance"), (None if real else stability, "stability")):
            if smaller is not None:
                need_agreement(
                    smaller.lower,
                    robust.upper,
                    "the peak of mu of robust performance",
                    f"the peak of its part, {word}, is at least that: {SINGULAR_PROVEN}",
                    INTERVALS_COVER,
                )
    elif structure is None:
        robust = nominal
    return Conditions(pole, nominal, stability, robust, dt=dt).with_checker(ConditionsChecker(N))


def condition_systems(
    plant: GeneralisedPlant, controller: Any
) -> dict[str, tuple[StateSpace, Structure]]:
    """For each condition that applies, the system that a perturbation closes, and its structure.

    `conditions` passes them to `peak`, and a `PeakChecker` certifies the peaks with them. For a
    part of the performance channels take `plant.channel` first.

    Raises InputError as `GeneralisedPlant.close`.

    Examples
    --------
    >>> import control
    >>> from workbench.mu import condition_systems
    >>> from workbench.structure import Complex
    >>> from workbench.uncertainty import generalised_plant
    >>> G = control.tf([1.0], [1.0, 1.0])
    >>> plant = generalised_plant(
    ...     [(G, "v", "y"), (control.tf([0.2], [1.0]), "u", "z")],
    ...     {"v": "u + d", "e": "-y"},
    ...     perturbation=[(Complex(1), "z", "d")],
    ...     control="u",
    ...     measurement="e",
    ... )
    >>> asked = condition_systems(plant, control.tf([2], [1]))
    >>> {name: N.nstates for name, (N, _) in asked.items()}
    {'robust_stability': 1}
    """
    import control

    N, structure = plant.close(controller), plant.structure
    rows, columns = (structure.columns, structure.rows) if structure else (0, 0)
    y, z = np.split(np.arange(N.noutputs), [rows])
    u, w = np.split(np.arange(N.ninputs), [columns])

    def part(outputs: Array, inputs: Array) -> StateSpace:
        B, C, D = N.B[:, inputs], N.C[outputs], N.D[np.ix_(outputs, inputs)]
        return control.ss(N.A, B, C, D, float(N.dt or 0.0))

    performs = min(len(z), len(w)) > 0
    found = {}
    if performs:
        found["nominal_performance"] = (
            part(z, w),
            Structure([Full(len(w), len(z), name="performance")]),
        )
    if structure is not None:
        found["robust_stability"] = part(y, u), structure
        if performs:
            whole = part(np.arange(N.noutputs), np.arange(N.ninputs))
            found["robust_performance"] = whole, plant.performance_structure
    return found


def _margin(found: Peak | None) -> tuple[float, float] | None:
    """Lower and upper bound of the reciprocal of a peak; None without a peak."""
    if found is None:
        return None
    return reciprocal(found.upper), reciprocal(found.lower)
