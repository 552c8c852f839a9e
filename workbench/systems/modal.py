"""Modal realisations: one block of two states for each resonance."""

from __future__ import annotations

import numpy as np

from workbench.arrays import RealArray
from workbench.errors import InputError


def modal_form(A: RealArray, B: RealArray, C: RealArray) -> tuple[RealArray, RealArray, RealArray]:
    """A realisation whose blocks [s w; -w s] are the resonances, slow ones first, each C = [1 0].

    A (n, n), B (n, m), C (1, n) with complex poles only, each of them once and seen by C. The
    states of similar plants then mean the same, what each resonance adds to the output, so that one
    function of the state can serve all of them. Raises InputError for a real pole and for more than
    one output.
    """
    poles, vectors = np.linalg.eig(A)
    up = [i for i in np.argsort(abs(poles)) if poles[i].imag > 0]
    if 2 * len(up) != len(A) or C.shape != (1, len(A)):
        raise InputError(f"poles {poles}, C of shape {C.shape}: need complex poles, one output")
    T = np.zeros_like(A)
    for place, i in enumerate(up):
        v = vectors[:, i] / (C @ vectors[:, i])
        T[:, 2 * place], T[:, 2 * place + 1] = v.real, v.imag
    into = np.linalg.inv(T)
    return into @ A @ T, into @ B, C @ T
