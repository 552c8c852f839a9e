"""Sets of complex points: input checks, and the frame of coordinates of the exact kernels.

A set is the last axis of a complex array (..., N). The frame of a set moves it to the origin and
scales it by powers of two to unit size. Scaling by powers of two is exact, and so is the
translation of a small set far from the origin (Sterbenz: a - b is exact if a/2 <= b <= 2a). So a
set of spread 1 at 1e8, or one of size 1e-300 or 1e300, loses no more digits than one near 1.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.compiled import compiled, unchecked_kernel
from workbench.errors import InputError

LARGEST_EXPONENT = 1000
"""Largest exponent, of either sign, of a power-of-two scale; its inverse is a normal number too."""


def as_points(points: ArrayLike) -> np.ndarray:
    """Sets of points as a complex128 array (..., N), N >= 1, all finite.

    A real array holds points on the real axis. One whose last axis has length 2 is refused with an
    `InputError`, because it is more often a table of x, y pairs than sets of two real points.
    """
    values = _numeric("points", points)
    if values.ndim == 0 or values.shape[-1] == 0:
        raise InputError(
            f"points of shape {values.shape} hold no point; needed is (..., N) with N >= 1"
        )
    if values.dtype.kind != "c" and values.shape[-1] == 2:
        raise InputError(
            f"real points of shape {values.shape} look like x, y pairs: pass "
            "points[..., 0] + 1j * points[..., 1] (or points + 0j for two points on the real axis)"
        )
    return _finite("points", values.astype(np.complex128))


def canonical_angle(angle: ArrayLike) -> np.ndarray:
    """The direction [rad] of a line, in [0, pi)."""
    turned = np.mod(np.asarray(angle, dtype=np.float64), np.pi)
    # a tiny negative angle is rounded up to pi
    return np.where(turned >= np.pi, 0.0, turned)


class Batch(NamedTuple):
    """Sets (S, N) and, for each answer (A,), the index of its set, its centre and its angle [rad].

    ``shape`` is the shape (...) that the answers are to be given, with A elements.
    """

    sets: np.ndarray
    shape: tuple[int, ...]
    which: np.ndarray
    center: np.ndarray
    angle: np.ndarray


def as_batch(
    points: ArrayLike, center: ArrayLike | None = None, angle: ArrayLike | None = None
) -> Batch:
    """Points (..., N), centres (...) and angles (...) [rad], broadcast without copying points.

    A centre or angle that is None becomes zero; a given angle is brought to [0, pi).
    """
    values = as_points(points)
    centers = _numeric("center", 0 if center is None else center).astype(np.complex128)
    angles = _numeric("angle", 0 if angle is None else angle)
    if angles.dtype.kind == "c":
        raise InputError("angle is complex; needed is a real number of radians")
    centers, angles = _finite("center", centers), _finite("angle", angles.astype(np.float64))
    lead = values.shape[:-1]
    try:
        shape = np.broadcast_shapes(lead, centers.shape, angles.shape)
    except ValueError:
        raise InputError(
            f"center {centers.shape} and angle {angles.shape} do not broadcast with the leading "
            f"axes {lead} of points {values.shape}"
        ) from None
    which = np.arange(math.prod(lead)).reshape(lead)
    parts = (which, centers, canonical_angle(angles))
    return Batch(
        np.ascontiguousarray(values).reshape(-1, values.shape[-1]),
        shape,
        *(np.broadcast_to(part, shape).ravel() for part in parts),
    )


def _numeric(name: str, given: ArrayLike) -> np.ndarray:
    """The given numbers as an array, or an `InputError` that names them."""
    try:
        values = np.asarray(given)
    except Exception as error:  # an object that is not an array may fail with any error
        raise InputError(f"{name} are no array of numbers: {error}") from None
    if values.dtype.kind not in "iufc":
        raise InputError(f"{name} of type {values.dtype} are no numbers; needed is complex or real")
    return values


def _finite(name: str, values: np.ndarray) -> np.ndarray:
    """The same values, or an `InputError` that says which one is not finite."""
    bad = ~np.isfinite(values)
    if bad.any():
        first = tuple(int(axis[0]) for axis in np.nonzero(np.atleast_1d(bad)))
        raise InputError(
            f"{name}: {np.count_nonzero(bad)} of {bad.size} values are NaN or infinite, "
            f"the first at index {first if len(first) > 1 else first[0]}; needed are finite numbers"
        )
    return values


class Frame(NamedTuple):
    """Coordinates of unit size: ((re p, im p) * shrink - (x, y)) * zoom."""

    shrink: float
    x: float
    y: float
    zoom: float


@unchecked_kernel
def _unit_scale(size: float) -> float:
    """The power of two that brings a size near 1 (1 for size 0)."""
    exponent = math.frexp(size)[1]
    return math.ldexp(1.0, -min(max(exponent, -LARGEST_EXPONENT), LARGEST_EXPONENT))


@compiled
def find_frame(points: np.ndarray, anchored: bool, anchor: complex) -> Frame:
    """Frame of one set (N,) about the anchor or, without one, the middle of its bounding box."""
    left = right = points[0].real
    low = high = points[0].imag
    for p in points:
        left, right = min(left, p.real), max(right, p.real)
        low, high = min(low, p.imag), max(high, p.imag)
    size = max(max(-left, right), max(-low, high))
    if anchored:
        size = max(size, max(abs(anchor.real), abs(anchor.imag)))
    # shrink before subtracting: near 1e308 a difference would overflow
    shrink = _unit_scale(size)
    left, right, low, high = left * shrink, right * shrink, low * shrink, high * shrink
    x, y = 0.5 * (left + right), 0.5 * (low + high)
    if anchored:
        x, y = anchor.real * shrink, anchor.imag * shrink
    reach = max(max(x - left, right - x), max(y - low, high - y))
    return Frame(shrink, x, y, _unit_scale(reach))


@compiled
def to_frame(points: np.ndarray, frame: Frame) -> tuple[np.ndarray, np.ndarray]:
    """The coordinates (N,), (N,) of one set (N,) in a frame."""
    x, y = np.empty(points.size), np.empty(points.size)
    for i, p in enumerate(points):
        x[i] = (p.real * frame.shrink - frame.x) * frame.zoom
        y[i] = (p.imag * frame.shrink - frame.y) * frame.zoom
    return x, y


@compiled
def selected(x: np.ndarray, which: np.ndarray) -> np.ndarray:
    """Coordinates (M,) of the points with indices ``which`` (M,)."""
    some = np.empty(which.size)
    for k in range(which.size):
        some[k] = x[which[k]]
    return some


@compiled
def point_from_frame(frame: Frame, x: float, y: float) -> complex:
    """The point with coordinates (x, y) in a frame."""
    return complex(
        (x / frame.zoom + frame.x) / frame.shrink, (y / frame.zoom + frame.y) / frame.shrink
    )


@compiled
def length_to_frame(frame: Frame, length: float) -> float:
    """A length in units of a frame."""
    return length * frame.shrink * frame.zoom


@compiled
def length_from_frame(frame: Frame, length: float) -> float:
    """A length that is given in units of a frame."""
    return length / frame.zoom / frame.shrink
