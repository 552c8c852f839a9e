"""Models with known poles and gains by least squares with equality constraints.

Given F = A - K C and C, the one-step predictions

    yhat = C (q - F)^-1 ((B - K D) u + K y) + D u

are linear in B - K D, D and K. So is the prior knowledge. A = F + K C has the pole p with the
outputs' direction w if C (p - F)^-1 K w = w. The static gain is G if C (1 - F)^-1 (B - K D + K G) +
D = G. If F is a shift, these are ARX models with known poles. Given A and C, simulations are linear
in B and D, and so is the gain.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench.identification.experiments.several import Experiments
from workbench.identification.innovations.gains import operating_point
from workbench.identification.innovations.input_regression import (
    InputRegression,
    constrained_least_squares,
)
from workbench.identification.innovations.knowledge import Knowledge
from workbench.identification.innovations.model import InnovationsModel
from workbench.identification.innovations.scaling import Scaling


def regressed(
    model: InnovationsModel, record: Experiments, known: Knowledge, direct: bool, parallel: bool
) -> InnovationsModel | None:
    """The model with known poles and gains whose B, D and K minimise the one-step errors.

    F = A - K C and C of the given model are kept. Known gains are imposed only for inputs whose
    gains are all known. For a repeated pole ``parallel`` says that it acts in several directions of
    the outputs; otherwise it forms one chain. None if the regression overflows, or if a pole of F
    is known.
    """
    scaling = Scaling.of(record)
    m, known = scaling.applied(model), known.in_units(scaling.u_spread, scaling.y_spread)
    nu, ny = m.B.shape[1], len(m.C)
    F = m.A - m.K @ m.C
    drive = InputRegression(F, m.C, (direct,) * nu + (False,) * ny)
    equations, goals = _known_rows(drive, m, known, nu, parallel)
    if not np.isfinite(equations).all():
        return None

    def pieces() -> Iterator[tuple[RealArray, RealArray]]:
        for u, y in record.pieces():
            signals = scaling.scaled(*model.driven_part(u, _filled(model, u, y)))
            joint = np.hstack([signals[0] - m.u_offset, signals[1] - m.y_offset])
            yield joint, scaling.scaled(*model.driven_part(u, y))[1]

    theta = constrained_least_squares(*drive.factor(pieces()), equations, goals)
    if theta is None:
        return None
    both, D, level = drive.parts(theta)
    K, D = both[:, nu:], D[:, :nu]
    A, B = F + K @ m.C, both[:, :nu] + K @ D
    u_offset, y_offset = operating_point(A, B, m.C, D, K @ (level - m.y_offset), level)
    found = replace(m, A=A, B=B, D=D, K=K, u_offset=m.u_offset + u_offset, y_offset=y_offset)
    return scaling.restored(found, record)


def _known_rows(
    drive: InputRegression, m: InnovationsModel, known: Knowledge, nu: int, parallel: bool
) -> tuple[RealArray, RealArray]:
    """Equations, with right-hand sides, for known poles and for known columns of gains."""
    ny, n = m.C.shape
    rows: list[ComplexArray] = []
    goals: list[complex] = []
    columns: list[int] = []

    def add(left: ComplexArray, w: ComplexArray, goal: ComplexArray) -> None:
        for o in range(ny):  # left (ny, n): left K w = goal
            B = np.zeros((n, nu + ny), dtype=complex)
            B[:, nu:] = np.outer(left[o], w)
            rows.append(drive.row(B, np.zeros((ny, nu + ny), dtype=complex)))
            goals.append(goal[o])

    with np.errstate(all="ignore"):
        for pole, times in known.groups():
            inverse = np.linalg.pinv(pole * np.eye(n) - drive.M)
            left = m.C @ inverse
            directions = np.linalg.svd(np.eye(ny) - left @ m.K)[2].conj()[::-1]
            beside = min(times, ny) if parallel else 1
            for w in directions[:beside]:
                add(left, w, w)
            chain = left
            for _ in range(times - beside):
                chain = chain @ inverse
                add(chain, directions[0], np.zeros(ny, dtype=complex))
        equations = [*np.real(rows), *np.imag(rows)]
        ends = [*np.real(goals), *np.imag(goals)]
        gain = np.zeros((ny, 0)) if known.gain is None else known.gain
        columns += [int(j) for j in np.flatnonzero(np.isfinite(gain).all(axis=0))]
        for j in columns:
            left = m.C @ np.linalg.inv(np.eye(n) - drive.M)
            for o in range(ny):
                B, D = np.zeros((n, nu + ny)), np.zeros((ny, nu + ny))
                B[:, j], D[o, j] = left[o], 1.0
                B[:, nu:] = np.outer(left[o], gain[:, j])
                equations.append(drive.row(B, D))
                ends.append(gain[o, j])
    return np.array(equations).reshape(-1, drive.columns), np.array(ends)


def with_known_gains(
    model: InnovationsModel, record: Experiments, known: Knowledge, direct: bool, predicting: bool
) -> InnovationsModel | None:
    """The model with known gains whose B, D and offsets minimise the errors.

    The errors are those of one-step predictions or of simulations. None if the regression
    overflows.
    """
    scaling = Scaling.of(record)
    m, known = scaling.applied(model), known.in_units(scaling.u_spread, scaling.y_spread)
    n, nu = m.order, m.B.shape[1]
    # If A has a pole at 1, a constant that enters the states causes a drift.
    drifts = n > 0 and float(np.min(np.abs(np.linalg.eigvals(m.A) - 1))) < 1 / len(record)
    K = m.K if predicting else np.zeros_like(m.K)
    drive = InputRegression(m.A - K @ m.C, m.C, (direct,) * nu + (False,) * drifts)
    noise = replace(  # the predictor's response to past outputs alone
        m,
        B=np.zeros_like(m.B),
        D=np.zeros_like(m.D),
        u_offset=0 * m.u_offset,
        delay_samples=(),
        members=(),
    )

    def pieces() -> Iterator[tuple[RealArray, RealArray]]:
        for u, y in record.pieces():
            inputs, outputs = scaling.scaled(*model.driven_part(u, y))
            inputs, left = inputs - m.u_offset, outputs - m.y_offset
            if predicting:
                filled = scaling.scaled(*model.driven_part(u, _filled(model, u, y)))[1]
                left = outputs - noise.one_step(inputs, filled, 1)
            constant = np.ones((len(inputs), int(drifts)))
            yield np.hstack([inputs, constant]), left

    equations, goals = [], []
    if known.gain is not None:
        outward = np.linalg.solve((np.eye(n) - m.A).T, m.C.T).T
        for o, j in np.argwhere(np.isfinite(known.gain)):
            # The regression determines B - K D.
            B, D = np.zeros((n, nu + drifts)), np.zeros((len(m.C), nu + drifts))
            B[:, j], D[:, j] = outward[o], outward[o] @ K
            D[o, j] += 1.0
            equations.append(drive.row(B, D))
            goals.append(known.gain[o, j])
    rows = np.array(equations).reshape(-1, drive.columns)
    theta = constrained_least_squares(*drive.factor(pieces()), rows, np.array(goals))
    if theta is None:
        return None
    both, D, level = drive.parts(theta)
    D = D[:, :nu]
    B = both[:, :nu] + K @ D
    u_offset, y_offset = np.zeros(nu), level
    if predicting or drifts:
        forcing = K @ level + both[:, nu:].sum(axis=1)
        u_offset, y_offset = operating_point(m.A, B, m.C, D, forcing, level)
    offsets = m.u_offset + u_offset, m.y_offset + y_offset
    found = replace(m, B=B, D=D, u_offset=offsets[0], y_offset=offsets[1])
    return scaling.restored(found, record)


def _filled(model: InnovationsModel, u: RealArray, y: RealArray) -> RealArray:
    """Outputs in which predictions replace missing samples."""
    missing = np.isnan(y)
    return np.where(missing, model.one_step(u, y, len(y)), y) if missing.any() else y
