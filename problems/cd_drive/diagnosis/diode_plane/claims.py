"""Statements about detectors and kinds of defects, each judged draw by draw."""

from __future__ import annotations

from workbench.types import DataArray, Dataset

from ...laboratory.bench_setup import PERIOD
from ..defect_claims import Claim

CLAIMED = ("decoupled", "shocks are felt", "coupling", "quality finds them", "kinds", "sooner")
"""Names of the statements that are checked."""
COUPLED = 0.01
"""Squared correlation of sum and error under shocks from which they count as coupled."""
MISSED = 0.01
"""Share of the defects that a detector may miss and still count as finding them."""
ISOLATED = 0.9
"""Least share of the held-out defects whose kind is recognised."""


def isolated_share(confusion: DataArray) -> DataArray:
    """Share of the held-out defects (draw,) whose kind was recognised."""
    kinds = confusion["kind"].values.tolist()
    right = sum(confusion.sel(kind=one, found=one, drop=True) for one in kinds)
    share: DataArray = right / confusion.sum(["kind", "found"])
    return share


def plane_claims(answer: Dataset) -> list[Claim]:
    """Statements that are checked, then comparisons that are only reported."""
    alarms, missed = answer["false_alarms"], answer["missed"].mean("kind")
    in_sums = alarms.sel(detector=["binary", "quality"]).sum(["detector", "condition"])
    delay = answer["delay"]
    return [
        Claim("decoupled", "no false alarm of the sum, shaken or not", in_sums == 0),
        Claim(
            "shocks are felt",
            "false alarms of the error under shocks",
            alarms.sel(detector="error", condition="shock") > 0,
        ),
        Claim(
            "coupling",
            f"sum and error correlate by at most {COUPLED:g} (squared) on every drive",
            answer["coupling"].max("drive") <= COUPLED,
        ),
        Claim(
            "quality finds them",
            f"the quality signal misses at most {MISSED:.0%}",
            missed.sel(detector="quality") <= MISSED,
        ),
        Claim("sooner", "the quality signal is sooner than the binary one", answer["lead"] > 0),
        Claim(
            "kinds",
            f"at least {ISOLATED:.0%} of the held-out defects told by kind",
            isolated_share(answer["confusion"]) >= ISOLATED,
        ),
        Claim(
            "",
            "the quality signal finds all",
            missed.sel(detector="quality") == 0,
        ),
        Claim("", "the binary detector finds all", missed.sel(detector="binary") == 0),
        Claim(
            "",
            "the error misses more than half",
            missed.sel(detector="error") > 0.5,
        ),
        *(
            Claim(
                "",
                f"{kind}: quality at least a sample sooner than binary",
                delay.sel(kind=kind, detector="binary") - delay.sel(kind=kind, detector="quality")
                >= PERIOD,
            )
            for kind in delay["kind"].values.tolist()
        ),
    ]
