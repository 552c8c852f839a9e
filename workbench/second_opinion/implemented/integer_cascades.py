"""Fixed-point cascades, driven by the errors and inputs that are worst for them.

The worst signal is the sign of an impulse response, reversed in time. The value that it reaches
within the samples tried can refute a bound but never confirm it.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench._core.arrays import RealArray
from workbench.certificate import Check, relative_excess
from workbench.executor.effort import tries

SAMPLES = 600
"""Number of samples of each impulse response."""
REACHED_ROUNDING = 1e-9
"""Share by which rounding of doubles may lift the reached value above a bound."""


def reached_rounding(
    channels: Any, shifts: Any, plant: Any, sign: int, step: float, claimed: float
) -> Check:
    """Check that no rounding errors in the loop move the control beyond the claimed bound.

    Parameters
    ----------
    channels, shifts
        Sections (L, 6) and shifts (L,) of input j to output i, in lists of lists.
    plant
        Sampled StateSpace in full scales, with its delay.
    sign
        u = sign K y.
    step
        One unit of a signal.
    claimed
        The bound, over full scale.
    """
    sizes = [np.full(plant.noutputs, step / 2)]
    sizes += [step / 2 * np.exp2(one.astype(float)) for line in shifts for one in line]
    errors = np.concatenate(sizes)
    total = np.zeros(plant.ninputs)
    for control in _impulses(channels, plant, sign, errors.size):
        total += np.abs(control) @ errors
    reached = float(total.max(initial=0.0)) + step / 2  # from the conversion of the control
    statement = (
        "error of the control that the worst roundings reach, over the claimed bound, less 1"
    )
    over = f"for the worst roundings of {tries(SAMPLES)} samples"
    return Check(
        "worst roundings", statement, relative_excess(reached, claimed), REACHED_ROUNDING, over=over
    )


def reached_signals(channels: Any, shifts: Any, largest: Any, step: float) -> Check:
    """Check that no measurement within full scale drives a section beyond its claimed bound."""
    worst = 0.0
    for line, shift_of, claims in zip(channels, shifts, largest, strict=True):
        for rows, shift, claim in zip(line, shift_of, claims, strict=True):
            reached = np.abs(_outputs(rows)).sum(axis=0) * np.exp2(-shift.astype(float))
            for k, bound in enumerate(claim):
                saturated = k == len(claim) - 1 and bound >= 1.0 - step
                if np.isfinite(bound) and not saturated:
                    worst = max(worst, float(reached[k]) / bound)
    statement = "signal that the worst measurement reaches, over the claimed bound, less 1"
    over = f"for the worst measurements of {tries(SAMPLES)} samples"
    return Check("worst measurements", statement, worst - 1.0, REACHED_ROUNDING, over=over)


def _outputs(rows: RealArray) -> RealArray:
    """Impulse responses (N, L) from the input of the cascade to each section's output."""
    memory = np.zeros((len(rows), 4))
    found = np.zeros((tries(SAMPLES), len(rows)))
    for n in range(tries(SAMPLES)):
        v = float(n == 0)
        for k, (b0, b1, b2, _, a1, a2) in enumerate(rows):
            v1, v2, w1, w2 = memory[k]
            w = b0 * v + b1 * v1 + b2 * v2 - a1 * w1 - a2 * w2
            memory[k] = v, v1, w, w1
            found[n, k] = v = w
    return found


def _impulses(channels: Any, plant: Any, sign: int, count: int) -> Any:
    """Controls (outputs, count) at each sample, after an impulse of each error at the first sample.

    The errors are those of the measurements, then those of each section of each cascade.
    """
    G = [np.asarray(part, dtype=float) for part in (plant.A, plant.B, plant.C, plant.D)]
    inputs, outputs = plant.noutputs, plant.ninputs
    memory = [[np.zeros((len(rows), 4, count)) for rows in line] for line in channels]
    x, u = np.zeros((len(G[0]), count)), np.zeros((outputs, count))
    for n in range(tries(SAMPLES)):
        first = np.eye(count) if n == 0 else np.zeros((count, count))
        y = G[2] @ x + G[3] @ u + first[:inputs]
        control, error = np.zeros((outputs, count)), inputs
        for i, line in enumerate(channels):
            for j, rows in enumerate(line):
                v = y[j]
                for k, (b0, b1, b2, _, a1, a2) in enumerate(rows):
                    v1, v2, w1, w2 = memory[i][j][k]
                    w = b0 * v + b1 * v1 + b2 * v2 - a1 * w1 - a2 * w2 + first[error]
                    memory[i][j][k] = v, v1, w, w1
                    v, error = w, error + 1
                control[i] += v
        u = sign * control
        x = G[0] @ x + G[1] @ u
        yield control
