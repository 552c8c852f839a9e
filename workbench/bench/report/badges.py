"""What the report says of a run in a few words."""

from __future__ import annotations

import math
from dataclasses import dataclass

from workbench.bench.results import COMPARISON, Run

WORDS = {
    "holds": "holds",
    "fails": "fails",
    "uncertified": "no certificate",
    "stopped": "best so far",
}


@dataclass(frozen=True)
class Badge:
    """State of a run (holds, partial, fails, stopped or uncertified) and its words.

    ``outcome`` is what the method ended with; empty for a comparison, whose cells have one each.
    """

    state: str
    words: str
    outcome: str


def run_badge(run: Run, failed: bool = False) -> Badge:
    """Badge of a run: what its certificate says, and of a comparison what its cells say.

    A run that was kept as a failure never holds, whatever certificate lies in its folder.
    """
    if run.certificate is None:
        state = "uncertified"
    elif run.best_so_far:
        state = "stopped"
    elif run.problem == COMPARISON and run.certificate.holds and not failed:
        return _of_cells(run.metrics)
    else:
        state = "holds" if run.holds and not failed else "fails"
    outcome = "" if run.problem == COMPARISON else str(run.outcome)
    return Badge(state, WORDS[state], outcome)


def _of_cells(metrics: dict[str, float]) -> Badge:
    """Share of a comparison's cells that are certified, and how many of its claims are false.

    Comparisons of older versions count successes, and no false claims.
    """
    share = metrics.get("certified_share", metrics.get("success_rate", math.nan))
    cells, false = metrics.get("cells", math.nan), metrics.get("false_claims", math.nan)
    contradictions = metrics.get("contradictions", 0.0)
    words = f"{_percent(share)} of {_count(cells, 'cell')} certified"
    if math.isnan(false):
        return Badge("partial", f"{words}, false claims not counted", "")
    words += f", {_count(false, 'false claim')}"
    if contradictions:
        words += f", {_count(contradictions, 'contradiction')}"
    state = "fails" if false or contradictions else "holds" if share == 1 else "partial"
    return Badge(state, words, "")


def _percent(share: float) -> str:
    """A share in per cent; 0 % and 100 % are said of none and of all only."""
    if not 0 <= share <= 1:
        return "unknown share"
    if share in (0, 1):
        return f"{share:.0%}".replace("%", " %")
    return f"{min(max(100 * share, 0.1), 99.9):.1f} %"


def _count(number: float, noun: str) -> str:
    if not math.isfinite(number):
        return f"unknown number of {noun}s"
    return f"{number:.0f} {noun}{'' if number == 1 else 's'}"
