"""Open records of plants whose truth is known, and whether that truth denies a finding."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.signal import chirp, lfilter

from workbench.identification.record_tests.finding import Finding
from workbench.identification.record_tests.record import RecordData

EXCITATIONS = (
    "white noise", "binary", "periodic multisine", "one multisine", "crested multisine", "steps",
    "one step", "sweep", "sine", "staircase", "set points", "coloured noise", "impulses",
    "uniform levels",
)  # fmt: skip
PLANTS = ("lag", "two lags", "dead time", "resonance", "integrator", "pair", "right zero", "fast")
CONVERTERS = ("none", "12 bits", "8 bits", "counts", "slow sensor")
NOISES = ("white", "coloured", "heavy tails", "none")
DRIFTS = ("none", "none", "none", "ramp", "warm-up", "walk")


@dataclass(frozen=True)
class Path:
    """A discrete-time path: numerator, denominator, dead time and time constants [samples]."""

    numerator: list[float]
    denominator: list[float]
    wait: int = 0
    constants: tuple[float, ...] = ()

    def answer(self, u):
        y = lfilter(self.numerator, self.denominator, u)
        return np.concatenate([np.zeros(self.wait), y[: len(y) - self.wait]])


@dataclass(frozen=True)
class Truth:
    """How a record was made."""

    paths: tuple[Path, ...]
    excitation: str
    converter: str
    noise: str
    step: float  # of the converter
    drift: float  # movement over the standard deviation of the output
    lines: int  # in the input, of sines and multisines
    clean: np.ndarray = field(repr=False)


def path(kind, rng, samples):
    """A plant of a kind, with time constants that a record of so many samples may show."""
    tau = float(np.exp(rng.uniform(np.log(2), np.log(samples / 8))))
    p = np.exp(-1 / tau)
    if kind == "lag":
        return Path([0, 1 - p], [1, -p], 0, (tau,))
    if kind == "two lags":
        q = np.exp(-3 / tau)
        return Path([0, 0, (1 - p) * (1 - q)], np.convolve([1, -p], [1, -q]), 0, (tau, tau / 3))
    if kind == "dead time":
        wait = int(rng.integers(1, max(2, samples // 20)))
        return Path([0, 1 - p], [1, -p], wait, (tau,))
    if kind == "integrator":
        return Path([0, 1 / tau], [1, -1], 0, (np.inf,))
    if kind == "right zero":
        q = np.exp(-2 / tau)
        lags = np.convolve([1, -p], [1, -q])
        return Path(
            list((1 - p) * (1 - q) * np.array([0, -1 / (1 - p), 1 / (1 - p) + 1])),
            lags,
            0,
            (tau, tau / 2),
        )
    if kind == "fast":
        return Path([0.3, 0.7], [1], 0, ())
    found = []
    for _ in range(2 if kind == "pair" else 1):
        omega, zeta = rng.uniform(0.05, 1.0), 10 ** rng.uniform(-3, -1)
        size = np.exp(-zeta * omega)
        a = [1, -2 * size * np.cos(omega * np.sqrt(1 - zeta**2)), size**2]
        found.append(([0, sum(a)], a, 1 / (zeta * omega)))
    if len(found) == 1:
        return Path(found[0][0], found[0][1], 0, (found[0][2],))
    (b1, a1, t1), (b2, a2, t2) = found
    return Path(list(np.convolve(b1, a2) + np.convolve(b2, a1)), np.convolve(a1, a2), 0, (t1, t2))


def signal(kind, rng, n):
    """An input of a kind."""
    if kind == "white noise":
        return rng.standard_normal(n)
    if kind == "binary":
        clock = int(rng.integers(1, max(2, min(60, n // 20))))
        return np.repeat(rng.choice([-1.0, 1.0], n // clock + 1), clock)[:n]
    if kind in ("periodic multisine", "one multisine", "crested multisine"):
        period = n if kind == "one multisine" else n // int(rng.integers(3, 9))
        lines = np.arange(1, max(2, int(period * rng.uniform(0.05, 0.4))), rng.choice([1, 2]))
        phases = rng.uniform(0, 2 * np.pi, len(lines)) * (kind != "crested multisine")
        spectrum = np.zeros(period // 2 + 1, complex)
        spectrum[lines] = np.exp(1j * phases)
        one = np.fft.irfft(spectrum, period)
        return np.resize(one / one.std(), n)
    if kind == "steps":
        at = np.sort(rng.choice(np.arange(1, n), 8, replace=False))
        return np.resize([0.0, 1.0], 9)[np.searchsorted(at, np.arange(n), side="right")]
    if kind == "one step":
        return (np.arange(n) >= n // rng.integers(2, 10)).astype(float)
    if kind == "sweep":
        return chirp(np.arange(n), rng.uniform(1e-4, 1e-2), n, rng.uniform(0.05, 0.4))
    if kind == "sine":
        return np.sin(2 * np.pi * rng.uniform(5 / n, 0.2) * np.arange(n) + rng.uniform(0, 6))
    if kind == "staircase":
        steps = int(rng.integers(5, 20))
        return np.floor(np.arange(n) * steps / n) / steps
    if kind == "set points":
        count = int(rng.integers(6, 30))
        at = np.sort(rng.choice(np.arange(1, n), count, replace=False))
        levels = np.round(rng.uniform(20, 80, count + 1))
        return levels[np.searchsorted(at, np.arange(n), side="right")]
    if kind == "coloured noise":
        p = np.exp(-1 / rng.uniform(2, n / 50))
        return lfilter([1 - p], [1, -p], rng.standard_normal(n))
    if kind == "impulses":
        u = np.zeros(n)
        u[rng.choice(np.arange(n), int(rng.integers(1, 8)), replace=False)] = 1.0
        return u
    clock = int(rng.integers(1, max(2, n // 50)))
    return np.repeat(rng.integers(0, 5, n // clock + 1) / 4, clock)[:n].astype(float)


def line_sizes(u):
    """Amplitudes of the lines of a period of an input, over the largest; of all of it if none."""
    repeats = [p for p in range(10, len(u) // 2) if np.array_equal(u[:p], u[p : 2 * p])]
    sizes = np.abs(np.fft.rfft(u[: repeats[0] if repeats else len(u)]))[1:]
    return sizes / max(sizes.max(), 1e-300)


def disturbance(kind, rng, n):
    """Noise of a kind, of standard deviation 1."""
    if kind == "none":
        return np.zeros(n)
    if kind == "heavy tails":
        return rng.standard_t(3, n) / np.sqrt(3)
    white = rng.standard_normal(n)
    if kind == "white":
        return white
    p = np.exp(-1 / rng.uniform(2, max(3, n / 100)))
    return lfilter([np.sqrt(1 - p**2)], [1, -p], white)


def drifting(kind, rng, n):
    """Drift of a kind that moves by 1, or more for a walk."""
    time = np.linspace(0, 1, n)
    if kind == "ramp":
        return rng.choice([-1, 1]) * time
    if kind == "warm-up":
        return 1 - np.exp(-time / rng.uniform(0.1, 0.5))
    walk = np.cumsum(rng.standard_normal(n)) / np.sqrt(n)
    return walk * (kind == "walk")


def converted(y, kind, rng):
    """What a converter makes of an output, and its step."""
    span = float(np.ptp(y)) or 1.0
    if kind in ("12 bits", "8 bits"):
        step = 1.3 * span / 2 ** int(kind.split()[0])
    elif kind == "counts":
        step = span / rng.integers(6, 60)
    else:
        step = 0.0
    if kind == "slow sensor":
        hold = int(rng.integers(2, 6))
        return y[np.arange(len(y)) // hold * hold], 0.0
    return (step * np.round(y / step) if step else y), step


def open_record(rng) -> tuple[RecordData, Truth]:
    """A record of an open loop, and how it was made; nothing is wrong with it but its drift."""
    n = int(np.exp(rng.uniform(np.log(200), np.log(20000))))
    kinds = rng.choice(PLANTS, size=2 if rng.random() < 0.2 else 1)
    excitation = str(rng.choice(EXCITATIONS))
    paths = tuple(path(str(kind), rng, n) for kind in kinds)
    u = np.column_stack([signal(excitation, rng, n) for _ in paths])
    lines = max(np.count_nonzero(line_sizes(column) > 1e-3) for column in u.T)
    clean = np.sum([one.answer(column) for one, column in zip(paths, u.T, strict=True)], axis=0)
    size = float(clean.std()) or 1.0
    noise = str(rng.choice(NOISES))
    y = clean + size * 10 ** (-rng.uniform(20, 60) / 20) * disturbance(noise, rng, n)
    kind = str(rng.choice(DRIFTS))
    drift = rng.uniform(0.3, 3.0) * size * drifting(kind, rng, n)
    y = y + drift + rng.choice([0.0, 0.0, 5.0, -300.0]) * size
    converter = str(rng.choice(CONVERTERS))
    y, step = converted(y, converter, rng)
    unit = 10.0 ** rng.integers(-12, 13)
    u = u * 10.0 ** rng.integers(-12, 13) + rng.choice([0.0, 3.0])
    names = tuple(f"u{j + 1}" for j in range(len(paths)))
    record = RecordData(
        u, unit * y[:, None], None, (0,), float(rng.choice([1.0, 1e-3])), names, ("y",)
    )
    return record, Truth(
        paths, excitation, converter, noise, step, float(np.ptp(drift)) / size, lines, clean
    )


def denied(finding: Finding, record: RecordData, truth: Truth) -> bool:
    """Whether the truth of an open record denies a finding."""
    n = len(record.u)
    name = finding.where.split("'")[1] if "'" in finding.where else ""
    if finding.kind == "excitation":
        u = record.u[:, record.inputs.index(name)]
        if "sine" in finding.message:
            many = truth.lines > 2 or "multisine" not in truth.excitation
            return truth.excitation != "sine" and many
        if "stands still" in finding.message:
            longest = np.diff(np.flatnonzero(np.r_[True, np.diff(u) != 0, True])).max()
            return longest < 0.89 * n
        return np.count_nonzero(np.diff(u)) >= 5
    if finding.kind == "collinear inputs":
        r = np.corrcoef(record.u.T)[0, 1]
        return 1 - r**2 > 0.02
    if finding.kind == "coarse steps":
        return truth.step / np.sqrt(12) < 0.08 * truth.clean.std()
    if finding.kind == "drift":
        return truth.drift < 0.1
    if finding.kind == "short record":
        return sum(sum(one.constants) for one in truth.paths) < n / 10
    if finding.kind == "delay":
        one = truth.paths[record.inputs.index(name)]
        waited = int(0.7 * finding.strength)
        step = np.abs(one.answer(np.ones(2 * int(finding.strength) + 1)))
        return step[:waited].max() > step[-1] / 8
    return True
