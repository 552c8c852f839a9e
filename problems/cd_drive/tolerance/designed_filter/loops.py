"""Loops of K (1 - F) while a defect passes, with every fault filter (sections 8.5 and 8.7).

Section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from workbench import Check
from workbench.certify import stability_check
from workbench.diagnosis import DemandReached, FaultEstimation, FaultLoop
from workbench.mu import Conditions, conditions
from workbench.synthesis import MarginsOfPlants, SingleLoops, discretise
from workbench.systems import bilinear_continuous
from workbench.types import RealArray, StateSpace

from ...control.loops import plants
from ...diagnosis.fault_filter.demand import limits_of, plants_of
from ...drive.plants import controller
from ...drive.tables import Axis
from ...laboratory.bench_setup import PERIOD

CONDITIONS = ("sensitivity", "robust stability", "robust sensitivity")
"""Norm of the nominal loop, mu of robust stability, and mu of robust performance; the sensitivity
is divided by its limit.
"""


def delayed_margins(axis: Axis, filters: Mapping[str, StateSpace], delay: float) -> MarginsOfPlants:
    """Margins and growth of the loops of K (1 - F) with the nominal drive and all twelve.

    filters: discrete F by name. delay: delay of the computer [samples].
    """
    import control

    K = control.ss(controller(axis))
    continuous = {name: K * (1 - bilinear_continuous(F)) for name, F in filters.items()}
    discrete = {name: discretise(K, PERIOD) * (1 - F) for name, F in filters.items()}
    systems = plants(axis, "own", "printed")
    return SingleLoops(continuous, discrete, systems, delay).margins()


def certified(loop: FaultLoop, F: StateSpace, peak: float) -> RealArray:
    """Bounds (CONDITIONS, 2) of the loop of K (1 - F); infinite if the nominal loop is unstable.

    F: discrete. peak: allowed sensitivity.
    """
    found = _removal(loop, bilinear_continuous(F), peak)
    every = (found.nominal_performance, found.robust_stability, found.robust_performance)
    return np.array([[np.inf] * 2 if one is None else [one.lower, one.upper] for one in every])


def filter_checks(
    loop: FaultLoop,
    F: StateSpace,
    order: int,
    limits: tuple[float, float, float],
    reached: DemandReached,
) -> list[Check]:
    """Checks of a discrete filter, in which everything is certified again.

    order: allowed number of states. limits: reached relative error, leakage [m] and sensitivity.
    reached: of the demand.
    """
    loop, (*limits_of_estimate, peak) = loop.within(reached.share), limits
    stability = stability_check(F)
    found = [
        Check("filter", "largest modulus of a pole, less 1", stability.value, stability.limit),
        Check("order", "states of the filter", float(F.nstates), order),
    ]
    if not stability.holds:
        return found
    requirements = loop.requirements(*limits_of_estimate)
    program = FaultEstimation(loop.plant, "f", requirements=requirements)
    continuous = bilinear_continuous(F)
    plants, over_limits = plants_of(reached), limits_of(reached)
    for channel in program.channels:
        upper = program.certified_peak(continuous, channel=channel).upper
        over = f"{plants}, in the band of the requirement"
        words = f"certified supremum of mixed mu{over_limits}"
        found.append(Check(channel.name, words, upper, 1.0, over=over))
    again = _removal(loop, continuous, peak)
    pole = np.inf if again.pole is None else again.pole.real
    statement = "rightmost pole of the nominal loop of K (1 - F) [rad/s]"
    found.append(Check("removal: stable", statement, pole, -np.finfo(float).tiny))
    stated = {
        "removal: robust stability": ("mu of robust stability", again.robust_stability),
        "removal: sensitivity": (
            f"largest |S| over its limit, as mu{over_limits}",
            again.robust_performance,
        ),
    }
    for name, (words, one) in stated.items():
        upper = np.inf if one is None else one.upper
        found.append(Check(name, words, upper, 1.0, over=plants))
    return found


def drive_checks(axis: Axis, F: StateSpace, delay: float, peak: float) -> list[Check]:
    """Checks that the drives' sampled loops have the margins that the peak of the sensitivity
    implies.
    """
    found = delayed_margins(axis, {"F": F}, delay)
    gain, phase, growth = (one[0, -1] for one in found)
    over = "for these 13 drives"
    implied = 20 * np.log10(peak / (peak - 1)) if peak > 1 else np.inf
    short = implied - float(np.nan_to_num(gain, nan=-np.inf, posinf=np.inf).min())
    angle = np.degrees(2 * np.arcsin(min(1.0, 0.5 / peak)))
    shorter = angle - float(np.nan_to_num(phase, nan=-np.inf, posinf=np.inf).min())
    words = "margin that the limit of the sensitivity implies, less the least one found"
    rate = "rate of the slowest motion [1/s]"
    return [
        Check("drives: growth", rate, float(growth.max()), 0.0, over=over),
        Check("drives: gain", f"gain {words} [dB]", short, 0.0, over=over),
        Check("drives: phase", f"phase {words} [deg]", shorter, 0.0, over=over),
    ]


def _removal(loop: FaultLoop, F: StateSpace, peak: float) -> Conditions:
    """Conditions of the loop while the estimate of F is subtracted from the error.

    Its performance is the sensitivity divided by the peak.
    """
    return conditions(loop.removal.weighted(performance=[1 / peak]), F)
