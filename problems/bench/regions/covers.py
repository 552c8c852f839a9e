"""Whether covers of the regions of six heaters contain all true plants, at all
frequencies at once.
"""

from __future__ import annotations

import numpy as np
from scipy import stats

from workbench import solve
from workbench._core.arrays import BoolArray
from workbench.identification import local_polynomial
from workbench.identification.responses.of_records import record_responses
from workbench.types import ComplexArray, RealArray
from workbench.uncertainty import Responses, StadiumCover, contains
from workbench.uncertainty.responses.regions import region_radius

from .plants import Channel, heaters
from .records import record

SECONDS = 5.0
"""Sampling time of the heaters [s]."""
DECIBELS = 40.0
MOST = 40
"""Number of frequencies of a cover."""
ORDER = 2
"""Order of a cover's nominal model and weights."""
BANDS = 4
"""Number of bands for which the share of points outside is shown."""
FORMER_DEGREE, FORMER_WIDTH = 2, 14
"""Degree and width of the local polynomials that every record was fitted by in an older version."""
LENGTHS = ("30 time constants", "18 time constants")


def heater_draw(length: str, draw: int, seed: int) -> tuple[bool, RealArray, RealArray]:
    """For one draw of six records: whether the cover contains all plants, and shares of points
    outside.

    The shares (BANDS,) are those of today's regions and of the older local polynomials.
    """
    plants = heaters()
    pairs = []
    for k, plant in enumerate(plants):
        samples = plant.long if length == LENGTHS[0] else plant.short
        rng = np.random.default_rng([seed, draw, k])
        u, y, _ = record(plant, "prbs", samples, DECIBELS, [rng])
        pairs.append((u[0, 0], y[0]))
    estimates, _ = record_responses(pairs, 1.0 / SECONDS, MOST)
    found = Responses.from_estimates(estimates)
    exact = _truth(found.frequency_hz)
    outside = np.abs(found.values - exact) > region_radius(found, 0.95)
    former = _shares_of_older_regions(
        pairs, plants[0].long if length == LENGTHS[0] else plants[0].short
    )
    inside = region_radius(found, 0.95) < np.abs(found.values)
    last = found.frequency_hz[np.argmin(inside.all(axis=1)) - 1] if not inside.all() else np.inf
    clear = found.within(0.0, last)
    cover = solve(StadiumCover(clear, ORDER, confidence=0.95)).answer.model
    between = np.sqrt(clear.frequency_hz[1:] * clear.frequency_hz[:-1])
    fine = np.union1d(clear.frequency_hz, between)
    held = contains(cover, Responses(frequency_hz=fine, values=_truth(fine))).holds
    return held, _shares(outside), former


def _shares_of_older_regions(pairs: list[tuple[RealArray, RealArray]], shortest: int) -> RealArray:
    """Shares (BANDS,) of points outside the regions of the older local polynomials."""
    at = np.unique(np.geomspace(1, (shortest - 1) // 2, MOST).astype(int))
    outside = []
    for k, (u, y) in enumerate(pairs):
        cut = u[-shortest:, None], y[-shortest:, None]
        local = local_polynomial(*cut, degree=FORMER_DEGREE, lines=FORMER_WIDTH, at=at)
        channel = heaters()[k].channels[0]
        assert isinstance(channel, Channel)
        away = np.abs(local.response[:, 0, 0] - channel.response(at / shortest))
        free = 2 * (FORMER_WIDTH - 2 * (FORMER_DEGREE + 1))
        radius = np.sqrt(stats.f.ppf(0.95, 2, free) * local.variance[:, 0, 0])
        outside.append(away > radius)
    return _shares(np.array(outside).T)


def _shares(outside: BoolArray) -> RealArray:
    """Share (BANDS,) of points (F, N) that are outside, in each band."""
    return np.array([part.mean() for part in np.array_split(outside, BANDS)])


def _truth(frequency_hz: RealArray) -> ComplexArray:
    """True responses (F, N) of the heaters."""
    channels = [plant.channels[0] for plant in heaters()]
    parts = [c.response(frequency_hz * SECONDS) for c in channels if isinstance(c, Channel)]
    return np.stack(parts, axis=1)
