"""Random loops as engineers write them, in every form, and their margins in 50 digits.

A loop is a plant and a controller, P to PID, lead, lag or notch times integrators, lags,
resonances, zeros on either side of the axis and dead time, in continuous or sampled time and in any
unit of time. What is true of it is computed from the coefficients as they are stored: polynomials
in s or in z by exact arithmetic, values by mpmath.
"""

from dataclasses import dataclass, replace

import control
import mpmath
import numpy as np
from flint import ctx, fmpq, fmpq_poly

FORMS = ("tf", "zpk", "ss", "product", "series", "feedback")
DIGITS = 50
ROUNDING = 2.0**-42
"""Values of a polynomial below this share of the sizes of its terms are made of rounding."""
ON_AXIS = 1e-25
"""Distance of a root from the axis or the circle, relative, at which it lies there."""


@dataclass(frozen=True)
class Loop:
    """P and C as transfer functions."""

    P: control.TransferFunction
    C: control.TransferFunction

    def form(self, name):
        """L = P C in one of the forms, or a loop made by an inner feedback."""
        P, C = self.P, self.C
        if name == "tf":
            return control.tf(
                np.polymul(P.num[0][0], C.num[0][0]), np.polymul(P.den[0][0], C.den[0][0]), P.dt
            )
        if name == "zpk":
            zeros, poles = (np.concatenate([f(P), f(C)]) for f in (control.zeros, control.poles))
            gain = P.num[0][0][0] / P.den[0][0][0] * C.num[0][0][0] / C.den[0][0][0]
            return control.zpk(zeros, poles, gain, dt=P.dt)
        if name == "ss":
            return control.ss(P) * control.ss(C)
        if name == "series":
            return control.series(C, P)
        if name == "feedback":
            return C * control.feedback(P, control.tf([0.1], [1.0], P.dt))
        return P * C


def loop_of(seed, unit=None):
    """A random loop; with a unit of time [s] of its own, or in the one given."""
    rng = np.random.default_rng(seed)
    drawn = 10 ** rng.uniform(-6, 6)
    time = drawn if unit is None else unit
    plant, controller = _plant(rng), _controller(rng)
    if rng.random() < 0.4:
        dt = 10 ** rng.uniform(-2, -0.3)
        P, C = (control.tf(*_in_unit(*part, time)) for part in (plant, controller))
        P = control.sample_system(P, dt * time, "zoh")
        C = control.sample_system(C, dt * time, "bilinear")
        late = int(rng.integers(0, 4))
        return Loop(P * control.tf([1.0], [1.0] + late * [0.0], dt * time), C)
    if rng.random() < 0.3:
        late = control.pade(10 ** rng.uniform(-2, 0), int(rng.integers(1, 4)))
        plant = tuple(np.polymul(a, b) for a, b in zip(plant, late, strict=True))
    return Loop(*(control.tf(*_in_unit(*part, time)) for part in (plant, controller)))


def _in_unit(num, den, time):
    """A transfer function of s in 1 / unit as one of s in 1 / s."""
    return tuple(np.asarray(p) * time ** np.arange(len(p))[::-1] for p in (num, den))


def _corner(rng, low=-1.0, high=1.0):
    return 10 ** rng.uniform(low, high)


def _plant(rng):
    num, den = [_corner(rng)], [1.0]
    for _ in range(rng.integers(0, 4)):
        den = np.polymul(den, [1.0, 0.0])
    for _ in range(rng.integers(0 if len(den) > 1 else 1, 4)):
        den = np.polymul(den, [1.0 / _corner(rng), 1.0])
    if rng.random() < 0.4:
        w, zeta = _corner(rng), _corner(rng, -3, 0)
        den = np.polymul(den, [w**-2, 2 * zeta / w, 1.0])
    if rng.random() < 0.3:
        num = np.polymul(num, [-1.0 / _corner(rng, 0.3, 1.5), 1.0])
    if rng.random() < 0.3 and len(den) > len(num):
        num = np.polymul(num, [1.0 / _corner(rng), 1.0])
    return num, den


def _controller(rng):
    gain, slow, fast = _corner(rng, -2), _corner(rng, -2, 0), _corner(rng, 0, 2)
    kind = rng.choice(["P", "PI", "PD", "PID", "lead", "lag", "notch"])
    filtered = [1.0 / (10 * fast), 1.0]
    if kind == "P":
        return [gain], [1.0]
    if kind == "PI":
        return [gain, gain * slow], [1.0, 0.0]
    if kind == "PD":
        return [gain / slow, gain], filtered
    if kind == "PID":
        return gain * np.polymul([1.0, slow], [1.0 / fast, 1.0]), np.polymul([1.0, 0.0], filtered)
    if kind == "lead":
        return [gain / slow, gain], [1.0 / fast, 1.0]
    if kind == "lag":
        return [gain / fast, gain], [1.0 / slow, 1.0]
    w, zeta = _corner(rng), _corner(rng, -2, 0)
    return (
        gain * np.array([w**-2, 0.1 * zeta / w, 1.0]),
        np.array([w**-2, 2 * zeta / w, 1.0]),
    )


# --- what is true of a loop ---------------------------------------------------------------------


def polynomials(system):
    """Numerator and denominator with the coefficients as stored, exactly."""
    if isinstance(system, control.TransferFunction):
        return tuple(_exact(part[0][0][::-1]) for part in (system.num, system.den))
    A, B, C = (_matrix(part) for part in (system.A, system.B, system.C))
    poles, adjugate = _leverrier(A)
    n = len(A)
    moments = [
        sum(C[0][i] * M[i][j] * B[j][0] for i in range(n) for j in range(n)) for M in adjugate
    ]
    return _exact([system.D[0, 0]]) * poles + fmpq_poly(moments[::-1]), poles


def _matrix(M):
    return [[fmpq(*float(x).as_integer_ratio()) for x in row] for row in np.atleast_2d(M)]


def _leverrier(A):
    """det(s I - A), and the coefficients of the adjugate, highest first (Faddeev, Leverrier)."""
    n = len(A)
    M = [[fmpq(i == j) for j in range(n)] for i in range(n)]
    coefficients, adjugate = [fmpq(1)], []
    for k in range(1, n + 1):
        adjugate.append(M)
        AM = [[sum(A[i][h] * M[h][j] for h in range(n)) for j in range(n)] for i in range(n)]
        c = -sum(AM[i][i] for i in range(n)) / k
        coefficients.append(c)
        M = [[AM[i][j] + (c if i == j else 0) for j in range(n)] for i in range(n)]
    return fmpq_poly(coefficients[::-1]), adjugate


def _exact(coefficients):
    return fmpq_poly([fmpq(*float(c).as_integer_ratio()) for c in coefficients])


@dataclass(frozen=True)
class Truth:
    """Crossings (K, 2) with omega [rad/s], stability, and the distance of L from -1."""

    gains: np.ndarray
    phases_deg: np.ndarray
    delays: np.ndarray
    modulus: float
    stable: bool
    clear: np.ndarray

    def told(self, omega):
        """Without crossovers that are not clear, except at these frequencies."""
        near = abs(self.phases_deg[:, 1:] - omega) <= 1e-6 * omega
        kept = self.clear | near.any(axis=1)
        return replace(self, phases_deg=self.phases_deg[kept], delays=self.delays[kept])

    @property
    def gain(self):
        factors = self.gains[:, 0]
        return factors[factors < 1].max(initial=0.0), factors[factors > 1].min(initial=np.inf)

    @property
    def phase_deg(self):
        return min(self.phases_deg[:, 0], key=abs, default=np.inf)

    @property
    def delay(self):
        return self.delays[:, 0].min(initial=np.inf)


def truth(N, D, dt):
    """Margins of N / D; crossings at which both are made of rounding are not ``clear``."""
    with mpmath.workdps(DIGITS), ctx.workprec(400):
        return _truth(N, D, float(dt or 0.0))


def _truth(N, D, dt):
    degree = max(N.degree(), D.degree())

    def mirrored(p):
        """p(-s), or z^degree p(1 / z)."""
        if dt:
            return fmpq_poly([p[degree - k] for k in range(degree + 1)])
        return fmpq_poly([p[k] * (-1) ** k for k in range(degree + 1)])

    def at(p, z):
        return mpmath.polyval([_mp(c) for c in reversed(p.coeffs())] or [0], z)

    def L(omega):
        s = mpmath.expj(omega * dt) if dt else 1j * omega
        return at(N, s) / at(D, s)

    one, other = N * mirrored(D), D * mirrored(N)
    unit = _on_boundary(N * mirrored(N) - D * mirrored(D), dt)
    sizes = fmpq_poly([abs(c) for c in N.coeffs()])
    clear = [abs(at(N, _point(w, dt))) > ROUNDING * at(sizes, 1 if dt else w) for w in unit]
    real = [w for w in _on_boundary(one - other, dt) if abs(at(D, _point(w, dt))) > 0]
    # |1 + L|^2 is stationary where the derivative of (N + D)(N + D)* / (D D*) is zero.
    S, size = (N + D) * mirrored(N + D), D * mirrored(D)
    flat = _on_boundary(S.derivative() * size - S * size.derivative(), dt)
    flat = [w for w in flat if at(D, _point(w, dt)) != 0]
    modulus = min((abs(1 + L(w)) for w in flat), default=mpmath.inf)
    ends = []
    end = (fmpq(-1), mpmath.pi / dt) if dt else (None, mpmath.inf)
    for s, omega in ((fmpq(1) if dt else fmpq(0), mpmath.mpf(0)), end):
        below = D(s) if s is not None else D[degree]
        if below != 0:
            above = N(s) if s is not None else N[degree]
            modulus = min(modulus, abs(1 + _mp(above / below)))
            ends.append((_mp(above / below), omega))
    ends += [(mpmath.re(L(w)), w) for w in real]
    gains = [(-1 / value, w) for value, w in ends if value < 0]
    phases = [(mpmath.degrees(mpmath.arg(-L(w))), w) for w in unit]
    delays = [(mpmath.radians(p % 360) / w, w) for p, w in phases]
    roots = [root for root, _ in (N + D).complex_roots()]
    well_posed = (N + D).degree() == degree
    inside = [abs(r) < 1 if dt else r.real < 0 for r in roots]
    table = [np.array([(float(a), float(b)) for a, b in rows]).reshape(-1, 2)
             for rows in (gains, phases, delays)]  # fmt: skip
    return Truth(*table, float(modulus), well_posed and all(inside), np.array(clear, dtype=bool))


def _point(omega, dt):
    return mpmath.expj(omega * dt) if dt else mpmath.mpc(0, omega)


def _on_boundary(p, dt):
    """Frequencies above 0 of roots on the imaginary axis, or on the circle."""
    if p.degree() < 1:
        return []
    found = []
    for root, _ in p.complex_roots():
        x, y = (mpmath.mpf(part.mid().str(60, radius=False)) for part in (root.real, root.imag))
        size = mpmath.hypot(x, y)
        off = abs(size - 1) if dt else abs(x)
        if y > 0 and off <= ON_AXIS * size:
            found.append(mpmath.atan2(y, x) / dt if dt else y)
    return sorted(found)


def _mp(q):
    q = fmpq(q)
    return mpmath.mpf(int(q.p)) / mpmath.mpf(int(q.q))


def disagreements(found, N, D, dt):
    """What the classical margins of a loop N / D are not, as they are found.

    A number may differ by what changes of the coefficients by half a last place make of it. Where
    changes by some last places decide on the stability, the verdict may be "unstable".
    """
    omega = found.phases_deg[:, 1]
    exact = truth(N, D, dt).told(omega)
    pairs = list(zip(_numbers(found), _numbers(exact), strict=True))
    close = [x == y or abs(x - y) <= 1e-12 + 1e-9 * abs(y) for x, y in pairs]
    told = []
    if len(found.phases_deg) != len(exact.phases_deg):
        told.append(f"{len(found.phases_deg)} crossovers, not {len(exact.phases_deg)}")
    if all(close) and found.stable == exact.stable and not told:
        return []
    rng = np.random.default_rng(0)
    near = [truth(_rounded(N, rng), _rounded(D, rng), dt).told(omega) for _ in range(8)]
    if any(len(one.phases_deg) != len(exact.phases_deg) for one in near):
        told = []
    if found.stable != exact.stable and (found.stable or not _doubtful(N, D, dt, rng)):
        told.append(f"stable {found.stable}, not {exact.stable}")
    for k, (x, y) in enumerate(pairs):
        spread = max(abs(_numbers(one)[k] - y) for one in near)
        modulus = k == len(NUMBERS) - 1
        if modulus and found.stable != exact.stable:
            continue
        if not (close[k] or abs(x - y) <= 4 * spread):
            told.append(f"{NUMBERS[k]} {x}, not {y} within {spread:.1e}")
    return told


NUMBERS = ("gain down", "1 / gain up", "1 / phase", "1 / delay", "modulus")


def _numbers(margins):
    low, high = margins.gain
    inverse = [1.0 / max(x, 1e-300) for x in (abs(margins.phase_deg), margins.delay)]
    return [low, 1.0 / high, *inverse, margins.modulus if margins.stable else 0.0]


def _doubtful(N, D, dt, rng):
    """Whether one of some random changes, which are not the worst ones, makes a loop unstable."""
    every = (truth(_rounded(N, rng, 2**48), _rounded(D, rng, 2**48), dt) for _ in range(16))
    return not all(one.stable for one in every)


def _rounded(polynomial, rng, precision=2**55):
    """Coefficients changed by relative errors of up to 4 over a precision: half a last place."""
    steps = [fmpq(int(rng.integers(-4, 5)), precision) for _ in polynomial.coeffs()]
    return fmpq_poly([c * (1 + step) for c, step in zip(polynomial.coeffs(), steps, strict=True)])
