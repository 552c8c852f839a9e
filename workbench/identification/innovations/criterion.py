"""The criterion of prediction errors, with its exact gradient.

It is, up to constants, a negative log likelihood with unknown noise covariance,

    N/2 log det(sum e e'/N) + w N/2 log det(sum s s'/N),

of the one-step errors e and, weighted by w, of the free-run errors s. With w = 0 it gives the
classical maximum-likelihood estimate, which is best for prediction. Real records are never quite
linear, and with one-step errors alone slow errors of the plant model are then modelled as noise;
w > 0 requires that the same model also simulates the whole record. Free-run errors are correlated
over many samples, so that tens of them carry as much information as one independent error.
Therefore w = 0.1 weights both kinds about equally, and w = 1 favours simulation.

Source: L. Ljung, System Identification, 2nd ed., 1999, sections 7.2, 10.2 and 15.2.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np
from scipy.signal import lfilter

from workbench._core.arrays import BoolArray, IntegerArray, RealArray
from workbench.identification.experiments.several import Experiments
from workbench.identification.innovations.model import InnovationsModel, initial_state
from workbench.identification.innovations.recursions import predictions, sensitivity_rows

BLOCK = 512
"""Samples whose derivatives are computed at a time."""
LEAST_ERROR = 1e-9
"""Errors below this size, relative to the outputs, count as rounding, since records may have no
noise.
"""


class Criterion:
    """The criterion as a function of A, B, C, D, K, the offsets and the initial states.

    Each run, one-step and free, has an initial state for each experiment. ``direct`` says whether D
    is free; otherwise the model's D is kept. ``entries`` marks the free entries of A, B, C, D and
    K, concatenated row by row; None: all are free. ``free`` are the indices of the free ones in
    that order. ``seen`` are the indices of the samples that count.
    """

    def __init__(
        self,
        model: InnovationsModel,
        record: Experiments,
        simulation_weight: float,
        direct: bool = True,
        entries: BoolArray | None = None,
    ) -> None:
        self._template = model
        # What inputs before the record did, which act later, nothing tells.
        late = model.longest_delay_samples
        self._pieces = [model.driven_part(u, y) for u, y in record.pieces() if len(u) > late]
        ends = np.cumsum([len(u) for u, _ in record.pieces()])
        self.seen = np.concatenate(
            [
                np.arange(end - len(u) + late, end)
                for end, (u, _) in zip(ends, record.pieces(), strict=True)
            ]
        )
        self._weights = (1.0, simulation_weight) if simulation_weight > 0 else (1.0,)
        spread = np.nanstd(record.y, axis=0)
        self.floor = np.diag((LEAST_ERROR * spread) ** 2)
        self._rows = len(self.seen)
        parts = (model.A, model.B, model.C, model.D, model.K, model.u_offset, model.y_offset)
        self._shapes = [part.shape for part in parts]
        self._ends = np.cumsum([0] + [part.size for part in parts])
        held = np.zeros(self._ends[-1], dtype=bool)
        if entries is not None:
            held[: self._ends[5]] = ~entries
        if not direct:
            held[self._ends[3] : self._ends[4]] = True
        self.free = np.flatnonzero(~held)

    @property
    def of_inputs(self) -> IntegerArray:
        """Indices of the free entries of B and D among the parameters."""
        a, b, c, d = self._ends[1], self._ends[2], self._ends[3], self._ends[4]
        inside = ((self.free >= a) & (self.free < b)) | ((self.free >= c) & (self.free < d))
        return np.flatnonzero(inside)

    @property
    def common(self) -> int:
        """Number of parameters that the experiments share; the initial states follow them."""
        return len(self.free)

    def start(self, model: InnovationsModel) -> RealArray:
        """Parameters (P,) of a model, with the initial states that fit the experiments best."""
        parts = (model.A, model.B, model.C, model.D, model.K, model.u_offset, model.y_offset)
        whole = np.concatenate([part.ravel() for part in parts])
        gains = (model.K, np.zeros_like(model.K))[: len(self._weights)]
        states = [
            initial_state(model, gain, u - model.u_offset, y - model.y_offset)
            for gain in gains
            for u, y in self._pieces
        ]
        return np.concatenate([whole[self.free], *states])

    def model(self, theta: RealArray) -> InnovationsModel:
        """Model with given parameters (P,)."""
        m = self._template
        parts = (m.A, m.B, m.C, m.D, m.K, m.u_offset, m.y_offset)
        whole = np.concatenate([part.ravel() for part in parts])
        whole[self.free] = theta[: self.common]
        A, B, C, D, K, u_offset, y_offset = (
            whole[a:b].reshape(shape)
            for (a, b), shape in zip(pairwise(self._ends), self._shapes, strict=True)
        )
        return replace(m, A=A, B=B, C=C, D=D, K=K, u_offset=u_offset, y_offset=y_offset)

    def by_parameters(self, slopes: RealArray, count: int) -> RealArray:
        """Derivatives (q, P) by the P = ``count`` parameters, from those by all entries.

        The entries are those of A, B, C, D, K and both offsets, row by row.
        """
        found = np.zeros((len(slopes), count))
        found[:, : self.common] = slopes[:, self.free]
        return found

    def __call__(self, theta: RealArray) -> float:
        """Value of the criterion; infinite if the errors overflow."""
        value = 0.0
        with np.errstate(all="ignore"):
            for run, weight in enumerate(self._weights):
                covariance = self._covariance(theta, run)
                if not np.isfinite(covariance).all():
                    return np.inf
                value += weight * self._likelihood(covariance)
        return value if np.isfinite(value) else np.inf

    def expand(self, theta: RealArray) -> tuple[float, RealArray, RealArray]:
        """Value, gradient (P,) and Gauss-Newton Hessian (P, P) of the criterion."""
        value, gradient = 0.0, np.zeros(len(theta))
        hessian = np.zeros((len(theta), len(theta)))
        for run, weight in enumerate(self._weights):
            covariance = self._covariance(theta, run)
            value += weight * self._likelihood(covariance)
            whiten = np.sqrt(weight) * whitening(covariance)
            for columns, errors, rows in self._blocks(theta, run):
                white = np.matmul(whiten.T, rows).reshape(-1, rows.shape[2])
                gradient[columns] += white.T @ (errors @ whiten).ravel()
                hessian[np.ix_(columns, columns)] += white.T @ white
        return value, gradient, hessian

    def errors(self, theta: RealArray) -> RealArray:
        """One-step errors (N, ny); missing ones are zero."""
        return np.concatenate([own for _, own, _ in self._blocks(theta, 0)])

    def driven(self, theta: RealArray) -> Iterator[tuple[RealArray, RealArray, RealArray]]:
        """Inputs (T, nu) less their offset, the outputs (T, ny) less theirs that they and the
        initial state cause, and the measured ones, of each experiment.
        """
        for _, x, (A, B, C, D, K), u, y in self._runs(theta, 0):
            yield u, predictions(A, B, C, D, np.zeros_like(K), x, u, np.zeros_like(y)), y

    def repeated(
        self, theta: RealArray, record: Experiments, draws: Iterable[RealArray]
    ) -> Iterator[Experiments]:
        """The record with the outputs that the model has with other one-step errors (N, ny)."""
        offset = self.model(theta).y_offset
        parts, first = [], 0
        for _, x, matrices, u, y in self._runs(theta, 0):
            A, B, C, D, K = matrices
            driven = predictions(A, B, C, D, np.zeros_like(K), x, u, np.zeros_like(y)) + offset
            noise = A, K, C, np.eye(len(C)), np.zeros_like(K), np.zeros_like(x)
            seen = slice(first, first + len(u))
            parts.append((seen, driven, noise, np.where(np.isnan(y), np.nan, 0.0)))
            first += len(u)
        for errors in draws:
            outputs = record.y.copy()
            for seen, driven, noise, missing in parts:
                drawn = np.ascontiguousarray(errors[seen])
                made = driven + predictions(*noise, drawn, np.zeros_like(driven)) + missing
                outputs[self.seen[seen]] = made
            yield replace(record, y=outputs)

    def filtered_rows(
        self, theta: RealArray, filters: list[RealArray]
    ) -> Iterator[tuple[IntegerArray, RealArray]]:
        """Columns, and derivatives (T, ny, columns) of errors, through a filter for each output.

        Filters are polynomials in the delay of a sample; each experiment starts at rest.
        """
        last, states = -1, [np.zeros(0)] * len(filters)
        for columns, _, rows in self._blocks(theta, 0):
            if columns[-1] != last:  # another experiment, with an initial state of its own
                last = columns[-1]
                states = [np.zeros((len(a) - 1, rows.shape[2])) for a in filters]
            filtered = np.empty_like(rows)
            for o, a in enumerate(filters):
                filtered[:, o], states[o] = lfilter(a, 1.0, rows[:, o], axis=0, zi=states[o])
            yield columns, filtered

    def slopes(
        self, theta: RealArray, parts: IntegerArray, errors: RealArray | None = None
    ) -> RealArray:
        """Contribution (parts, P) of each part of the record to the one-step errors' gradient.

        parts: number of each sample's part (N,), which never decreases. errors: used in place of
        the one-step errors (N, ny).
        """
        found, first = np.zeros((int(parts[-1]) + 1, len(theta))), 0
        parts = parts[self.seen]
        errors = None if errors is None else errors[self.seen]
        weight = np.linalg.inv(self._covariance(theta, 0))
        for columns, own, rows in self._blocks(theta, 0):
            block = slice(first, first + len(own))
            seen = own if errors is None else errors[block]
            each = np.einsum("toc,to->tc", rows, seen @ weight)
            for part in np.unique(parts[block]):
                found[part, columns] += each[parts[block] == part].sum(axis=0)
            first = block.stop
        return found

    def _runs(
        self, theta: RealArray, run: int
    ) -> Iterator[tuple[int, RealArray, tuple[RealArray, ...], RealArray, RealArray]]:
        """Index and value of the initial state, matrices, inputs and outputs of each experiment.

        Run 0 is one-step prediction, run 1 the free run with K = 0.
        """
        model = self.model(theta)
        matrices = model.matrices(np.zeros_like(model.K) if run else model.K)
        for number, (u, y) in enumerate(self._pieces):
            place = self.common + (run * len(self._pieces) + number) * model.order
            state = theta[place : place + model.order].copy()
            yield place, state, matrices, u - model.u_offset, y - model.y_offset

    def _covariance(self, theta: RealArray, run: int) -> RealArray:
        """Covariance (ny, ny) of a run's errors, not below that of rounding."""
        total = self.floor.copy()
        for _, state, matrices, u, y in self._runs(theta, run):
            errors = y - predictions(*matrices, state, u, y)
            errors[np.isnan(y)] = 0.0
            total += errors.T @ errors / self._rows
        return total

    def _likelihood(self, covariance: RealArray) -> float:
        """Negative log likelihood of errors with a covariance, up to a constant."""
        scale = np.sqrt(np.diag(covariance))
        unit = np.linalg.slogdet(covariance / np.outer(scale, scale))[1]
        return 0.5 * self._rows * float(unit + 2 * np.log(scale).sum())

    def _blocks(
        self, theta: RealArray, run: int
    ) -> Iterator[tuple[IntegerArray, RealArray, RealArray]]:
        """Columns, errors (T, ny) and derivatives (T, ny, columns) of blocks of samples."""
        n, nu, ny = self._shapes[0][0], self._shapes[1][1], self._shapes[2][0]
        kept = np.r_[self.free, self._ends[-1] : self._ends[-1] + n]
        everything = len(kept) == self._ends[-1] + n
        for place, x, matrices, u, y in self._runs(theta, run):
            moved = np.zeros((n, n * (n + nu + ny)))
            shifted, free = np.zeros((n, nu + ny)), np.eye(n)
            columns = np.r_[0 : self.common, place : place + n]
            for first in range(0, len(u), BLOCK):
                part = slice(first, first + BLOCK)
                errors = np.empty((len(u[part]), ny))
                rows = np.empty((len(errors), ny, self._ends[-1] + n))
                sensitivity_rows(*matrices, x, moved, shifted, free, u[part], y[part], errors, rows)
                if run:  # the gain has no effect on a free run
                    rows[:, :, self._ends[4] : self._ends[5]] = 0.0
                yield columns, errors, rows if everything else rows[:, :, kept]


def all_but_gain(model: InnovationsModel) -> BoolArray:
    """Mask of the entries of A, B, C, D among the entries of A, B, C, D, K."""
    sizes = [getattr(model, name).size for name in "ABCDK"]
    return np.arange(sum(sizes)) < sum(sizes[:4])


def whitening(covariance: RealArray) -> RealArray:
    """W (n, n) with W W^T = covariance^-1, for positive definite covariances (n, n) of any scale.

    Errors that are multiples of each other have a correlation that is singular to rounding; its
    eigenvalues count as at least that rounding.
    """
    values, vectors = scaled_eigen(covariance)
    least = len(values) * np.finfo(float).eps
    return np.asarray(vectors / np.sqrt(np.maximum(values, least)))


def scaled_eigen(matrix: RealArray) -> tuple[RealArray, RealArray]:
    """Eigenvalues (n,) of a positive semidefinite matrix (n, n) that is scaled to a diagonal of 1,
    and its eigenvectors (n, n) in the scale of the matrix' inverse.

    A diagonal entry of zero is not scaled.
    """
    scale = np.sqrt(np.diag(matrix))
    scale[scale == 0] = 1.0
    values, vectors = np.linalg.eigh(matrix / np.outer(scale, scale))
    return values, vectors / scale[:, None]
