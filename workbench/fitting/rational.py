"""Real rational functions represented by zeros, poles and a gain.

Polynomial coefficients lose all their digits over five decades of frequency; roots do not. So fits
work on roots, and the result is realised as a cascade of second-order sections at the end.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import ComplexArray, RealArray
from workbench._core.heavy_types import StateSpace
from workbench.answer import ProgramAnswer
from workbench.errors import InputError

if TYPE_CHECKING:
    from flint import fmpq, fmpq_poly

CONVERSION_ROUNDING = 1e-9
"""Relative error of a response that is explained by rounding of the roots."""


@dataclass(frozen=True, eq=False, repr=False)
class Rational(ProgramAnswer):
    """gain * prod(s - zeros) / prod(s - poles), proper, with real coefficients.

    Unlike a `TransferFunction`, it keeps zeros and poles, which the coefficients of polynomials
    lose to rounding.

    Parameters
    ----------
    zeros, poles
        Roots [rad/s], complex ones in exact conjugate pairs (see `conjugate_pairs`); at least
        as many poles as zeros.
    gain
        Real factor of the products.

    Raises
    ------
    InputError
        More zeros than poles, roots without their conjugates, or values that are not finite.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.fitting import Rational
    >>> W = Rational(zeros=[], poles=[-2.0], gain=4.0)
    >>> W.response(np.array([0.0, 2.0])).round(6).tolist(), W.is_stable
    ([(2+0j), (1-1j)], True)
    """

    zeros: ComplexArray
    poles: ComplexArray
    gain: float

    def __post_init__(self) -> None:
        for name in ("zeros", "poles"):
            roots = np.asarray(getattr(self, name), dtype=complex).ravel()
            if not np.isfinite(roots).all():
                raise InputError(f"{name} must be finite, they are {roots}")
            ordered = _ordered(roots)
            if roots.imag.any() and not np.array_equal(ordered, _ordered(roots.conj())):
                raise InputError(f"{name} must come in conjugate pairs, they are {roots}")
            object.__setattr__(self, name, ordered)
        object.__setattr__(self, "gain", float(self.gain))
        if not np.isfinite(self.gain):
            raise InputError(f"gain must be finite, it is {self.gain}")
        if self.zeros.size > self.poles.size:
            raise InputError(f"{self.zeros.size} zeros, but only {self.poles.size} poles")

    @property
    def order(self) -> int:
        """Number of poles."""
        return int(self.poles.size)

    @property
    def is_stable(self) -> bool:
        """Whether all poles lie left of the imaginary axis."""
        return bool(np.all(self.poles.real < 0))

    @property
    def is_minimum_phase(self) -> bool:
        """Whether all zeros lie left of the imaginary axis."""
        return bool(np.all(self.zeros.real < 0))

    def __call__(self, s: ArrayLike) -> ComplexArray:
        """Values at complex frequencies s [rad/s], of the same shape as s."""
        s = np.asarray(s, dtype=complex)
        value = np.full(s.shape, self.gain, dtype=complex)
        for i, pole in enumerate(self.poles):  # factors interleaved, so that no product overflows
            if i < self.zeros.size:
                value *= s - self.zeros[i]
            value /= s - pole
        return value

    def response(self, omega: ArrayLike) -> ComplexArray:
        """Values on the imaginary axis at angular frequencies [rad/s]."""
        return self(1j * np.asarray(omega, dtype=float))

    def scaled(self, factor: float) -> Rational:
        """The function times a factor."""
        return Rational(self.zeros, self.poles, self.gain * factor)

    def inverse(self) -> Rational:
        """1 / function; it exists only if there are as many zeros as poles."""
        return Rational(self.poles, self.zeros, 1 / self.gain)

    @property
    def lti(self) -> StateSpace:
        """As `state_space`."""
        return self.state_space()

    def state_space(self) -> StateSpace:
        """State-space realisation: a cascade of second-order sections, scaled in time and size.

        At most one section has order one. Sections go from the lowest to the highest pole, each
        with the zeros nearest to its poles.
        """
        import control

        a, b = np.zeros((0, 0)), np.zeros((0, 1))
        c, d = np.zeros((1, 0)), np.eye(1)
        gain = self.gain
        for numerator, denominator in self._sections():
            a2, b2, c2, d2 = _section(numerator, denominator)
            size = max(np.abs(c2).max(), abs(d2[0, 0]))
            c2, d2, gain = c2 / size, d2 / size, gain * size
            corner = np.zeros((len(a), len(a2)))
            a = np.block([[a, corner], [b2 @ c, a2]])
            b = np.vstack([b, b2 @ d])
            c = np.hstack([d2 * c, c2])
            d = d2 * d
        share = np.sqrt(abs(gain)) or 1.0  # input and output scaled to the same size
        return control.ss(a, b * share, c * (gain / share), d * gain)

    def _sections(self) -> list[tuple[RealArray, RealArray]]:
        """Numerators and denominators of the sections, coefficients of the highest power first.

        The product of the sections is function / gain.
        """
        groups = _grouped(self.poles)
        zeros = sorted(_grouped(self.zeros), key=len, reverse=True)
        taken: dict[int, ComplexArray] = {}
        for zero in zeros:
            free = [i for i, pole in enumerate(groups) if i not in taken and len(pole) >= len(zero)]
            nearest = min(free, key=lambda i: abs(_level(groups[i]) - _level(zero)))
            taken[nearest] = zero
        return [
            (_coefficients(taken.get(i, np.zeros(0, complex))), _coefficients(pole))
            for i, pole in enumerate(groups)
        ]


def conjugate_pairs(roots: ArrayLike) -> ComplexArray:
    """Roots of a real polynomial in exact conjugate pairs, with rounding errors repaired.

    A complex root is paired with the nearest root on the other side of the real axis; one without a
    partner is moved onto the axis.
    """
    left = list(np.asarray(roots, dtype=complex).ravel())
    done: list[complex] = []
    left.sort(key=lambda root: -abs(root.imag))
    while left:
        root = left.pop(0)
        across = [k for k, other in enumerate(left) if other.imag * root.imag < 0]
        if root.imag == 0 or not across:
            done.append(complex(root.real))
            continue
        k = min(across, key=lambda k: abs(left[k] - root.conjugate()))
        mean = (root + left.pop(k).conjugate()) / 2
        done += [mean, mean.conjugate()]
    return _ordered(np.array(done, dtype=complex))


def rational_of_system(system: StateSpace) -> Rational:
    """Zeros, poles and gain of a proper SISO continuous-time system.

    Raises
    ------
    InputError
        The argument is no system, not SISO, in discrete time, or not finite.

    Examples
    --------
    >>> import control
    >>> from workbench.fitting import rational_of_system
    >>> function = rational_of_system(control.tf([2.0, 6.0], [1.0, 1.0]))
    >>> function.zeros.real.tolist(), function.gain
    ([-3.0], 2.0)
    """
    if not hasattr(system, "zeros"):
        raise InputError(f"a transfer function or state space is needed, not {system!r:.80}")
    if system.ninputs != 1 or system.noutputs != 1:
        raise InputError(f"a SISO system is needed, not {system.noutputs} x {system.ninputs}")
    if system.isdtime(strict=True):
        raise InputError(f"a continuous-time system is needed, dt is {system.dt}")
    parts = _parts(system)
    if not all(np.isfinite(part).all() for part in parts):
        raise InputError("the system has coefficients that are not finite")
    function = _with_roots(system, *_scaled_roots(system))
    if _distance(function, system) <= CONVERSION_ROUNDING:
        return function
    return _exact(system)


def _with_roots(system: StateSpace, zeros: ArrayLike, poles: ArrayLike) -> Rational:
    """The function of a system with these roots."""
    bare = Rational(conjugate_pairs(zeros), conjugate_pairs(poles), 1.0)
    # take the gain where the function is neither tiny nor huge: off the axis, at a middle frequency
    at = complex(np.exp(_log_sizes(bare).mean()) * (1.0 + 0.5j))
    gain = float((complex(system(at)) / complex(bare(at))).real)
    return Rational(bare.zeros, bare.poles, gain)


def _exact(system: StateSpace) -> Rational:
    """The function of a system, its polynomials exact and its roots correctly rounded."""
    numerator, denominator = _polynomials(system)
    gain = _leading(numerator) / _leading(denominator)
    return Rational(_roots(numerator), _roots(denominator), float(gain))


def _roots(polynomial: fmpq_poly) -> ComplexArray:
    found: Any = polynomial.complex_roots()  # pairs of root and multiplicity
    return conjugate_pairs([complex(root) for root, count in found for _ in range(count)])


def _leading(polynomial: fmpq_poly) -> Fraction:
    """The coefficient of the highest power; 0 of the zero polynomial."""
    degree = polynomial.degree()
    last = polynomial[degree] if degree >= 0 else polynomial[0]
    return Fraction(int(last.p), int(last.q))


def _polynomials(system: StateSpace) -> tuple[fmpq_poly, fmpq_poly]:
    """Numerator and denominator in exact rational numbers.

    det(s - A + B C) = det(s - A) (1 + C (s - A)^-1 B) gives the numerator.
    """
    import flint

    from workbench.certify.known_plants.exact_function import exact_rational

    def exact(values: RealArray) -> list[fmpq]:
        return [exact_rational(x) for x in values.ravel()]

    parts = _parts(system)
    if len(parts) == 2:
        numerator, denominator = (flint.fmpq_poly(exact(part)[::-1]) for part in parts)
        return numerator, denominator
    A, B, C, D = (flint.fmpq_mat(part.shape[0], part.shape[1], exact(part)) for part in parts)
    denominator = A.charpoly()
    return (A - B * C).charpoly() + (D[0, 0] - 1) * denominator, denominator


def _parts(system: StateSpace) -> tuple[RealArray, ...]:
    """Matrices A, B, C, D of a state space; numerator and denominator of a transfer function."""
    if hasattr(system, "A"):
        return system.A, system.B, system.C, system.D
    return system.num[0][0], system.den[0][0]


def _log_sizes(function: Rational) -> RealArray:
    """Logarithms of the sizes of roots other than 0; those of 1 if there are none."""
    sizes = np.abs(np.concatenate([function.zeros, function.poles]))
    return np.log(sizes[sizes > 0]) if sizes.any() else np.zeros(1)


def _distance(function: Rational, system: StateSpace) -> float:
    """Largest relative difference of the responses at points off the axis, near the sizes of the
    roots.
    """
    s = np.exp(np.quantile(_log_sizes(function), np.linspace(0, 1, 9))) * (1.0 + 0.5j)
    values = np.array([complex(system(each)) for each in s])
    with np.errstate(all="ignore"):
        apart = np.abs(function(s) - values) / np.abs(values)
    return float(apart[values != 0].max(initial=0.0))


def _scaled_roots(system: StateSpace) -> tuple[ComplexArray, ComplexArray]:
    """Zeros and poles [rad/s] of a system, computed in another unit of time, signals of unit size.

    SLICOT computes zeros with an absolute tolerance, so the matrices must have unit size.
    """
    import control

    if not isinstance(system, control.StateSpace) or not system.nstates:
        return system.zeros(), system.poles()
    poles = np.abs(system.poles())
    time = float(np.exp(np.mean(np.log(poles[poles > 0])))) if poles.any() else 1.0
    b, c = (float(np.abs(each).max()) or 1.0 for each in (system.B, system.C))
    scaled = control.ss(
        system.A / time,
        system.B / b,
        system.C / c,
        system.D / b / c * time,
        remove_useless_states=False,
    )
    return scaled.zeros() * time, scaled.poles() * time


def _ordered(roots: ComplexArray) -> ComplexArray:
    """Roots sorted by size, then real part, then imaginary part."""
    return roots[np.lexsort((roots.imag, roots.real, np.abs(roots)))]


def _grouped(roots: ComplexArray) -> list[ComplexArray]:
    """Groups of one or two roots: conjugate pairs, and real roots two by two from the lowest."""
    real = roots[roots.imag == 0]
    real = real[np.argsort(np.abs(real))]
    upper = roots[roots.imag > 0]
    groups = [np.array([root, root.conjugate()]) for root in upper]
    groups += [real[i : i + 2] for i in range(0, real.size, 2)]
    return sorted(groups, key=_level)


def _level(roots: ComplexArray) -> float:
    """Mean logarithm of the sizes of the roots."""
    return float(np.mean(np.log(np.maximum(np.abs(roots), np.finfo(float).tiny))))


def _coefficients(roots: ComplexArray) -> RealArray:
    """Real coefficients of prod(s - roots), highest power first."""
    return np.atleast_1d(np.poly(roots)).real.astype(float)


def _section(
    numerator: RealArray, denominator: RealArray
) -> tuple[RealArray, RealArray, RealArray, RealArray]:
    """Realisation A, B, C, D of a section, with time scaled by the section's own frequency."""
    n = denominator.size - 1
    scale = max(abs(denominator[-1]) ** (1 / n), np.finfo(float).tiny ** 0.25)
    powers = scale ** np.arange(n + 1)
    den = denominator / powers  # in s / scale
    num = np.concatenate([np.zeros(n + 1 - numerator.size), numerator]) / powers
    d = num[0]
    c = (num[1:] - d * den[1:])[None, :]
    a = np.vstack([-den[None, 1:], np.eye(n)[:-1]]) * scale
    b = np.eye(n)[:, :1] * scale
    return a, b, c, np.array([[d]])
