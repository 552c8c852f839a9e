"""Mutants of what computes: each makes an answer of a tight problem wrong on the unsound side."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import control
import numpy as np

Change = Callable[[Callable[..., Any]], Callable[..., Any]]
"""A function that makes a mutant of a function."""


@dataclass(frozen=True)
class Mutant:
    """A changed function, and the tight problem whose certificate must fail with it.

    ``place`` is the module below `workbench` and the function, or the class and its method.
    ``optimum``: the answer stays valid, and nothing may prove that it is the best one.
    """

    name: str
    place: str
    change: Change
    problem: str
    optimum: bool = False


def result(how: Callable[[Any], Any]) -> Change:
    """Changes what the function returns."""
    return lambda original: lambda *given, **named: how(original(*given, **named))


def given(how: Callable[..., tuple[Any, ...]]) -> Change:
    """Changes the positional arguments that the function gets."""
    return lambda original: lambda *old, **named: original(*how(*old), **named)


def times(factor: float) -> Change:
    return result(lambda value: factor * value)


def constant(value: float) -> Change:
    return result(lambda old: np.full_like(np.asarray(old, dtype=float), value)[()])


def field(name: str, factor: float) -> Change:
    """Multiplies a field of what the function returns; None stays None."""

    def change(found: Any) -> Any:
        return found and replace(found, **{name: factor * np.asarray(getattr(found, name))[()]})

    return result(change)


def entry(place: int, factor: float) -> Change:
    """Multiplies one of several values that the function returns."""
    return result(lambda found: tuple(factor * v if k == place else v for k, v in enumerate(found)))


def system(change: Callable[..., tuple[Any, ...]]) -> Change:
    """Changes the matrices of a StateSpace that the function returns."""
    return result(
        lambda old: control.StateSpace(
            *change(old.A, old.B, old.C, old.D), old.dt, remove_useless_states=False
        )
    )


def without_last_block(parts: tuple[Any, Any, Any]) -> tuple[Any, Any, Any]:
    """Multipliers that forget the last output."""
    D_left = np.array(parts[0])
    D_left[..., -1, -1] *= 0.25
    return D_left, parts[1], parts[2]


def K_times(factor: float) -> Change:
    """Closes the plant with a multiple of the controller."""
    return given(lambda plant, K: (plant, K if callable(K) and factor == 1 else factor * K))


BOUND, POINT = "certify.mu_bound:structured_bound", "certify.mu_bound:_products"
NORM, CLOSE = "certify.norms:certified_norm", "systems.generalised_plant:GeneralisedPlant.close"
PEAK = "mu.robust.performance:performance_peak"
PROVEN = "certify.singularity:proven_bound"
FULL, MIXED, REPEATED = "mu_upper_full", "mu_upper_mixed", "mu_upper_repeated"
FREE_RUN = "identification.innovations.model:InnovationsModel.free_run"
LOOP, FILTER = "mu_synthesis", "fault_filter"
SCALED, TARGET = "mu.frequency.scaled_peak:scaled_peak", "mu_synthesis_target"

MUTANTS = [
    # --- the bound at one frequency -----------------------------------------------------------
    *(
        Mutant(f"bound of {problem} times {factor}", BOUND, times(factor), problem)
        for factor in (0.5, 0.9, 0.99)
        for problem in (FULL, MIXED, REPEATED)
    ),
    Mutant("bound a constant", BOUND, constant(0.02), FULL),
    Mutant("bound of the next matrix", BOUND, result(lambda v: np.roll(v, 1)), FULL),
    Mutant("bound the least of the batch", BOUND, result(lambda v: 0 * v + v.min()), FULL),
    Mutant("conjugation forgotten", POINT, given(lambda X, Y, D: (X.real + 0j, Y, D)), FULL),
    Mutant("D forgotten in part", POINT, given(lambda X, Y, D: (X, Y, 0.9 * D)), REPEATED),
    Mutant("M a little smaller", POINT, given(lambda X, Y, D: (0.99 * X, Y, D)), FULL),
    Mutant(
        "largest eigenvalue too small",
        "certify.mu_bound:_largest",
        result(lambda r: (r[0], 0.97 * r[1], r[2])),
        FULL,
    ),
    Mutant("a block dropped", "certify.mu_bound:structured", result(without_last_block), FULL),
    Mutant(
        "D of one side smaller",
        "certify.mu_bound:structured",
        result(lambda p: (0.9 * p[0], p[1], p[2])),
        REPEATED,
    ),
    # --- lower bounds ---------------------------------------------------------------------------
    *(
        Mutant(f"lower bound of {problem} times {factor}", PROVEN, times(factor), problem)
        for factor in (1.01, 1.5, 10.0)
        for problem in (FULL, MIXED, REPEATED)
    ),
    # --- norms and peaks ------------------------------------------------------------------------
    *(
        Mutant(f"norm of {problem} times {factor}", NORM, times(factor), problem)
        for factor in (0.5, 0.99)
        for problem in ("hinf", "hinf_flexible")
    ),
    Mutant("norm a constant", NORM, constant(0.02), "hinf_flexible"),
    *(
        Mutant(f"{name} of {problem} times 0.98", place, field(part, 0.98), problem)
        for name, place, part in (
            ("residues", "certify.modes.partial_fractions:enclosed_fractions", "out"),
            ("polynomials", "certify.modes.power_series:polynomials", "terms"),
        )
        for problem in ("hinf", "hinf_flexible")
    ),
    *(
        Mutant(f"peak times {factor}", PEAK, field("upper", factor), LOOP)
        for factor in (0.5, 0.9, 0.99)
    ),
    Mutant("lower bound of the peak too large", PEAK, field("lower", 1.01), LOOP),
    Mutant(
        "peak a constant",
        PEAK,
        result(lambda p: p and replace(p, upper=0.02, lower=0.01)),
        LOOP,
    ),
    Mutant("no interval left", PEAK, result(lambda p: p and replace(p, intervals=())), LOOP),
    Mutant(
        "first interval lost",
        PEAK,
        result(lambda p: p and replace(p, intervals=p.intervals[1:])),
        LOOP,
    ),
    Mutant(
        "last interval lost",
        PEAK,
        result(lambda p: p and replace(p, intervals=p.intervals[:-1])),
        LOOP,
    ),
    *(
        Mutant(f"peak proven by scalings times {factor}", SCALED, field("upper", factor), TARGET)
        for factor in (0.5, 0.99)
    ),
    Mutant("lower bound of that peak too large", SCALED, field("lower", 1.01), TARGET),
    Mutant(
        "scalings lost",
        SCALED,
        result(lambda p: p and replace(p, scalings=None)),
        TARGET,
    ),
    Mutant(
        "scalings of twice the gain",
        SCALED,
        result(lambda p: p and replace(p, scalings=replace(p.scalings, gain=2 * p.scalings.gain))),
        TARGET,
    ),
    Mutant(
        "scalings upside down",
        SCALED,
        result(
            lambda p: (
                p
                and replace(
                    p,
                    scalings=replace(
                        p.scalings,
                        numerators=p.scalings.denominators,
                        denominators=p.scalings.numerators,
                    ),
                )
            )
        ),
        TARGET,
    ),
    # --- responses and loops ----------------------------------------------------------------------
    *(
        Mutant(f"loop of {problem} with {factor} K", CLOSE, K_times(factor), problem)
        for factor, problem in ((-1.0, "hinf"), (-1.0, "hinf_flexible"))
    ),
    Mutant(f"loop of {LOOP} with -K", CLOSE, K_times(-1.0), LOOP),
    Mutant("outputs half", CLOSE, system(lambda A, B, C, D: (A, B, C / 2, D / 2)), "hinf"),
    Mutant("inputs half", CLOSE, system(lambda A, B, C, D: (A, B / 2, C, D / 2)), "hinf_flexible"),
    Mutant("loop's inputs half", CLOSE, system(lambda A, B, C, D: (A, B / 2, C, D / 2)), LOOP),
    Mutant(
        "poles moved to the left",
        CLOSE,
        system(lambda A, B, C, D: (A - 5 * np.eye(len(A)), B, C, D)),
        "hinf_flexible",
    ),
    # --- filters and switching -----------------------------------------------------------------
    *(
        Mutant(
            f"peak of a filter times {factor}",
            "diagnosis.estimation.program:FaultEstimation.certified_peak",
            field("upper", factor),
            FILTER,
        )
        for factor in (0.5, 0.99)
    ),
    # --- shapes, fits and covers ----------------------------------------------------------------
    *(
        Mutant(
            f"radius of a circle times {factor}",
            "geometry.exact_circle:exact_circle",
            result(
                lambda found, factor=factor: (
                    (found[0], factor * found[1])
                    if isinstance(found, tuple)
                    else replace(found, radius=factor * found.radius)
                )
            ),
            "circle",
        )
        for factor in (0.5, 0.99)
    ),
    *(
        Mutant(
            f"{name} of a stadium times {factor}",
            "geometry.exact_stadium:exact_stadium",
            entry(place, factor),
            "stadium",
        )
        for place, name, factor in (
            (0, "centre", 1.02),
            (1, "radius", 0.99),
            (2, "half-length", 0.9),
            (3, "angle", 1.2),
        )
    ),
    Mutant(
        "centre of a circle times 1.02",
        "geometry.exact_circle:exact_circle",
        entry(0, 1.02),
        "circle",
    ),
    Mutant("simulation smaller", FREE_RUN, times(0.9), "state_space_fit"),
    Mutant(
        "half the peak of a multisine",
        "identification.experiments.crest_factor:CrestFactor.peak",
        result(lambda found: (found[0], 0.5 * found[1])),
        "crest_factor",
    ),
    Mutant(
        "one sample late",
        FREE_RUN,
        result(lambda y: np.roll(y, 1, axis=0)),
        "state_space_fit",
    ),
    Mutant(
        "responses of a fit smaller",
        "fitting.rational:Rational.response",
        times(1.01),
        "magnitude_cover",
    ),
    Mutant(
        "weights of a cover smaller",
        "uncertainty.covers.weights:complex_weight",
        result(lambda W: W.scaled(0.9)),
        "circle_cover",
    ),
    Mutant(
        "sets of matrices smaller",
        "uncertainty.matrix_covers.sets.newton:finished",
        field("left", 0.99),
        "matrix_sets",
    ),
    Mutant(
        "sets of matrices of the next frequency",
        "uncertainty.matrix_covers.sets.newton:finished",
        result(lambda f: replace(f, left=np.roll(f.left, 1, axis=0))),
        "matrix_traces",
    ),
    Mutant(
        "multipliers forgotten",
        "uncertainty.matrix_covers.sets.multipliers:with_balanced_multipliers",
        field("weights", 0.0),
        "matrix_sets",
        optimum=True,
    ),
    Mutant(
        "deviations larger",
        "uncertainty.matrix_covers.sets.program:FoundSets.deltas",
        times(1.01),
        "matrix_sets",
        optimum=True,
    ),
    Mutant(
        "the place of a Delta of a matrix cover",
        "uncertainty.matrix_covers.model:interconnection",
        system(lambda A, B, C, D: (A, B, -C, -D)),
        "matrix_cover",
    ),
    Mutant(
        "a matrix cover misses its plants",
        "uncertainty.matrix_covers.methods:_need",
        times(0.9),
        "matrix_cover",
    ),
]


def applied(mutant: Mutant, monkeypatch: Any) -> None:
    """Put the mutant in the place of the original, wherever it was imported."""
    module, _, attribute = mutant.place.partition(":")
    owner: Any = importlib.import_module(f"workbench.{module}")
    *classes, name = attribute.split(".")
    for part in classes:
        owner = getattr(owner, part)
    original = getattr(owner, name)
    changed = mutant.change(original)
    monkeypatch.setattr(owner, name, changed)
    if classes:
        return
    for loaded in list(sys.modules.values()):
        if getattr(loaded, "__name__", "").startswith("workbench"):
            for key, value in list(vars(loaded).items()):
                if value is original:
                    monkeypatch.setattr(loaded, key, changed)
