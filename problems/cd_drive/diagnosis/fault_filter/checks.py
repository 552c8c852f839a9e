"""Checks of the fault filter: certificates computed again, members of the set, single drives."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from workbench import Check
from workbench.certify import stability_check
from workbench.diagnosis import FaultEstimation, FaultLoop
from workbench.systems import bilinear_continuous, response
from workbench.types import Dataset, StateSpace

from ...drive.plants import ANTIALIASING
from ...drive.red_book import envelope
from ...drive.tables import Axis
from ...laboratory.bench_setup import PERIOD
from .defect_estimates import LONGEST, SHAPES
from .demand import limits_of, plants_of, reached_of
from .figures import total
from .loop import FAST, GAIN, NOISE_BAND, SLOW

PEAK_AGREES = 1e-3
"""Relative amount by which a peak certified again may exceed the stored one."""
MEMBERS = 40
"""Number of random plants of the set."""
LOWER_BOUND_EXCESS = 1e-6
"""Relative amount by which the lower bound may exceed a filter's total, by rounding."""


def filter_checks(
    axis: Axis,
    loops: dict[str, FaultLoop],
    filters: Mapping[str, StateSpace],
    order: int,
    limits: tuple[float, float],
    answer: Dataset,
) -> list[Check]:
    """Checks of the continuous and the sampled filter, of the defects shown and of the front.

    loops: around the reached share of the set. limits: relative error and leakage [m] that are
    reached.
    """
    found = [
        one
        for name in loops
        for one in _of_filter(axis, name, loops[name], filters[name], limits, answer)
    ]
    few = filters["discrete"]
    front = answer["front"].sel(kind="nominal plant")
    beaten = float((answer["least_total"] / total(front)).max())
    period = "difference of its period from the loop's [s]"
    bound = "lower bound over the total of the front's filters, at most"
    return [
        *found,
        Check("order", "states of the sampled filter", float(few.nstates), order),
        Check("period", period, abs(float(few.dt) - PERIOD), 1e-12),
        Check("defects", "length of the longest defect shown [m]", max(SHAPES.values()), LONGEST),
        Check("bound", bound, beaten, 1 + LOWER_BOUND_EXCESS),
    ]


def _of_filter(
    axis: Axis,
    name: str,
    loop: FaultLoop,
    K: StateSpace,
    limits: tuple[float, float],
    answer: Dataset,
) -> Iterator[Check]:
    """Stability, certificates computed again, and members of the set, for one filter."""
    F = bilinear_continuous(K) if K.dt else K
    stability = stability_check(K)
    yield replace(stability, name=f"{name}: stable filter", where="")
    program, reached = (
        FaultEstimation(loop.plant, "f", requirements=loop.requirements(*limits)),
        reached_of(answer),
    )
    stored = answer["peak"].sel(design=name, bound="upper")
    supremum = f"certified supremum of mixed mu{limits_of(reached)}"
    again = "certified supremum over the claimed one, less 1"
    for channel in program.channels:
        upper = program.certified_peak(F, channel=channel).upper
        excess = upper / float(stored.sel(requirement=channel.name)) - 1
        over = f"{plants_of(reached)}, in the band of the requirement"
        yield Check(f"{name}: {channel.name}", supremum, upper, 1.0, over=over)
        yield Check(f"{name}: {channel.name} again", again, excess, PEAK_AGREES, over=over)
    drawn = "largest value of a plant, by formula, over what is allowed"
    over = f"for {MEMBERS} plants drawn from the set"
    for (quantity, value), allowed in zip(
        _members(axis, loop, F).items(), (*limits, GAIN), strict=True
    ):
        yield Check(f"{name}: {quantity} of members", drawn, value / allowed, 1.0, over=over)


def _members(axis: Axis, loop: FaultLoop, F: StateSpace) -> dict[str, float]:
    """Largest error, leakage of the envelope [m] and gain of F on members of the set."""
    rng = np.random.default_rng(0)
    frequency = np.unique(np.concatenate([np.geomspace(0.1, 15e3, 1500), [SLOW, FAST, NOISE_BAND]]))
    omega = loop.warped_omega(frequency)
    model = loop.model
    real = 0 * omega if model.W_r is None else model.W_r.response(omega)
    circular = model.W_c.response(omega)
    K, G = (response(part, omega)[:, 0, 0] for part in (loop.controller, loop.nominal))
    filter_ = response(F, omega)[:, 0, 0]
    worst = {"error": 0.0, "leakage": 0.0, "gain": 0.0}
    for _ in range(MEMBERS):
        x, phase = rng.uniform(-1.0, 1.0), rng.uniform(0.0, 2 * np.pi)
        delay = rng.uniform(0.0, 1.0) / ANTIALIASING  # constant, or a complex scalar that varies
        delta = np.exp(1j * (phase - omega * delay))
        T = filter_ / (1 + K * G * (1 + x * real + delta * circular))
        slow = frequency <= SLOW
        leaks = np.abs(T)[slow] * envelope(axis, frequency[slow])
        curves = {"error": np.abs(1 - T)[frequency >= FAST], "leakage": leaks, "gain": np.abs(T)}
        worst = {name: max(worst[name], float(curve.max())) for name, curve in curves.items()}
    return worst
