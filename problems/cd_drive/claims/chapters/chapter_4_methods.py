"""Chapter 4: ways to estimate (section 4.1), and were the experiments linear (4.5, 4.6.4)?"""

from __future__ import annotations

from workbench import Run

from ...drive.tables import Axis
from ..items import Item, Number, Value, Verdict, at_least, at_most, near
from ..readings import both, quotient

METHODS = "cd/{}/response-methods"
EXCITATIONS = ("step", "sines", "noise")
SURE = 0.95
"""Least share of the draws in which a claim holds that is made."""
FOCUS, RADIAL = "cd/focus/linearity", "cd/radial/linearity"
MULTISINE = "cd/{}/multisine-linearity"
MEDIAN = "output_closed_median_percent_mean"


def worst_parameters(names: str) -> Value:
    """Largest rms error of parameters over the four estimators, from sines."""

    def worst(run: Run) -> float:
        errors = run.data["parameter_error"].sel(noise="quiet", excitation="sines")
        chosen = errors.sel(parameter=names.split()).astype(float)
        return float(((chosen**2).mean("draw") ** 0.5).max())

    return worst


def nearer(noise: str, *pairs: str) -> Value:
    """Least share of the draws in which the first of a pair is nearer the truth."""
    return lambda run: min(run.metrics[f"nearer_{noise}_{pair}"] for pair in pairs)


def response_error(name: str) -> tuple[Number, ...]:
    """Rms error of a response over the frequencies, in nine draws of ten."""
    words = f"rms error by {name.replace('_', ' ')}, nine draws of ten"
    return both(at_most, words, METHODS, f"error_quiet_{name}_high", 0.01)


ESTIMATION = (
    Item(
        "Section 4.1.1",
        "Parameters are found by least squares, prediction errors, instruments or likelihood",
        Verdict.REPRODUCED,
        (
            *both(
                at_most,
                "largest rms error of R, Bl, k by any",
                METHODS,
                worst_parameters("R Bl k"),
                0.01,
            ),
            *both(at_most, "largest rms error of b by any", METHODS, worst_parameters("b"), 0.05),
        ),
        "From v_r/u of CD1 by sines of 0.1 V, 30 s, at the laboratory's noise and the true mass",
        "models",
    ),
    Item(
        "Section 4.1.1, equation 4.2",
        "Instruments cancel the effect of noise that least squares suffer from, without its model",
        Verdict.REPRODUCED,
        (
            *both(
                at_least,
                "draws in which instruments are nearer, least of three excitations",
                METHODS,
                nearer("noisy", *(f"{one}_instruments_than_least_squares" for one in EXCITATIONS)),
                SURE,
            ),
            *both(
                at_least,
                "rms error by least squares, steps",
                METHODS,
                "error_noisy_step_least_squares_mean",
                0.02,
            ),
            *both(
                at_most,
                "the same by instruments",
                METHODS,
                "error_noisy_step_instruments_mean",
                0.02,
            ),
        ),
        "White noise, ten times the laboratory's; the filtered regressors colour it. Instruments "
        "and prediction errors then agree",
        "models",
    ),
    Item(
        "Section 4.1.2",
        "Responses are found from a step, from sines, or from spectra",
        Verdict.REPRODUCED,
        (*response_error("step"), *response_error("sines"), *response_error("spectra_4s")),
        "v_r/u of CD1 from 30 s and 0.1 V of each. Spectra need segments of seconds at the "
        "resonance",
        "responses",
    ),
    Item(
        "Section 4.1.2",
        "The step method suits first and second order, provided that there is little noise",
        Verdict.READING,
        (
            *both(at_most, "rms error, quiet", METHODS, "error_quiet_step_mean", 0.005),
            *both(
                at_least, "the same, ten times the noise", METHODS, "error_noisy_step_mean", 0.01
            ),
        ),
        "For the second order of v_r/u, without a model. A model fitted to the same noisy steps by "
        "instruments stays below 1 %",
        "responses",
    ),
    Item(
        "Section 4.1.2",
        "Sines need many measurements, which a plant that settles slowly makes long",
        Verdict.READING,
        (
            *both(at_least, "share of the time in which the coil settles", METHODS, "waiting", 0.5),
            *both(
                at_least,
                "draws in which sines are nearer than steps and spectra of equal time",
                METHODS,
                nearer("quiet", "sines_than_step", "sines_than_spectra_4s"),
                SURE,
            ),
        ),
        "More than half of the time is spent waiting, and the sines are still the nearest",
        "responses",
    ),
    Item(
        "Section 4.1.2, equation 4.3",
        "The response by spectra depends on how the spectra are estimated",
        Verdict.REPRODUCED,
        (
            *both(
                at_least,
                "error with segments of 1/2 s over that with 4 s",
                METHODS,
                quotient("error_quiet_spectra_half_s_mean", "error_quiet_spectra_4s_mean"),
                2.0,
            ),
            at_least(
                "the inverse, ten times the noise, radial",
                METHODS.format("radial"),
                quotient("error_noisy_spectra_4s_mean", "error_noisy_spectra_half_s_mean"),
                2.0,
            ),
        ),
        "Short segments flatten the resonance, long ones average less noise",
        "responses",
    ),
)


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


LINEARITY = (
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
