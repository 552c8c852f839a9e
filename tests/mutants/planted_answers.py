"""Planted wrong answers of every tight problem: some far off, some by one percent only."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import control
import numpy as np

Wrong = Callable[[Any], Any]
"""A function that spoils a right answer."""


def scaled(field: str, factor: float) -> Wrong:
    """The answer with a field multiplied."""
    return lambda answer: replace(answer, **{field: factor * np.asarray(getattr(answer, field))})


def shifted(field: str, by: complex) -> Wrong:
    """The answer with a number added to a field."""
    return lambda answer: replace(answer, **{field: np.asarray(getattr(answer, field)) + by})


def one_entry(field: str, factor: float) -> Wrong:
    """The answer with the first entry of a field multiplied: the others stay right."""

    def spoil(answer: Any) -> Any:
        values = np.array(getattr(answer, field))
        values.flat[0] *= factor
        return replace(answer, **{field: values})

    return spoil


def largest_entry(field: str, factor: float) -> Wrong:
    """The answer with the largest entry of a field multiplied: the others stay right."""

    def spoil(answer: Any) -> Any:
        values = np.array(getattr(answer, field))
        values.flat[np.argmax(values)] *= factor
        return replace(answer, **{field: values})

    return spoil


def controller(change: Callable[[Any], Any], field: str = "K") -> Wrong:
    """The answer with its controller changed and its claims kept."""
    return lambda answer: replace(answer, **{field: change(getattr(answer, field))})


def gain(factor: float) -> Callable[[Any], Any]:
    """A controller with its gain multiplied."""
    return lambda K: control.ss(K.A, K.B, factor * K.C, factor * K.D, K.dt)


def faster(factor: float) -> Callable[[Any], Any]:
    """A controller with its poles multiplied."""
    return lambda K: control.ss(factor * K.A, K.B, K.C, K.D, K.dt)


def other_input(K: Any) -> Any:
    """A controller with an input too many."""
    return control.ss(K.A, np.hstack([K.B, K.B]), K.C, np.hstack([K.D, K.D]), K.dt)


def unstable_state(K: Any) -> Any:
    """A controller with a hidden unstable state, which no response shows."""
    return control.append(K, control.ss([[1.0]], [[0.0]], [[0.0]], [[0.0]]))[
        : K.noutputs, : K.ninputs
    ]


def unstable_hidden(K: Any) -> Any:
    """As `unstable_state`, the realisation kept as it is."""
    n = K.nstates
    A = np.block([[K.A, np.zeros((n, 1))], [np.zeros((1, n)), np.ones((1, 1))]])
    B, C = np.vstack([K.B, np.zeros((1, K.ninputs))]), np.hstack([K.C, np.zeros((K.noutputs, 1))])
    return control.StateSpace(A, B, C, K.D, K.dt, remove_useless_states=False)


SHAPES = {
    "radius 1 % too small": scaled("radius", 0.99),
    "one radius 1 % too small": one_entry("radius", 0.99),
    "radius half": scaled("radius", 0.5),
    "radius negative": scaled("radius", -1.0),
    "radius not a number": scaled("radius", np.nan),
    "one centre off by 5 %": one_entry("center", 1.05),
    "centre conjugated": lambda a: replace(a, center=np.conj(a.center) + 0.5j),
    "centre moved": shifted("center", 0.1 + 0.1j),
}
CONTROLLERS = {
    "gain of the other sign": controller(gain(-1.0)),
    "no controller": controller(gain(0.0)),
    "another input": controller(other_input),
    "hidden unstable state": controller(unstable_hidden),
    "poles of the other sign": controller(faster(-1.0)),
}
FITS = {
    "gain doubled": lambda R: R.scaled(2.0),
    "gain of the other sign": lambda R: R.scaled(-1.0),
}


def with_roots(**changes: Callable[[np.ndarray], np.ndarray]) -> Wrong:
    """A rational function with its poles or zeros changed."""

    def spoil(R: Any) -> Any:
        return replace(R, **{name: change(getattr(R, name)) for name, change in changes.items()})

    return spoil


def in_model(name: str, spoil: Wrong) -> Wrong:
    """A cover with one function of its model spoilt."""

    def change(answer: Any) -> Any:
        model = answer.model
        return replace(answer, model=replace(model, **{name: spoil(getattr(model, name))}))

    return change


def in_record_model(use: str, **changes: Callable[[Any], Any]) -> Wrong:
    """An identified model with some matrices changed."""

    def change(answer: Any) -> Any:
        model = getattr(answer, use)
        new = {name: how(getattr(model, name)) for name, how in changes.items()}
        return replace(answer, **{use: replace(model, **new)})

    return change


mirrored = with_roots(poles=lambda p: -p.conj())
mirrored_zeros = with_roots(zeros=lambda z: -z.conj())

COVERS = {
    "W_c 1 % too small": in_model("W_c", lambda R: R.scaled(0.99)),
    "W_c half": in_model("W_c", lambda R: R.scaled(0.5)),
    "W_c unstable": in_model("W_c", mirrored),
    "W_c not minimum phase": in_model("W_c", mirrored_zeros),
    "nominal unstable": in_model("nominal", mirrored),
    "nominal of the other sign": in_model("nominal", lambda R: R.scaled(-1.0)),
    "nominal 10 % too large": in_model("nominal", lambda R: R.scaled(1.1)),
}

SETS = {
    "left 1 % too small": scaled("left", 0.99),
    "right half": scaled("right", 0.5),
    "left turned": lambda a: replace(a, left=a.left[..., ::-1, :]),
    "not a number": scaled("left", np.nan),
    "the next frequency's": lambda a: replace(a, left=np.roll(a.left, 1, axis=0)),
}

PLANTED: dict[str, dict[str, Wrong]] = {
    "circle": SHAPES,
    **{
        name: SHAPES
        | {
            "half-length zero": scaled("half_length", 0.0),
            "half-length 10 % too small": scaled("half_length", 0.9),
            "turned by a right angle": shifted("angle", np.pi / 2),
            "turned by 0.1": shifted("angle", 0.1),
        }
        for name in ("stadium", "small_stadium")
    },
    **{
        name: {
            "1 % too small": scaled("value", 0.99),
            "the largest 1 % too small": largest_entry("value", 0.99),
            "half": scaled("value", 0.5),
            "G of the other sign and less": lambda a: replace(a, G=-a.G, value=0.99 * a.value),
            "not a number": scaled("value", np.nan),
        }
        for name in ("mu_upper_full", "mu_upper_mixed", "mu_upper_repeated")
    },
    **{
        name: {
            "1 % too large": scaled("value", 1.01),
            "twice as large": scaled("value", 2.0),
            "Delta 1 % smaller": scaled("Delta", 0.99),
            "Delta turned": lambda a: replace(a, Delta=-a.Delta),
        }
        for name in ("mu_lower_full", "mu_lower_mixed")
    },
    "hinf": CONTROLLERS
    | {
        "norm 1 % too small": scaled("norm", 0.99),
        "norm a constant": lambda a: replace(a, norm=0.02, gamma=0.02),
        "gain 10 % larger": controller(gain(1.1)),
    },
    "h2": CONTROLLERS
    | {
        "norm 1 % too small": scaled("norm", 0.99),
        "norm half": scaled("norm", 0.5),
        "least 1 % too large": scaled("least", 1.01),
        "gain 10 % larger": controller(gain(1.1)),
        "a direct term": controller(lambda K: control.ss(K.A, K.B, K.C, K.D + 0.1)),
    },
    "mixed_norms": CONTROLLERS
    | {
        "norm 1 % too small": scaled("norm", 0.99),
        "norm half": scaled("norm", 0.5),
        "limited norm 1 % too small": scaled("hinf_norm", 0.99),
        "bound below the norm": lambda a: replace(a, bound=0.9 * a.norm),
        "least 1 % above the norm": lambda a: replace(a, least=1.01 * a.norm),
        "gain 10 % larger": controller(gain(1.1)),
        "a direct term": controller(lambda K: control.ss(K.A, K.B, K.C, K.D + 0.1)),
    },
    "hinf_flexible": CONTROLLERS
    | {
        "norm 1 % too small": scaled("norm", 0.99),
        "norm half": scaled("norm", 0.5),
    },
    "mu_synthesis": CONTROLLERS
    | {
        "peak 1 % too small": scaled("upper", 0.99),
        "peak half": scaled("upper", 0.5),
        "peak a constant": lambda a: replace(a, upper=0.02, lower=0.01),
        "gain 30 % smaller": controller(gain(0.7)),
    },
    "mu_synthesis_target": CONTROLLERS
    | {
        "peak 1 % too small": scaled("upper", 0.99),
        "gain 30 % smaller": controller(gain(0.7)),
    },
    "fault_filter": CONTROLLERS
    | {
        "peaks 1 % too small": lambda a: replace(a, peaks=0.99 * a.peaks, stacked=0.99 * a.stacked),
        "peaks half": lambda a: replace(a, peaks=0.5 * a.peaks, stacked=0.5 * a.stacked),
        "stacked 1 % too small": scaled("stacked", 0.99),
        "one peak 1 % too small": lambda a: replace(
            a, peaks=a.peaks * np.array([[1.0, 1.0], [1.0, 0.99]])
        ),
    },
    "switching": {
        "one sample shorter": lambda a: replace(a, samples=a.samples - 1),
        "dwell 1": lambda a: replace(a, samples=1),
        "P negative": lambda a: replace(a, P=-a.P, samples=1),
        "P not symmetric": lambda a: replace(
            a, P=a.P + np.triu(np.ones(a.P.shape[-2:]), 1), samples=1
        ),
    },
    **{
        name: {
            "level 1 % too small": scaled("level", 0.99),
            "level half": scaled("level", 0.5),
            "gain of the other sign": scaled("K", -1.0),
            "gain 30 % larger": scaled("K", 1.3),
            "no gain": scaled("K", 0.0),
            "not a number": scaled("K", np.nan),
            "multiplier zero": scaled("multiplier", 0.0),
        }
        for name in ("record_decay", "record_h2", "record_hinf")
    },
    "response_fit": FITS
    | {
        "gain 10 % too large": lambda R: R.scaled(1.1),
        "unstable": mirrored,
        "not minimum phase": mirrored_zeros,
    },
    "magnitude_fit": {
        "unstable": mirrored,
        "not minimum phase": mirrored_zeros,
    },
    "magnitude_cover": {
        "1 % too low": lambda R: R.scaled(0.99),
        "half": lambda R: R.scaled(0.5),
        "unstable": mirrored,
        "not minimum phase": mirrored_zeros,
    },
    "matrix_sets": SETS,
    "matrix_traces": SETS | {"centre moved": shifted("centre", 0.1)},
    "matrix_cover": {
        "W_1 1 % too small": in_model("W_1", gain(0.99)),
        "W_2 half": in_model("W_2", gain(0.5)),
        "nominal 1 % too large": in_model("nominal", gain(1.01)),
        "nominal of the other sign": in_model("nominal", gain(-1.0)),
        "least sets smaller": lambda a: replace(a, least=scaled("left", 0.9)(a.least)),
    },
    "circle_cover": COVERS,
    "stadium_cover": COVERS
    | {
        "W_r 10 % too small": in_model("W_r", lambda R: R.scaled(0.9)),
        "W_r unstable": in_model("W_r", mirrored),
        "W_r of the other phase": in_model("W_r", mirrored_zeros),
    },
    "experiment_design": {
        "cost 1 % too small": scaled("worst", 0.99),
        "cost half": scaled("worst", 0.5),
        "1 % too much power": scaled("power", 1.01),
        "powers of the other sign": scaled("power", -1.0),
        "no power": scaled("power", 0.0),
        "a line without power": largest_entry("power", 0.0),
        "a negative power": largest_entry("power", -1.0),
        "not a number": scaled("power", np.nan),
        "powers of other lines": lambda a: replace(a, power=np.roll(a.power, 3)),
    },
    "crest_factor": {
        "not a number": lambda phases: phases * np.nan,
        "infinite": lambda phases: phases + np.inf,
    },
    "state_space_fit": {
        "simulator unstable": in_record_model("simulator", A=lambda A: 1.2 * A),
        "predictor unstable": in_record_model("predictor", A=lambda A: 1.2 * A),
    },
    "parameter_fit": {
        "gain 1 % off": lambda p: p * np.array([1.0, 1.0, 1.01]),
        "stiffness 1 % off": lambda p: p * np.array([1.01, 1.0, 1.0]),
        "damping doubled": lambda p: p * np.array([1.0, 2.0, 1.0]),
        "at the start": lambda p: np.array([20.0, 2.0, 1.0]),
    },
}
