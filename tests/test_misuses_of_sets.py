"""Wrong input to uncertain systems, their analysis and margins: each is told in words."""

import math

import control
import numpy as np
import pytest
from tables import each
from test_misuses import (
    LAG,
    NOT_A_COUNT,
    NOT_A_NUMBER,
    NOT_A_SYSTEM,
    NOT_AN_OBJECT,
    NOT_POSITIVE,
    SAMPLED,
)

from workbench.errors import WorkbenchError
from workbench.mu import (
    bundle_plot,
    loop_margins,
    margin_sensitivity,
    monte_carlo,
    robust_performance,
    robust_stability,
    skewed_peak,
    worst_case_gain,
)
from workbench.structure import Complex, Real, Structure
from workbench.uncertainty import (
    append,
    complex_scalar,
    delay,
    dynamics,
    feedback,
    interconnect,
    real,
    ss,
    tf,
)

A = real("a", 1, percent=20)
G = tf([1], [1, A])
NOT_A_NAME = ("", "1k", 3, None, "k 1")
NOT_A_SET = ("loop", None, object(), LAG, np.eye(2))
UNSTABLE = tf([1], [1, -1]) * A
STRUCTURE = Structure([Real(1, name="a"), Complex(1, name="f")])

# What is called, with arguments that are right, and what is wrong of each of them.
CALLS = {
    "real": (
        real,
        {"name": "k", "nominal": 10, "percent": 5},
        {
            "name": NOT_A_NAME,
            "nominal": (*NOT_A_NUMBER, math.inf, 0, None),
            "percent": NOT_POSITIVE,
            "plus_minus": (1.0,),
            "low": (9.0,),
        },
    ),
    "real, ends": (
        real,
        {"name": "k", "nominal": 10, "low": 9, "high": 12},
        {
            "low": (*NOT_A_NUMBER, 10, 11, -math.inf, None),
            "high": (*NOT_A_NUMBER, 10, 9, math.inf, None),
        },
    ),
    "complex_scalar": (
        complex_scalar,
        {"name": "c", "nominal": 1.0, "radius": 0.1},
        {"name": NOT_A_NAME, "nominal": (*NOT_A_NUMBER, None), "radius": NOT_POSITIVE},
    ),
    "dynamics": (
        dynamics,
        {"name": "d", "inputs": 1, "outputs": 1},
        {
            "name": NOT_A_NAME,
            "inputs": (*NOT_A_COUNT, 0),
            "outputs": (*NOT_A_COUNT, 0),
            "bound": ("W", -1.0, 0.0, None, np.eye(2), 1 / control.tf([1, -1], [1])),
        },
    ),
    "delay": (
        delay,
        {"name": "tau", "low": 0.0, "high": 1.0},
        {"name": NOT_A_NAME, "low": (*NOT_A_NUMBER, -1.0, 2.0), "high": (*NOT_A_NUMBER, 0.0)},
    ),
    "tf": (
        tf,
        {"num": [1], "den": [1, A]},
        {
            "num": ("1", None, [1, 2, 3], [None], [LAG]),
            "den": ("1", None, [0, 0], [None], [LAG], []),
        },
    ),
    "ss": (
        ss,
        {"A": [[A]], "B": [[1]], "C": [[1]], "D": [[0]]},
        {
            "A": ("A", None, [[A, 1]], [[None]], [[G]]),
            "B": ("B", None, [[1], [2]], [[1], [1, 2]]),
            "C": ("C", None, [[1, 2]]),
            "D": ("D", None, [[1, 2]]),
        },
    ),
    "feedback": (
        feedback,
        {"sys1": G},
        {
            "sys1": (*NOT_AN_OBJECT, append(G, G)[0, :]),
            "sys2": (*NOT_AN_OBJECT, np.eye(2), SAMPLED),
            "sign": (0, 2, "-", None, True),
        },
    ),
    "at": (
        G.at,
        {"a": 1.1},
        {"a": ("1", None, math.nan, math.inf, [1, 2]), "b": (1.0,)},
    ),
    "sample": (G.sample, {"count": 3}, {"count": (*NOT_A_COUNT, 0)}),
    "interconnect": (
        interconnect,
        {"syslist": [(G, "u", "y")], "connections": {}, "inputs": "u", "outputs": "y"},
        {
            "syslist": (None, 3, [], [G], [(G, "u")], [(G, "u", "u")], [(G, "w", "y")]),
            "connections": ([["G.u"]], 3, "u", {"e": 3}, {"e": "u *"}, {"y": "u"}, {"e": "x"}),
            "inputs": ([], "x", ["u", "u"], ["u", "w"]),
            "outputs": ("x", ["y", "x"]),
        },
    ),
    "robust_stability": (
        robust_stability,
        {"system": G},
        {"system": (*NOT_A_SET, UNSTABLE), "tolerance": NOT_POSITIVE},
    ),
    "robust_performance": (
        robust_performance,
        {"system": G},
        {"system": (*NOT_A_SET, UNSTABLE), "gain": NOT_POSITIVE, "tolerance": NOT_POSITIVE},
    ),
    "worst_case_gain": (
        worst_case_gain,
        {"system": G},
        {"system": ("loop", None, object(), LAG, UNSTABLE), "tolerance": NOT_POSITIVE},
    ),
    "margin_sensitivity": (
        margin_sensitivity,
        {"system": G},
        {
            "system": (*NOT_A_SET, UNSTABLE),
            "gain": (*NOT_A_NUMBER, 0.0, -1.0),
            "growth": NOT_POSITIVE,
            "tolerance": NOT_POSITIVE,
        },
    ),
    "skewed_peak": (
        skewed_peak,
        {"system": control.append(LAG, LAG), "structure": STRUCTURE, "fixed": "a"},
        {
            "system": (*NOT_AN_OBJECT, LAG),
            "structure": (None, "blocks", [Real(1)]),
            "fixed": ("b", 2, 1.5, ["a", "f"], None),
            "tolerance": NOT_POSITIVE,
        },
    ),
    "loop_margins": (
        loop_margins,
        {"plant": G, "controller": 1.0},
        {
            "plant": (*NOT_A_SYSTEM, None),
            "controller": (*NOT_A_SYSTEM, None, np.eye(2), SAMPLED),
            "skew": (*NOT_A_NUMBER, math.inf),
            "tolerance": NOT_POSITIVE,
            "parts": (*NOT_A_COUNT, 0),
            "time_limit": NOT_POSITIVE,
        },
    ),
    "monte_carlo": (
        monte_carlo,
        {"system": G, "quantity": lambda member: 1.0, "count": 2},
        {
            "system": NOT_A_SET,
            "quantity": ("norm", lambda member: None, lambda member: math.nan),
            "count": (*NOT_A_COUNT, 0),
            "seed": (1.5, "lucky", None),
            "confidence": (*NOT_POSITIVE, 1.0),
        },
    ),
    "bundle_plot": (
        bundle_plot,
        {"system": G, "samples": 2},
        {
            "system": NOT_A_SET,
            "kinds": ("bodes", [], 3, ["bode", "x"]),
            "samples": (*NOT_A_COUNT, 0),
        },
    ),
}
MISUSES = {
    f"{call}, {name}: {value!r} ({k})": (call, name, value)
    for call, (_, _, wrong) in CALLS.items()
    for name, values in wrong.items()
    for k, value in enumerate(values)
}


@each("misuse", MISUSES.values(), ids=MISUSES)
def test_misuses_of_sets_are_told(misuse):
    call, name, value = misuse
    function, right, _ = CALLS[call]
    with pytest.raises(WorkbenchError) as told:
        function(**{**right, name: value})
    assert 15 < len(str(told.value)) < 800


@pytest.mark.parametrize("other", ["K", None, object(), [[1, "a"]]])
@pytest.mark.parametrize(
    "operation", ["__add__", "__sub__", "__mul__", "__truediv__", "__matmul__"]
)
def test_arithmetic_with_what_is_no_system_is_told(operation, other):
    with pytest.raises(WorkbenchError):
        getattr(G, operation)(other)


def test_misuses_are_many():
    assert len(MISUSES) >= 300
