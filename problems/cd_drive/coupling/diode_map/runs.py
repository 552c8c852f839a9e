"""Records with defects, and what a function of the diodes makes of the readings in them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from workbench.types import RealArray

from ...diagnosis.defect_kinds import KINDS, draw
from ...diagnosis.defect_runs import ROTATION, SETTLING, SPACING
from ...drive.disc import VELOCITY, Defect, Disc
from ...drive.photo_diodes import CAPTURE
from ...drive.red_book import ACCEPTABLE_ERROR
from ...drive.tables import AXES, red_book
from ...laboratory.bench_setup import PERIOD
from .bench import DefectBench, level_of

REFRACTIONS = ("independent", "alike")
"""How the false displacements of both axes belong together: drawn for themselves, or one drawn and
the other in proportion to the acceptable errors.
"""
EACH = 2
"""Number of defects of each kind in a record."""
NEIGHBOURS = 100
"""Number of nearest points of the training records whose mean true error the map returns."""
ESTIMATES = ("reading", "nothing", "map of two", "map of four")
"""What is compared: the normalised error, the guess 0, and maps of the own pair of diodes and of
both pairs.
"""


class Points(NamedTuple):
    """Samples inside defects: readings (N, 4), true errors (N, 2) [m] and kinds (N,).

    A reading holds both normalised errors [m], then both sums over those of the clean disc. clean
    (2,): rms error [m] of both readings outside the defects. largest (2,): largest true errors [m].
    A record whose focus or track is lost has no samples, and NaN for `clean`.
    """

    reading: RealArray
    error: RealArray
    kind: NDArray[np.int64]
    clean: RealArray
    largest: RealArray


@dataclass(frozen=True)
class Draw:
    """Defects of all kinds in random order, and the disc under them."""

    seed: int
    refraction: str

    def defects(self) -> tuple[list[str], list[tuple[Defect, Defect]]]:
        """Kinds, and each defect as the focus and as the radial loop sees it, in places."""
        rng, pairs = np.random.default_rng(self.seed), []
        kinds = [str(one) for one in rng.permutation(np.repeat(list(KINDS), EACH))]
        for n, kind in enumerate(kinds):
            focus, own = draw(kind, rng, "focus"), draw(kind, rng, "radial").displacement
            share = ACCEPTABLE_ERROR["radial"] / ACCEPTABLE_ERROR["focus"]
            moved = own if self.refraction == REFRACTIONS[0] else share * focus.displacement
            start = SETTLING + SPACING * (0.25 + n)
            present = start - 1e-9, start + 0.5 * SPACING
            focus = replace(focus, angle=(ROTATION * start) % 1.0, present=present)
            pairs.append((focus, replace(focus, displacement=moved)))
        return kinds, pairs

    @property
    def disc(self) -> Disc:
        """A disc with the Red Book's deviations in both axes."""
        focus, radial = (red_book(axis).deviation for axis in AXES)
        return Disc(warp=(focus,), eccentricity=(radial,), rotation=ROTATION)

    def points(self, bench: DefectBench) -> Points:
        """The samples inside the defects of this draw."""
        kinds, pairs = self.defects()
        duration = SETTLING + SPACING * len(pairs)
        found = bench.over(self.disc, pairs, duration, self.seed)
        number = np.full(len(found.read), -1)
        for n, (kind, (one, _)) in enumerate(zip(kinds, pairs, strict=True)):
            first = round((SETTLING + SPACING * (0.25 + n)) / PERIOD)
            last = first + round(one.length / VELOCITY / PERIOD)
            number[first : last + 1] = list(KINDS).index(kind)
        settled = np.arange(len(number)) >= round(SETTLING / PERIOD)
        inside, clean = settled & (number >= 0), settled & (number < 0)
        scale = np.array([one.K_optn for one in bench.axes])
        metres = found.read[:, :2] / scale
        light = found.read[:, 2:4] / level_of(found.read[settled], number[settled] >= 0)
        largest = abs(found.error[settled]).max(axis=0)
        lost = bool((largest > [CAPTURE[axis] for axis in AXES]).any())
        kept = inside & (not lost)
        rms = np.sqrt(((metres - found.error)[clean] ** 2).mean(axis=0))
        rms = np.full(2, np.nan) if lost else rms
        reading = np.hstack([metres, light])
        return Points(reading[kept], found.error[kept], number[kept], rms, largest)


@dataclass(frozen=True, eq=False)
class DiodeMap:
    """Mean true error of the nearest readings: the best static function, for many of them."""

    training: Points

    def estimates(self, points: Points) -> RealArray:
        """Estimates (4, N, 2) [m] of the true errors, by ESTIMATES."""
        reading = points.reading
        two = [self._nearest(reading, [n, n + 2])[:, n] for n in range(2)]
        four = self._nearest(reading, [0, 1, 2, 3])
        return np.array([reading[:, :2], np.zeros(four.shape), np.transpose(two), four])

    def _nearest(self, reading: RealArray, used: list[int]) -> RealArray:
        """Means (N, 2) of the true errors at the nearest training readings."""
        scale = self.training.reading[:, used].std(axis=0)
        tree = cKDTree(self.training.reading[:, used] / scale)
        near = tree.query(reading[:, used] / scale, k=NEIGHBOURS)[1]
        mean: RealArray = self.training.error[near].mean(axis=1)
        return mean


def together(every: list[Points]) -> Points:
    """All samples of several records as one."""
    return Points(
        np.concatenate([one.reading for one in every]),
        np.concatenate([one.error for one in every]),
        np.concatenate([one.kind for one in every]),
        np.nanmean([one.clean for one in every], axis=0),
        np.max([one.largest for one in every], axis=0),
    )
