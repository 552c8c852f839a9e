"""Covers of random families: what is certified covers, by state-space responses of the model."""

from dataclasses import replace
from functools import cache

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lanes import examples, thinned

import workbench as wb
from workbench.bench.formats import netcdf
from workbench.errors import InputError
from workbench.fitting.rational import Rational
from workbench.uncertainty import (
    CircleCover,
    CoverSteps,
    Responses,
    StadiumCover,
    UncertaintyModel,
    limited_orientation,
    narrowest_angles,
)

OMEGA = np.geomspace(1, 1000, 14)
KINDS = {"circle": CircleCover, "stadium": StadiumCover}
FORMS = ["multiplicative", "additive"]
METHODS = ["steps", "joint"]
SLOW_ADDITIVE = ["multiplicative", pytest.param("additive", marks=pytest.mark.slow)]
"""Forms of tests by the joint method, whose additive covers take as long again."""
NOMINAL = Rational([], [-1.5 + 30j, -1.5 - 30j], 900.0)


def family(seed, count=6, spread=0.2, omega=OMEGA):
    """Second-order plants of random frequency, damping and gain."""
    rng = np.random.default_rng(seed)
    level, damping, gain = 1 + spread * rng.uniform(-1, 1, (3, count))
    s = 1j * omega[:, None]
    return 900 * gain * level**2 / (s**2 + 3 * damping * level * s + 900 * level**2)


def program_of(kind, responses, **keywords):
    """A cover of low orders, which is quick."""
    orders = {"order": 2, "zeros": 0, "complex_order": 2}
    if kind == "stadium":
        orders["real_order"] = 1
    return KINDS[kind](responses, **(orders | keywords))


@cache
def solved(kind, form, method):
    program = program_of(kind, Responses(omega=OMEGA, values=family(1)), form=form)
    return program, wb.solve(program, method=method)


def response(system, omega):
    """Response of a state-space model, by itself."""
    eye = np.eye(system.nstates)
    return np.array([
        (system.C @ np.linalg.solve(1j * w * eye - system.A, system.B) + system.D)[0, 0]
        for w in omega
    ])  # fmt: skip


def outside(model, responses, slack=1e-6):
    """How many plants (F,) are outside their set, by a fine sampling of its segment."""
    systems = model.systems()
    parts = {name: response(system, responses.omega) for name, system in systems.items()}
    g = parts["G"]
    unit = g if model.form == "multiplicative" else np.ones_like(g)
    end = unit * parts.get("W_r", np.zeros_like(g))
    away = responses.values - g[:, None]
    along = np.clip((away / np.where(end == 0, 1, end)[:, None]).real, -1, 1)
    distance = np.abs(away - along * end[:, None])
    scale = np.abs(responses.values).max(axis=1, keepdims=True)
    beyond = distance > np.abs(unit * parts["W_c"])[:, None] * (1 + slack) + 1e-10 * scale
    return (beyond & responses.present).sum(axis=1)


def is_left(roots):
    return bool(np.all(np.real(roots) < 0))


def assert_covers(program, solution, leave_out=0):
    assert solution.certificate is not None, solution.message
    assert solution.certificate.failures == ()
    model = solution.answer.model
    assert np.all(outside(model, program.responses) <= leave_out)
    for name, system in model.systems().items():
        assert is_left(system.poles()), name
    assert is_left(model.W_c.zeros)
    assert model.nominal.order <= program.order or program.nominal is not None
    assert model.W_c.order <= program.complex_order
    if program.nominal is None:
        assert model.nominal.zeros.size <= program.zeros
    if isinstance(program, StadiumCover):
        assert model.W_r.order <= program.real_order
    assert model.form == program.form
    assert np.isfinite(list(program.metrics(solution.answer).values())).all()


# --- random families ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("method", "form"),
    [
        *(("steps", form) for form in FORMS),
        ("joint", "multiplicative"),
        pytest.param("joint", "additive", marks=pytest.mark.slow),
    ],
)
@pytest.mark.parametrize("kind", KINDS)
def test_a_family_is_covered(kind, method, form):
    program, solution = solved(kind, form, method)
    assert_covers(program, solution)


@examples(2, 4)
@given(
    st.integers(0, 10_000),
    st.integers(2, 40),
    st.sampled_from(list(KINDS)),
    st.sampled_from(METHODS),
    st.sampled_from(FORMS),
    st.floats(0.01, 0.4),
)
def test_random_families_are_covered(seed, count, kind, method, form, spread):
    responses = Responses(omega=OMEGA, values=family(seed, count, spread))
    program = program_of(kind, responses, form=form)
    assert_covers(program, wb.solve(program, method=method))


def mean_square(program, answer):
    """Mean over log frequency of radius^2, and of a tenth of half-length^2, by brute force."""
    omega = program.responses.omega
    logs = np.log(omega)
    middle = (logs[1:] + logs[:-1]) / 2
    edges = np.concatenate([[(3 * logs[0] - logs[1]) / 2], middle, [(3 * logs[-1] - logs[-2]) / 2]])
    shares = np.diff(edges)
    # at both ends the half interval outside does not count
    shares[[0, -1]] = logs[1] - logs[0], logs[-1] - logs[-2]
    systems = answer.model.systems()
    g = response(systems["G"], omega)[:, None]
    away = program.responses.values - g
    if program.form == "multiplicative":
        away = away / g
    end = response(systems["W_r"], omega)[:, None] if "W_r" in systems else np.zeros((len(g), 1))
    along = np.clip((away / np.where(end == 0, 1, end)).real, -1, 1)
    radius = np.abs(away - along * end).max(axis=1)
    return (shares @ (radius**2 + 0.1 * np.abs(end[:, 0]) ** 2)) / shares.sum()


@pytest.mark.parametrize("form", SLOW_ADDITIVE)
@pytest.mark.parametrize("kind", KINDS)
def test_joint_is_never_worse_than_steps(kind, form):
    sizes = [mean_square(p, s.answer) for p, s in (solved(kind, form, m) for m in METHODS)]
    assert sizes[1] <= sizes[0] * (1 + 1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_joint_is_never_worse_than_steps_for_others(seed):
    program = program_of("circle", Responses(omega=OMEGA, values=family(seed + 20, 4, 0.4)))
    sizes = [mean_square(program, wb.solve(program, method=method).answer) for method in METHODS]
    assert sizes[1] <= sizes[0] * (1 + 1e-4)


@pytest.mark.parametrize("order", [0, 1, 3, 6])
def test_orders(order):
    program = program_of(
        "circle", Responses(omega=OMEGA, values=family(2)), order=order, zeros=None
    )
    assert program.zeros == order
    assert_covers(program, wb.solve(program, method="steps"))


def test_a_constant_nominal():
    program = program_of("circle", Responses(omega=OMEGA, values=family(36, 12, 0.17)), order=0)
    solution = wb.solve(program, method="joint")
    assert_covers(program, solution)


@pytest.mark.parametrize("seed", [9, 17])
def test_realisations_are_stable_too(seed):
    """Real weights whose fit would be an integrator."""
    program = program_of(
        "stadium", Responses(omega=OMEGA, values=family(seed, 13, 0.12)), real_order=2
    )
    solution = wb.solve(program, method="steps")
    assert_covers(program, solution)
    assert np.abs(solution.answer.model.W_r.poles).min() >= 1e-5 * OMEGA[0]


def test_few_frequencies_and_two_plants():
    omega = np.geomspace(3, 300, 10)
    program = program_of(
        "stadium", Responses(omega=omega, values=family(3, 2, omega=omega)), complex_order=3
    )
    assert_covers(program, wb.solve(program, method="steps"))


def test_constant_weights():
    program = program_of(
        "stadium", Responses(omega=OMEGA, values=family(4)), complex_order=0, real_order=0
    )
    assert_covers(program, wb.solve(program, method="steps"))


def test_many_plants():
    omega = np.geomspace(1, 1000, 50)
    program = program_of("stadium", Responses(omega=omega, values=family(5, 1000, omega=omega)))
    assert_covers(program, wb.solve(program, method="steps"))


# --- what may be asked for ------------------------------------------------------------------------


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("kind", KINDS)
def test_a_given_nominal_stays(kind, method):
    given_nominal = NOMINAL.state_space()
    program = program_of(kind, Responses(omega=OMEGA, values=family(6)), nominal=given_nominal)
    solution = wb.solve(program, method=method)
    assert_covers(program, solution)
    found = response(solution.answer.model.systems()["G"], OMEGA)
    np.testing.assert_allclose(found, response(given_nominal, OMEGA), rtol=1e-8)


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_left_out(kind):
    values = family(7, 7)
    values[::3, 2] *= 3 + 2j
    responses = Responses(omega=OMEGA, values=values)
    program = program_of(kind, responses, leave_out=1)
    solution = wb.solve(program, method="steps")
    assert_covers(program, solution, leave_out=1)
    assert "but the 1 worst" in solution.certificate.checks[0].statement
    strict = program_of(kind, responses)
    certificate = strict.certify(solution.answer, 1e-6)
    assert not certificate.valid
    assert any(failure.startswith("containment") for failure in certificate.failures)


def test_equal_plants_and_one_left_out():
    """Two plants of the same response, farthest out: leaving out one does not rid us of both."""
    values = family(8, 5)
    values = np.column_stack([values, 2 * values[:, 0], 2 * values[:, 0]])
    program = program_of("circle", Responses(omega=OMEGA, values=values), leave_out=1)
    assert_covers(program, wb.solve(program, method="steps"), leave_out=1)


@pytest.mark.parametrize("kind", KINDS)
def test_missing_data(kind):
    values = family(9, 6)
    present = np.random.default_rng(9).random(values.shape) > 0.3
    present[:, 1:3] = True
    full = Responses(omega=OMEGA, values=np.where(present, values, np.nan), present=present)
    program = program_of(kind, full)
    solution = wb.solve(program, method="steps")
    assert_covers(program, solution)
    data = program.to_dataset(solution.answer)
    assert np.array_equal(data["present"].values, present)
    assert np.all(data["response"].values[~present] == 0)


@pytest.mark.parametrize("method", METHODS)
def test_minimum_phase(method):
    program = program_of("stadium", Responses(omega=OMEGA, values=family(10)), minimum_phase=True)
    solution = wb.solve(program, method=method)
    assert_covers(program, solution)
    assert is_left(solution.answer.model.W_r.zeros)
    assert "W_r minimum phase" in [check.name for check in solution.certificate.checks]


@pytest.mark.parametrize("orientation", [narrowest_angles, limited_orientation()])
def test_orientations(orientation):
    program = program_of(
        "stadium", Responses(omega=OMEGA, values=family(11)), orientation=orientation
    )
    assert_covers(program, wb.solve(program, method="steps"))


# --- families without width -----------------------------------------------------------------------

ONE = family(12, 1)
DEGENERATE = {
    "equal": np.repeat(ONE, 3, axis=1),
    "of different gain": ONE * np.array([0.8, 1, 1.3]),
    "of different phase": ONE * np.array([1 - 0.1j, 1, 1 + 0.1j]),
    "equal at one frequency": family(12) / family(12)[6] * family(12)[6, 0],
    "nearly equal": ONE * (1 + 1e-12 * np.array([-1, 0, 1])),
}


@pytest.mark.parametrize("name", thinned([name for name in DEGENERATE if name != "equal"], 2))
@pytest.mark.parametrize("kind", KINDS)
def test_degenerate_families_by_steps(kind, name):
    form = FORMS[len(name) % 2]
    program = program_of(kind, Responses(omega=OMEGA, values=DEGENERATE[name]), form=form)
    assert_covers(program, wb.solve(program, method="steps"))


@pytest.mark.parametrize(
    "name", [n if n == "equal" else pytest.param(n, marks=pytest.mark.slow) for n in DEGENERATE]
)
@pytest.mark.parametrize("kind", thinned(KINDS, 2))
def test_degenerate_families(kind, name):
    form = FORMS[len(name) % 2]
    program = program_of(kind, Responses(omega=OMEGA, values=DEGENERATE[name]), form=form)
    assert_covers(program, wb.solve(program, method="joint"))


@pytest.mark.parametrize("form", SLOW_ADDITIVE)
@pytest.mark.parametrize("kind", thinned(KINDS, 2))
def test_plants_that_are_the_nominal(kind, form):
    values = np.repeat(NOMINAL.response(OMEGA)[:, None], 2, axis=1)
    program = program_of(kind, Responses(omega=OMEGA, values=values), nominal=NOMINAL, form=form)
    solution = wb.solve(program)
    assert_covers(program, solution)
    assert solution.answer.model.sizes(OMEGA)[0].max() < 1e-9 * np.abs(values).max() + 1e-9


# --- wrong answers --------------------------------------------------------------------------------


def altered(answer, **parts):
    model = answer.model
    old = {name: getattr(model, name) for name in ("nominal", "W_c", "W_r")}
    return replace(answer, model=UncertaintyModel(**(old | parts), form=model.form))


def mirrored(of, kind):
    roots = getattr(of, kind).copy()
    roots.real *= -1
    return replace(of, **{kind: roots})


def times_all_pass(of):
    """A first-order all-pass beside it: the magnitude stays."""
    return Rational(np.append(of.zeros, 7.0), np.append(of.poles, -7.0), of.gain)


def resized(sets, factor, name="radius"):
    return replace(sets, **{name: getattr(sets, name) * factor})


WRONG = {
    "small W_c": (lambda a: altered(a, W_c=a.model.W_c.scaled(0.8)), "containment"),
    "W_c of zero": (lambda a: altered(a, W_c=a.model.W_c.scaled(0)), "containment"),
    "unstable W_c": (lambda a: altered(a, W_c=mirrored(a.model.W_c, "poles")), "W_c stable"),
    "W_c of other phase": (
        lambda a: altered(a, W_c=mirrored(a.model.W_c, "zeros")),
        "W_c minimum phase",
    ),
    "W_c of high order": (
        lambda a: altered(a, W_c=times_all_pass(times_all_pass(a.model.W_c))),
        "order of W_c",
    ),
    "shifted nominal": (lambda a: altered(a, nominal=a.model.nominal.scaled(2.0)), "containment"),
    "unstable nominal": (
        lambda a: altered(a, nominal=mirrored(a.model.nominal, "poles")),
        "nominal stable",
    ),
    "nominal of high order": (
        lambda a: altered(a, nominal=times_all_pass(a.model.nominal)),
        "order of nominal",
    ),
    "nominal of many zeros": (
        lambda a: altered(a, nominal=replace(a.model.nominal, zeros=[-1e6])),
        "zeros of nominal",
    ),
    "large second set": (lambda a: replace(a, second=resized(a.second, 1.01)), "second set"),
    "small second set": (lambda a: replace(a, second=resized(a.second, 0.99)), "second set"),
    "second set longer than needed": (
        lambda a: replace(a, second=replace(a.second, half_length=a.second.half_length + 0.01)),
        "second set",
    ),
    "second set of no number": (lambda a: replace(a, second=resized(a.second, np.nan)), "second"),
}
WRONG_STADIUM = {
    "no W_r": (lambda a: altered(a, W_r=a.model.W_r.scaled(0)), "containment"),
    "turned W_r": (lambda a: altered(a, W_r=times_all_pass(a.model.W_r)), "order of W_r"),
    "unstable W_r": (lambda a: altered(a, W_r=mirrored(a.model.W_r, "poles")), "W_r stable"),
    "long second set": (
        lambda a: replace(a, second=resized(a.second, 1.25, "half_length")),
        "second set",
    ),
    "short second set": (
        lambda a: replace(a, second=resized(a.second, 0.9, "half_length")),
        "second set",
    ),
    "shifted second set": (
        lambda a: replace(a, second=replace(a.second, center=a.second.center + 0.1)),
        "second set",
    ),
}


@pytest.mark.parametrize(
    ("kind", "name"),
    [*(("circle", n) for n in WRONG), *(("stadium", n) for n in WRONG | WRONG_STADIUM)],
)
def test_wrong_answers_are_refused(kind, name):
    program, solution = solved(kind, "multiplicative", "joint")
    assert program.certify(solution.answer, 1e-6).valid
    wrong, check = (WRONG | WRONG_STADIUM)[name]
    certificate = program.certify(wrong(solution.answer), 1e-6)
    assert not certificate.valid
    assert any(failure.startswith(check) for failure in certificate.failures), certificate.failures


def test_a_model_of_another_form_cannot_be_checked():
    program, solution = solved("circle", "multiplicative", "steps")
    answer = solution.answer
    model = UncertaintyModel(answer.model.nominal, answer.model.W_c, None, form="additive")
    with pytest.raises(InputError, match="has the form 'additive', not 'multiplicative'"):
        program.certify(replace(answer, model=model), 1e-6)


def test_another_nominal_than_the_given_one_is_refused():
    program, solution = solved("circle", "multiplicative", "joint")
    given_one = replace(program, nominal=NOMINAL)
    failures = given_one.certify(solution.answer, 1e-6).failures
    assert any(failure.startswith("nominal given") for failure in failures)


# --- input ----------------------------------------------------------------------------------------

RESPONSES = Responses(omega=OMEGA, values=family(13))


@pytest.mark.parametrize(
    ("keywords", "words"),
    [
        ({"responses": family(13)}, "responses must be Responses, not ndarray"),
        ({"order": -1}, "order must be a whole number, 0 or more, not -1"),
        ({"order": 2.0}, "order must be a whole number, 0 or more, not 2.0"),
        ({"complex_order": True}, "complex_order must be a whole number"),
        ({"real_order": "1"}, "real_order must be a whole number, 0 or more, not '1'"),
        ({"zeros": 3}, "zeros=3: at most the order, 2, can be had"),
        ({"order": 30}, "order is 30; 14 frequencies determine 27 at most"),
        ({"complex_order": 7}, "complex_order is 7; 14 frequencies determine 6 at most"),
        ({"real_order": 14}, "real_order is 14; 14 frequencies determine 13 at most"),
        ({"form": "inverse"}, "form is 'inverse'; it must be one of"),
        ({"leave_out": 5}, "leave_out is 5; it may be 4 at most"),
        ({"leave_out": 1.5}, "leave_out must be a whole number"),
        (
            {"leave_out": 4, "responses": Responses(omega=OMEGA, values=family(1, 5))},
            "leaves no spread",
        ),
        ({"nominal": "G"}, "a transfer function or state space is needed, not 'G'"),
        ({"nominal": control.tf([1.0], [1.0, -2.0])}, "the given nominal must be stable"),
        ({"orientation": None}, "orientation must be a function, not None"),
    ],
)
def test_refused(keywords, words):
    with pytest.raises(InputError, match=words):
        program_of("stadium", **({"responses": RESPONSES} | keywords))


def test_numpy_integers_are_whole_numbers():
    program = program_of("circle", RESPONSES, order=np.int64(2), leave_out=np.int64(1))
    assert (program.order, program.leave_out) == (2, 1)


def test_centres_of_zero_are_named():
    omega = np.geomspace(0.1, 10.0, 20)
    lag = 1.0 / (1j * omega + 1.0)
    plants = Responses(omega=omega, values=np.stack([lag, -lag], axis=-1))
    solution = wb.solve(CircleCover(plants, order=2), method="steps")
    assert solution.certificate is None
    assert "centres of the sets are 0 at every frequency" in solution.message


def test_a_nominal_through_zero_is_named():
    nominal = Rational([1j * OMEGA[3], -1j * OMEGA[3]], [-3.0, -4.0], 1.0)
    solution = wb.solve(program_of("circle", RESPONSES, nominal=nominal))
    assert solution.certificate is None
    assert f"through zero at {RESPONSES.place(3)}" in solution.message


def test_an_orientation_of_another_shape_is_named():
    program = program_of("stadium", RESPONSES, orientation=lambda omega, away: np.zeros(3))
    solution = wb.solve(program, method="steps")
    assert solution.certificate is None
    assert "(3,)" in solution.message


# --- storage and figures --------------------------------------------------------------------------


@pytest.mark.cases(1)
@pytest.mark.parametrize("form", SLOW_ADDITIVE)
@pytest.mark.parametrize("kind", KINDS)
def test_covers_come_back_from_their_files(kind, form, tmp_path):
    program, solution = solved(kind, form, "joint")
    file = tmp_path / "data.nc"
    netcdf.write(program.to_dataset(solution.answer), file)
    back = program.from_dataset(netcdf.read(file))
    assert isinstance(back, CoverSteps)
    assert back.model.form == form
    for name in ("nominal", "W_c", "W_r"):
        one, other = getattr(solution.answer.model, name), getattr(back.model, name)
        assert (one is None) == (other is None)
        if one is not None:
            assert np.array_equal(one.zeros, other.zeros)
            assert np.array_equal(one.poles, other.poles)
            assert one.gain == other.gain
    for name in ("first", "second", "third"):
        one, other = getattr(solution.answer, name), getattr(back, name)
        assert type(one) is type(other)
        for part in ("center", "radius", "half_length", "angle"):
            assert np.array_equal(getattr(one, part), getattr(other, part))
    assert repr(program.certify(back, 1e-6)) == repr(program.certify(solution.answer, 1e-6))
    assert program.metrics(back) == program.metrics(solution.answer)


def test_every_array_has_a_unit_and_a_name():
    program, solution = solved("stadium", "additive", "joint")
    data = program.to_dataset(solution.answer)
    for name, array in data.data_vars.items():
        assert array.attrs["units"], name
        assert array.attrs["long_name"], name


@pytest.mark.parametrize("kind", KINDS)
def test_figures(kind):
    program, solution = solved(kind, "multiplicative", "joint")
    shown = replace(program, windows_hz={"First Resonance": (3.0, 8.0), "nothing": (1e6, 1e7)})
    drawn = shown.figures(solution.answer)
    names = {"plane", "plane-first-resonance", "nominal", "complex-weight"}
    assert set(drawn) == names | ({"real-weight"} if kind == "stadium" else set())
    for figure in drawn.values():
        for axes in figure.axes:
            assert axes.get_ylabel()
        assert any(axes.get_xlabel() for axes in figure.axes)
        figure.canvas.draw()
