"""A disc as the laser sees it: its deviations and its surface defects.

Section, table and equation numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, with_config

from workbench.errors import InputError
from workbench.types import RealArray

from .tables import Axis

VELOCITY = 1.3
"""Scanning velocity [m/s], constant along the track (section 2.5.3)."""


STRICT = ConfigDict(extra="forbid", allow_inf_nan=True)
"""Rules for discs and defects in a script: unknown fields are errors; infinite numbers are allowed.
"""


@with_config(STRICT)
@dataclass(frozen=True)
class Defect:
    """A surface defect (scratch, finger print, dust): it dims the light and falsifies the error.

    A white dot has a negative depth: it reflects more light than the pits around it.

    length along the track [m]; angle where it starts [revolutions]; depth share of the light that
    it takes, at most 1; if negative, that it adds; displacement false displacement f_sd that swings
    once up and down, amplitude [m] (eq. 2.9); offset constant false displacement within the defect
    [m]; edge share of the length of its smooth beginning, and of its end, 0 to 0.5; present
    times [s] at which it appears and vanishes.

    Raises InputError outside these ranges.
    """

    length: float = 1.2e-3
    angle: float = 0.25
    depth: float = 0.9
    displacement: float = 0.0
    offset: float = 0.0
    edge: float = 0.2
    present: tuple[float, float] = (0.0, np.inf)

    def __post_init__(self) -> None:
        if not (self.length > 0.0 and -9.0 <= self.depth <= 1.0 and 0.0 <= self.edge <= 0.5):
            raise InputError(f"{self}: need length > 0, depth in -9 to 1 and edge in 0 to 0.5")

    def met(
        self, revolutions: RealArray, time: RealArray, rotation: RealArray
    ) -> tuple[NDArray[np.bool_], RealArray]:
        """Whether the laser is on the defect, and the share of its length passed: each (N,)."""
        travelled = (revolutions - self.angle) % 1.0  # revolutions since its start
        along = travelled * VELOCITY / (np.maximum(rotation, 1e-12) * self.length)
        inside = (along <= 1.0) & (rotation > 0.0)
        return inside & (time >= self.present[0]) & (time < self.present[1]), along

    def effect(
        self, revolutions: RealArray, time: RealArray, rotation: RealArray
    ) -> tuple[RealArray, RealArray]:
        """Remaining share of the light, and f_sd [m]: each (N,).

        revolutions (N,): turned so far. time [s] (N,). rotation [Hz] (N,): frequency at that time.
        """
        inside, along = self.met(revolutions, time, rotation)
        from_edge = np.minimum(along, 1.0 - along) / max(self.edge, 1e-12)
        window = np.where(inside, 0.5 - 0.5 * np.cos(np.pi * np.clip(from_edge, 0.0, 1.0)), 0.0)
        swing = self.displacement * np.sin(2 * np.pi * along) + self.offset
        return 1.0 - self.depth * window, swing * window


@with_config(STRICT)
@dataclass(frozen=True)
class Disc:
    """A disc, its deviations and its rotation.

    warp          amplitudes [m] of the vertical deviation at the rotation frequency and its
                  harmonics; Table 2.3 allows 500 um;
    eccentricity  the same for the radial deviation; Table 2.4 allows 70 um;
    rotation      frequency [Hz], 3 to 9 at normal speed; 0 for a disc at rest;
    speed         profile of the rotation: times [s] and factors on the frequency there,
                  linear between them, constant before and after; 1 throughout when left out;
    phase         angle of the rotation at the start [revolutions];
    offset        constant deviation of the axis in use [m];
    reflectivity  of the layer; 1 is that of the disc on which the optical gains were measured;
    run_up        time [s] over which the deviation grows to its size: a loop that starts at rest
                  meets a disc that does so too.

    Raises InputError for a negative rotation, run-up or reflectivity.
    """

    warp: Sequence[float] = ()
    eccentricity: Sequence[float] = ()
    rotation: float = 6.0
    phase: float = 0.0
    offset: float = 0.0
    reflectivity: float = 1.0
    run_up: float = 0.2
    speed: Sequence[tuple[float, float]] = ()

    def __post_init__(self) -> None:
        if min(self.rotation, self.run_up, self.reflectivity) < 0.0:
            raise InputError(f"{self}: rotation, run_up and reflectivity must not be negative")
        points = np.array(self.speed, float).reshape(-1, 2)
        if not np.isfinite(points).all() or (np.diff(points[:, 0], prepend=-1e-300) <= 0.0).any():
            raise InputError(f"speed is {self.speed}; times must increase and not be negative")
        if (points[:, 1] < 0.0).any():
            raise InputError(f"speed is {self.speed}; the factors must not be negative")

    @classmethod
    def along(cls, axis: Axis, *amplitudes: float, **rest: Any) -> Self:
        """A disc that has these harmonics [m] of deviation in one axis, and none in the other."""
        warp, eccentricity = (amplitudes, ()) if axis == "focus" else ((), amplitudes)
        return cls(warp=warp, eccentricity=eccentricity, **rest)

    def deviation(self, axis: Axis, time: RealArray) -> RealArray:
        """Position x_cd of the layer, or y_cd of the track [m], at times [s] (N,): (N,)."""
        harmonics = self.warp if axis == "focus" else self.eccentricity
        angle = 2 * np.pi * self.turned(time)[0]
        wobble = np.zeros_like(time)
        for n, amplitude in enumerate(harmonics, start=1):
            wobble += amplitude * np.sin(n * angle)
        if self.run_up > 0.0:
            wobble *= 0.5 - 0.5 * np.cos(np.pi * np.minimum(time / self.run_up, 1.0))
        return wobble + self.offset

    def surface(self, defects: Sequence[Defect], time: RealArray) -> tuple[RealArray, RealArray]:
        """Relative light and false displacement f_sd [m] at times [s] (N,): each (N,)."""
        light, false = np.full_like(time, self.reflectivity), np.zeros_like(time)
        revolutions, rotation = self.turned(time)
        for defect in defects:
            left, shift = defect.effect(revolutions, time, rotation)
            light *= left
            false += shift
        return light, false

    def dimmed(self, defects: Sequence[Defect], time: RealArray) -> list[tuple[float, float]]:
        """Intervals (from, until) of times [s] (N,) in which a defect takes light."""
        dark = self.surface(defects, time)[0] < self.reflectivity
        change = np.diff(np.concatenate([[False], dark, [False]]).astype(int))
        step = float(time[1] - time[0])
        starts, ends = np.flatnonzero(change > 0), np.flatnonzero(change < 0)
        return [(step * a, step * b) for a, b in zip(starts, ends, strict=True)]

    def turned(self, time: RealArray) -> tuple[RealArray, RealArray]:
        """Revolutions since the start, and rotation frequency [Hz], at times [s] (N,): each
        (N,).
        """
        if not len(self.speed):
            return self.rotation * time + self.phase, np.full_like(time, self.rotation)
        at, factor = np.array(self.speed, float).T
        if at[0] > 0.0:
            at, factor = np.append(0.0, at), np.append(factor[0], factor)
        # The integral of a piecewise linear function is a parabola after each corner.
        areas = np.append(0.0, np.cumsum(np.diff(at) * (factor[1:] + factor[:-1]) / 2))
        last = np.searchsorted(at, time, side="right") - 1
        now = np.interp(time, at, factor)
        area = areas[last] + (time - at[last]) * (factor[last] + now) / 2
        return self.rotation * area + self.phase, self.rotation * now
