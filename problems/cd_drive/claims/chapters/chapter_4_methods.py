"""Chapter 4: ways to estimate parameters and responses (section 4.1)."""

from __future__ import annotations

from workbench import Run

from ..items import Item, Number, Value, Verdict, at_least, at_most
from ..readings import both, quotient

METHODS = "cd/{}/response-methods"
EXCITATIONS = ("step", "sines", "noise")
SURE = 0.95
"""Least share of the draws in which a claim holds that is made."""


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


ITEMS = (
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
