"""Public functions and Programs with arguments that are right, for calls with wrong ones."""

import control
import numpy as np
from scipy import stats
from test_misuses import JOINTS, LAG, LOOP, OMEGA, PLANTS, STRUCTURE, VALUES
from test_misuses_of_sets import CALLS

import workbench as wb
from workbench.conic import ConeFactor, ConeKind, ConicForm, ConicProgram
from workbench.fitting import fit_magnitude, fit_response
from workbench.geometry import NarrowestStadium, SmallestAreaStadium, SmallestCircle
from workbench.mu import (
    bound_gradient,
    bound_sensitivity,
    branch_and_bound,
    complex_part_added,
    coprime_margin,
    destabilising_perturbation,
    disk_gain,
    disk_phase,
    frequency_sweep,
    guaranteed_probability,
    loop_margins,
    lower_bound,
    nu_gap,
    peak,
    performance_peak,
    rank_one_mu,
    skew_bounds,
    upper_bound,
)
from workbench.synthesis import Mode, SwitchedStability, gap_metric
from workbench.systems import bandwidths, modulus_margin
from workbench.uncertainty import (
    MatrixResponses,
    UncertaintyModel,
    contains,
    real,
    tf,
    widened_responses,
)

A = real("a", 1, percent=20)
G = tf([1], [1, A])
PAIR = control.append(LAG, LAG)
FALLING = np.array([[0.5, 0.1], [0.0, 0.4]])
MODES = (Mode("a", FALLING, shortest_samples=None), Mode("b", FALLING.T))
MODEL = UncertaintyModel(LAG, control.tf([0.3], [1]))
POINTS = np.array([0, 1, 1j])
MATRIX = np.array([[1.0, 0.5], [0.2, 1.0]])
FORM = ConicForm([1.0], [[-1.0]], [-3.0], [ConeFactor(ConeKind.NONNEGATIVE, 1)])
BOUND = upper_bound(MATRIX, STRUCTURE)
PEAK = peak(PAIR, STRUCTURE)

MORE = {
    "smallest_circle": (wb.smallest_circle, {"points": POINTS}),
    "narrowest_stadium": (wb.narrowest_stadium, {"points": POINTS}),
    "smallest_area_stadium": (wb.smallest_area_stadium, {"points": POINTS}),
    "SmallestCircle": (SmallestCircle, {"points": POINTS}),
    "NarrowestStadium": (NarrowestStadium, {"points": POINTS}),
    "SmallestAreaStadium": (SmallestAreaStadium, {"points": POINTS}),
    "lower_bound": (lower_bound, {"M": MATRIX, "structure": STRUCTURE, "method": "best"}),
    "gradient": (bound_gradient, {"M": MATRIX, "structure": STRUCTURE, "bound": BOUND}),
    "rank_one_mu": (rank_one_mu, {"real": np.ones((3, 1), complex), "others": np.ones(3)}),
    "frequency_sweep": (
        frequency_sweep,
        {"system": PAIR, "structure": STRUCTURE, "omega": OMEGA},
    ),
    "skew_bounds": (skew_bounds, {"M": MATRIX, "structure": STRUCTURE, "fixed": [0]}),
    "peak, more": (
        peak,
        {
            "system": PAIR,
            "structure": STRUCTURE,
            "width": 0.01,
            "complex_part": 0.1,
            "band": (0.1, 10.0),
            "steps": 20,
        },
    ),
    "performance_peak": (performance_peak, {"plant": LOOP, "controller": 0.1}),
    "destabilising": (
        destabilising_perturbation,
        {"peak": PEAK, "system": PAIR, "structure": STRUCTURE},
    ),
    "with_complex_part": (
        complex_part_added,
        {"system": PAIR, "structure": STRUCTURE, "complex_part": 0.1},
    ),
    "branch_and_bound": (
        branch_and_bound,
        {"M": MATRIX, "structure": STRUCTURE, "tolerance": 0.1, "nodes": 10},
    ),
    "sensitivity": (bound_sensitivity, {"M": MATRIX, "structure": STRUCTURE}),
    "disk_gain": (disk_gain, {"alpha": 0.5, "skew": 0.0}),
    "disk_phase": (disk_phase, {"alpha": 0.5, "skew": 0.0}),
    "nu_gap": (nu_gap, {"first": LAG, "second": LAG * 2, "tolerance": 0.01}),
    "coprime_margin": (coprime_margin, {"plant": LAG, "controller": 1.0, "tolerance": 0.01}),
    "gap_metric": (gap_metric, {"first": LAG, "second": LAG * 2}),
    "set_margins": (
        loop_margins,
        {"plant": G, "controller": 1.0, "tolerance": 0.1, "parts": 10},
    ),
    "guaranteed_probability": (
        guaranteed_probability,
        {
            "system": G,
            "gain": 1.1,
            "distributions": {"a": stats.norm(1, 1)},
            "tolerance": 0.1,
            "parts": 5,
        },
    ),
    "contains": (contains, {"model": MODEL, "responses": PLANTS, "leave_out": 0}),
    "widened": (widened_responses, {"responses": PLANTS, "content": 0.95}),
    "MatrixResponses": (
        MatrixResponses,
        {"omega": OMEGA, "values": VALUES[:, :, None, None]},
    ),
    "Mode": (
        Mode,
        {"name": "a", "A": FALLING, "shortest_samples": 1, "longest_samples": 3, "rate": None},
    ),
    "SwitchedStability": (SwitchedStability, {"modes": MODES, "limit_samples": 20}),
    "ConicProgram": (
        ConicProgram,
        {"form": FORM, "constant": 0.0, "maximise": False},
    ),
    "ConicForm": (
        ConicForm,
        {"c": [1.0], "A": [[-1.0]], "b": [-3.0], "cones": list(FORM.cones)},
    ),
    "ConeFactor": (ConeFactor, {"kind": ConeKind.NONNEGATIVE, "size": 1}),
    "fit_magnitude": (
        fit_magnitude,
        {"omega": OMEGA, "magnitude": np.abs(VALUES[:, 0]), "order": 1},
    ),
    "fit_response": (fit_response, {"omega": OMEGA, "response": VALUES[:, 0], "order": 1}),
    "bandwidths": (bandwidths, {"loop": LAG}),
    "modulus_margin": (modulus_margin, {"L": VALUES[:, 0]}),
    "solve": (wb.solve, {"task": SmallestCircle(POINTS), "method": None}),
    "run": (wb.run, {"name": "no/such/problem", "method": None}),
    "load": (wb.load, {"name": "no/such/problem"}),
    "open_run": (wb.open_run, {"path": "no-such-folder"}),
    "verify": (wb.verify, {"path": "no-such-folder"}),
}
DRAWING = ("bundle_plot",)
"""Slow, and about figures."""

FUNCTIONS = {
    name: (function, right)
    for name, (function, right, *_) in {**JOINTS, **CALLS, **MORE}.items()
    if name not in DRAWING and "{records}" not in repr(right)
}
SOLVED = (SmallestCircle, NarrowestStadium, SmallestAreaStadium, SwitchedStability, ConicProgram)
"""Programs that are solved too, because they are small."""
