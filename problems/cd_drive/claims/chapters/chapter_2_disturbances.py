"""Chapter 2: what disturbs the loops, and playability."""

from __future__ import annotations

from workbench import Run

from ...drive.photo_diodes import CAPTURE
from ...drive.tables import Axis
from ..items import Item, Number, Verdict, at_least, at_most
from ..readings import both

SWITCHED, GROUPS = "cd/{}/two-controllers-switched", "cd/{}/disturbance-groups"
REPAIRED = 2.5e-3
"""Longest burst [m of track] that the error code repairs (section 2.5.1)."""


def repairable_defects_survived(axis: Axis, high: float) -> Number:
    """How often the reference strategy keeps focus or track over the longest repairable defect."""

    def share(run: Run) -> float:
        peak = run.data["peak"].sel(share=1.0, strategy="reference")
        longest = peak.sel(length=REPAIRED, method="nearest")
        return float((longest < CAPTURE[axis]).mean())

    what = f"share of draws that the reference strategy survives at 2.5 mm, {axis}"
    return at_most(what, f"cd/{axis}/excursion", share, high)


def arm(run: Run, case: str, group: str) -> float:
    """An arm of the balloon of one controller."""
    return float(run.data["arm"].sel(case=case, group=group))


def shocks_of_slow(axis: Axis) -> Number:
    """How much more often shocks put the slow controller out of spec than the disc alone does."""

    def more(run: Run) -> float:
        ends = run.data["arm_interval"].sel(case="slow")
        return float(
            ends.sel(end="low", group="shocks") - ends.sel(end="high", group="disc deviation")
        )

    what = f"slow: share of time out of spec with shocks less without, least, {axis}"
    return at_least(what, SWITCHED.format(axis), more, 0.0)


def shocks_of_fast(axis: Axis) -> Number:
    """Share of time that the fast controller is out of spec in shocks."""
    what = f"fast: share of time out of spec in shocks, {axis}"
    return at_most(what, SWITCHED.format(axis), lambda run: arm(run, "fast", "shocks"), 0.1)


ITEMS = (
    Item(
        "Equation 2.9, figure 2.13",
        "Disc deviations, shocks, self-pollution and surface defects enter the focus error",
        Verdict.READING,
        (
            *both(
                at_most,
                "sensed error off equation 2.9, most of 90 %",
                GROUPS,
                "equation_2_9_off_high",
                0.05,
            ),
            *both(
                at_most,
                "off the sum of what the groups do alone, most of 90 %",
                GROUPS,
                "superposition_off_high",
                0.1,
            ),
            *both(
                at_least,
                "error by self-pollution alone, least of 90 % [um]",
                GROUPS,
                "peak_self_pollution_low_um",
                1e-3,
            ),
        ),
        "Within the linear range. Self-pollution is read as a force on the lens: a jump of the "
        "sledge through the suspension, a share of the other coil's force, air at the rotation. "
        "Its sizes are assumed, as none is printed",
        "figure-2-13",
    ),
    Item(
        "Section 2.5.1",
        "An abrupt movement of the sledge disturbs the radial loop, and the focus loop less",
        Verdict.OPEN,
        found="Needs a model of the sledge. Figure 2.13 has a jump through the suspension, of an "
        "assumed size: nothing is printed to size it by",
    ),
    Item(
        "Section 2.5.1",
        "Air is of little importance at 9 Hz of rotation, and an issue at 100 Hz",
        Verdict.READING,
        (
            *both(
                at_least,
                "error by air at 100 Hz over that at 9 Hz, least drive",
                GROUPS,
                "fast_over_audio_air",
                10.0,
            ),
            *both(
                at_least,
                "error by the same force, the same ratio",
                GROUPS,
                "fast_over_audio_same_force",
                1.0,
            ),
        ),
        "Air is taken to push with the square of the rotation; how hard is not printed. An issue "
        "is read as an error ten times as large",
    ),
    Item(
        "Section 2.5.1",
        "A high bandwidth is needed against shocks",
        Verdict.REPRODUCED,
        (
            shocks_of_slow("focus"),
            shocks_of_slow("radial"),
            shocks_of_fast("focus"),
            shocks_of_fast("radial"),
        ),
        "Arms of two balloons, reference controller and K'. Least: lower end of the arm's interval "
        "with shocks less upper end without",
    ),
    Item(
        "Sections 2.5.1, 2.6",
        "A low bandwidth is better against surface defects",
        Verdict.READING,
        (
            at_most(
                "motion by a scratch, a third of the gain over all of it, focus",
                "cd/focus/bandwidth-trade-off",
                "scratch_third_over_full_high",
                0.7,
            ),
            at_most(
                "the same, radial",
                "cd/radial/bandwidth-trade-off",
                "scratch_third_over_full_high",
                0.7,
            ),
            at_least(
                "discs and scratches of 15 in which the third ends nearer, focus",
                "cd/focus/bandwidth-trade-off",
                "better_third",
                1.0,
            ),
            at_least(
                "in which it ends farther, radial",
                "cd/radial/bandwidth-trade-off",
                "worse_third",
                1.0,
            ),
        ),
        "True of what the scratch adds. Of the whole error it is true where the disc deviates by a "
        "tenth of what is allowed at most; radially it is false from a quarter of it on",
        "trade-off",
    ),
    Item(
        "Section 2.5.1",
        "Defects of 2.5 mm, which the code repairs, are too much for the loops, mainly radially",
        Verdict.REPRODUCED,
        (
            repairable_defects_survived("focus", 0.5),
            repairable_defects_survived("radial", 0.25),
        ),
        "Reference strategy, at the Red Book's deviation, over angles and draws",
        "survival",
    ),
    Item(
        "Figure 2.14",
        "When the loop is closed again after a defect it answers strongly",
        Verdict.REPRODUCED,
        (
            at_least(
                "error after the scratch over the periodic one, means over draws",
                "cd/focus/strategies",
                lambda run: (
                    run.metrics["excursion_reference_mean"] / run.metrics["periodic_reference_mean"]
                ),
                2.0,
            ),
            at_most(
                "share of draws in which the disc stays readable",
                "cd/focus/strategies",
                "readable_reference",
                0.9,
            ),
        ),
        shown="figure-8-7",
    ),
    Item(
        "Section 2.6, figure 2.15",
        "Playability is a balloon: every cause of errors is an arm of it",
        Verdict.READING,
        (
            at_least(
                "causes that take more than 0.1 % of the time, reference strategy, radial",
                "cd/playability",
                lambda run: float(
                    (run.data["arm"].sel(axis="radial", strategy="reference") > 1e-3).sum()
                ),
                4.0,
            ),
        ),
        "An arm is a share of time out of spec, over discs and shocks of assumed distributions",
        "balloon",
    ),
    Item(
        "Section 2.6",
        "A change of the bandwidth changes the balloon's shape and keeps its volume",
        Verdict.REFUTED,
        (
            at_least(
                "size with the slow controller over that with the fast one, focus",
                SWITCHED.format("focus"),
                lambda run: run.metrics["balloon_slow"] / run.metrics["balloon_fast"],
                1.5,
                1.0,
            ),
            at_least(
                "the same, radial",
                SWITCHED.format("radial"),
                lambda run: run.metrics["balloon_slow"] / run.metrics["balloon_fast"],
                1.5,
                1.0,
            ),
        ),
        "For the bandwidths of the reference controller and of K'",
    ),
    Item(
        "Section 2.6",
        "The Red Book allows 220 block errors a second (data channel test)",
        Verdict.OPEN,
        found="Needs the data channel: modulation, error code, and bit errors by the true error. "
        "Runs count bursts above 2.5 mm instead",
    ),
    Item(
        "Section 2.6",
        "HF signal tests: more bandwidth lengthens the settling after a scratch, and jitter grows",
        Verdict.OPEN,
        found="Needs an HF signal with slicer and phase-locked loop in the laboratory",
    ),
)
