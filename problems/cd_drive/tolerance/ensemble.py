"""Discs and circumstances of a player, drawn at random from stated distributions.

Section and table numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players
(2003).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from workbench.errors import InputError
from workbench.study import array_cache
from workbench.types import RealArray

from ..diagnosis.defect_kinds import KINDS, SHOCK_PEAK, draw, shocks
from ..drive.disc import Defect, Disc
from ..drive.tables import Axis, red_book
from ..laboratory.bench_setup import RATE
from ..laboratory.experiment import Laboratory

GROUPS = ("disc deviation", "shocks", *KINDS, "everything")
"""Causes of errors: the disc's deviation alone, with one other cause, or with all of them (figure
2.15).
"""
BEGIN = 0.3
"""Time [s] from which shocks and defects occur; the disc has run up by then."""
GAIN_STEP = 0.5
"""Step [dB] to which loop gains are rounded."""

Range = tuple[float, float]


@dataclass(frozen=True)
class Spread:
    """Distributions of the circumstances; a range (from, to) is uniform.

    rotation      [Hz]: at constant linear velocity, from 9 inside to 3 outside (section 2.5.3);
    deviation     amplitude at the rotation frequency over the Red Book's 500 um or 70 um: not all
                  discs meet it (Tables 2.3, 2.4, section 2.6);
    harmonics     amplitudes of the second and third harmonic over that of the first: assumed, as
                  if a hundredth of a warp were bent;
    reflectivity  of the layer over that of the reference disc. The Red Book asks for at least 0.7
                  of the light, and most discs reflect 0.8; the player knows the clean level;
    gain_db       standard deviation of the loop gain [dB], in addition to the drives' own optical
                  gains: the error of the automatic gain control (section 4.4; assumed);
    rotation_error  relative standard deviation of the rotation frequency that strategies assume:
                  they get it from the disc servo (section 8.6 warns of it; the size is assumed);
    shocks        number of shocks of the chassis per second, Poisson distributed: a portable
                  player (section 2.5.1; assumed);
    shock         peak of a shock over the 10 or 1 m/s^2 that bring the error close to the
                  acceptable one;
    shock_time    duration of the half sine [s]: its spectrum reaches to 1.5 / duration (assumed);
    defects       number per revolution, Poisson distributed, at least one; see the kinds' ranges in
                  `defect_kinds` (sections 2.5, 7.1);
    size          factor on the length of a defect of its kind (assumed);
    refraction    factor on its false displacement. At 1 no defect shifts the error by more than is
                  acceptable, but real defects do move the focus point (section 2.5.1; assumed).

    Raises InputError for spreads that are negative, not finite, or out of order.
    """

    rotation: Range = (3.0, 9.0)
    deviation: Range = (0.3, 1.3)
    harmonics: Range = (0.0, 0.02)
    reflectivity: Range = (0.85, 1.0)
    gain_db: float = 1.0
    rotation_error: float = 0.01
    shocks: float = 8.0
    shock: Range = (0.2, 2.0)
    shock_time: Range = (5e-3, 20e-3)
    defects: float = 2.0
    size: Range = (0.7, 1.6)
    refraction: Range = (0.5, 5.0)

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            low, high = value if isinstance(value, tuple) else (0.0, value)
            if not 0.0 <= low <= high < np.inf:
                raise InputError(
                    f"{field.name} is {value}; a spread is not negative, finite, from low to high"
                )
        if self.rotation[0] <= 0.0 or self.shock_time[0] <= 0.0:
            raise InputError(f"{self}: rotation and shock_time must be positive")


@dataclass(frozen=True)
class Remembered(Disc):
    """A disc whose motion is computed once for all strategies.

    The returned arrays are read-only.
    """

    def deviation(self, axis: Axis, time: RealArray) -> RealArray:
        return _deviation(self, axis, len(time))

    def surface(self, defects: Sequence[Defect], time: RealArray) -> tuple[RealArray, RealArray]:
        return _surface(self, tuple(defects), len(time))


@array_cache(megabytes=50)
def _deviation(disc: Remembered, axis: Axis, samples: int) -> RealArray:
    found = Disc.deviation(disc, axis, np.arange(samples) / RATE)
    found.flags.writeable = False
    return found


@array_cache(megabytes=50)
def _excitation(
    bench: Laboratory, many: tuple[tuple[float, float, float], ...], samples: int
) -> RealArray:
    return shocks(bench, many, samples)


@array_cache(megabytes=50)
def _surface(
    disc: Remembered, defects: tuple[Defect, ...], samples: int
) -> tuple[RealArray, RealArray]:
    light, false = Disc.surface(disc, defects, np.arange(samples) / RATE)
    light.flags.writeable = false.flags.writeable = False
    return light, false


@dataclass(frozen=True)
class Circumstance:
    """A disc with its defects, shocks (time [s], peak [m/s^2], duration [s]), gain [dB], seed.

    believed: rotation frequency [Hz] that the strategies assume.
    """

    axis: Axis
    group: str
    disc: Remembered
    defects: tuple[Defect, ...]
    shocks: tuple[tuple[float, float, float], ...]
    gain_db: float
    believed: float
    seed: int

    def noise_seed(self, drive: str) -> int:
        """Seed of the noise on a drive, different from those on the others."""
        key = (self.seed, *drive.encode())
        return int(np.random.SeedSequence(key).generate_state(1)[0])

    def excitation(self, bench: Laboratory, duration: float) -> RealArray:
        """Voltage [V] (N,) that has the same effect on the lens as the shocks, see
        `defect_kinds.shocks`.
        """
        return _excitation(bench, self.shocks, round(duration * RATE)).copy()


def circumstances(
    axis: Axis, count: int, duration: float, rng: np.random.Generator, spread: Spread | None = None
) -> list[Circumstance]:
    """Draw circumstances; the sizes of the groups differ by one at most.

    Raises InputError for an ensemble of none, and for a duration that ends before BEGIN [s].
    """
    if count < 1:
        raise InputError(f"an ensemble of {count} circumstances; it must have 1 or more")
    if not BEGIN < duration < np.inf:
        raise InputError(f"duration is {duration} s; it must be finite and above {BEGIN} s")
    spread = Spread() if spread is None else spread
    return [
        _drawn(axis, GROUPS[k % len(GROUPS)], duration, np.random.default_rng(seed), spread)
        for k, seed in enumerate(rng.integers(2**63, size=count))
    ]


def _drawn(
    axis: Axis, group: str, duration: float, rng: np.random.Generator, spread: Spread
) -> Circumstance:
    rotation = rng.uniform(*spread.rotation)
    first = rng.uniform(*spread.deviation) * red_book(axis).deviation
    wobble = (first, *(first * rng.uniform(*spread.harmonics) for _ in range(2)))
    disc = Remembered.along(
        axis,
        *wobble,
        rotation=rotation,
        phase=rng.uniform(),
        reflectivity=rng.uniform(*spread.reflectivity),
    )
    gain_db = GAIN_STEP * round(rng.normal(0.0, spread.gain_db) / GAIN_STEP)
    believed = rotation * (1.0 + rng.normal(0.0, spread.rotation_error))
    shocks: list[tuple[float, float, float]] = []
    if group in ("shocks", "everything"):
        for time in BEGIN + (duration - BEGIN) * rng.uniform(
            size=rng.poisson(spread.shocks * (duration - BEGIN))
        ):
            peak = rng.choice([-1.0, 1.0]) * rng.uniform(*spread.shock) * SHOCK_PEAK[axis]
            shocks.append((float(time), float(peak), rng.uniform(*spread.shock_time)))
    kinds = {"everything": list(KINDS)}.get(group, [group] if group in KINDS else [])
    defects = [
        _placed(draw(str(rng.choice(kinds)), rng, axis), rng, spread)
        for _ in range(max(1, rng.poisson(spread.defects)) if kinds else 0)
    ]
    seed = int(rng.integers(2**31))
    return Circumstance(axis, group, disc, tuple(defects), tuple(shocks), gain_db, believed, seed)


def _placed(defect: Defect, rng: np.random.Generator, spread: Spread) -> Defect:
    length = defect.length * rng.uniform(*spread.size)
    shift = defect.displacement * rng.uniform(*spread.refraction)
    return replace(
        defect, length=length, displacement=shift, angle=rng.uniform(), present=(BEGIN, np.inf)
    )


def groups(many: list[Circumstance]) -> np.ndarray:
    """Index of the group of each circumstance (C,)."""
    return np.array([GROUPS.index(one.group) for one in many])
