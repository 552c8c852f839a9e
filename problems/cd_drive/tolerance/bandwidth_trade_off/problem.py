"""Does a disc need a high bandwidth, and a surface defect a low one (figure 6.7)?

Equation, figure and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
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
    draws_summary,
    figure,
    independent_seeds,
    interval_text,
    markdown_table,
    metric,
    part,
    share_of_draws,
    table,
    verdict_of_share,
)
from workbench.synthesis import discretise
from workbench.types import DataArray, Dataset, Figure, RealArray

from ...diagnosis.scratch_draws import ScratchDraw
from ...drive.shared_parameters import TABLES
from ...drive.tables import Axis
from ...laboratory.bench_setup import PERIOD
from ...laboratory.printed_noise import Amplitude, Fixed
from ..bench_reading import BenchReading
from .figures import SHOWN, one_record, reactions
from .runs import CONTROLLERS, THIRD, PlainLoop, Reaction

SHARES = (0.0, 0.1, 0.25, 0.5, 1.0)
"""Deviations of the disc over what the Red Book allows."""
LENGTHS = (0.3e-3, 1.0e-3, 2.5e-3)
"""Lengths of scratches [m]; figure 6.7 has 1 mm, and the error correction repairs 2.5 mm."""
FULL, SLOW = CONTROLLERS[0], list(CONTROLLERS[1:])


@problem(
    "cd/{axis}/bandwidth-trade-off",
    axis=("focus", "radial"),
    needs=lambda axis, **_: {"lower": ref(f"cd/{axis}/lower-bandwidth")},
    data=(*TABLES, "data/red_book.csv"),
    added=("delay", "noise", "noise_fixed"),
)
def bandwidth_trade_off(
    axis: Axis,
    lower: Run,
    drive: str = "nominal",
    depth: Annotated[float, Field(gt=0, le=1)] = 0.7,
    swing: Annotated[float, Field(ge=0, le=5)] = 0.5,
    draws: Annotated[int, Field(ge=1, le=1000)] = 12,
    delay: Annotated[float, Field(ge=0, le=2)] = 1.0,
    noise: Amplitude = "rms",
    noise_fixed: Fixed = "metres",
) -> BandwidthTradeOff:
    """What a high bandwidth gains on the disc and costs in a scratch, with no detector (fig. 6.7).

    The controllers are the reference controller with its own gain and with a third of it, and K',
    designed for defects. Each disc is simulated with the same noise with and without a scratch, so
    that the effects of scratch and disc can be separated. The slower loop is better where the
    scratch matters more than the disc, and only there.

    drive: "CD1" to "CD12", or "nominal". depth: share of the light that a scratch takes. swing: its
    false displacement, over the acceptable error. draws: number of draws of place, sign, edge and
    noise. delay, noise, noise_fixed: as in `cd/<axis>/strategies`.
    """
    reading = BenchReading(delay=delay, noise=noise, noise_fixed=noise_fixed)
    loop = PlainLoop(axis, discretise(lower.answer.K, PERIOD), drive, depth, swing, reading)
    return BandwidthTradeOff(loop, draws)


@dataclass(frozen=True, eq=False)
class BandwidthTradeOff(Study):
    """Every controller on every disc with every scratch."""

    loop: PlainLoop
    draws: int

    headline: ClassVar[str] = "scratch_third_over_full_mean"

    @property
    def quantifier(self) -> str:
        return f"in {self.draws} simulated draws of each scratch and disc, on {self.loop.drive}"

    controller = dim(CONTROLLERS)
    share = dim(SHARES, meaning="deviation over the Red Book's")
    length = dim(LENGTHS, unit="m")
    draw = dim(lambda self: range(self.draws))
    cases = (share, length, draw)

    @array(dims=cases)
    def seed(self, context: Context) -> Any:
        return independent_seeds(context.rng, len(SHARES), len(LENGTHS), self.draws)

    @part
    def met(self, context: Context, seed: DataArray) -> RealArray:
        """Reactions of every case and controller."""

        def reactions_in(place: tuple[int, ...]) -> list[Reaction]:
            one = seed[place]
            scratch = ScratchDraw.drawn(self.loop.axis, int(one))
            share, length = float(one["share"]), float(one["length"])
            return [self.loop.reaction(law, share, length, scratch) for law in CONTROLLERS]

        found = context.spread(reactions_in, list(np.ndindex(seed.shape)), "scratches")
        return np.reshape(found, (*seed.shape, len(CONTROLLERS), len(Reaction._fields)))

    @arrays((*cases, controller), disc="m", scratch="m", both="m", control="V", lost="1")
    def reacted(self, met: RealArray) -> dict[str, RealArray]:
        """Error from the disc, part that the scratch adds, and error from both."""
        return {name: met[..., n].astype("f4") for n, name in enumerate(Reaction._fields)}

    time = dim(
        lambda self: self.loop.shown_times(SHOWN[1]), unit="s", meaning="time from the scratch"
    )

    @arrays((controller, time), measured="m", true="m", u="V")
    def record(self, context: Context) -> dict[str, Any]:
        """One record of one draw: measured and true error, and the control signal."""
        scratch = ScratchDraw.drawn(self.loop.axis, int(context.rng.integers(2**31)))
        found = [self.loop.shown(law, *SHOWN, scratch) for law in CONTROLLERS]
        rows = np.transpose(found, (1, 0, 2)).astype(np.float32)
        return dict(zip(("measured", "true", "u"), rows, strict=True))

    # --- checks -------------------------------------------------------------------------------

    @check(title="third gain on the disc", at_most=1.0 - CLAIM_SHARE)
    def disc_worse(self, disc: DataArray) -> float:
        """share of draws in which a third of the gain leaves no larger error of a turning disc"""
        turning = disc.sel(share=[one for one in SHARES if one])
        return float(share_of_draws(turning.sel(controller=THIRD) <= turning.sel(controller=FULL)))

    @check(title="{controller} in a scratch", at_most=1.0 - CLAIM_SHARE, each="controller")
    def scratch_less(self, scratch: DataArray) -> DataArray:
        """share of draws in which a scratch of 1 mm moves its lens no less than at full gain"""
        one = self.held(scratch).sel(length=1e-3)
        return share_of_draws(~(one.sel(controller=SLOW) < one.sel(controller=FULL)), "controller")

    def held(self, values: DataArray) -> DataArray:
        """Values on discs that all three controllers follow without a scratch."""
        return values.sel(share=list(SHARES[:3]))

    # --- what is told -------------------------------------------------------------------------

    @metric
    def ratios(self, answer: Dataset) -> dict[str, float]:
        """Numbers of the slower loops over those with full gain, in the same draws."""
        numbers: dict[str, float] = {}
        for name in ("disc", "scratch", "control"):
            one = self.held(answer[name]).sel(length=1e-3)
            one = one.sel(share=list(SHARES[1:3])) if name == "disc" else one
            ratio = one / one.sel(controller=FULL)
            for law, key in zip(SLOW, ("third", "K_prime"), strict=True):
                told = draws_summary(ratio.sel(controller=law), "share")
                for summary in told["summary"].values:
                    found = float(told.sel(summary=summary))
                    numbers[f"{name}_{key}_over_full_{summary}"] = found
        return numbers

    @metric
    def better(self, both: DataArray) -> dict[str, float]:
        """Number of pairs of disc and scratch at which a slower loop has the smaller error, and of
        all pairs.
        """
        shares = self.share_better(both)
        numbers = {"cases": float(shares.sel(controller=THIRD).size)}
        for law, key in zip(SLOW, ("third", "K_prime"), strict=True):
            verdicts = [
                verdict_of_share(float(one)) for one in shares.sel(controller=law).values.ravel()
            ]
            numbers[f"better_{key}"] = float(verdicts.count("holds"))
            numbers[f"worse_{key}"] = float(verdicts.count("fails"))
        return numbers

    def share_better(self, both: DataArray) -> DataArray:
        """Share of draws in which a slower loop's largest error is below that with full gain."""
        less = both.sel(controller=SLOW) < both.sel(controller=FULL)
        return share_of_draws(less, "controller", "share", "length")

    def told(self, values: DataArray) -> str:
        return interval_text(draws_summary(values), form="{:.2f}")

    @table
    def trade_off(self, answer: Dataset) -> dict[str, str]:
        """Each disc and scratch: mean, and 90 % range of the draws."""
        micro = {name: 1e6 * answer[name] for name in ("disc", "scratch", "both")}
        shares, rows = self.share_better(answer["both"]), []
        for share in SHARES:
            for length in LENGTHS:
                for law in CONTROLLERS:
                    at = {"share": share, "length": length, "controller": law}
                    told = [
                        interval_text(draws_summary(one.sel(at)), form="{:.2f}")
                        for one in micro.values()
                    ]
                    verdict = "" if law == FULL else verdict_of_share(float(shares.sel(at)))
                    lost = f"{float(answer['lost'].sel(at).mean()):.0%}"
                    rows.append([f"{share:g}", f"{1e3 * length:g}", law, *told, lost, verdict])
        heads = ["disc / Red Book", "scratch [mm]", "controller", "disc alone [um]"]
        heads += ["by the scratch [um]", "both [um]", "lost", "nearer than full gain"]
        return {"trade-off": markdown_table(heads, rows)}

    @figure
    def drawn(self, answer: Dataset) -> dict[str, Figure]:
        return {
            "figure-6-7": one_record(answer, self.loop.axis),
            "reactions": reactions(answer, self.loop.axis),
        }
