"""Chapter 4: were the experiments linear (sections 4.5 and 4.6.4)?"""

from __future__ import annotations

from workbench import Run

from ...drive.tables import Axis
from ..items import Item, Number, Verdict, at_least, at_most, near

FOCUS, RADIAL = "cd/focus/linearity", "cd/radial/linearity"
MULTISINE = "cd/{}/multisine-linearity"
MEDIAN = "output_closed_median_percent_mean"


def apart(run: Run) -> float:
    """Largest difference [%] of the levels of input and output in open loop."""
    levels = run.data["thd"].sel(loop="open")
    return float(abs(levels.sel(channel="input") - levels.sel(channel="output")).max())


def added(run: Run) -> float:
    """Mean THD of the output with eight harmonics over that with five."""
    eight, five = (run.metrics[f"output_closed_{n}_harmonics_percent"] for n in (8, 5))
    return eight / five


def starts_high(axis: Axis) -> Number:
    """Level of the input at 100 Hz, tens of percents."""
    what = f"input at 100 Hz, {axis} [%]"
    return Number(
        what, f"cd/{axis}/linearity", "input_closed_first_percent_mean", 25.0, 200.0, 100.0
    )


ITEMS = (
    Item(
        "Equation 4.26",
        "The THD is the rms of the harmonics over that of the fundamental: 0 of a pure sine",
        Verdict.REPRODUCED,
        (
            at_most(
                "mean of the excitation as measured, focus [%]",
                FOCUS,
                "input_open_percent_high",
                1.0,
            ),
            at_most("the same, radial [%]", RADIAL, "input_open_percent_high", 1.0),
        ),
        shown="thd",
    ),
    Item(
        "Section 4.5",
        "A multisine tests linearity faster than sines of growing size",
        Verdict.READING,
        (
            at_most(
                "its time over that of four sizes, equal errors of its level, focus, 97.5 % bound",
                MULTISINE.format("focus"),
                "time_ratio_absolute_high",
                1.0,
            ),
            at_most(
                "the same, equal relative errors, radial",
                MULTISINE.format("radial"),
                "time_ratio_relative_high",
                1.0,
            ),
            at_least(
                "its time over that of the largest size alone, focus, 2.5 % bound",
                MULTISINE.format("focus"),
                "time_ratio_one_size_absolute_low",
                1.0,
            ),
        ),
        "Per accuracy of the odd distortion in closed loop. It saves the smaller sizes; sines of "
        "the largest one alone are as fast or faster",
        "tests",
    ),
    Item(
        "Section 4.5",
        "The optics are far less linear than the mechanics: a Wiener model",
        Verdict.NOT_COMPUTABLE,
        found="The laboratory's mechanics are linear, and the thesis prints no nonlinearity of the "
        "real ones",
    ),
    Item(
        "Section 4.6.4, figure 4.9",
        "In open loop input and output have the same THD: the experiment is linear",
        Verdict.REPRODUCED,
        (
            at_most("largest difference, focus [%]", FOCUS, apart, 1.0),
            at_most("largest difference, radial [%]", RADIAL, apart, 1.0),
        ),
        shown="thd",
    ),
    Item(
        "Section 4.6.4, figure 4.9",
        "In closed loop the output's THD stays around 5 %",
        Verdict.READING,
        (
            near("median over the frequencies, mean of draws, focus [%]", FOCUS, MEDIAN, 5.0, 0.3),
            near("the same, radial [%]", RADIAL, MEDIAN, 5.0, 0.3),
        ),
        "Read as the median over the frequencies. It is noise: a record's largest level is 13 to "
        "25 % in focus, and 13 to 30 % radially, in nine draws of ten",
        "thd",
    ),
    Item(
        "Section 4.6.4, figure 4.9",
        "In closed loop the input's THD starts at about 100 % and falls to the output's",
        Verdict.READING,
        (
            starts_high("focus"),
            at_most(
                "input at 2000 Hz, focus [%]", FOCUS, "input_closed_last_percent_mean", 10.0, 5.0
            ),
            starts_high("radial"),
            at_most(
                "input at 2000 Hz, radial [%]", RADIAL, "input_closed_last_percent_mean", 10.0, 5.0
            ),
        ),
        "The first level depends on the excitation's size. The last one is below the output's",
        "thd",
    ),
    Item(
        "Section 4.6.4",
        "The closed-loop experiments are in the linear range",
        Verdict.REPRODUCED,
        (
            at_most(
                "most distortion without noise, focus [%]", FOCUS, "output_distortion_percent", 5.0
            ),
            at_most(
                "most distortion without noise, radial [%]",
                RADIAL,
                "output_distortion_percent",
                5.0,
            ),
        ),
        "What is left of the output's THD without noise and a turning disc",
    ),
    Item(
        "Section 4.6.4",
        "Above the fourth harmonic nothing adds to the THD",
        Verdict.REPRODUCED,
        (
            at_most("mean THD of the output with 8 over that with 5, focus", FOCUS, added, 1.15),
            at_most("the same, radial", RADIAL, added, 1.15),
        ),
        "Eight harmonics instead of five add a tenth to the output's THD, which is noise",
    ),
)
