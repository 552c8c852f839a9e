"""A Study's declarations: what they store, check, count and show, and what they refuse."""

from __future__ import annotations

from dataclasses import dataclass

import control
import numpy as np
import pytest

from workbench import Check, solve
from workbench.errors import InputError
from workbench.executor import Context
from workbench.solvers import Options
from workbench.study import (
    Study,
    array,
    arrays,
    check,
    dim,
    figure,
    lines,
    metric,
    part,
    system,
    table,
    variables,
)

LAGS = {"slow lag": 1.0, "fast lag": 10.0}


@dataclass(frozen=True)
class Lags(Study):
    """Two lags over frequency."""

    points: int = 5
    measured: bool = False

    headline = "bandwidth_slow_lag"

    lag = dim(LAGS)
    end = dim("low", "high")

    @dim(unit="rad/s")
    def omega(self):
        """frequency"""
        return np.geomspace(0.1, 100.0, self.points)

    @part
    def calls(self):
        """A counter, made once."""
        return []

    @system(lag)
    def plant(self, calls):
        calls.append(1)
        return {name: control.ss(-corner, corner, 1.0, 0.0) for name, corner in LAGS.items()}

    nominal = system(lambda: control.ss(-1.0, 1.0, 1.0, 0.0))
    corner = array(dims=lag, unit="rad/s", meaning="corner", value=lambda: LAGS)
    unit = array(dims=lag, value=lambda: ["1", "1"], coordinate=True)

    @array(dims=(lag, omega), unit="1")
    def size(self, plant, omega):
        """magnitude of the response."""
        return [abs(one(1j * omega.values)) for one in plant.values()]

    band = arrays(
        (lag, end),
        lambda corner: _bands(corner),
        half=("rad/s", "half and whole corner"),
        twice="rad/s",
        absent="1",
    )
    poles = array(dims="poles", unit="rad/s", value=lambda: [-1.0, -10.0])
    missing = array(dims=lag, unit="1", value=lambda self: np.ones(2) if self.measured else None)

    @variables
    def own(self, poles):
        """Whatever a function gives."""
        return {"own_poles": (("pole",), poles.values[::-1], {"units": "rad/s"})}

    @check(title="{lag}", at_most=1.0, each="lag", where="near {omega}")
    def passes(self, size):
        """magnitude nowhere above 1"""
        return size

    below = check(
        title="corner",
        statement="largest",
        value=lambda corner: corner,
        at_most=lambda self: 2.0 * self.points,
    )
    apart = check(
        title="{lag} alone",
        statement="corner",
        value=lambda corner: corner,
        each="lag",
        at_most=LAGS,
    )
    kept = check(
        title="", statement="sum of the measured", value=lambda missing: missing, at_most=3.0
    )
    by_hand = check(value=lambda corner: [Check("by hand", "corner", float(corner.max()), 10.0)])

    bandwidth = metric(lambda corner: corner)
    static = metric("static_gain", value=lambda size: size.max())
    two = metric(lambda size: {"first": size[0, 0], "second": size[1, 0]})

    summary = table(rows=lag, corner="{:.1f}", half="{:.2f}")

    @table
    def by_name(self, size):
        return ["lag", "least"], [[str(n), float(v.min())] for n, v in zip(LAGS, size, strict=True)]

    magnitude = lines("size", x="omega", each="lag", limit=0.707, title="two lags")

    @figure
    def nothing(self, missing):
        return missing


def _bands(corner):
    pairs = np.stack([corner.values / 2, corner.values], axis=1)
    return {"half": pairs, "twice": 4 * pairs}


@pytest.fixture
def answer():
    return Lags().compute(Context(options=Options()))


def test_arrays_are_stored_with_dims_units_and_meaning(answer):
    assert answer["size"].dims == ("lag", "omega")
    assert answer["size"].attrs == {"units": "1", "long_name": "magnitude of the response"}
    assert answer["half"].attrs == {"units": "rad/s", "long_name": "half and whole corner"}
    assert answer["omega"].attrs == {"units": "rad/s", "long_name": "frequency"}
    assert answer["lag"].values.tolist() == list(LAGS) and "unit" in answer.coords
    assert np.array_equal(answer["corner"], [1.0, 10.0])
    assert answer["poles"].dims == ("poles",) and answer["poles"].attrs == {"units": "rad/s"}
    assert "absent" not in answer and "missing" not in answer and "calls" not in answer


def test_arrays_of_names_that_a_function_gives(answer):
    assert answer["own_poles"].dims == ("pole",)
    assert answer["own_poles"].values.tolist() == [-10.0, -1.0]


def test_what_is_needed_twice_is_computed_once(answer):
    np.testing.assert_allclose(answer["size"][:, 0], 1 / np.hypot(1, [0.1, 0.01]))


def test_systems_come_back(answer):
    plants = Lags().plant(answer)
    assert list(plants) == list(LAGS)
    np.testing.assert_allclose(plants["fast lag"].A, [[-10.0]])
    np.testing.assert_allclose(Lags().nominal(answer).B, [[1.0]])


def test_checks_name_the_place_of_the_worst(answer):
    checks = {one.name: one for one in Lags().checks(answer, 1e-6)}
    assert list(checks) == [
        "slow lag", "fast lag", "corner", "slow lag alone", "fast lag alone", "by hand"
    ]  # fmt: skip
    assert checks["fast lag"].where == "near 0.1 rad/s" and checks["fast lag"].holds
    assert checks["fast lag"].statement == "magnitude nowhere above 1"
    assert (checks["corner"].value, checks["corner"].limit) == (10.0, 10.0)
    assert (checks["slow lag alone"].limit, checks["fast lag alone"].limit) == (1.0, 10.0)
    assert checks["corner"].where == "at lag fast lag"


def test_a_worst_value_that_is_no_number_fails(answer):
    answer["size"][1, 2] = np.nan
    found = Lags().checks(answer, 1e-6)[1]
    assert not found.holds and np.isnan(found.value)


def test_numbers_of_single_precision_are_widened_before_they_are_used(answer):
    """Their sums and moduli would be of single precision, and differ between processors."""
    narrow = answer.assign(size=answer["size"].astype(np.float32))
    get = Lags()._getter(narrow)
    assert get("size").dtype == get("answer")["size"].dtype == float
    assert narrow["size"].dtype == np.float32  # what is stored stays narrow


def test_metrics_by_label_template_and_name(answer):
    numbers = Lags().metrics(answer)
    assert list(numbers) == [
        "bandwidth_slow_lag",
        "bandwidth_fast_lag",
        "static_gain",
        "first",
        "second",
    ]
    assert numbers["bandwidth_fast_lag"] == 10.0


def test_tables_and_figures_are_made_from_what_is_stored(answer):
    made = Lags().tables(answer)
    assert list(made) == ["summary", "by-name"]
    assert made["summary"].splitlines()[0].split("|")[1:-1] == [
        " lag      ", " corner [rad/s] ", " half low [rad/s] ", " half high [rad/s] "
    ]  # fmt: skip
    assert made["summary"].splitlines()[1].count(":") == 3
    drawn = Lags().figures(answer)
    assert list(drawn) == ["magnitude"]
    (panel,) = drawn["magnitude"].axes
    assert panel.get_xlabel() == "frequency [rad/s]" and panel.get_xscale() == "log"
    assert panel.get_ylabel() == "magnitude of the response" and len(panel.lines) == 3


def test_a_study_is_solved_and_certified():
    found = solve(Lags(points=7))
    assert found.certificate.holds and found.answer.sizes["omega"] == 7
    assert "missing" in solve(Lags(measured=True)).answer


def broken(**names):
    return dataclass(frozen=True)(type("Broken", (Study,), names))()


@pytest.mark.parametrize(
    ("names", "message"),
    [
        ({"x": array(dims=(), value=lambda y: y)}, "declares no 'y'; there are context, x"),
        (
            {"x": array(dims=(), value=lambda y: y), "y": array(dims=(), value=lambda x: x)},
            "x -> y -> x need each other",
        ),
        (
            {"a": dim("p", "q"), "x": array(dims="a", value=lambda: [1.0, 2.0, 3.0])},
            r"array 'x' has shape \(3,\); its dims \(a\) have sizes \(2,\)",
        ),
        (
            {"m": metric(lambda x: x), "x": array(dims=(), value=lambda m: m)},
            "no array may need it",
        ),
    ],
)
def test_what_cannot_be_computed_is_named(names, message):
    with pytest.raises(InputError, match=message):
        broken(**names).compute(Context(options=Options()))


def test_views_see_stored_arrays_alone(answer):
    study = broken(p=part(lambda: 1), m=metric(lambda p: p))
    with pytest.raises(InputError, match="stores no 'p'"):
        study.metrics(study.compute(Context(options=Options())))
    with pytest.raises(InputError, match="needs at_most"):
        broken(c=check(value=lambda: 1.0)).checks(answer, 1e-6)


def test_a_declaration_that_hides_what_a_study_has_is_refused():
    with pytest.raises(InputError, match="Hiding declares 'judging_tolerance', which a Study has"):

        class Hiding(Study):
            judging_tolerance = array(dims=(), value=lambda: 1.0)
