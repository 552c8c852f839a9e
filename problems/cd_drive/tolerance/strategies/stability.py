"""Stability of the loops of strategies A and B on a clean disc."""

from __future__ import annotations

import numpy as np

from workbench.certify import certified_norm
from workbench.diagnosis import Rotation
from workbench.simulation import discrete_system
from workbench.systems import bilinear_continuous

from ...diagnosis.position_estimator.model import kalman
from ...laboratory.bench_setup import PERIOD
from ...laboratory.experiment import Laboratory
from ..tactics import Strategies


def repetitive_level(strategies: Strategies, bench: Laboratory) -> float:
    """Largest |Q (1 - g T)| of strategy A on a drive; below 1 it is stable, see `Repetitive`.

    It is certified between grid points by the Hamiltonians of the continuous system of the same
    norm, since SLICOT's norm of this discrete system is 4 % too small. Raises InputError if K alone
    does not stabilise the drive.
    """
    loop = -bench.sampled_error() * discrete_system(strategies.controller, PERIOD)
    return certified_norm(bilinear_continuous(strategies.repetitive.contraction(loop)))


def estimated_decay(strategies: Strategies, bench: Laboratory) -> float:
    """Decay rate [1/s] of the slowest mode of strategy B on a drive; negative if it grows.

    The loop is closed at quality 1. It has the drive with its delay, K, and the Kalman filter in
    steady state, which gets the previous command and whose u_p is added to K's command.
    """
    drive = bench.sampled_error()
    K = discrete_system(strategies.controller, PERIOD)
    settled = kalman(bench.axis, Rotation(strategies.rotation)).steady_state
    model, n = settled.model, settled.model.seen
    A, B, C = model.A[:n, :n], model.B[:n], model.C[:n]
    seen = np.eye(n) - np.outer(settled.gain, C)
    effort = model.disturbance[:n]
    # States: drive, K, estimator, last command; y = Cp x of the drive.
    sizes = np.cumsum([0, drive.nstates, K.nstates, n, 1])
    p, k, e, v = (slice(*sizes[i : i + 2]) for i in range(4))
    y, command = np.zeros((2, sizes[-1]))
    y[p] = drive.C[0]
    command[k], command[e] = K.C[0], effort @ seen
    command += (K.D[0, 0] + effort @ settled.gain) * y
    closed = np.zeros((sizes[-1], sizes[-1]))
    closed[p, p], closed[k, k], closed[e, e] = drive.A, K.A, A @ seen
    closed[p] += np.outer(drive.B[:, 0], command)
    closed[k] += np.outer(K.B[:, 0], y)
    closed[e] += np.outer(A @ settled.gain, y)
    closed[e, v] += B[:, None]
    closed[v] = command
    return float(-np.log(abs(np.linalg.eigvals(closed)).max()) / PERIOD)
