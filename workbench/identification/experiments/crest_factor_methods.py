"""Methods for a low crest factor: a formula, an iteration and a nonlinear program."""

from __future__ import annotations

import numpy as np

from workbench.accuracy import ANY_ACCURACY_ALIKE
from workbench.executor import Context
from workbench.identification.experiments.crest_factor import CrestFactor, schroeder_phases
from workbench.program import Claim, method
from workbench.solvers import Outcome, in_one_thread, ipopt, ipopt_outcome

CLIPPINGS = 400
"""Number of clippings; the crest factor hardly changes after them."""
INSTANTS_PER_PERIOD = 16
"""Instants per period of the highest line at which the signal is computed."""
HALF_POWERS = tuple(2**n for n in range(1, 9))
"""Halves p / 2 of the even powers p whose p-norms are minimised in turn."""


@method(CrestFactor, "schroeder", optimal=False, accuracy=ANY_ACCURACY_ALIKE)
def _schroeder(program: CrestFactor, context: Context) -> Claim:
    """Schroeder's closed form."""
    return schroeder_phases(program.lines, program.amplitudes), Outcome.SOLVED, ""


@method(CrestFactor, "clipping", optimal=False, accuracy=ANY_ACCURACY_ALIKE)
def _clipping(program: CrestFactor, context: Context) -> Claim:
    """Alternate clipping in time with restoring the amplitudes; clip less each time.

    Van der Ouderaa, Schoukens and Renneboog, IEEE Trans. Instrum. Meas. 37(1), 1988.
    """
    return clipped_phases(program, context), Outcome.SOLVED, ""


def clipped_phases(program: CrestFactor, context: Context) -> np.ndarray:
    """The best phases [rad] found by repeated clipping from Schroeder's phases."""
    points = INSTANTS_PER_PERIOD * int(program.lines[-1])
    phases = schroeder_phases(program.lines, program.amplitudes)
    best, lowest = phases, np.inf
    for level in context.track(np.linspace(0.75, 0.995, CLIPPINGS), "clippings"):
        signal = program.multisine(phases).period(points=points)
        peak = np.abs(signal).max()
        if peak < lowest:
            best, lowest = phases, peak
        clipped = np.clip(signal, -level * peak, level * peak)
        phases = np.angle(np.fft.rfft(clipped)[program.lines])
    return best


@method(CrestFactor, "ipopt", optimal=False)
@in_one_thread
def _ipopt(program: CrestFactor, context: Context) -> Claim:
    """Nonlinear programs: least p-norm for p doubled each time, from the clipped phases.

    Guillaume, Schoukens, Pintelon and Kollar, IEEE Trans. Instrum. Meas. 40(6), 1991. The minimax
    program itself has a constraint for every instant, and takes a hundred times as long.
    """
    import casadi as ca

    points = INSTANTS_PER_PERIOD * int(program.lines[-1])
    turns = 2 * np.pi * np.outer(np.arange(points), program.lines) / points
    with context.stating():
        phases = ca.MX.sym("phases", len(program.lines))
        height, half = ca.MX.sym("height"), ca.MX.sym("half")
        cosines = ca.DM(np.cos(turns) * program.amplitudes)
        sines = ca.DM(np.sin(turns) * program.amplitudes)
        signal = (cosines @ ca.cos(phases) - sines @ ca.sin(phases)) / height
        norm = ca.log(ca.sum1((signal**2) ** half) / points) / (2 * half)
        nlp = {"x": phases, "p": ca.vertcat(height, half), "f": norm}
        solver = ipopt("crest", nlp, context.options)
    found = clipped_phases(program, context)
    best, lowest, message = found, _peak(program, found), "no step lowered the peak"
    for half_power in context.track(HALF_POWERS, "norms"):
        peak = _peak(program, found)
        found = solver(x0=found, p=[peak, half_power])["x"].full().ravel()
        if (peak := _peak(program, found)) < lowest:
            best, lowest, message = found, peak, ipopt_outcome(solver)[1]
    return np.angle(np.exp(1j * best)), Outcome.SOLVED, message


def _peak(program: CrestFactor, phases: np.ndarray) -> float:
    """Largest |u| at the instants of the methods."""
    signal = program.multisine(phases).period(points=INSTANTS_PER_PERIOD * int(program.lines[-1]))
    return float(np.abs(signal).max())
