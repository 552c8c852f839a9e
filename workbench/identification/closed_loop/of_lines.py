"""How a model scatters that is fitted to the mean period of a loop's signals.

At the lines of the excitation the means over the periods have errors E = Y - G U, and each group of
periods tells one draw of them. The methods that fit G to these means differ in how they search, and
in the input that they take; to first order all of them solve sum Re(P' W E) = 0, with P the
derivatives of G U by the parameters and W the weight of the outputs. So a sandwich of P' W P and of
the scatter of P' W E over the groups is the covariance of each.

Source: R. Pintelon, J. Schoukens, System Identification: A Frequency Domain Approach, 2nd ed.,
2012, section 9.11 (the sample covariance of periods in place of that of the noise).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import ComplexArray, IntegerArray
from workbench.identification.closed_loop.explained import mean_period
from workbench.identification.closed_loop.methods import CleanInput
from workbench.identification.closed_loop.program import ClosedLoopFit
from workbench.identification.experiments.several import Experiments
from workbench.identification.innovations.model import InnovationsModel
from workbench.identification.innovations.uncertainty import response_slopes, root_of_inverse


def moves_of_lines(
    program: ClosedLoopFit,
    clean_input: CleanInput,
    model: InnovationsModel,
    record: Experiments,
    parts: IntegerArray,
    frequency: ArrayLike,
) -> ComplexArray:
    """Changes of the response (parts, F, ny, nu) where a group of periods is left out.

    They are of first order. ``parts`` (N,) is the number of each sample's group; groups are whole
    periods.
    """
    direct, period = program.direct, int(program.period or 0)
    lines = np.arange(1, (period + 1) // 2)
    response = model.response(lines / period)
    filler = mean_period(record, period).y
    record = replace(record, y=np.where(np.isnan(record.y), filler, record.y))

    def input_and_error(part: Experiments) -> tuple[ComplexArray, ComplexArray]:
        """Lines (L, channels) of the input, and of y less what the model makes of it."""
        clean = mean_period(part, period)
        signals = clean_input(program, part, clean), clean.y
        u, y = (np.fft.rfft(one[:period], axis=0)[lines] for one in signals)
        return u, y - np.einsum("lou,lu->lo", response, u)

    u, error = input_and_error(record)
    slopes = np.einsum("loup,lu->lop", response_slopes(model, lines / period, direct), u)
    weight = np.linalg.pinv((error.T @ error.conj()).real, hermitian=True)
    weighted = np.einsum("lop,oq->lqp", slopes.conj(), weight)
    root = root_of_inverse(np.einsum("lqp,lqr->pr", weighted, slopes).real)
    along = response_slopes(model, frequency, direct) @ root
    moves = []
    for number, size in enumerate(np.bincount(parts)):
        first = int(np.searchsorted(parts, number))
        error = input_and_error(record.part(first, first + int(size)))[1]
        gradient = np.einsum("lqp,lq->p", weighted, error).real
        moves.append(along @ (root.T @ gradient) * size / (len(parts) - size))
    return np.array(moves)
