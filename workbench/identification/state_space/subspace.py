"""Predictor-based subspace identification: an innovations model without iterations.

A long vector autoregression with inputs gives the Markov parameters of the one-step predictor. The
product of their Hankel matrix with the past of the record is factored into observability matrix and
states. Inputs may depend on past noise, so closed-loop records are allowed.

Every step is a regression on lagged samples and uses only their triangular factor. So the record is
read once, and all orders share the factor.

Source: A. Chiuso, "The role of vector autoregressive modeling in predictor-based subspace
identification", Automatica 43(6), 2007.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from workbench._core.arrays import RealArray
from workbench.identification.experiments.quality import checked_record
from workbench.identification.experiments.several import Experiments
from workbench.identification.innovations.gains import (
    innovation_gain,
    operating_point,
)
from workbench.identification.innovations.model import InnovationsModel
from workbench.identification.innovations.regression import (
    LaggedTriangle,
    lagged_triangle,
    least_squares,
)
from workbench.identification.innovations.scaling import Scaling
from workbench.identification.state_space.selection import best_fitting, fitting_pasts, refuse_order

RANK_ROUNDING = 1e-10
"""A singular value of the states below this, relative to the largest, counts as rounding."""
NO_NOISE = 1e-9
"""Innovations below this size, relative to the outputs, count as rounding."""


def subspace(u: RealArray, y: RealArray, order: int, past: int) -> InnovationsModel:
    """Innovations model of a record u (N, nu), y (N, ny).

    Parameters
    ----------
    order
        Number of states, 1 to past * ny. The model has fewer if the record shows fewer.
    past
        Number of past samples that the predictor uses; powers of A - K C should decay within them.

    Raises
    ------
    InputError
        The same as for `checked_record`; or order or past is too large for the record.
    """
    u, y = checked_record(u, y)
    nu, ny = u.shape[1], y.shape[1]
    refuse_order(order, past, len(u), nu, ny)
    return SubspaceModels(Experiments(u, y), (past,)).model(order, past)


class SubspaceModels:
    """Models of all orders and several pasts from one pass over the experiments.

    Unlike a `StateSpace`, it holds the factors from which models of any order are made.

    ``direct`` allows inputs to act within the sample (D may differ from zero).
    """

    def __init__(self, record: Experiments, pasts: Sequence[int], direct: bool = True) -> None:
        self.record, self.pasts, self._direct = record, tuple(pasts), direct
        self._scaling = Scaling.of(record)
        nu, ny = record.u.shape[1], record.y.shape[1]
        longest = max(pasts)
        pieces = (self._scaling.scaled(*piece) for piece in record.pieces())
        whole = lagged_triangle(pieces, longest, nu + ny)
        self._factors = {
            past: whole if past == longest else whole.shorter(past) for past in self.pasts
        }
        self._states: dict[int, tuple[RealArray, RealArray]] = {}

    def rank(self, past: int) -> int:
        """Number of states that the record shows with a past."""
        singular = self._weighted(past)[1]
        return max(1, int(np.sum(singular > RANK_ROUNDING * singular[0])))

    def _weighted(self, past: int) -> tuple[RealArray, RealArray]:
        """Linear maps (rank, past * channels) from the history to states, and singular values."""
        if past not in self._states:
            self._states[past] = _state_maps(self._factors[past], self.record.u.shape[1])
        return self._states[past]

    def model(self, order: int, past: int) -> InnovationsModel:
        """The model of an order, or of a lower one if the record does not show more states."""
        maps = self._weighted(past)[0][: min(order, self.rank(past))]
        model = _regressed(self._factors[past], maps, self.record.u.shape[1], self._direct)
        return self._scaling.restored(model, self.record)


def _state_maps(lagged: LaggedTriangle, nu: int) -> tuple[RealArray, RealArray]:
    """Linear maps from the history to the states, best first, and their singular values.

    Block row i of observability times reachability contains the Markov parameters, shifted by i.
    """
    r, m, past = lagged.factor, lagged.channels, lagged.past
    ny, history = m - nu, lagged.history
    now_in = r[:, -m : r.shape[1] - ny]
    regressors = np.hstack([r[:, : history.stop], now_in])
    markov = least_squares(regressors, r[:, -ny:])[:, 1 : history.stop]
    product = np.zeros((past * ny, past * m))
    for i in range(past):
        product[i * ny : (i + 1) * ny, : (past - i) * m] = markov[:, i * m :]
    left, singular, _ = np.linalg.svd(product @ r[1:, history].T, full_matrices=False)
    used = max(1, int(np.sum(singular > RANK_ROUNDING * singular[0])))
    maps = (left[:, :used] / np.sqrt(np.maximum(singular[:used], 1e-300))).T @ product
    return maps, singular


def _regressed(lagged: LaggedTriangle, maps: RealArray, nu: int, direct: bool) -> InnovationsModel:
    """Model whose states are linear maps of the history, by regression, at unit scale."""
    r, m = lagged.factor, lagged.channels
    ny, n, history = m - nu, len(maps), lagged.history
    one, now_in, now_out = r[:, :1], r[:, -m : r.shape[1] - ny], r[:, -ny:]
    states = r[:, history] @ maps.T
    # One sample later, the history starts with the present sample and ends one lag earlier.
    later = np.hstack([r[:, -m:], r[:, history.start : history.stop - m]])
    seen = np.hstack([one, states, now_in]) if direct else np.hstack([one, states])
    output = least_squares(seen, now_out)
    innovation = now_out - seen @ output.T
    next_states = later @ maps.T
    driven = np.hstack([one, states, now_in])
    update = least_squares(np.hstack([driven, innovation]), next_states)
    A, B, C = update[:, 1 : 1 + n], update[:, 1 + n : 1 + n + nu], output[:, 1 : 1 + n]
    D = output[:, 1 + n :] if direct else np.zeros((ny, nu))
    K = update[:, 1 + n + nu :]
    quiet = np.linalg.norm(innovation) <= NO_NOISE * np.linalg.norm(now_out)
    if quiet or np.max(np.abs(np.linalg.eigvals(A - K @ C)), initial=0.0) >= 1:
        plain = least_squares(driven, next_states)
        A, B = plain[:, 1 : 1 + n], plain[:, 1 + n :]
        noise = np.hstack([next_states - driven @ plain.T, innovation])
        update = plain
        K = np.zeros((n, ny)) if quiet else np.full((n, ny), np.nan)
        found = innovation_gain(A, C, np.zeros((n + ny, n + ny)) if quiet else noise.T @ noise)
        K = K if found is None else found
    u_offset, y_offset = operating_point(A, B, C, D, update[:, 0], output[:, 0])
    return InnovationsModel(A, B, C, D, K, u_offset, y_offset)


def best_subspace(
    u: RealArray, y: RealArray, order: int, largest_radius: float = 1.0
) -> InnovationsModel | None:
    """The best subspace model of a record u (N, nu), y (N, ny) over several pasts, or None.

    Its predictor is stable, and its poles lie within the largest radius. The best model fits its
    own record best. The result is None if the record is too short for the order.
    """
    return best_subspace_of(Experiments(u, y), order, largest_radius=largest_radius)


def best_subspace_of(
    record: Experiments,
    order: int,
    *,
    direct: bool = True,
    delay: Sequence[int] = (),
    largest_radius: float = 1.0,
) -> InnovationsModel | None:
    """As `best_subspace`, for several experiments.

    ``direct`` allows inputs to act within the sample; ``delay`` [samples] (nu,) holds their delays.
    """
    late = record.delayed(delay)
    pasts = fitting_pasts(order, len(late), late.u.shape[1], late.y.shape[1])
    if not pasts:
        return None
    models = SubspaceModels(late, pasts, direct)
    found = (
        replace(models.model(order, past), delay_samples=tuple(delay) if any(delay) else ())
        for past in pasts
    )
    return best_fitting(found, record, direct=direct, largest_radius=largest_radius)
