"""Chapter 9: conclusions, and what is left to do."""

from __future__ import annotations

from typing import Any

from workbench import Run

from ..items import Item, Value, Verdict, at_least, at_most
from ..loop_readings import DEFECTS
from ..readings import both, quotient

FOCUS, RADIAL = "cd/focus/best-gains", "cd/radial/best-gains"
IMMUNITY, VARIANTS = "cd/{}/immunity", "cd/{}/cover-variants"


def _arm(run: Run, use: str, gain: float) -> Any:
    """Share of time out of spec by cause, on all circumstances."""
    return run.data["arm"].sel(case=f"{use} {gain:+g} dB").mean("half")


def in_defects(use: str) -> Value:
    """Time out of spec in defects at 2 dB more gain over the reference strategy's at its own."""

    def ratio(run: Run) -> float:
        most, least = _arm(run, use, 2.0), _arm(run, "reference", 0.0)
        return float(most.sel(group=DEFECTS).mean() / least.sel(group=DEFECTS).mean())

    return ratio


ITEMS = (
    Item(
        "Section 9.1",
        "The balloon of playability shrinks with A, B and C",
        Verdict.REPRODUCED,
        tuple(
            at_most(
                f"balloon with {name} less the reference strategy's, upper end, {axis}",
                run,
                f"{name}_less_reference_high",
                0.0,
            )
            for axis, run in (("focus", FOCUS), ("radial", RADIAL))
            for name in ("A", "B", "C")
        ),
        "Each at the gain that suits it best, chosen and judged on different circumstances",
        "compared",
    ),
    Item(
        "Section 9.1",
        "A and B do not make the loops worse in shocks",
        Verdict.REPRODUCED,
        (
            at_most(
                "time out of spec with A less the reference strategy's, lower end, focus",
                FOCUS,
                "A_less_reference_in_shocks_low",
                0.0,
            ),
            at_most("A, radial", RADIAL, "A_less_reference_in_shocks_low", 0.0),
            at_most("B, upper end, focus", FOCUS, "B_less_reference_in_shocks_high", 0.0),
            at_most("B, upper end, radial", RADIAL, "B_less_reference_in_shocks_high", 0.0),
        ),
        "A is as good as the reference strategy within what can be told, B is a little better",
        "compared",
    ),
    Item(
        "Section 9.1",
        "C does not make the loops worse in shocks",
        Verdict.REFUTED,
        (
            at_least(
                "time out of spec with C less the reference strategy's, lower end, focus",
                FOCUS,
                "C_less_reference_in_shocks_low",
                0.0,
            ),
        ),
        "By two thousandths of the time, each at its best gain",
        "compared",
    ),
    Item(
        "Section 9.1",
        "Immunity against defects allows more bandwidth",
        Verdict.READING,
        (
            at_least("best gain with A [dB], focus", FOCUS, "best_gain_A", 1.0),
            at_least("best gain with B [dB], focus", FOCUS, "best_gain_B", 1.0),
            at_least("best gain with A [dB], radial", RADIAL, "best_gain_A", 1.0),
            at_least("best gain with B [dB], radial", RADIAL, "best_gain_B", 1.0),
            *(
                number
                for axis in ("focus", "radial")
                for name in ("A", "B", "C")
                for number in (
                    at_least(
                        f"gain at which defects cost {name} what they cost the reference strategy, "
                        f"lower end [dB], {axis}",
                        IMMUNITY.format(axis),
                        f"gain_{name}_low",
                        2.0,
                    ),
                    at_most(
                        f"time in shocks with {name} there over that at 0 dB, {axis}",
                        IMMUNITY.format(axis),
                        f"shocks_{name}_found",
                        0.5,
                    ),
                )
            ),
            *(
                at_most(
                    f"time in defects, reference strategy at 2 dB over that at 0, {axis}",
                    run,
                    in_defects("reference"),
                    1.2,
                )
                for axis, run in (("focus", FOCUS), ("radial", RADIAL))
            ),
        ),
        "Defects allow more than 2 dB, above which the largest S passes 2 on a drive: the plants "
        "bound the gain. The reference strategy likes more gain as well, in defects too",
        "balloons, immunity",
    ),
    Item(
        "Section 9.2",
        "The cross-couplings of both loops should be identified",
        Verdict.OPEN,
        found="Needs both axes in one laboratory",
    ),
    Item(
        "Section 9.2",
        "Faults of the sledge should be diagnosed",
        Verdict.OPEN,
        found="Needs a sledge in the laboratory",
    ),
    Item(
        "Section 9.2",
        "The set of plants should be extrapolated beyond the twelve drives",
        Verdict.READING,
        (
            *both(
                at_least,
                "width of the sets over that of twelve drives, median",
                VARIANTS,
                "width_over_default_extrapolated",
                1.1,
            ),
            *both(
                at_least,
                "peak of mu over that with twelve",
                VARIANTS,
                quotient("peak_extrapolated", "peak_default"),
                1.05,
            ),
        ),
        "If responses are normally distributed: a further drive lies inside with 90 % at each "
        "frequency. The sets grow by two fifths, mu by a seventh",
        "costs, curves",
    ),
    Item(
        "Section 9.2",
        "Playability should be measured objectively",
        Verdict.READING,
        (
            at_most("balloon with B, focus", FOCUS, "balloon_B", 0.2),
            at_least("balloon of the reference strategy, focus", FOCUS, "balloon_reference", 0.2),
        ),
        "As shares of time out of spec by the true error, over an ensemble of discs. The data "
        "channel is not part of it",
        "balloons",
    ),
    Item(
        "Section 9.2",
        "The methods should be tried on a DVD drive",
        Verdict.OPEN,
        found="Needs the parameters of such a drive; none are printed",
    ),
)
