"""Records of open and closed loops whose truth is known: plants, excitations, noise, controllers.

Everything is linear and runs by difference equations, so that the part of u that comes from the
disturbance of y is known exactly and can be scaled.
"""

from dataclasses import dataclass

import numpy as np
from scipy import linalg, signal

from workbench.identification.record_tests.record import RecordData

PLANTS = ("lag", "dead time", "resonance", "integrator", "two inputs")
EXCITATIONS = (
    "white", "coloured", "prbs", "multisine, periods", "multisine, one period", "steps",
    "chirp", "sine", "staircase", "log",
)  # fmt: skip
NOISES = ("white", "slow", "loads", "coloured")
CONTROLLERS = ("P", "PI", "PID", "LQG")
DRIVEN = ("prbs", "steps", "dither", "nothing")


@dataclass(frozen=True)
class Log:
    """A record, what it is, and which share of u's variance comes from the disturbance of y."""

    record: RecordData
    what: str
    share: float = 0.0


def as_record(u, y, direct=True, starts=(0,), r=None):
    u, y = (np.asarray(x, float).reshape(len(x), -1) for x in (u, y))
    names = [tuple(f"{name}{i}" for i in range(x.shape[1])) for name, x in (("u", u), ("y", y))]
    return RecordData(u, y, r, starts, 1.0, *names, direct)


def plant(kind, rng):
    """Numerator and denominator in 1/z; at least one sample of delay."""
    fast, gain = np.exp(-1 / np.exp(rng.uniform(np.log(3), np.log(100)))), rng.uniform(0.5, 5.0)
    lag = np.array([0.0, gain * (1 - fast)]), np.array([1.0, -fast])
    if kind == "dead time":
        return np.concatenate([np.zeros(rng.integers(2, 21)), lag[0]]), lag[1]
    if kind == "resonance":
        omega, damping = (
            np.exp(rng.uniform(np.log(0.05), np.log(0.6))),
            10 ** rng.uniform(-1.7, -0.5),
        )
        pole = np.exp(omega * (-damping + 1j * np.sqrt(1 - damping**2)))
        a = np.real(np.poly([pole, pole.conjugate()]))
        return np.array([0.0, gain * a.sum()]), a
    if kind == "integrator":
        return lag[0] / 20, np.convolve(lag[1], [1.0, -1.0])
    return lag


def held(levels, n, longest, rng):
    """Levels, each held for a random time of up to `longest` samples."""
    times = np.cumsum(rng.integers(longest // 3 + 1, longest + 1, n))
    return levels[np.searchsorted(times, np.arange(n), side="right")]


def prbs(n, hold, rng):
    """A maximum-length sequence from a random start, each bit held."""
    bits = int(np.ceil(np.log2(max(n / hold, 8) + 1)))
    state = rng.integers(0, 2, bits)
    state[0] = 1
    sequence = signal.max_len_seq(bits, state=state)[0]
    return np.resize(np.repeat(2.0 * sequence - 1, hold), n)


def multisine(n, period, rng):
    lines = np.arange(1, max(3, int(period * rng.uniform(0.05, 0.4))))
    time = np.arange(n)[:, None]
    phases = rng.uniform(0, 2 * np.pi, len(lines))
    if period * 2 <= n:
        one = np.cos(2 * np.pi * time[:period] * lines / period + phases).sum(1)
        return np.resize(one, n)
    return np.cos(2 * np.pi * time * lines / period + phases).sum(1)


def excitation(kind, n, periods, rng):
    if kind == "white":
        return rng.standard_normal(n)
    if kind == "coloured":
        pole = rng.uniform(0.5, 0.98)
        return signal.lfilter([1], [1, -pole], rng.standard_normal(n + 500))[500:]
    if kind == "prbs":
        return prbs(n, int(rng.integers(1, 20)), rng)
    if kind == "multisine, periods":
        return multisine(n, n // periods, rng)
    if kind == "multisine, one period":
        return multisine(n, n, rng)
    if kind == "steps":
        return held(rng.choice([-1.0, 1.0], n), n, max(n // int(rng.integers(3, 20)), 20), rng)
    if kind == "chirp":
        low, high = np.exp(rng.uniform(np.log(1e-3), np.log(1e-2))), rng.uniform(0.05, 0.4)
        return signal.chirp(np.arange(n), low, n, high, str(rng.choice(["linear", "logarithmic"])))
    if kind == "sine":
        return np.sin(2 * np.pi * rng.uniform(0.003, 0.2) * np.arange(n) + rng.uniform(0, 6))
    if kind == "staircase":
        count = int(rng.integers(4, 20))
        return np.minimum(np.arange(n) * count // n, count - 1) / count
    return held(np.round(rng.uniform(0, 10, n)) / 10, n, int(rng.integers(20, 200)), rng)


def noise(kind, n, rng):
    white = rng.standard_normal(n + 2000)
    if kind == "slow":
        pole = 1 - 10 ** rng.uniform(-3, -1.3)
        return signal.lfilter([1], [1, -pole], white)[2000:]
    if kind == "loads":
        times = rng.random(n + 2000) < 1 / rng.uniform(40, 150)
        return np.cumsum(times * white)[2000:] * 1.0
    if kind == "coloured":
        pole = rng.uniform(0.5, 0.95) * np.exp(1j * rng.uniform(0.1, 1.5))
        return signal.lfilter([1], np.real(np.poly([pole, pole.conjugate()])), white)[2000:]
    return white[2000:]


def quantised(x, rng, bits=12):
    step = np.ptp(x, axis=0) * rng.uniform(1.2, 4.0) / 2**bits
    step = np.where(step > 0, step, 1.0)
    return np.round(x / step) * step


def open_log(seed, kind=None, spoiled=True, **fixed):
    """A record of an open loop."""
    rng = np.random.default_rng(seed)
    which = str(rng.choice(PLANTS)) if "plant" not in fixed else fixed["plant"]
    kind = kind or str(rng.choice(EXCITATIONS))
    n = fixed.get("n") or int(np.exp(rng.uniform(np.log(250), np.log(10000))))
    inputs = 2 if which == "two inputs" else 1
    periods = int(rng.integers(3, 12))
    u = np.stack([excitation(kind, n, periods, rng) for _ in range(inputs)], 1)
    v_kind, level = str(rng.choice(NOISES)), 10 ** (-rng.uniform(20, 60) / 20)
    y = np.zeros(n)
    for channel in u.T:
        before = np.concatenate([np.full(2000, channel[0] * (which != "integrator")), channel])
        y = y + signal.lfilter(*plant(which, rng), before)[2000:]
    v = noise(v_kind, n, rng)
    y = y + level * y.std() * v / (v.std() or 1.0)
    said = [which, kind, v_kind, f"{n} samples, {-20 * np.log10(level):.0f} dB"]
    spoil = rng.random(6) < 0.25 if spoiled else np.zeros(6, bool)
    if spoil[0]:
        y = y + 0.05 * y.std() * ((y - y.mean()) / y.std()) ** 2
        said.append("bent sensor")
    if spoil[1]:
        b, a = signal.butter(2, rng.uniform(0.2, 0.7))
        y = signal.lfilter(b, a, y - y[0]) + y[0]
        if rng.random() < 0.5:
            u = signal.lfilter(b, a, u - u[0], axis=0) + u[0]
        said.append("filters")
    if spoil[2]:
        y = y + y.std() * rng.uniform(0.05, 0.5) * np.arange(n) / n
        said.append("drift")
    if spoil[3]:
        u, y = u + 10 * u.std() * rng.standard_normal(), y + 10 * y.std() * rng.standard_normal()
        said.append("offset")
    if spoil[4]:
        quiet = 10 ** (-rng.uniform(20, 50) / 20)
        u = u + quiet * u.std(0) * rng.standard_normal(u.shape)
        said.append(f"u measured at {-20 * np.log10(quiet):.0f} dB")
    if spoil[5]:
        y = np.where(rng.random(n) < rng.uniform(0.005, 0.1), np.nan, y)
        said.append("missing")
    if rng.random() < 0.5:
        u, missing = quantised(u, rng), np.isnan(y)
        y = np.where(missing, np.nan, quantised(np.where(missing, 0, y), rng))
        said.append("12 bits")
    starts = (0,) if rng.random() < 0.8 else (0, int(n * rng.uniform(0.3, 0.7)))
    direct = bool(rng.random() < 0.7)
    said.append("direct" if direct else "delayed")
    return Log(as_record(u, y, direct, starts), ", ".join(said))


GRID = np.exp(1j * np.geomspace(1e-3, np.pi, 1000))
MOST_SENSITIVE = 2.0


def _response(b, a):
    return np.polyval(b[::-1], 1 / GRID) / np.polyval(a[::-1], 1 / GRID)


def damped(b, a, num, den):
    """Whether the loop is stable and its sensitivity has no high peak."""
    loop = _add(np.convolve(a, den), np.convolve(b, num))
    peak = abs(1 / (1 + _response(b, a) * _response(num, den))).max()
    return abs(np.roots(loop)).max() < 0.9995 and peak < MOST_SENSITIVE


def controller(kind, b, a, rng):
    """Numerator and denominator in 1/z of u = C (r - y), which keeps the loop stable."""
    if kind == "LQG":
        weights = 10 ** rng.uniform(-1, 1) * 4.0 ** np.arange(6) if len(b) < 8 else []
        for weight in weights:
            C = _lqg(b, a, weight, rng)
            if damped(b, a, *C):
                return C
        kind = "PI"
    gain = rng.uniform(0.5, 3.0) / np.abs(_response(b, a)).max()
    poles = abs(np.roots(a))
    slow = max(1 - poles[poles < 0.9999].max(), 0.005)
    for _ in range(20):
        smooth = np.array([1.0, -0.5])
        PI = gain * np.array([1.0, slow - 1.0]), np.array([1.0, -1.0])
        PID = _add(np.convolve(PI[0], smooth), 0.5 * gain * np.array([1.0, -2.0, 1.0]))
        C = {
            "P": (np.array([gain]), np.array([1.0])),
            "PI": PI,
            "PID": (PID, np.convolve(PI[1], smooth)),
        }[kind]
        if damped(b, a, *C):
            return C
        gain /= 1.5
    return controller("P", b, a, rng)


def _lqg(b, a, weight, rng):
    order = max(len(a), len(b)) - 1
    A = np.eye(order, k=-1)
    A[0] = -np.pad(a[1:], (0, order + 1 - len(a)))
    B, C = np.eye(order)[:, :1], np.pad(b[1:], (0, order + 1 - len(b)))[None]
    size = (C @ C.T).item()
    P = linalg.solve_discrete_are(A, B, C.T @ C / size, [[weight]])
    K = np.linalg.solve(weight + B.T @ P @ B, B.T @ P @ A)
    noise = [[10 ** rng.uniform(-2, 0) * size]]
    S = linalg.solve_discrete_are(A.T, C.T, B @ B.T, noise)
    L = A @ S @ C.T / (C @ S @ C.T + noise)
    num, den = signal.ss2tf(A - B @ K - L @ C, L, K, [[0.0]])
    return num[0], den


def _add(p, q):
    n = max(len(p), len(q))
    return np.pad(p, (0, n - len(p))) + np.pad(q, (0, n - len(q)))


def closed_log(seed, share=0.1, delayed=None, **fixed):
    """A record of u = C (r - y) + dither; `share` of u's variance comes from the disturbance."""
    rng = np.random.default_rng(seed)
    which = fixed.get("plant") or str(rng.choice(PLANTS))
    kind = fixed.get("controller") or str(rng.choice(CONTROLLERS))
    disturbed = fixed.get("noise") or str(rng.choice(NOISES))
    driven = fixed.get("driven") or str(rng.choice(DRIVEN))
    n = fixed.get("n") or int(np.exp(rng.uniform(np.log(1000), np.log(10000))))
    delayed = bool(rng.random() < 0.5) if delayed is None else delayed
    b, a = plant(which, rng)
    inside = np.concatenate([[0.0], b]) if delayed else b
    num, den = controller(kind, inside, a, rng)
    if delayed:
        num = np.concatenate([[0.0], num])
    loop = _add(np.convolve(a, den), np.convolve(b, num))
    total = n + 3000
    r, dither, v = np.zeros(total), np.zeros(total), np.zeros(total)
    if driven == "prbs":
        r = prbs(total, int(rng.integers(1, 20)), rng)
    if driven == "steps":
        r = held(rng.choice([-1.0, 1.0], total), total, n // int(rng.integers(3, 20)), rng)
    if driven == "dither":
        dither = rng.standard_normal(total)
    v = noise(disturbed, total, rng)
    if disturbed == "loads":
        v = v - v[:3000].mean()
    if rng.random() < 0.5 or disturbed == "loads":
        v = v + 10 ** -rng.uniform(1, 2.5) * v[3000:].std() * rng.standard_normal(total)
    second = np.zeros(total)
    if which == "two inputs":
        second = signal.lfilter([0.0, 0.3], [1, -0.7], rng.standard_normal(total))
        outside = signal.lfilter(*plant("lag", rng), second)
    else:
        outside = np.zeros(total)
    forward, sensitive = np.convolve(b, num), np.convolve(a, den)

    def answers(v, r, dither):
        """u and y of the loop."""
        u = signal.lfilter(np.convolve(a, num), loop, r - v)
        y = signal.lfilter(sensitive, loop, v) + signal.lfilter(forward, loop, r)
        u = u + signal.lfilter(sensitive, loop, dither)
        y = y + signal.lfilter(np.convolve(b, den), loop, dither)
        return u[3000:], y[3000:]

    u_r, y_r = answers(outside, r, dither)
    u_v, y_v = answers(v, 0 * r, 0 * dither)
    if u_r.std() > 0:
        scale = np.sqrt(share / (1 - share)) * u_r.std() / u_v.std()
    else:
        scale, share = 1.0, 1.0
    u, y = u_r + scale * u_v, y_r + scale * y_v
    u = np.stack([u, second[3000:]], 1) if which == "two inputs" else u[:, None]
    said = [which, kind, disturbed, driven, f"{n} samples", "delayed" if delayed else "at once"]
    if rng.random() < 0.5:
        u, y = quantised(u, rng), quantised(y, rng)
        said.append("12 bits")
    return Log(as_record(u, y, delayed and bool(rng.random() < 0.5)), ", ".join(said), share)
