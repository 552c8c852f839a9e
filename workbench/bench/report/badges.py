"""A short summary of a run for the report."""

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
    """State of a run (holds, partial, fails, stopped or uncertified) and its text.

    ``outcome`` is that of the run; empty for a comparison, each of whose cells has one.
    """

    state: str
    words: str
    outcome: str


def run_badge(run: Run, failed: bool = False) -> Badge:
    """Badge of a run, by its certificate; for a comparison, by its cells.

    A run that was stored as a failure never holds, whatever certificate its folder contains.
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
    """Share of a comparison's cells that are certified, and its number of false claims.

    Comparisons of older versions count successes only, and no false claims.
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
    """A share in per cent; 0 % means none and 100 % means all, without rounding."""
    if not 0 <= share <= 1:
        return "unknown share"
    if share in (0, 1):
        return f"{share:.0%}".replace("%", " %")
    return f"{min(max(100 * share, 0.1), 99.9):.1f} %"


def _count(number: float, noun: str) -> str:
    if not math.isfinite(number):
        return f"unknown number of {noun}s"
    return f"{number:.0f} {noun}{'' if number == 1 else 's'}"
