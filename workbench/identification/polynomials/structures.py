"""Polynomial models as innovations models: canonical blocks, and their free entries.

In observer form a polynomial is the first column of a block of A, a numerator a column of B, and a
noise numerator a column of K; each entry is a free parameter:

    ARMAX         A y = B u + C e          one block for each output, driven by u and e
    output error  y = B/F u + e            one block for each pair of output and input
    Box-Jenkins   y = B/F u + C/D e        the same, and one block of noise for each output

So the code for state-space models, with its exact gradients, minimises the prediction errors of all
of them. Source: L. Ljung, System Identification, 2nd ed., 1999, sections 4.2 and 4.3.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.linalg import block_diag

from workbench._core.arrays import BoolArray, RealArray
from workbench.identification.innovations.autoregression import autoregression
from workbench.identification.innovations.model import InnovationsModel

PolynomialKind = Literal["armax", "output-error", "box-jenkins"]


@dataclass(frozen=True)
class _Block:
    """States of one polynomial: the output that they add to, and the signals that drive them."""

    output: int
    inputs: tuple[int, ...]
    noise: bool


def _blocks(kind: PolynomialKind, nu: int, ny: int) -> Iterator[_Block]:
    for o in range(ny):
        if kind == "armax":
            yield _Block(o, tuple(range(nu)), True)
            continue
        for j in range(nu):
            yield _Block(o, (j,), False)
        if kind == "box-jenkins":
            yield _Block(o, (), True)


def polynomial_start(
    model: InnovationsModel, kind: PolynomialKind, known: int = 0
) -> tuple[InnovationsModel, BoolArray]:
    """A polynomial model close to a given state-space model, and its free entries.

    Every polynomial has the degree of the model. A block responds to the signals that drive it as
    the model does; signals that this kind of model lacks are dropped, such as the noise in output
    error.

    The first ``known`` poles of the model, which its block triangular A shows, are kept. A
    polynomial is then the product p a of a fixed p and a free a. Its block has two parts in
    observer form: that of p, and that of a, which drives it. Together they can have any numerator,
    since each numerator is b p + c a with a unique b, and c of lower degree. Blocks of noise alone
    stay free.

    Returns
    -------
    The model in observer form, and a mask of the free entries of A, B, C, D and K.
    """
    n, nu, ny = model.order, model.B.shape[1], len(model.C)
    blocks = list(_blocks(kind, nu, ny))
    total = n * len(blocks)
    A, B, C = np.zeros((total, total)), np.zeros((total, nu)), np.zeros((ny, total))
    K = np.zeros((total, ny))
    free = {
        name: np.zeros(M.shape, dtype=bool) for name, M in zip("ABCK", (A, B, C, K), strict=True)
    }
    plain = _observer_form(model.A, 0)
    held = _observer_form(model.A, known)
    for number, block in enumerate(blocks):
        rows = slice(number * n, (number + 1) * n)
        kept = known if block.inputs else 0
        companion, seen = held if kept else plain
        A[rows, rows], C[block.output, number * n] = companion, 1.0
        if kept < n:
            free["A"][number * n + kept : (number + 1) * n, number * n + kept] = True
        markov = _markov(model, block.output)
        for j in block.inputs:
            B[rows, j] = np.linalg.solve(seen, markov[0][:, j])
            free["B"][rows, j] = True
        if block.noise:
            K[rows, block.output] = np.linalg.solve(seen, markov[1][:, block.output])
            free["K"][rows, block.output] = True
    parts = (free["A"], free["B"], free["C"], np.ones(model.D.shape, dtype=bool), free["K"])
    entries = np.concatenate([part.ravel() for part in parts])
    return replace(model, A=A, B=B, C=C, K=K), entries


def with_noise_of(simulator: InnovationsModel, order: int, errors: RealArray) -> InnovationsModel:
    """A Box-Jenkins model to start from: an output-error model, and its free run's errors (N, ny).

    The noise of each output is the autoregression of the order that the errors' autocovariances
    give (Yule and Walker), which is always stable. NaN marks a missing error.
    """
    nu = simulator.B.shape[1]
    states, gains = [], []
    for o, v in enumerate(errors.T):
        factors = autoregression(v, order)
        rows = slice(o * nu * order, (o + 1) * nu * order)
        companion = np.eye(order, k=1)
        companion[:, 0] = factors
        plant = simulator.A[rows, rows], simulator.B[rows], simulator.C[o, rows]
        states.append((*plant, companion))
        gains.append(np.concatenate([np.zeros(nu * order), factors])[:, None])
    first = np.eye(1, order)[0]
    return replace(
        simulator,
        A=block_diag(*[block_diag(A, companion) for A, _, _, companion in states]),
        B=np.vstack([part for _, B, _, _ in states for part in (B, np.zeros((order, nu)))]),
        C=block_diag(*[np.concatenate([C, first])[None] for _, _, C, _ in states]),
        K=block_diag(*gains),
    )


def _observer_form(A: RealArray, known: int) -> tuple[RealArray, RealArray]:
    """Companion matrix (n, n) of the eigenvalues of A, and its observability matrix.

    The first ``known`` eigenvalues have their own block, which the block of the others drives.
    """
    n = len(A)
    companion = np.eye(n, k=1)
    for first, end in ((0, known), (known, n)):
        if end > first:
            companion[first:end, first] = -np.real(np.poly(A[first:end, first:end]))[1:]
    seen, row = np.empty((n, n)), np.eye(n)[0]
    for k in range(n):
        seen[k] = row
        row = row @ companion
    return companion, seen


def _markov(model: InnovationsModel, output: int) -> tuple[RealArray, RealArray]:
    """The first n Markov parameters of an output, from inputs (n, nu) and from noise (n, ny)."""
    row, rows = model.C[output], []
    for _ in range(model.order):
        rows.append(row)
        row = row @ model.A
    observed = np.array(rows)
    return observed @ model.B, observed @ model.K
