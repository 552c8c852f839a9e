"""Scatter of a model that is fitted to the mean period of a loop's signals.

At the lines of the excitation, the means over the periods have errors E = Y - G U, and each group
of periods gives one sample of these errors. The methods that fit G to the means differ in their
search and in the input that they use. To first order they all solve sum Re(P' W E) = 0, where P
holds the derivatives of G U with respect to the parameters and W the weights of the outputs. So the
covariance of each is a sandwich formula with P' W P and the scatter of P' W E over the groups.

Sources: R. Pintelon, J. Schoukens, System Identification: A Frequency Domain Approach, 2nd ed.,
2012 (the sample covariance of periods in place of a model of the noise); P. Welch, "The use of fast
Fourier transform for the estimation of power spectra", IEEE Transactions on Audio and
Electroacoustics 15(2), 1967 (parts that overlap and fade into each other).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import ComplexArray
from workbench.identification.closed_loop.explained import excitation_of, mean_period
from workbench.identification.closed_loop.methods import CleanInput
from workbench.identification.closed_loop.program import ClosedLoopFit
from workbench.identification.experiments.several import Experiments
from workbench.identification.innovations.curvature import root_of_inverse
from workbench.identification.innovations.model import InnovationsModel
from workbench.identification.innovations.uncertainty import response_slopes


def moves_of_lines(
    program: ClosedLoopFit,
    clean_input: CleanInput,
    model: InnovationsModel,
    record: Experiments,
    groups: int,
    frequency: ArrayLike,
) -> ComplexArray:
    """Changes of the response (parts, F, ny, nu) when a group of periods is left out.

    The changes are of first order. There are about ``groups`` groups, each of whole periods.
    """
    direct, period = program.direct, int(program.period_samples or 0)
    lines = np.arange(1, (period + 1) // 2)
    response = model.response(lines / period)
    mean = mean_period(record, period)
    record = replace(record, y=np.where(np.isnan(record.y), mean.y, record.y))

    def input_and_error(part: Experiments) -> tuple[ComplexArray, ComplexArray]:
        """Lines (L, channels) of the input, and of y minus the model's response to it."""
        signals = clean_input(program, part, part), part.y
        u, y = (np.fft.rfft(one[:period], axis=0)[lines] for one in signals)
        return u, y - np.einsum("lou,lu->lo", response, u)

    u, error = input_and_error(mean)
    slopes = np.einsum("loup,lu->lop", response_slopes(model, lines / period, direct), u)
    weight = np.linalg.pinv((error.T @ error.conj()).real, hermitian=True)
    weighted = np.einsum("lop,oq->lqp", slopes.conj(), weight)
    root = root_of_inverse(np.einsum("lqp,lqr->pr", weighted, slopes).real)
    along = response_slopes(model, frequency, direct) @ root
    pairs = len(record) // period - 1
    size = max(1, pairs // groups)
    moves = []
    for first in range(0, pairs - size + 1, size):
        faded = _faded_mean_period(record.part(first * period, (first + size + 1) * period), period)
        gradient = np.einsum("lqp,lq->p", weighted, input_and_error(faded)[1]).real
        moves.append(along @ (root.T @ gradient))
    overlap = np.sqrt(size / (size - 1 / 4))  # a squared fade has 3/8 of the power, not 1/2
    return np.array(moves) * overlap / (len(moves) - 1)


def _faded_mean_period(part: Experiments, period: int) -> Experiments:
    """The mean period of a part, with its last period faded into its first.

    So it is periodic without a jump: what u did before the part does not appear as an error of the
    plant.
    """
    rise = np.sin(np.pi * np.arange(period) / (2 * period)) ** 2
    count = len(part) // period - 1
    weights = np.concatenate([rise, np.ones((count - 1) * period), 1 - rise])[:, None] / count
    u, y = ((weights * one).reshape(count + 1, period, -1).sum(axis=0) for one in (part.u, part.y))
    return replace(part, u=u, y=y, excitation=excitation_of(part)[:period], starts=(0,))
