"""Ways to a low crest factor: a formula, an iteration, a nonlinear program."""

from __future__ import annotations

import numpy as np

from workbench.executor import Context
from workbench.identification.crest_factor import CrestFactor, schroeder_phases
from workbench.program import Claim, method
from workbench.solvers import Outcome, ipopt, ipopt_outcome

SWAPS = 400
"""Clippings; the crest factor hardly changes after them."""
POINTS = 12
"""Instants of the nonlinear program per period of the highest line."""


@method(CrestFactor, "schroeder", optimal=False)
def _schroeder(program: CrestFactor, context: Context) -> Claim:
    """Schroeder's closed form."""
    return schroeder_phases(program.lines, program.amplitudes), Outcome.SOLVED, ""


@method(CrestFactor, "clipping", optimal=False)
def _clipping(program: CrestFactor, context: Context) -> Claim:
    """Time-frequency swapping: clip, keep the phases, restore the amplitudes, clip less.

    Van der Ouderaa, Schoukens and Renneboog, IEEE Trans. Instrum. Meas. 37(1), 1988.
    """
    return clipped_phases(program, context), Outcome.SOLVED, ""


def clipped_phases(program: CrestFactor, context: Context) -> np.ndarray:
    """The best phases met on the way of the swapping, from Schroeder's."""
    points = 16 * int(program.lines[-1])
    phases = schroeder_phases(program.lines, program.amplitudes)
    best, lowest = phases, np.inf
    for level in context.track(np.linspace(0.75, 0.995, SWAPS), "clippings"):
        signal = program.multisine(phases).period(points)
        peak = np.abs(signal).max()
        if peak < lowest:
            best, lowest = phases, peak
        clipped = np.clip(signal, -level * peak, level * peak)
        phases = np.angle(np.fft.rfft(clipped)[program.lines])
    return best


@method(CrestFactor, "ipopt", optimal=False)
def _ipopt(program: CrestFactor, context: Context) -> Claim:
    """Nonlinear program: least t with |u| <= t at every instant, from the clipped phases."""
    import casadi as ca

    start = clipped_phases(program, context)
    points = POINTS * int(program.lines[-1])
    turns = 2 * np.pi * np.outer(np.arange(points), program.lines) / points
    sizes = program.amplitudes / program.rms
    with context.stating():
        phases, peak = ca.MX.sym("phases", len(program.lines)), ca.MX.sym("peak")
        cosines, sines = ca.DM(np.cos(turns) * sizes), ca.DM(np.sin(turns) * sizes)
        signal = cosines @ ca.cos(phases) - sines @ ca.sin(phases)
        nlp = {
            "x": ca.vertcat(phases, peak),
            "f": peak,
            "g": ca.vertcat(signal - peak, -signal - peak),
        }
        solver = ipopt("crest", nlp, context.options)
    height = np.abs(program.multisine(start).period(points)).max() / program.rms
    found = solver(x0=np.append(start, height), ubg=0)["x"].full().ravel()
    outcome, message = ipopt_outcome(solver)
    return np.angle(np.exp(1j * found[:-1])), outcome, message
