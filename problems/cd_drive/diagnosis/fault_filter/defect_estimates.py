"""Defects of several shapes, estimated in the closed loops of the twelve drives (figure 7.13)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from workbench.simulation import respond
from workbench.systems import realisation
from workbench.types import RealArray, StateSpace

from ...control.loops import open_loop, plants
from ...drive.disc import VELOCITY
from ...drive.plants import ANTIALIASING, Gain
from ...drive.tables import Axis
from ...laboratory.bench_setup import PERIOD, RATE

LONGEST = 1.6e-3
"""Length of the longest defect along the track [m] (section 7.3.2)."""
SIZE = 1e-6
"""False displacement of a defect [m]; the loops are linear."""
FINE = 20
"""Number of steps per sample in which the anti-aliasing filter is simulated."""
SHAPES = {"bump": 0.4e-3, "doublet": 0.8e-3, "slow bump": LONGEST}
"""Shapes of defects and their lengths along the track [m]."""
BEFORE, AFTER = 1e-3, 6e-3
"""Simulated time before a defect and after its start [s]."""


def bump(length: float, time: RealArray) -> RealArray:
    """Raised cosine [1] of a length along the track [m], at times [s] after its start."""
    along = time * VELOCITY / length
    inside = (along >= 0.0) & (along <= 1.0)
    return np.where(inside, 0.5 - 0.5 * np.cos(2 * np.pi * along), 0.0)


def defect(shape: str, time: RealArray) -> RealArray:
    """False displacement [m] at times [s] after its start: a raised cosine, or one swing up and
    down.
    """
    along = time * VELOCITY / SHAPES[shape]
    swing = np.sin(2 * np.pi * along) if shape == "doublet" else 1.0
    return np.asarray(SIZE * bump(SHAPES[shape], time) * swing)


def sampled_defect(shape: str) -> tuple[RealArray, RealArray]:
    """Times (N,) [s] and the defect (N,) [m] after the filter, as the converters see it."""
    return converted(lambda time: defect(shape, time))


def converted(defect: Callable[[RealArray], RealArray]) -> tuple[RealArray, RealArray]:
    """Times (N,) [s] and a defect (N,) [m] after the filter, from its displacement over time."""
    step = PERIOD / FINE
    fine = np.arange(-BEFORE, AFTER, step)
    decay = np.exp(-ANTIALIASING * step)
    lowpass = realisation(
        (np.array([[decay]]), np.array([[1 - decay]]), np.eye(1), np.zeros((1, 1))), step
    )
    seen = respond(lowpass, defect(fine)[:, None])[:, 0]
    return fine[::FINE], seen[::FINE]


def estimates(
    axis: Axis, F: StateSpace, shape: str, delay: float, gain: Gain
) -> tuple[RealArray, RealArray, RealArray]:
    """Times (N,), the defect (N,), and its estimates u_f (12, N) [m], one per drive.

    F is sampled, e [m] -> u_f [m]; each drive's e is f_en by its own optical gain.
    """
    time, seen = sampled_defect(shape)
    return time, seen, estimated(sensitivities(axis, delay, gain), F, seen)


def sensitivities(axis: Axis, delay: float, gain: Gain) -> list[StateSpace]:
    """Sampled S of the twelve drives' loops, with a delay [samples] and these gains."""
    found = []
    for name, system in plants(axis, gain, "printed").items():
        if name == "nominal":
            continue
        L = open_loop(axis, system, delay)
        direct = 1.0 / (1.0 + L.D)
        matrices = (L.A - L.B @ direct @ L.C, L.B @ direct, -direct @ L.C, direct)
        found.append(realisation(matrices, 1 / RATE))
    return found


def estimated(loops: list[StateSpace], F: StateSpace, seen: RealArray) -> RealArray:
    """Estimates u_f (12, N) [m] by F of a defect (N,) [m], in each of the loops S."""
    errors = [respond(S, seen[:, None]) for S in loops]
    return np.array([respond(F, error)[:, 0] for error in errors])


def relative_errors(seen: RealArray, estimated: RealArray) -> RealArray:
    """Rms error of the estimates during the defect, over the defect's rms: (12,)."""
    during = np.abs(seen) > 1e-3 * np.abs(seen).max()
    wrong = np.sqrt(((estimated - seen)[:, during] ** 2).mean(axis=1))
    return np.asarray(wrong / np.sqrt((seen[during] ** 2).mean()))
