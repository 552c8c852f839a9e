"""The radial loop jumps tracks: kick and brake, counted, timed or the fastest (section 3.6.1).

Section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from workbench import Run, problem, ref
from workbench.executor import Context
from workbench.study import (
    CLAIM_SHARE,
    Study,
    array,
    arrays,
    check,
    dim,
    figure,
    independent_seeds,
    interval_text,
    metric,
    part,
    share_interval,
    table,
)
from workbench.types import DataArray, Dataset, RealArray

from ...drive.photo_diodes import TRACK_PITCH
from ...drive.shared_parameters import TABLES
from ...drive.tables import drives
from ...laboratory.bench_setup import PERIOD, RATE
from .figures import by_tracks, one_jump
from .laws import Jump, acceleration
from .optimal import FastestJump
from .runs import LAWS, START, Landing, Setting

TRACKS = (1, 2, 4, 8, 16, 32, 64)
"""Numbers of tracks that are jumped across."""
VOLTS = (3.0, 10.0)
"""Largest voltages of the pulses [V]; the second is the converter's limit."""
SHARES = (0.0, 1.0)
"""Eccentricities of the disc over what the Red Book allows."""
COUNTED = LAWS[0]
COUNTABLE = TRACK_PITCH / (2 * PERIOD)
"""Speed [m/s] of the lens across the tracks at which it passes half a track per sample."""
SHOWN = (8, 3.0)
"""Number of tracks and voltage [V] of the records that figures show."""


@problem(
    "cd/radial/track-jump",
    slow=True,
    needs={"tracks": ref("cd/radial-error")},
    data=(*TABLES, "data/red_book.csv"),
)
def track_jump(tracks: Run, draws: Annotated[int, Field(ge=1, le=1000)] = 4) -> TrackJump:
    """Jumps across 1 to 64 tracks: where they land, on every drive (section 3.6.1).

    A pulse kicks the lens and brakes it while the controller's input is held. One law counts the
    zeros of the radial error that the sum confirms, one counts all zeros; one plays the pulse that
    would move a free mass; one plays the fastest jump of the nominal lens under the voltage limit,
    found with CasADi.

    Assumed: the laws, as the thesis describes none; the radial diodes see the light of
    `cd/radial-error` on and beside the track; the lens jumps away from its middle. Certified: the
    fastest jump reaches its track at rest, and no pulse that is a sample shorter does, for the
    nominal drive without disturbances. Simulated: shares of draws that land, with 99 %
    Clopper-Pearson intervals.

    draws: number of draws of noise and of the disc's angle, for every drive, law, pulse and disc.
    """
    light = tracks.answer["light"].median(["width", "bits", "stagger"]).values
    contrast = float(light[0] / light[len(light) // 2] - 1.0)
    return TrackJump(contrast, draws)


@dataclass(frozen=True)
class TrackJump(Study):
    """Jumps by every law across every number of tracks, on every drive.

    contrast: light between two tracks over that on a track, minus 1.
    """

    contrast: float
    draws: int

    headline: ClassVar[str] = "landed_one_track_low"

    @property
    def quantifier(self) -> str:
        return f"for these 12 drives, in {self.draws} simulated draws of each jump"

    law, share = dim(LAWS), dim(SHARES, meaning="eccentricity over the Red Book's")
    tracks, volts = dim(TRACKS), dim(VOLTS, unit="V")
    drive = dim(lambda: [one.name for one in drives("radial")])
    draw = dim(lambda self: range(self.draws))
    component = dim("lens", "arm", "lens' speed", "arm's speed")

    # --- the fastest jumps --------------------------------------------------------------------

    @part
    def solved(self, context: Context) -> list[tuple[RealArray, RealArray]]:
        """Pulse and proof of the fastest jump, by voltage and number of tracks."""
        cases = [FastestJump("nominal", n, volts) for volts in VOLTS for n in TRACKS]
        return context.spread(lambda one: one.fastest(), cases, "fastest jumps")

    samples = array(
        dims=(volts, tracks),
        unit="1",
        meaning="of the fastest jump",
        value=lambda solved: np.reshape(
            [len(pulse) for pulse, _ in solved], (len(VOLTS), len(TRACKS))
        ),
    )
    tick = dim(lambda solved: range(max(len(pulse) for pulse, _ in solved)))
    pulse = array(
        dims=(volts, tracks, tick),
        unit="V",
        meaning="of the fastest jump, 0 after its end",
        value=lambda solved: _padded([pulse for pulse, _ in solved]),
    )
    direction = array(
        dims=(volts, tracks, component),
        unit="1",
        meaning="in which a jump of a sample less falls short",
        value=lambda solved: np.reshape([one for _, one in solved], (len(VOLTS), len(TRACKS), -1)),
    )
    free_mass = array(
        dims=(volts, tracks),
        unit="1",
        meaning="samples of kick and brake of a free mass",
        value=lambda: [
            [2 * np.sqrt(n * TRACK_PITCH / acceleration(one)) / PERIOD for n in TRACKS]
            for one in VOLTS
        ],
    )

    # --- simulations --------------------------------------------------------------------------

    seed = array(
        dims=(drive, draw),
        value=lambda self, context: independent_seeds(context.rng, 12, self.draws),
    )

    @part
    def met(
        self, context: Context, seed: DataArray, pulse: DataArray, samples: DataArray
    ) -> RealArray:
        """Landings (laws, volts, tracks, shares, drives, draws, 4)."""
        jumps = [
            (Setting(self.contrast, share), Jump(n, volts, START), law)
            for law in LAWS
            for volts in VOLTS
            for n in TRACKS
            for share in SHARES
        ]
        pulses = {
            (n, one): pulse.sel(tracks=n, volts=one).values[: int(samples.sel(tracks=n, volts=one))]
            for n in TRACKS
            for one in VOLTS
        }

        def one(place: tuple[int, ...]) -> list[Landing]:
            at = seed[place]
            name, number = str(at["drive"].values), int(at)
            return [
                setting.landing(jump, law, name, number, _played(jump, law, pulses))
                for setting, jump, law in jumps
            ]

        found = context.spread(one, list(np.ndindex(seed.shape)), "jumps")
        shape = len(LAWS), len(VOLTS), len(TRACKS), len(SHARES), len(Landing._fields)
        return np.moveaxis(np.reshape(found, (*seed.shape, *shape)), (0, 1), (4, 5))

    told = arrays(
        (law, volts, tracks, share, drive, draw),
        lambda met: {name: met[..., n].astype("f4") for n, name in enumerate(Landing._fields)},
        off=("1", "tracks beyond the target"),
        held=("1", "whether a track is held at the end"),
        time=("s", "until the error from the target stays acceptable"),
        speed=("m/s", "largest speed over the tracks"),
    )

    moment = dim(
        lambda: np.arange(-round(0.5e-3 * RATE), round(4e-3 * RATE)) / RATE,
        unit="s",
        meaning="time from the start of the jump",
    )

    @arrays((law, moment), shown_place="1", shown_read="1", shown_sum="1", shown_u="V")
    def shown(self, pulse: DataArray, samples: DataArray) -> dict[str, Any]:
        """One record of every law: position in tracks, normalised error, sum, voltage."""
        n, volts = SHOWN
        jump, setting = Jump(n, volts, START), Setting(self.contrast, 0.0)
        at = {"tracks": n, "volts": volts}
        fastest = {(n, volts): pulse.sel(at).values[: int(samples.sel(at))]}
        first, rows = round(START * RATE), []
        inside = slice(first - round(0.5e-3 * RATE), first + round(4e-3 * RATE))
        for law in LAWS:
            one = setting.record(jump, law, "CD1", 1, _played(jump, law, fastest))
            place = (one.x - one.x_cd) / TRACK_PITCH
            total = one.sum / one.sum[first - 1000 : first].mean()
            rows.append([each[inside] for each in (place, one.f_en, total, one.u)])
        every = np.transpose(np.array(rows, np.float32), (1, 0, 2))
        return dict(zip(("shown_place", "shown_read", "shown_sum", "shown_u"), every, strict=True))

    # --- checks -------------------------------------------------------------------------------

    @check(title="fastest", at_most=1e-3)
    def reaches(self, pulse: DataArray, samples: DataArray) -> DataArray:
        """distance [tracks, tracks/ms] of the end of the fastest jump from rest on the new track"""
        found = [
            [
                np.linalg.norm(
                    one.reached_by(pulse.values[i, j, : samples.values[i, j]]) - one.target[0]
                )
                for j, one in enumerate(row)
            ]
            for i, row in enumerate(_cases())
        ]
        return samples.copy(data=found)

    @check(title="none is faster", at_most=0.0)
    def least(self, samples: DataArray, direction: DataArray) -> DataArray:
        """reach of a pulse of a sample less in the separating direction over the target, less 1"""
        found = [
            [
                -one.beyond(direction.values[i, j], int(samples[i, j]) - 1)
                for j, one in enumerate(row)
            ]
            for i, row in enumerate(_cases())
        ]
        return samples.astype(float).copy(data=found)

    @check(title="limit", at_most=1e-9)
    def limited(self, pulse: DataArray) -> DataArray:
        """relative excess of a pulse over its limit"""
        return abs(pulse).max(["tick", "tracks"]) / pulse["volts"] - 1.0

    @check(title="one track", at_most=1.0 - CLAIM_SHARE)
    def lands(self, off: DataArray, held: DataArray) -> float:
        """share of counted jumps across one track by 3 V, on centred discs, that land elsewhere"""
        here = {"law": COUNTED, "tracks": 1, "volts": VOLTS[0], "share": 0.0}
        return float((~_landed(off, held).sel(here)).mean())

    # --- what is told -------------------------------------------------------------------------

    @metric
    def shares(self, answer: Dataset) -> dict[str, float]:
        """Shares of jumps that land on their track, with 99 % intervals."""
        landed = _landed(answer["off"], answer["held"])
        centred = landed.sel(share=0.0, law=COUNTED)
        cases = {
            "one_track": centred.sel(tracks=1, volts=VOLTS[0]),
            "one_track_red_book": landed.sel(share=1.0, law=COUNTED, tracks=1, volts=VOLTS[0]),
            "countable": centred.sel(tracks=[1, 2, 4, 8], volts=VOLTS[0]),
            "too_fast": centred.sel(tracks=[32, 64], volts=VOLTS[1]),
        }
        cases |= {
            f"{law.replace(' ', '_')}_all": landed.sel(share=0.0, law=law, volts=VOLTS[0])
            for law in LAWS
        }
        numbers = {}
        for name, one in cases.items():
            for end in (found := share_interval(one))["summary"].values:
                numbers[f"landed_{name}_{end}"] = float(found.sel(summary=end))
        return numbers

    @metric
    def times(self, answer: Dataset) -> dict[str, float]:
        """Samples of the fastest jump, and median settling times [s] of the laws relative to it."""
        landed = _landed(answer["off"], answer["held"]) & (answer["time"] > 0.0)
        one = answer["time"].where(landed).sel(share=0.0, tracks=8, volts=VOLTS[0])
        least = answer["samples"].sel(tracks=8, volts=VOLTS[0]) * PERIOD
        median = (one / least).median(["drive", "draw"])
        numbers = {
            f"settling_{law.replace(' ', '_')}_over_fastest": float(median.sel(law=law))
            for law in LAWS
        }
        samples = answer["samples"]
        return numbers | {
            f"fastest_{n}_tracks_{volts:g}_V_s": float(samples.sel(tracks=n, volts=volts)) * PERIOD
            for n in (1, 8, 64)
            for volts in VOLTS
        }

    @table
    def landings(self, answer: Dataset) -> tuple[list[str], list[list[str]]]:
        """Share of jumps that land on their track: mean and 99 % interval."""
        landed, rows = _landed(answer["off"], answer["held"]), []
        for law in LAWS:
            for volts in VOLTS:
                for share in SHARES:
                    one = share_interval(landed.sel(law=law, volts=volts, share=share), "tracks")
                    told = [interval_text(one.sel(tracks=n), form="{:.2f}") for n in TRACKS]
                    rows.append([law, f"{volts:g}", f"{share:g}", *told])
        return ["law", "pulse [V]", "disc / Red Book", *(f"{n} tracks" for n in TRACKS)], rows

    @figure
    def drawn(self, answer: Dataset) -> dict[str, Any]:
        return {"jump": one_jump(answer, *SHOWN), "landed": by_tracks(answer, COUNTABLE)}


def _landed(off: DataArray, held: DataArray) -> DataArray:
    return (off == 0.0) & (held == 1.0)


def _cases() -> list[list[FastestJump]]:
    return [[FastestJump("nominal", n, volts) for n in TRACKS] for volts in VOLTS]


def _played(jump: Jump, law: str, fastest: dict[tuple[int, float], RealArray]) -> RealArray:
    """Pulse [V] of a playing law."""
    return jump.clocked() if law == "clock" else fastest[jump.tracks, jump.volts]


def _padded(pulses: list[RealArray]) -> RealArray:
    """Pulses of different lengths in one array (volts, tracks, ticks), padded."""
    longest = max(map(len, pulses))
    every = [np.pad(one, (0, longest - len(one))) for one in pulses]
    return np.reshape(every, (len(VOLTS), len(TRACKS), longest))
