"""Impulse responses regularised by decaying kernels, and their uncertainty.

Sources: T. Chen, H. Ohlsson, L. Ljung, "On the estimation of transfer functions, regularizations
and Gaussian processes - revisited", Automatica 48(8), 2012 (the kernel, and its posterior); T.
Chen, L. Ljung, "Implementation of algorithms for tuning parameters in regularized least squares
problems in system identification", Automatica 49(7), 2013 (the marginal likelihood by triangular
factors).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike
from scipy.linalg import block_diag, cho_factor, cho_solve, solve_triangular
from scipy.optimize import minimize
from scipy.signal import lfilter

from workbench._core.arrays import ComplexArray, RealArray
from workbench.errors import InputError
from workbench.identification.experiments.several import Experiments
from workbench.identification.innovations.impulse_ends import has_ended
from workbench.identification.innovations.model import InnovationsModel
from workbench.identification.innovations.regression import BLOCK, LEAST_NOISE, triangle_of_blocks
from workbench.identification.innovations.scaling import Scaling

TAPS, MOST_TAPS = 70, 560
"""Samples of an impulse response at first, and at most in all inputs; between them it is doubled
until it ends.
"""
ROWS_FOR_EACH = 3
"""Fewest samples in the record for each tap."""
DECAYS = (0.5, 0.8, 0.95)
"""Decay factors per sample of the kernels that are compared; the best one is refined."""


@dataclass(frozen=True)
class _Posterior:
    """Posterior distribution of the taps, for signals scaled to unit spread.

    It has the means (ny, nu, taps), the levels (ny,), and for each output a root (nu taps, nu taps)
    of the covariance of its taps. The kernels' parameters (ny, 2 nu) are those of the search.
    """

    response: RealArray
    level: RealArray
    roots: list[RealArray]
    kernels: RealArray
    scaling: Scaling

    def ended(self, late: Experiments, direct: bool) -> bool:
        """Whether the responses to delayed inputs have died out before their last tap."""
        u, y = self.scaling.scaled(*max(late.pieces(), key=lambda piece: len(piece[0])))
        padded = np.pad(self.response, ((0, 0), (0, 0), (0 if direct else 1, 0)))
        made = np.zeros(y.shape)
        for o, j in np.ndindex(padded.shape[:2]):
            made[:, o] += lfilter(padded[o, j], [1.0], u[:, j])
        errors = (y - made - self.level)[padded.shape[-1] :]
        return has_ended(self.response, self.roots, errors)


def impulse_response(
    record: Experiments, *, direct: bool = True, delay_samples: Sequence[int] = ()
) -> InnovationsModel | None:
    """Impulse responses regularised by a decaying kernel; None if the record is too short.

    Prior covariance c d^max(i, j) of samples i and j (the tuned and correlated kernel), with a
    scale c and a decay d for each pair of channels at which the marginal likelihood is largest.
    There are 70 samples, or up to 560 for all inputs together if the responses take longer to end.
    ``delay_samples`` [samples]: how much later each input acts.
    Raises `InputError` if a finding of the record's report forbids its use.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.identification import as_experiments, impulse_response
    >>> u = np.random.default_rng(0).standard_normal(1000)
    >>> y = control.forced_response(control.tf([0.5], [1, -0.5], 1.0), inputs=u).outputs
    >>> model = impulse_response(as_experiments(u, y))
    >>> float((model.C @ model.B)[0, 0].round(2))  # the first sample of the response
    0.5
    """
    record.report_for(direct=direct).need_usable()
    return impulse_model(record, direct=direct, delay=delay_samples)


def impulse_model(
    record: Experiments, *, direct: bool = True, delay: Sequence[int] = ()
) -> InnovationsModel | None:
    """As `impulse_response`, for a record that has been checked."""
    return impulse_model_that_ends(record, direct=direct, delay=delay)[0]


def impulse_model_that_ends(
    record: Experiments, *, direct: bool = True, delay: Sequence[int] = ()
) -> tuple[InnovationsModel | None, bool]:
    """As `impulse_model`, and whether the responses have died out before their last tap."""
    late = record.delayed(delay)
    found, ended = _posterior(late, direct)
    if found is None:
        return None, False
    model = _shift_register(found.response, found.level, direct)
    model = found.scaling.restored(model, late)
    model = replace(model, delay_samples=tuple(delay)) if any(delay) else model
    return model, ended


def impulse_response_deviations(
    record: Experiments,
    cycles_per_sample: ArrayLike,
    *,
    direct: bool = True,
    delay_samples: Sequence[int] = (),
) -> RealArray:
    """Standard deviations (F, ny, nu) of |G - truth| for the model of `impulse_response`.

    They are those of the posterior distribution, given the record: the prior responses decay as the
    kernel says, and the outputs have white noise. They are infinite if the responses have not died
    out before their last sample. ``cycles_per_sample`` (F,)
    [cycles/sample]. ``delay_samples`` [samples]: how much later each input acts. Raises
    `InputError` if the record is too short for a model.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.identification import as_experiments, impulse_response_deviations
    >>> rng = np.random.default_rng(0)
    >>> u = rng.standard_normal(1000)
    >>> y = control.forced_response(control.tf([0.5], [1, -0.5], 1.0), inputs=u).outputs
    >>> record = as_experiments(u, y + 0.1 * rng.standard_normal(1000))
    >>> found = impulse_response_deviations(record, [0.1, 0.2])
    >>> found.shape, bool((found < 0.02).all())
    ((2, 1, 1), True)
    """
    changes, ended = impulse_response_changes(
        record, cycles_per_sample, direct=direct, delay=delay_samples
    )
    found = np.sqrt((np.abs(changes) ** 2).sum(axis=0))
    return found if ended else np.full(found.shape, np.inf)


def impulse_response_changes(
    record: Experiments, frequency: ArrayLike, *, direct: bool = True, delay: Sequence[int] = ()
) -> tuple[ComplexArray, bool]:
    """Independent changes (Q, F, ny, nu) of the response, each of one standard deviation.

    And whether the responses have died out before their last tap; else the changes are too small.
    """
    late = record.delayed(delay)
    found, ended = _posterior(late, direct)
    if found is None:
        raise InputError(
            f"{len(late)} samples are too few for impulse responses; take a longer record"
        )
    ny, nu, taps = found.response.shape
    first = 0 if direct else 1
    turns = -2j * np.pi * np.asarray(frequency, dtype=float)[:, None]
    turn = np.exp(turns * (first + np.arange(taps)))
    after = np.exp(turns * (np.array(delay) if any(delay) else np.zeros(nu)))
    units = found.scaling.y_spread[:, None] / found.scaling.u_spread
    changes = np.empty((nu * taps, len(turn), ny, nu), dtype=complex)
    for o, root in enumerate(found.roots):
        each = root.reshape(nu, taps, -1)
        changes[:, :, o] = np.einsum("ft,utq->qfu", turn, each) * after * units[o]
    return changes, ended


def has_finite_response(model: InnovationsModel) -> bool:
    """Whether a model comes from `impulse_response`: its states are past inputs."""
    return bool(model.order) and not model.K.any() and not np.triu(model.A).any()


def _posterior(late: Experiments, direct: bool) -> tuple[_Posterior | None, bool]:
    """Impulse responses of delayed experiments, as long as they must be to end, and if they do.

    None if the record is too short.
    """
    nu = late.u.shape[1]
    most = len(late) // (ROWS_FOR_EACH * (nu + 1))
    taps, longest = min(TAPS, most), min(max(TAPS, MOST_TAPS // nu), most)
    found = _posterior_of(late, direct, taps, None) if taps >= 2 else None
    if found is None:
        return None, False
    while not (ended := found.ended(late, direct)) and taps < longest:
        taps = min(2 * taps, longest)
        longer = _posterior_of(late, direct, taps, found.kernels)
        if longer is None:
            break
        found = longer
    return found, ended


def _posterior_of(
    late: Experiments, direct: bool, taps: int, kernels: RealArray | None
) -> _Posterior | None:
    """Impulse responses of ``taps`` samples, and one sample more for a direct term.

    The search for the kernels begins at ``kernels``. None if too many samples are missing.
    """
    nu, ny, count = late.u.shape[1], late.y.shape[1], taps + direct
    scaling, rows = Scaling.of(late), 0

    def blocks() -> Iterator[RealArray]:
        nonlocal rows
        for piece in late.pieces():
            u, y = scaling.scaled(*piece)
            if len(u) <= taps:
                continue
            past = sliding_window_view(u, taps + 1, axis=0)[:, :, ::-1][:, :, taps + 1 - count :]
            for first in range(0, len(past), BLOCK):
                lags, now = past[first : first + BLOCK], y[taps + first : taps + first + BLOCK]
                each = lags.reshape(len(lags), -1)
                block = np.hstack([np.ones((len(now), 1)), each, now])
                known = np.isfinite(block).all(axis=1)
                rows += int(known.sum())
                yield block[known]

    factor = triangle_of_blocks(blocks(), 1 + count * nu + ny)
    if rows < ROWS_FOR_EACH * taps:
        return None
    inside = factor[1:, 1:]  # without means
    R, targets = inside[: count * nu, : count * nu], inside[: count * nu, count * nu :]
    rest = inside[count * nu :, count * nu :]
    free = max(rows - 1 - count * nu, 1)
    response, roots, found = np.empty((ny, nu, count)), [], []
    for o in range(ny):
        noise = float(rest[:, o] @ rest[:, o]) / free
        noise = max(noise, LEAST_NOISE)
        start = None if kernels is None else kernels[o]
        mean, root, kernel = _regularised(R, targets[:, o], noise, nu, count, start)
        response[o] = mean.reshape(nu, count)
        roots.append(root)
        found.append(kernel)
    level = factor[0, 1 + count * nu :] / factor[0, 0]
    means = factor[0, 1 : 1 + count * nu] / factor[0, 0]
    level = level - response.reshape(ny, -1) @ means
    return _Posterior(response, level, roots, np.array(found), scaling)


def _regularised(
    R: RealArray, target: RealArray, noise: float, nu: int, count: int, start: RealArray | None
) -> tuple[RealArray, RealArray, RealArray]:
    """Posterior mean (nu count,) of the taps, a root of their covariance, and the hyperparameters.

    These maximise the marginal likelihood; the search begins at ``start`` if there is one.
    """
    later = np.maximum.outer(np.arange(count), np.arange(count))

    def kernel_root(parameters: RealArray) -> RealArray:
        blocks = []
        for j in range(nu):
            scale, decay = np.exp(parameters[2 * j]), 1 / (1 + np.exp(-parameters[2 * j + 1]))
            kernel = scale * decay**later + 1e-12 * scale * np.eye(count)
            blocks.append(np.linalg.cholesky(kernel))
        return np.asarray(block_diag(*blocks))

    def cost(parameters: RealArray) -> float:
        try:
            moved = R @ kernel_root(np.clip(parameters, -15, 15))
            covariance = moved @ moved.T + noise * np.eye(len(moved))
            factor = cho_factor(covariance, lower=True)
        except np.linalg.LinAlgError:
            return np.inf
        half = 2 * float(np.log(np.diag(factor[0])).sum())
        return half + float(target @ cho_solve(factor, target))

    starts = [np.tile([0.0, np.log(d / (1 - d))], nu) for d in DECAYS]
    begin = min(starts, key=cost) if start is None else start
    best = minimize(cost, begin, method="Nelder-Mead", options={"maxiter": 120 * nu, "fatol": 0.1})
    root = kernel_root(np.clip(best.x, -15, 15))
    rows = np.vstack([R @ root, np.sqrt(noise) * np.eye(root.shape[1])])
    Q, triangle = np.linalg.qr(rows)
    white = solve_triangular(triangle, Q[: len(R)].T @ target)
    spread = solve_triangular(triangle, root.T, trans="T").T  # root triangle^-1
    return np.asarray(root @ white), np.sqrt(noise) * np.asarray(spread), np.asarray(best.x)


def _shift_register(response: RealArray, level: RealArray, direct: bool) -> InnovationsModel:
    """Model whose states are past inputs, for impulse responses (ny, nu, taps)."""
    ny, nu = response.shape[:2]
    lags = response[:, :, 1:] if direct else response
    length = lags.shape[2]
    A = block_diag(*[np.eye(length, k=-1)] * nu)
    B = block_diag(*[np.eye(length, 1)] * nu)
    D = response[:, :, 0] if direct else np.zeros((ny, nu))
    return InnovationsModel(
        A, B, lags.reshape(ny, -1), D, np.zeros((len(A), ny)), np.zeros(nu), np.asarray(level)
    )
