"""Forms of models with one Delta: where Delta acts, and how a plant gives its Delta.

With X = W_1 Delta W_2 and the nominal G0, a model of a form contains the plants

    additive          G0 + X                   inverse-additive   (I - G0 X)^-1 G0
    input             G0 (I + X)               inverse-input      G0 (I - X)^-1
    output            (I + X) G0               inverse-output     (I - X)^-1 G0
    coprime           (M + X_M)^-1 (N + X_N)   with G0 = M^-1 N, N N~ + M M~ = I, X = [X_N, X_M]
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from workbench._core.arrays import Array
from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError
from workbench.systems.bilinear import bilinear_continuous, bilinear_sampled
from workbench.systems.equations.riccati import right_factors
from workbench.systems.realisation import realisation, transposed_system

MatrixForm = Literal[
    "additive",
    "input",
    "output",
    "inverse-additive",
    "inverse-input",
    "inverse-output",
    "coprime",
]
"""Place of the uncertainty: added to the plant, at its input or at its output; in a feedback around
the plant, its input or its output (the inverse forms); or added to the coprime factors.
"""

REACHED = 1e-8
"""A part of a plant that no X gives counts as rounding up to this size, relative to the plant. It
is half of the digits of a double. Half or double moves the border between rounding and the error
that names the plant.
"""


def delta_shape(form: MatrixForm, p: int, m: int) -> tuple[int, int]:
    """Rows and columns of X for plants of p outputs and m inputs."""
    return {
        "additive": (p, m),
        "input": (m, m),
        "output": (p, p),
        "inverse-additive": (m, p),
        "inverse-input": (m, m),
        "inverse-output": (p, p),
        "coprime": (p, m + p),
    }[form]


def interconnection(nominal: StateSpace, form: MatrixForm) -> StateSpace:
    """System from (w, u) to (z, y); with w = X z it is the model of a form."""
    A, B, C, D = nominal.A, nominal.B, nominal.C, nominal.D
    p, m = D.shape
    n = len(A)
    Ip, Im, zero = np.eye(p), np.eye(m), np.zeros
    if form == "coprime":
        factors = left_factors(nominal)
        H, root = factors.B[:, m:], np.linalg.inv(factors.D[:, m:])
        # G0 in the states of its factors, with M^-1 = root - C (s I - A)^-1 H root
        C = root @ factors.C
        A, B, D = factors.A - H @ C, factors.B[:, :m] - H @ D, root @ factors.D[:, :m]
        B_w, C_z, D_zw = -H @ root, np.vstack([zero((m, n)), -C]), np.vstack([zero((m, p)), -root])
        D_zu, D_yw = np.vstack([Im, -D]), root
    else:
        before, after = (B, D), (zero((n, p)), Ip)  # X is added to the input, or to the output
        B_w, D_yw = before if form in ("input", "inverse-additive", "inverse-input") else after
        sees_input = form in ("additive", "input", "inverse-input")
        C_z, D_zu = (zero((m, n)), Im) if sees_input else (C, D)
        D_zw = {
            "inverse-additive": D,
            "inverse-input": Im,
            "inverse-output": Ip,
        }.get(form, zero((len(C_z), B_w.shape[1])))
    return realisation(
        (
            A,
            np.hstack([B_w, B]),
            np.vstack([C_z, C]),
            np.block([[D_zw, D_zu], [D_yw, D]]),
        ),
        float(nominal.dt or 0.0),
    )


def left_factors(nominal: StateSpace) -> StateSpace:
    """Stable [N, M] with G0 = M^-1 N and N N~ + M M~ = I, realised with the states of G0."""
    period = float(nominal.dt or 0.0)
    plane = bilinear_continuous(nominal) if period else nominal
    left = transposed_system(right_factors(transposed_system(plane), "the nominal"))
    return bilinear_sampled(left, period) if period else left


def residuals(
    values: Array, nominal: Array, form: MatrixForm, factors: Array | None
) -> tuple[Array, Array]:
    """X (F, N, ., .) of plants with responses (F, N, p, m), and the size of what X cannot give.

    Parameters
    ----------
    nominal
        Responses (F, p, m) of G0.
    factors
        Responses (F, p, m + p) of [N, M]; only for the form "coprime".

    The second array (F, N) is the norm of the part of a plant that no X gives, relative to the norm
    of the plant. It exceeds rounding only if G0 or the plant is not square, or is singular. If
    several X give the plant, the smallest one is returned.
    """
    G, G0 = values, nominal[:, None]
    m = G.shape[-1]
    away = G - G0
    if form == "coprime":
        assert factors is not None
        N, M = factors[:, None, :, :m], factors[:, None, :, m:]
        seen = np.concatenate([np.broadcast_to(np.eye(m), (*G.shape[:2], m, m)), -G], axis=-2)
        away = M @ G - N
        X = away @ np.linalg.pinv(seen)
        left = X @ seen - away
    elif form == "additive":
        return away, np.zeros(away.shape[:2])
    else:
        before = {"input": G0, "inverse-additive": G0, "inverse-input": G}.get(form)
        after = {"output": G0, "inverse-additive": G, "inverse-output": G}.get(form)
        X = away if before is None else np.linalg.pinv(before) @ away
        X = X if after is None else X @ np.linalg.pinv(after)
        left = (X if before is None else before @ X) @ (np.eye(m) if after is None else after)
        left = left - away
    size = np.linalg.norm(G, axis=(2, 3))
    return X, np.linalg.norm(left, axis=(2, 3)) / np.where(size > 0, size, 1.0)


def need_reached(left: Array, form: MatrixForm, where: list[str], plants: list[str]) -> None:
    """Raise InputError for plants that the form cannot give completely; the message names plant and
    frequency.
    """
    worst = np.unravel_index(int(np.argmax(left)), left.shape)
    if not left[worst] <= REACHED:
        raise InputError(
            f"no uncertainty of the form {form!r} gives plant {plants[worst[1]]} at "
            f"{where[worst[0]]}: {100 * left[worst]:.3g} % of its response remains; take the form "
            "'additive' or 'coprime', or the form at the plant's other side"
        )
