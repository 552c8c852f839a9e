"""Second opinions on sampled loops: plants drawn from the set, and signals of the loop in time."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench.certificate import Check, relative_excess
from workbench.executor.effort import tries
from workbench.second_opinion.responses import plain_response

TRIED_FREQUENCIES = 4000
"""Number of frequencies, in equal steps of log frequency up to half the sampling rate."""
TRIED_REALS = np.linspace(-1.0, 1.0, 81)
"""Real deltas that are tried, relative to their bound."""
SAMPLES, SEED = 400, 5
"""Number of samples of the simulation, and the seed of its disturbance."""
RESPONSE_ROUNDING = 1e-6
"""Largest relative effect of rounding in the responses."""

Weight = Callable[[RealArray], ComplexArray]
"""Response of a weight at angular frequencies."""


def sampled_plants(
    G: Any,
    K: Any,
    sign: int,
    weights: tuple[Weight, Weight | None],
    form: str,
    claimed: float,
) -> Check:
    """Check that no perturbation smaller than 1 / claimed makes the sampled loop critical.

    At every frequency and real delta the least complex delta with 1 - sign K P = 0 is computed from
    the responses of K and of the sampled nominal G, each by itself.
    """
    nyquist = np.pi / float(K.dt)
    omega = np.geomspace(1e-5 * nyquist, nyquist, tries(TRIED_FREQUENCIES))
    g, k = plain_response(G, omega)[:, 0, 0], plain_response(K, omega)[:, 0, 0]
    c = weights[0](omega)
    r = np.zeros_like(c) if weights[1] is None else weights[1](omega)
    factor = g if form == "multiplicative" else np.ones_like(g)
    # 1 - sign k (g + factor (c dc + r dr)) = 0 with dr = t d and |dc| = t:
    # |a + b d t| = e t, a = 1 - sign k g, b = -sign k factor r, e = |k factor c|.
    a, b = 1 - sign * k * g, -sign * k * factor * r
    e = np.abs(k * factor * c)
    d = TRIED_REALS[:, None]
    square = np.abs(b * d) ** 2 - e**2
    half = (a.conj() * b * d).real
    whole = np.abs(a) ** 2
    # square t^2 + 2 half t + whole = 0; the least positive t is 1 over the largest root of the
    # reversed equation whole m^2 + 2 half m + square = 0.
    root = half**2 - whole * square
    with np.errstate(invalid="ignore", divide="ignore"):
        m = np.where(root >= 0, (-half + np.sqrt(np.maximum(root, 0.0))) / whole, 0.0)
    worst = np.unravel_index(int(np.nanargmax(m)), m.shape)
    return Check(
        "plants of the set",
        "mu by deltas that are tried over the bound, less 1",
        relative_excess(float(m[worst]), claimed),
        RESPONSE_ROUNDING,
        where=f"at {omega[worst[1]] / (2 * np.pi):.6g} Hz",
        over=f"at {omega.size} frequencies, for {TRIED_REALS.size} real deltas",
    )


def sampled_sensitivity(G: Any, K: Any, sign: int, claimed: float) -> Check:
    """Check that the sensitivity stays below the claimed peak at the frequencies tried."""
    nyquist = np.pi / float(K.dt)
    omega = np.geomspace(1e-5 * nyquist, nyquist, tries(TRIED_FREQUENCIES))
    loop = sign * plain_response(G, omega) @ plain_response(K, omega)
    size = 1.0 / np.linalg.norm(np.eye(G.noutputs) - loop, -2, axis=(-2, -1))
    worst = int(np.argmax(size))
    return Check(
        "sampled sensitivity",
        "largest gain over the claimed peak, less 1",
        relative_excess(float(size[worst]), claimed),
        RESPONSE_ROUNDING,
        where=f"at {omega[worst]:.6g} rad/s",
        over=f"at {omega.size} frequencies",
    )


def rounded_signals(K: Any, G: Any, sign: int, kind: type, share: float) -> Check:
    """Check that the controller, computed in its number format, stays as close as claimed to exact
    arithmetic.

    Both loops are simulated with the same disturbance, one in the format and one in long double.
    """
    rng = np.random.default_rng(SEED)
    w = rng.choice([-1.0, 1.0], size=(tries(SAMPLES), G.noutputs))
    exact, own = (_controls(K, G, sign, each, w) for each in (np.longdouble, kind))
    off = np.abs(own - exact).max(axis=0)
    size = np.abs(exact).max(axis=0)
    value = float(np.max(off / np.maximum(size, np.finfo(float).tiny)))
    # The claim is relative to the largest control for all disturbances, which is larger than for
    # this one.
    return Check(
        "signals in the number format",
        "largest difference of the control from exact numbers, over the control",
        value,
        max(share, 0.0) * _most(K, G, sign, size) + RESPONSE_ROUNDING**2,
        over=f"for {tries(SAMPLES)} samples of one disturbance",
    )


def _most(K: Any, G: Any, sign: int, size: RealArray) -> float:
    """Largest control for a disturbance of 1 in the first samples, divided by the observed
    control.
    """
    impulses = np.zeros((tries(SAMPLES), G.noutputs))
    total = np.zeros(K.noutputs)
    for channel in range(G.noutputs):
        w = impulses.copy()
        w[0, channel] = 1.0
        total += np.abs(_controls(K, G, sign, np.float64, w)).sum(axis=0)
    # Later samples add to the claim, so this value is less than it; a factor accounts for the
    # samples left out.
    return float(np.max(2.0 * total / np.maximum(size, np.finfo(float).tiny)))


def _controls(K: Any, G: Any, sign: int, kind: type, w: RealArray) -> Any:
    """Controls (N, controls) in the loop; the controller computes in numbers of one format."""
    parts: list[Any] = [np.asarray(part).astype(kind) for part in (K.A, K.B, K.C, K.D)]
    A, B, C, D = parts
    a, b, c, d = (np.asarray(part, dtype=np.longdouble) for part in (G.A, G.B, G.C, G.D))
    x: Any = np.zeros(len(A), dtype=kind)
    s = np.zeros(len(a), dtype=np.longdouble)
    found = np.zeros((len(w), len(C)), dtype=np.longdouble)
    before = np.zeros(G.ninputs, dtype=np.longdouble)
    for n, error in enumerate(w):
        y = (c @ s + d @ before + error).astype(kind)
        u = C @ x + D @ y
        x = A @ x + B @ y
        found[n] = u
        before = sign * u.astype(np.longdouble)
        s = a @ s + b @ before
    return found
