"""Residuals in which faults stand out from noise as far as possible.

With a basis Q_1 of all generators (see `matching`) and Q_1 [G_f G_w; 0] = [R_f R_w], the residual
W R_w^{-1} in which noise is co-inner, of gain 1 in every direction at every frequency, is the best
for every fault at once: no stable generator has a larger ||fault to r|| / ||noise to r|| (Ding,
Jeinsch, Frank, Ding, Int. J. Adaptive Control and Signal Processing 14 (2000): the unified
solution). It is the innovation of the Kalman filter for the noise of Q_1.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, solve_continuous_are

from workbench._core.heavy_types import StateSpace
from workbench.certify.norms import NORM_TOLERANCE, certified_norm
from workbench.diagnosis.generators.generator import Poles, ResidualGenerator
from workbench.diagnosis.generators.matching import followed_by, null_space_generator
from workbench.diagnosis.models.detectability import need_faults
from workbench.diagnosis.models.fault_model import FaultModel
from workbench.errors import InputError
from workbench.input_checks import is_real
from workbench.systems.equations.riccati import sampled_solution
from workbench.systems.realisation import Matrices, realisation

NOISE_RANK_SHARE = 1e-9
"""A singular value of the noise's direct term counts as 0 below this share of the largest."""


@dataclass(frozen=True, eq=False)
class WhitenedResidual:
    """A generator, and for each fault a lower bound on its gap to noise.

    The gap (k,) of a fault is ||fault to r|| / ||noise to r||, with H-infinity norms.

    Examples
    --------
    >>> import control
    >>> from workbench.diagnosis import FaultModel, whitened_residual
    >>> plant = control.ss(-1.0, [[1.0, 0.0]], 1.0, [[0.0, 0.1]], inputs=["f", "n"])
    >>> model = FaultModel(plant, faults=("f",), noise=("n",))
    >>> found = whitened_residual(model, poles=-2.0)
    >>> found.generator.faults, found.gaps.shape
    (('f',), (1,))
    """

    generator: ResidualGenerator
    gaps: NDArray[np.float64]


def whitened_residual(
    model: FaultModel, poles: Poles, *, regularisation: float = 0.0
) -> WhitenedResidual:
    """The generator with the largest gap between every fault and noise.

    Parameters
    ----------
    model
        With faults and noise; disturbances are decoupled.
    poles
        Poles of the basis Q_1, as for `model_matching`; they cancel.
    regularisation
        Size of a noise added to every output of Q_1, relative to the norm from the model's noise
        to those outputs. Take 0 if noise reaches all of them at high frequencies (R_w has full row
        rank at infinity). Otherwise, if faults reach high frequencies, the gap grows without bound
        as the regularisation falls: choose the bandwidth of the residual by it.

    Raises
    ------
    InputError
        The model has no fault or no noise; without regularisation, noise does not reach every
        direction at high frequencies, or at some frequency; as `null_space_generator`.

    Notes
    -----
    Gaps are rounded down from certified norms.

    Examples
    --------
    >>> import control
    >>> from workbench.diagnosis import FaultModel, whitened_residual
    >>> plant = control.ss(-1.0, [[1.0, 0.0]], 1.0, [[0.0, 0.1]], inputs=["f", "n"])
    >>> model = FaultModel(plant, faults=("f",), noise=("n",))
    >>> found = whitened_residual(model, poles=-2.0)
    >>> round(float(found.gaps[0]), 2)  # the fault's gain of 1 over the noise of 0.1
    10.0
    """
    need_faults(model)
    if not model.noise:
        raise InputError("the model has no noise to tell faults from; ask fault_detection()")
    if not (is_real(regularisation) and 0.0 <= regularisation < np.inf):
        raise InputError(f"regularisation is {regularisation!r}; it must be finite, from 0 on")
    base = null_space_generator(model, poles)
    noise = _channel(base, len(model.faults), None)
    A, B, C, D = (np.asarray(getattr(noise, part)) for part in "ABCD")
    extra = regularisation * certified_norm(noise) if regularisation else 0.0
    sizes = np.linalg.svd(D, compute_uv=False)
    full = len(sizes) == len(C) and sizes[-1] > NOISE_RANK_SHARE * sizes[0]
    if not (extra or full or model.dt):
        raise InputError(
            f"noise does not reach all {len(C)} rows of the residuals at high frequencies; give a "
            "regularisation, or add measurement noise"
        )
    whitening = realisation(
        _innovations(A, B, C, D, extra, bool(model.dt)), model.dt, outputs=base.Q.output_labels
    )
    names = list(base.Q.output_labels)
    generator = ResidualGenerator(
        followed_by(base.Q, whitening, names),
        followed_by(base.R, whitening, names),
        model.faults,
        model.noise,
    )
    loud = certified_norm(_channel(generator, len(model.faults), None))
    norms = [certified_norm(_channel(generator, j, j + 1)) for j in range(len(model.faults))]
    return WhitenedResidual(generator, np.array(norms) / (1.0 + NORM_TOLERANCE) / loud)


def _innovations(
    A: NDArray[Any],
    B: NDArray[Any],
    C: NDArray[Any],
    D: NDArray[Any],
    extra: float,
    sampled: bool,
) -> Matrices:
    """The filter that whitens the output of (A, B, C, D) driven by white noise, to intensity 1."""
    R, S = D @ D.T + extra**2 * np.eye(len(C)), B @ D.T
    of_noise = np.vstack([B.T, np.zeros((len(C), len(A)))])
    try:
        if not len(A):
            Y = A
        elif sampled:
            Y = sampled_solution(A.T, C.T, of_noise, np.vstack([D.T, extra * np.eye(len(C))]))
        else:
            Y = solve_continuous_are(A.T, C.T, B @ B.T, R, s=S)
        spread = R + C @ Y @ C.T if sampled else R
        gain: NDArray[Any] = np.linalg.solve(spread, ((A @ Y if sampled else Y) @ C.T + S).T).T
        root: NDArray[Any] = np.linalg.inv(np.linalg.cholesky(spread))
    except (LinAlgError, ValueError) as error:
        raise InputError(
            "noise has no spectral factor: it does not reach every residual at every frequency "
            f"({' '.join(str(error).split())}); give a regularisation, or add measurement noise"
        ) from None
    return A - gain @ C, gain, -root @ C, root


def _channel(generator: ResidualGenerator, first: int, last: int | None) -> StateSpace:
    """R from the inputs first to last - 1 alone; last None: to the end."""
    R = generator.R
    columns = slice(first, last)
    return realisation((R.A, R.B[:, columns], R.C, R.D[:, columns]), float(R.dt or 0.0))
