"""Judgement of one case's regions: do they hold the truth, and how wide are they?"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from workbench._core.arrays import BoolArray
from workbench.errors import InputError
from workbench.identification import IdentificationWarning, ResponseEstimate, local_response
from workbench.identification.responses.local_response import spaced_in_log
from workbench.identification.responses.of_records import informative, mean_of_periods
from workbench.types import ComplexArray, RealArray

from .design import Case
from .plants import Channel
from .records import BITS, EXCITATIONS, PERIODS, USED, quantised, record

THIRDS = 3
"""Number of parts of a case's band."""
REALISATIONS, RUN_OUT = 300, 400
"""Number of records, and of samples after each, from which a best linear approximation is computed.
"""
Estimator = Callable[[RealArray, RealArray, RealArray], ResponseEstimate]
"""Function of u (N, nu), y (N, 1) and frequencies (F,) [cycles/sample] that returns an estimate."""


@dataclass(frozen=True, eq=False)
class Judged:
    """Regions of R records at F frequencies [cycles/sample], for nu inputs.

    ``held`` (R, F, nu): the region holds the truth; ``radius`` (R, F, nu); ``told`` (R, F): the
    estimator gave a region; ``truth`` (F, nu); ``clear`` (F,): some input's part of the output
    exceeds the noise.
    """

    frequency: RealArray
    held: BoolArray
    radius: RealArray
    told: BoolArray
    truth: ComplexArray
    clear: BoolArray

    def thirds(self) -> list[tuple[float, float]]:
        """For each third of the band the coverage, and the upper end of its 99 % interval.

        A frequency without a region counts as a miss where the truth is clear, and is not counted
        elsewhere. Different records are independent, but the frequencies of one record are not.
        """
        found = []
        for part in np.array_split(np.flatnonzero(self.clear), THIRDS):
            shares = (self.held & self.told[..., None])[:, part].mean(axis=(1, 2))
            deviation = shares.std(ddof=1) / np.sqrt(len(shares)) if len(shares) > 1 else 0.0
            found.append((float(shares.mean()), float(shares.mean() + 2.576 * deviation)))
        return found

    @property
    def width(self) -> float:
        """Median of the radius divided by the size of the response."""
        relative = self.radius / np.abs(self.truth)
        return float(np.median(np.where(self.told[..., None], relative, np.inf)[:, self.clear]))


def places(case: Case, most: int) -> RealArray:
    """Frequencies [cycles/sample] at which regions are asked for; of a multisine the
    excited lines.
    """
    period = case.samples // PERIODS if case.excitation == "multisine" else case.samples
    highest = case.plant.band[1] if case.excitation == "multisine" else 0.5
    return spaced_in_log(np.arange(1.0, np.ceil(highest * period)), most) / period


def truth(case: Case, frequency: RealArray) -> ComplexArray:
    """True response (F, nu). For a nonlinear plant it is the best linear approximation for the
    input.
    """
    channels = case.plant.channels
    if all(isinstance(channel, Channel) for channel in channels):
        return np.stack([c.response(frequency) for c in channels if isinstance(c, Channel)], axis=1)
    rngs = [np.random.default_rng([0, k]) for k in range(REALISATIONS)]
    make = EXCITATIONS[case.excitation]
    u = quantised(np.array([make(rng, case.samples, case.plant.band) for rng in rngs]))
    u = np.concatenate([u, np.zeros((len(u), RUN_OUT))], axis=1)  # records start and end at rest
    turn = np.exp(-2j * np.pi * np.outer(np.arange(u.shape[1]), frequency))
    U, Y = u @ turn, channels[0].output(u) @ turn
    found: ComplexArray = (np.sum(Y * U.conj(), axis=0) / np.sum(np.abs(U) ** 2, axis=0))[:, None]
    return found


def records(case: Case, count: int, seed: int) -> tuple[RealArray, RealArray, RealArray]:
    """Records (count, ...) of a case, as `record` makes them."""
    rngs = [np.random.default_rng([seed, k]) for k in range(count)]
    return record(case.plant, case.excitation, case.samples, case.decibels, rngs, case.colour)


def judged(case: Case, made: tuple[RealArray, RealArray, RealArray], most: int) -> Judged:
    """Regions of `local_response` for records of a case; periodic records are averaged first.

    A record that `local_response` refuses has no region at any frequency.
    """

    def ours(u: RealArray, y: RealArray, frequency: RealArray) -> ResponseEstimate:
        if case.excitation == "multisine":
            samples = case.samples // PERIODS
            u, y = (np.stack([mean_of_periods(x, samples) for x in s.T], axis=1) for s in (u, y))
        try:
            return local_response(u, y, 1.0, frequency_hz=frequency)
        except InputError:
            none = np.zeros((frequency.size, 1, u.shape[1]))
            return ResponseEstimate(frequency, none.astype(complex), none + np.inf, 2.0)

    frequency = places(case, most)
    return judged_with(ours, case, made, frequency, truth(case, frequency))


def judged_with(
    estimator: Estimator,
    case: Case,
    made: tuple[RealArray, RealArray, RealArray],
    frequency: RealArray,
    exact: ComplexArray,
) -> Judged:
    """Regions of any estimator for the same records, against the truth (F, nu)."""
    held, radius, kept = [], [], []
    for u, y in zip(made[0], made[1], strict=True):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", IdentificationWarning)
            found = estimator(u.T, y[:, None], frequency)
        reach = np.where(np.isfinite(found.variance), found.radius(confidence=0.95), np.inf)[:, 0]
        away = np.abs(found.response[:, 0] - exact)
        held.append(away <= reach)
        radius.append(reach)
        kept.append(informative(found))
    parts = np.array(held), np.array(radius), np.array(kept)
    return Judged(frequency, *parts, exact, _clear(case, made, frequency, exact))


def _clear(
    case: Case,
    made: tuple[RealArray, RealArray, RealArray],
    frequency: RealArray,
    exact: ComplexArray,
) -> BoolArray:
    """Frequencies (F,) at which some input's part of the output exceeds the noise, on average."""
    u, y, size = made
    centred = u - u.mean(axis=-1, keepdims=True)
    turn = np.exp(-2j * np.pi * np.outer(np.arange(case.samples), frequency))
    U = centred[: 2 * THIRDS**2] @ turn / np.sqrt(case.samples)
    power = np.mean(np.abs(U.swapaxes(1, 2) * exact) ** 2, axis=0).max(axis=1)
    z = np.exp(2j * np.pi * frequency)
    shape = (1 - case.colour**2) / np.abs(1 - case.colour / z) ** 2
    step = np.mean(2 * np.abs(y).max(axis=-1) / (USED * 2**BITS))
    clear: BoolArray = power >= np.mean(size**2) * shape + step**2 / 12
    return clear
