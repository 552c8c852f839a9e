"""Observer gains by pole placement, for plants in any scaling.

    x^ := A x^ + B u + L (y - C x^)        L places the poles of A - L C

On the left x^ stands for its derivative in continuous time, for the next estimate in discrete time.
"""

from __future__ import annotations

import warnings

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import matrix_balance

from workbench._core.arrays import ComplexArray, RealArray
from workbench.errors import InputError, SolverError
from workbench.input_checks import as_array, need_numbers

UNOBSERVABLE_DISTANCE = 1e-11
"""A mode counts as unobservable if a system this near, relatively, has an unobservable mode."""
POLE_RESIDUAL = 1e-9
"""Largest relative residual of a placed pole, see `placement_residual`."""


def observer_gain(
    A: ArrayLike, C: ArrayLike, poles: ArrayLike, *, dt: float | None = None
) -> RealArray:
    """Gain L (n, p) that gives A - L C (n, n) the wanted poles (n,); outputs y = C x, C (p, n).

    dt: sample time [s]; None in continuous time. The states are balanced first, so that their
    units do not matter; the placement is SLICOT's SB01BD, and every pole is checked afterwards.

    Raises InputError for wrong shapes, for poles that are unstable or not in conjugate pairs, and
    for a mode that the outputs do not show; the message names the mode. Raises SolverError if a
    pole is missed.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.diagnosis import observer_gain
    >>> A, C = np.array([[0.0, 1.0], [-4.0, -0.5]]), np.array([[1.0, 0.0]])
    >>> L = observer_gain(A, C, [-5.0, -6.0])
    >>> np.sort(np.linalg.eigvals(A - L @ C).real).round(6).tolist()
    [-6.0, -5.0]
    """
    a, c, wanted = _checked(A, C, poles, dt)
    scaled, scale = balanced_matrix(a)
    seen = c * scale
    size = abs(seen).max(axis=1, keepdims=True)
    check_observable(scaled, seen, dt)
    # With fast sampling all poles lie close to 1: shift and scale them before the placement.
    shift, stretch = (0.0, 1.0) if dt is None else (1.0, dt)
    shifted = (scaled - shift * np.eye(len(a))) / stretch
    gain = _place(shifted, seen / size, (wanted - shift) / stretch) * stretch / size.T
    residual = placement_residual(scaled, seen, gain, wanted)
    if not residual <= POLE_RESIDUAL:
        raise SolverError(f"poles were missed: residual {residual:.2g}, wanted {POLE_RESIDUAL:.0e}")
    placed: RealArray = scale[:, None] * gain
    return placed


def placement_residual(A: RealArray, C: RealArray, gain: RealArray, poles: ComplexArray) -> float:
    """The largest relative distance of A - L C from a matrix that has one of the poles.

    The distance for a pole p is the smallest singular value of A - L C - p I. Unlike the error of
    computed eigenvalues it stays small for multiple poles. It is relative to the size of A or of
    A - I, whichever is smaller, because a fast sampled A is near I.
    """
    closed, unit = A - gain @ C, np.eye(len(A))
    size = max(min(np.linalg.norm(A, 2), np.linalg.norm(A - unit, 2)), abs(gain @ C).max())
    least = [np.linalg.svd(closed - pole * unit, compute_uv=False)[-1] for pole in poles]
    return float(max(least) / size)


def balanced_matrix(A: ArrayLike) -> tuple[RealArray, RealArray]:
    """D^-1 A D (n, n), its rows and columns of about equal size, and the diagonal of D (n,)."""
    scaled, (scale, _) = matrix_balance(np.asarray(A, float), permute=False, separate=True)
    return scaled, scale


def check_observable(A: RealArray, C: RealArray, dt: float | None = None) -> None:
    """Raise InputError, naming the mode, if y = C x does not show it (Popov, Belevitch, Hautus).

    A must be balanced: the distance to the nearest such system is compared with the sizes of A and
    C.
    """
    unit = np.eye(len(A))
    drift = A if dt is None else A - unit
    rate = max(float(np.linalg.norm(drift, 2)), np.finfo(float).tiny)
    level = max(float(np.linalg.norm(C, 2)), np.finfo(float).tiny)
    for mode in np.linalg.eigvals(A):
        pencil = np.vstack([(A - mode * unit) / rate, C / level])
        if np.linalg.svd(pencil, compute_uv=False)[-1] < UNOBSERVABLE_DISTANCE:
            raise InputError(
                f"the mode at {_described(mode, dt)} does not show in the measurement; "
                "leave it out of the model or measure something that moves with it"
            )


def _described(mode: complex, dt: float | None) -> str:
    s = complex(mode) if dt is None or mode == 0 else complex(np.log(mode)) / dt
    place = "s" if dt is None else "z"
    return f"{place} = {complex(mode):.6g} ({abs(s) / (2 * np.pi):.4g} Hz)"


def _place(a: RealArray, c: RealArray, poles: ComplexArray) -> RealArray:
    import control
    from slycot.exceptions import SlycotError

    real, upper = poles[poles.imag == 0.0], poles[poles.imag > 0.0]
    # SB01BD needs the two poles of a pair side by side
    pairs = np.column_stack([upper, upper.conj()]).ravel()
    try:
        with warnings.catch_warnings():
            # SB01BD warns of large gains; a fast observer of slow modes needs them, and the
            # residual judges them.
            warnings.simplefilter("ignore")
            gain: RealArray = np.asarray(control.place_varga(a.T, c.T, np.append(real, pairs))).T
    except SlycotError as fault:
        raise SolverError(f"pole placement failed: {fault}") from fault
    return gain


def _checked(
    A: ArrayLike, C: ArrayLike, poles: ArrayLike, dt: float | None
) -> tuple[RealArray, RealArray, ComplexArray]:
    a, c = as_array(A, "A"), np.atleast_2d(as_array(C, "C"))
    wanted = as_array(poles, "poles", dtype=complex)
    n = len(a) if a.ndim == 2 else 0
    if not n or a.shape != (n, n) or c.shape[1:] != (n,):
        raise InputError(f"A has shape {a.shape} and C {c.shape}; need (n, n) and (p, n)")
    if wanted.shape != (n,):
        raise InputError(f"poles have shape {wanted.shape}; {n} states need ({n},)")
    if not (np.isfinite(a).all() and np.isfinite(c).all() and np.isfinite(wanted).all()):
        raise InputError("A, C and the poles must be finite")
    if dt is not None:
        need_numbers(dt=dt)
    if dt is not None and not 0.0 < dt < np.inf:
        raise InputError(f"dt is {dt} s; it must be positive and finite")
    outside = wanted[wanted.real >= 0.0] if dt is None else wanted[abs(wanted) >= 1.0]
    if outside.size:
        region = "the left half-plane" if dt is None else "the unit circle"
        raise InputError(f"the pole {outside[0]:.6g} is not inside {region}")
    tiny = abs(wanted.imag) <= 1e-12 * abs(wanted)
    upper, lower = (np.sort_complex(wanted[~tiny & (wanted.imag * one > 0)]) for one in (1, -1))
    lower = np.sort_complex(lower.conj())
    if upper.shape != lower.shape or (abs(upper - lower) > 1e-9 * abs(upper)).any():
        raise InputError(f"poles {wanted.tolist()} are not in conjugate pairs")
    return a, c, np.concatenate([wanted[tiny].real.astype(complex), upper, upper.conj()])
