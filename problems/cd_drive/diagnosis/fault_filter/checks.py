"""Checks of the fault filter: certificates made again, members of the set, drives one by one."""

from __future__ import annotations

import numpy as np

from workbench import Check
from workbench.certify.stability import stability_of
from workbench.heavy_types import Dataset, StateSpace
from workbench.systems.generalised_plant import response
from workbench.systems.storage import restored

from ...drive.plants import ANTIALIASING
from ...drive.red_book import envelope
from ...laboratory.bench_setup import PERIOD
from .defect_estimates import LONGEST, SHAPES
from .design import estimation
from .front import BAND
from .loop import FAST, MOST, SLOW, FaultLoop, unsampled

AGAIN = 1e-3
"""By which a certified peak may differ when it is made again, relative."""
MEMBERS = 40
"""Plants of the set drawn at random."""
BOUNDED = 1e-6


def filter_checks(
    loops: dict[str, FaultLoop], error: float, leakage: float, order: int, answer: Dataset
) -> list[Check]:
    found = []
    for name, loop in loops.items():
        K = restored(answer, name)
        F = unsampled(K) if K.dt else K
        stability = stability_of(K)
        found.append(
            Check(f"{name}: stable filter", stability.statement, stability.value, stability.limit)
        )
        program = estimation(loop, error, leakage)
        for channel in program.channels:
            upper = program.certified(F, channel).upper
            statement = "certified supremum of mixed mu, of the whole set of plants"
            found.append(Check(f"{name}: {channel.name}", statement, upper, 1.0))
            claimed = float(
                answer["peak"].sel(design=name, requirement=channel.name, bound="upper")
            )
            statement = "certified supremum over the claimed one, less 1"
            found.append(
                Check(f"{name}: {channel.name} again", statement, upper / claimed - 1, AGAIN)
            )
        allowed = {"error": error, "leakage": leakage, "gain": MOST}
        for quantity, value in _members(loop, F).items():
            statement = "largest of plants drawn from the set, by formula, over what is allowed"
            ratio = value / allowed[quantity]
            found.append(Check(f"{name}: {quantity} of members", statement, ratio, 1.0))
    statement = "states of the sampled filter"
    found.append(Check("order", statement, float(restored(answer, "discrete").nstates), order))
    statement = "difference of its period from the loop's [s]"
    period = abs(float(restored(answer, "discrete").dt) - PERIOD)
    found.append(Check("period", statement, period, 1e-12))
    statement = "length of the longest defect shown [m]"
    found.append(Check("defects", statement, max(SHAPES.values()), LONGEST))
    front = answer["front"].sel(kind="nominal plant")
    total = front.sel(quantity="leakage") + 3 * front.sel(quantity="noise")
    beaten = float((answer["least_total"] / total).max())
    statement = "lower bound over the total of the front's filters, at most"
    found.append(Check("bound", statement, beaten, 1 + BOUNDED))
    return found


def _members(loop: FaultLoop, F: StateSpace) -> dict[str, float]:
    """Largest error, leakage of the envelope [m] and gain of F on members of the set."""
    rng = np.random.default_rng(0)
    frequency = np.unique(np.concatenate([np.geomspace(0.1, 15e3, 1500), [SLOW, FAST, BAND]]))
    omega = loop.warped(frequency)
    model = loop.model
    real = 0 * omega if model.W_r is None else model.W_r.response(omega)
    circular = model.W_c.response(omega)
    K, G = (response(part, omega)[:, 0, 0] for part in (loop.K, loop.G))
    filter_ = response(F, omega)[:, 0, 0]
    worst = {"error": 0.0, "leakage": 0.0, "gain": 0.0}
    for _ in range(MEMBERS):
        x, phase = rng.uniform(-1.0, 1.0), rng.uniform(0.0, 2 * np.pi)
        delay = rng.uniform(0.0, 1.0) / ANTIALIASING  # of a complex scalar that varies
        delta = np.exp(1j * (phase - omega * delay))
        T = filter_ / (1 + K * G * (1 + x * real + delta * circular))
        slow = frequency <= SLOW
        leaks = np.abs(T)[slow] * envelope(loop.axis, frequency[slow])
        curves = {"error": np.abs(1 - T)[frequency >= FAST], "leakage": leaks, "gain": np.abs(T)}
        worst = {name: max(worst[name], float(curve.max())) for name, curve in curves.items()}
    return worst
