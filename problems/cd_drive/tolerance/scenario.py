"""Scenarios: a disc, its rotation and its defects, shocks, and strategies over time.

A scenario is written down as a dictionary, or in a TOML file:

    duration = 2.0
    false_alarms = [[0.6, 0.601], [1.6, 1.601]]     # from and until [s]

    [bench]                                         # see Laboratory
    axis = "focus"
    drive = "CD3"

    [disc]                                          # see Disc
    warp = [500e-6]
    rotation = 5.5
    speed = [[0.0, 1.0], [2.0, 0.9]]                # slows down by a tenth

    [[defects]]                                     # see Defect
    length = 1.2e-3
    depth = 0.7

    [[shocks]]
    time = 0.8
    acceleration = 5.0

    [[stages]]
    strategy = "reference"

    [[stages]]
    time = 1.0
    strategy = "A"
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import TypeAdapter, ValidationError, with_config

from workbench.errors import InputError

from ..diagnosis.defect_kinds import SHOCK_DURATION, shocks
from ..diagnosis.quality import Quality
from ..drive.disc import STRICT, Defect, Disc
from ..laboratory.bench_setup import RATE
from ..laboratory.experiment import STILL, Laboratory
from ..laboratory.record import Record
from .tactics import STRATEGIES, Strategies, clean_level


@with_config(STRICT)
@dataclass(frozen=True)
class Shock:
    """A half sine of 10 ms on the chassis: its start [s] and peak acceleration [m/s^2]."""

    time: float
    acceleration: float


@with_config(STRICT)
@dataclass(frozen=True)
class Stage:
    """A strategy in `STRATEGIES` that is in charge from a time [s]."""

    strategy: str
    time: float = 0.0

    def __post_init__(self) -> None:
        if self.strategy not in STRATEGIES:
            raise InputError(f"strategy is {self.strategy!r}; known: {', '.join(STRATEGIES)}")


@with_config(STRICT)
@dataclass(frozen=True)
class Scenario:
    """A run of the virtual laboratory.

    Parameters
    ----------
    bench
        Drive in its laboratory.
    disc
        Disc, and how it turns.
    defects
        Defects of the disc; each must be met within the run.
    shocks
        Shocks of the chassis.
    false_alarms
        Start and end [s] of detections where there is no defect.
    stages
        Strategies in the order of time, the first from 0 on.
    rotation
        Rotation frequency [Hz] that the strategies assume. Default: the disc's own.
    bumpless
        Whether K and K' follow each other.
    quality
        Signal that opens the strategies' estimators, see `Strategies`.
    duration
        Length of the run [s].
    seed
        Seed of the noise.

    Raises InputError for a duration without a sample, for defects that are never met, among them
    all on a disc that stands, for shocks, false alarms or stages outside the run.
    """

    bench: Laboratory = field(default_factory=Laboratory)
    disc: Disc = STILL
    defects: tuple[Defect, ...] = ()
    shocks: tuple[Shock, ...] = ()
    false_alarms: tuple[tuple[float, float], ...] = ()
    stages: tuple[Stage, ...] = (Stage("reference"),)
    rotation: float | None = None
    bumpless: bool = True
    quality: Quality = "graded"
    duration: float = 1.0
    seed: int = 0

    def __post_init__(self) -> None:
        if not 1.0 / RATE <= self.duration < np.inf:
            raise InputError(f"duration is {self.duration} s; it must be positive and finite")
        self._check_defects()
        for what, times in (
            ("shock", [shock.time for shock in self.shocks]),
            ("false alarm", [time for interval in self.false_alarms for time in interval]),
            ("stage", [stage.time for stage in self.stages]),
        ):
            for time in times:
                if not 0.0 <= time < self.duration:
                    raise InputError(
                        f"{what} at {time} s lies outside the record, 0 to {self.duration} s"
                    )

    def _check_defects(self) -> None:
        if not self.defects:
            return
        if not self.disc.rotation > 0.0:
            raise InputError(
                f"rotation is {self.disc.rotation} Hz: a disc with defects has to turn"
            )
        time = np.arange(round(self.duration * RATE)) / RATE
        revolutions, rotation = self.disc.turned(time)
        for number, defect in enumerate(self.defects):
            if not defect.met(revolutions, time, rotation)[0].any():
                raise InputError(
                    f"defect {number}, {defect}, lies outside the record: it is not met in 0 to "
                    f"{self.duration} s"
                )

    def strategies(self, **designs: Any) -> Strategies:
        """Strategies of this scenario; ``designs``: F, replacement and K of `Strategies`."""
        return Strategies(
            self.bench.axis,
            clean_level(self.bench, self.disc.reflectivity),
            self.disc.rotation if self.rotation is None else self.rotation,
            bumpless=self.bumpless,
            false=self.false_alarms,
            quality=self.quality,
            dimmed=self._dimmed if self.quality == "prompt" else (),
            **designs,
        )

    @property
    def _dimmed(self) -> list[tuple[float, float]]:
        """Intervals [s] in which a defect takes light."""
        return self.disc.dimmed(self.defects, np.arange(round(self.duration * RATE)) / RATE)

    def run(self, **designs: Any) -> Record:
        """Simulate. Raises InputError if a strategy cannot be made or a part of it fails."""
        strategies = self.strategies(**designs)
        schedule = [(stage.time, strategies.named(stage.strategy)) for stage in self.stages]
        samples = round(self.duration * RATE)
        played = [(shock.time, shock.acceleration, SHOCK_DURATION) for shock in self.shocks]
        excitation = shocks(self.bench, played, samples)
        return self.bench.closed_loop(
            schedule, excitation, disc=self.disc, defects=self.defects, seed=self.seed
        )


def scenario(script: Mapping[str, Any]) -> Scenario:
    """Make the scenario of a dictionary, see the module.

    Raises InputError for unknown keys (and lists the known ones), and for values of a wrong type or
    without meaning.
    """
    try:
        return _adapter().validate_python(dict(script))
    except ValidationError as fault:
        raise InputError("scenario: " + "; ".join(_told(one) for one in fault.errors())) from fault


def read_scenario(path: str | Path) -> Scenario:
    """Read the scenario of a TOML file. Raises InputError as `scenario`, and for a bad file."""
    try:
        script = tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as fault:
        raise InputError(f"scenario file {path}: {fault}") from fault
    return scenario(script)


@cache
def _adapter() -> TypeAdapter[Scenario]:
    return TypeAdapter(Scenario)


def _told(error: Any) -> str:
    """Message for one error in a script, with its place."""
    place = ".".join(str(step) for step in error["loc"])
    if error["type"] != "unexpected_keyword_argument":
        message = str(error["msg"]).removeprefix("Value error, ")
        return f"{place}: {message}" if place else message
    known = [one.name for one in fields(_holder(error["loc"][:-1]))]
    return f"unknown key {place}; known there: {', '.join(known)}"


def _holder(path: tuple[str | int, ...]) -> Any:
    """Class whose fields are allowed at this place of a script."""
    parts = {"bench": Laboratory, "disc": Disc, "defects": Defect, "shocks": Shock, "stages": Stage}
    holder = parts[str(path[0])] if path else Scenario
    return holder
