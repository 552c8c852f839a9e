"""Things that people, scripts and files hand to functions, most of them wrong: drawn by a seed."""

import datetime
import decimal
import fractions
import math
import pathlib

import control
import numpy as np

from workbench.structure import Complex, Full, Real, Structure
from workbench.uncertainty import complex_scalar, dynamics, real, ss, tf

SIZES = (5e-324, 1e-300, 1e-100, -1.0, 1e100, 1e300, 1.7e308, math.inf, -math.inf, math.nan)


ODD = {"place": "", "value": None}
"""What is odd of a problem that is run, and where."""


class Refusing:
    """Refuses to be a number, an array, a length or a sequence."""

    def __float__(self):
        raise RuntimeError("no number")

    def __array__(self, *args, **kwargs):
        raise RuntimeError("no array")

    def __len__(self):
        raise RuntimeError("no length")

    def __iter__(self):
        raise RuntimeError("no sequence")


def _plain():
    """Objects that are no arrays and no systems."""
    endless = []
    endless.append(endless)
    return [
        *(None, True, False, 0, -1, 1, 2, 3, 7, 10**400, *SIZES),
        *("", "text", "\ud800", "a\x00b", "1.0", b"\xff", bytearray(b"x")),
        *([], (), {}, set(), {1.0}, frozenset({1}), [None], [[]], [1, [2]], [[1, 2], [3]], ["a"]),
        *({"a": 1}, {1: "a"}, {"k": math.nan}, endless, range(3), slice(1), ..., NotImplemented),
        *(1j, complex(math.nan, 1), decimal.Decimal("NaN"), fractions.Fraction(1, 3)),
        *(object(), object, int, len, lambda *_: None, Refusing(), Refusing, math),
        *(pathlib.Path("/nowhere"), datetime.date(2000, 1, 1), ValueError("x"), iter([1.0])),
    ]


def _arrays():
    """Arrays of odd types, shapes and values."""
    return [
        *(np.float32(1.5), np.int64(3), np.bool_(True), np.complex64(1j), np.str_("a")),
        *(np.array(1.0), np.array([0.0]), np.array([]), np.zeros((0, 3)), np.zeros((2, 0))),
        *(np.zeros((2, 2)), np.ones((2, 2, 2)), np.ones((1, 1, 1, 1)), np.eye(3)),
        *(np.array([None, 1]), np.array([object()]), np.array(["a", "b"]), np.array([b"a"])),
        *(np.array([1, 2], dtype=np.uint8), np.array([True, False]), np.float16([1, 2, 3])),
        *(np.array([1.0, np.nan]), np.array([np.inf, 1.0]), np.array([1j, 2.0])),
        *(np.full((2, 2), 5e-324), np.full((2, 2), 1e300), np.full((2, 2), 1e300j)),
        *(np.array([[1, 1e300], [1e-300, 1]]), np.array([[0.0, 1.0], [0.0, 0.0]])),
        *(np.ma.array([1.0, 2.0], mask=[True, False]), np.array(["2000-01-01"], "M8[D]")),
        *(np.zeros(2, dtype=[("a", float)]), np.longdouble(1), np.array([1.0, 2.0])[::-1]),
    ]


def _systems():
    """Systems of python-control of every kind that it makes, and uncertain ones."""
    s = control.tf([1, 0], [1])
    lag = control.ss([[-1.0]], [[1.0]], [[1.0]], [[0.0]])
    k = real("k", 1.0, plus_minus=0.5)
    gains = [control.ss([], [], [], [[x]]) for x in (0.0, 5e-324, 1e300, math.inf, math.nan)]
    bare = [[0.5]], [[1.0]], [[1.0]], [[0.0]]
    nothing = np.zeros((2, 2)), np.zeros((2, 1)), np.zeros((1, 2)), 0
    return [
        *(lag, s, 1 / s, 1 / (s - 1), 1 / (s * s + 1), control.tf([0], [1]), control.tf([1], [1])),
        *(control.tf([1e300], [1, 1]), control.tf([1], [1e300, 1]), control.tf([5e-324], [1, 1])),
        *(control.tf([1], [1, 0.5], 0.1), control.tf([1], [1, 0.5], True), control.tf(1, 1, 0.1)),
        *(control.ss(*bare, None), control.ss(*bare, True), control.ss([], [], [], np.eye(2))),
        *(control.append(lag, lag), control.append(lag, lag, lag), control.ss(*nothing)),
        *(control.ss([[x]], [[1.0]], [[1.0]], [[0.0]]) for x in (-1e300, -5e-324, math.nan)),
        *(control.frd([1.0, 2.0, 3.0], [1.0, 2.0, 3.0]), control.frd([math.nan], [1.0])),
        control.nlsys(None, lambda t, x, u, params: u, inputs=1, outputs=1),
        control.zpk([-1], [-2], 3.0),
        *gains,
        *(k, k * 1.0, complex_scalar("c", 0.0, 1.0), dynamics("d", 1, 1), dynamics("d", 2, 3)),
        *(
            tf([1], [1, k]),
            tf([k], [1, 1]),
            ss([], [], [], [[k]]),
            ss([[-k]], [[1]], [[1]], 0, 0.1),
        ),
        *(1e300 * k, 5e-324 * k, tf([1], [1, -k]), tf([1], [k, 1]), real("k", 1e300, percent=1)),
        *(Structure([block]) for block in (Real(1), Complex(2), Full(1, 1), Full(2, 3))),
        *(Real(1), Full, Structure),
    ]


POOL = (*_plain(), *_arrays(), *_systems())
"""Values that are tried as they are."""


def distorted(value, rng):
    """A right value made wrong: scaled, cut, turned, repeated, of another type or dimension."""
    with np.errstate(all="ignore"):
        return _DISTORTIONS[int(rng.integers(len(_DISTORTIONS)))](value, rng)


def _times(value, rng):
    return value * float(rng.choice(SIZES))


def _entry(value, rng):
    array = np.array(value, dtype=complex if np.iscomplexobj(value) else float)
    array.ravel()[int(rng.integers(array.size))] = rng.choice(SIZES)
    return array


_DISTORTIONS = (
    _times,
    _times,
    _entry,
    _entry,
    lambda value, rng: np.asarray(value)[: int(rng.integers(3))],
    lambda value, rng: np.asarray(value).T,
    lambda value, rng: np.asarray(value)[None],
    lambda value, rng: np.asarray(value).astype(rng.choice(["f4", "c16", "O", "i8", "U8", "?"])),
    lambda value, rng: [value, value],
    lambda value, rng: [value],
    lambda value, rng: {"value": value},
    lambda value, rng: str(value),
    lambda value, rng: np.array(value, dtype=object),
    lambda value, rng: list(value)[::-1],
    lambda value, rng: tuple(np.ravel(value)),
    lambda value, rng: -value,
)


def fuzzed(right, rng):
    """Something for an argument whose right value is known."""
    if rng.random() < 0.4:
        try:
            return distorted(right, rng)
        except Exception:  # what cannot be distorted so
            pass
    return POOL[int(rng.integers(len(POOL)))]
