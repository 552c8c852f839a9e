"""Local parameters of a normalised Delta, and the gradient of a real eigenvalue of M Delta.

The parameter of a real block is its value in [-1, 1], that of a complex scalar its angle. The
parameters of a full block are the two vectors of a dyad u v*, of any length; a full block that
attains mu may be a dyad.
"""

from __future__ import annotations

import numpy as np

from workbench._core.compiled import unchecked_kernel
from workbench.mu.lower.attain import FULL, REAL
from workbench.mu.lower.rayleigh import Q, X, inner_product, squared_size
from workbench.mu.lower.realise import set_block


@unchecked_kernel
def set_parameters(delta, table, v, p):  # type: ignore[no-untyped-def]
    """Set row p of v to the parameters of a normalised Delta whose full blocks are dyads."""
    at = 0
    for k in range(len(table)):
        r, nr, c, nc = table[k, 1], table[k, 2], table[k, 3], table[k, 4]
        if table[k, 0] == REAL:
            v[p, at] = min(max(delta[r, c].real, -1.0), 1.0)
            at += 1
        elif table[k, 0] == FULL:
            # The largest row of u v* has the direction of v*; then u is the dyad times v.
            row, most = r, -1.0
            for i in range(r, r + nr):
                total = 0.0
                for j in range(c, c + nc):
                    total += squared_size(delta[i, j])
                if total > most:
                    row, most = i, total
            scale = 1.0 / np.sqrt(most)
            for i in range(nr):
                u = 0j
                for j in range(c, c + nc):
                    u += delta[r + i, j] * np.conj(delta[row, j])
                v[p, at + 2 * i], v[p, at + 2 * i + 1] = scale * u.real, scale * u.imag
            at += 2 * nr
            for j in range(nc):
                v[p, at + 2 * j] = scale * delta[row, c + j].real
                v[p, at + 2 * j + 1] = -scale * delta[row, c + j].imag
            at += 2 * nc
        else:
            v[p, at] = np.arctan2(delta[r, c].imag, delta[r, c].real)
            at += 1


@unchecked_kernel
def _part_length(v, p, at, n):  # type: ignore[no-untyped-def]
    """Length of the n complex entries stored at a place."""
    total = 0.0
    for i in range(at, at + 2 * n):
        total += v[p, i] * v[p, i]
    return np.sqrt(total)


@unchecked_kernel
def set_delta(v, p, phase, table, delta):  # type: ignore[no-untyped-def]
    """Set Delta (rows, columns) from row p of v, with complex blocks turned by a phase."""
    turn = complex(np.cos(phase), np.sin(phase))
    at = 0
    for k in range(len(table)):
        r, nr, c, nc = table[k, 1], table[k, 2], table[k, 3], table[k, 4]
        if table[k, 0] == FULL:
            behind = at + 2 * nr
            scale = turn * (1.0 / (_part_length(v, p, at, nr) * _part_length(v, p, behind, nc)))
            for i in range(nr):
                u = scale * complex(v[p, at + 2 * i], v[p, at + 2 * i + 1])
                for j in range(nc):
                    delta[r + i, c + j] = u * complex(
                        v[p, behind + 2 * j], -v[p, behind + 2 * j + 1]
                    )
            at = behind + 2 * nc
        else:
            value = complex(np.cos(v[p, at]), np.sin(v[p, at])) * turn
            set_block(delta, table, k, complex(v[p, at], 0.0) if table[k, 0] == REAL else value)
            at += 1


@unchecked_kernel
def set_gradient(v, p, g, phase, delta, table, weight, w):  # type: ignore[no-untyped-def]
    """Set row g of v to d lambda / dp with lambda kept real: d lambda = Re(weight q* d(Delta) x).

    Delta is that of the parameters and the phase; q and x are those of the workspace.
    """
    turned = weight * complex(np.cos(phase), np.sin(phase))
    at = 0
    for k in range(len(table)):
        r, nr, c, nc = table[k, 1], table[k, 2], table[k, 3], table[k, 4]
        if table[k, 0] == FULL:
            behind = at + 2 * nr
            size_u, size_v = _part_length(v, p, at, nr), _part_length(v, p, behind, nc)
            backward, forward = 0j, 0j  # q* u and v* x
            for i in range(nr):
                u = complex(v[p, at + 2 * i], v[p, at + 2 * i + 1])
                backward += np.conj(w[Q, r + i]) * u
            for j in range(nc):
                forward += complex(v[p, behind + 2 * j], -v[p, behind + 2 * j + 1]) * w[X, c + j]
            backward *= turned * (1.0 / size_u)
            forward *= 1.0 / size_v
            along = (backward * forward).real
            factor = np.conj(turned * forward)
            for i in range(nr):
                one, e = factor * w[Q, r + i], at + 2 * i
                v[g, e] = (one.real - along * v[p, e] / size_u) / size_u
                v[g, e + 1] = (one.imag - along * v[p, e + 1] / size_u) / size_u
            for j in range(nc):
                one, e = backward * w[X, c + j], behind + 2 * j
                v[g, e] = (one.real - along * v[p, e] / size_v) / size_v
                v[g, e + 1] = (one.imag - along * v[p, e + 1] / size_v) / size_v
            at = behind + 2 * nc
        else:
            effect = weight * inner_product(w, Q, r, X, c, nr)
            v[g, at] = effect.real if table[k, 0] == REAL else (1j * delta[r, c] * effect).real
            at += 1
