"""Uncertain systems: arithmetic against plain numbers, members, connections, misuse."""

import control
import numpy as np
import pytest
from tables import each

from workbench.errors import InputError, UnknownNameError, WorkbenchError
from workbench.mu import conditions, loop_margins, robust_stability
from workbench.structure import Complex, Full, Real
from workbench.uncertainty import (
    Parameter,
    UncertaintyModel,
    append,
    block,
    complex_scalar,
    dynamics,
    feedback,
    generalised_plant,
    parametric_lft,
    real,
    series,
    ss,
    tf,
)

OMEGA = np.geomspace(0.05, 50.0, 15)
LAG = control.ss([[-2.0]], [[1.0]], [[3.0]], [[0.0]])
VALUES = {"a": 1.3, "b": -0.4, "c": 2.2}


def response(system):
    return np.moveaxis(np.asarray(system(1j * OMEGA, squeeze=False)), -1, 0)


def parameters():
    """Symmetric, about a nominal 0, and with the nominal off the middle."""
    return {
        "a": real("a", 1.0, percent=40),
        "b": real("b", 0.0, plus_minus=0.5),
        "c": real("c", 2.0, low=1.5, high=4.0),
    }


def numbers(values):
    return {name: control.ss([], [], [], [[value]]) for name, value in values.items()}


EXPRESSIONS = {
    "sum": lambda a, b, c: a + b - c,
    "numbers on either side": lambda a, b, c: 2 * a + b * 3 - 1 + (4 - c),
    "systems on either side": lambda a, b, c: LAG * a + b * LAG - LAG + (LAG - c),
    "transfer functions": lambda a, b, c: control.tf(1, [1, 1]) * a + b * control.tf(1, [1, 2]),
    "product in series": lambda a, b, c: (LAG + c) * (a + LAG) * b,
}
STATIC = {
    "quotient": lambda a, b, c: b / (a + c),
    "power": lambda a, b, c: a**3 + (a + c) ** -2,
    "reciprocal": lambda a, b, c: 1 / c + 2.5 / a,
    "product": lambda a, b, c: a * b * c * a,
}


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("name", EXPRESSIONS)
def test_arithmetic_is_that_of_systems(name, seed):
    rng = np.random.default_rng(seed)
    values = {"a": rng.uniform(0.6, 1.4), "b": rng.uniform(-0.5, 0.5), "c": rng.uniform(1.5, 4.0)}
    system = EXPRESSIONS[name](**parameters())
    expected = EXPRESSIONS[name](**numbers(values))
    used = {name: values[name] for name in system.elements}
    np.testing.assert_allclose(response(system.at(**used)), response(expected), atol=1e-12)
    assert system.dt in (0, None)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("name", STATIC)
def test_arithmetic_is_that_of_numbers(name, seed):
    rng = np.random.default_rng(seed)
    values = {"a": rng.uniform(0.6, 1.4), "b": rng.uniform(-0.5, 0.5), "c": rng.uniform(1.5, 4.0)}
    system = STATIC[name](**parameters())
    found = system.at(**{name: values[name] for name in system.elements}).D[0, 0]
    assert found == pytest.approx(STATIC[name](**values), rel=1e-12)


@pytest.mark.parametrize("value", [0.6, 1.0, 1.4])
def test_coefficients_of_a_transfer_function(value):
    a = parameters()["a"]
    G = tf([2, a, 3], [a, 1, 2 * a])
    expected = control.tf([2, value, 3], [value, 1, 2 * value])
    np.testing.assert_allclose(response(G.at(a=value)), response(control.ss(expected)), atol=1e-12)


def test_entries_of_a_state_space_and_their_repetitions():
    m, k = real("m", 2.0, percent=20), real("k", 5.0, percent=30)
    G = ss([[0, 1], [-k / m, -0.1 / m]], [[0], [1 / m]], [[1, 0]], [[0]])
    assert [(block.name, block.rows) for block in G.structure] == [("k", 1), ("m", 1)]
    expected = control.ss([[0, 1], [-6 / 2.3, -0.1 / 2.3]], [[0], [1 / 2.3]], [[1, 0]], 0)
    np.testing.assert_allclose(response(G.at(k=6.0, m=2.3)), response(expected), atol=1e-12)
    assert G.nominal.nstates == 2
    several = k * k - k * k + k
    assert several.structure.rows == 5 and several.reduced().structure.rows == 1


def test_feedback_repeats_no_element():
    k, delta = real("k", 10, percent=40), dynamics("delta", 1, 1)
    loop = tf([18], [1, 1.8, k]) * (1 + 0.5 * delta)
    C = control.ss(control.tf([2, 3], [1, 0]))
    for closed in (feedback(loop * C, 1), feedback(1, loop * C), feedback(loop, C)):
        assert closed.structure.to_pairs() == [(-1, 0), (1, 0)]
    low_pass = control.ss(control.tf([0.5], [0.1, 1]))
    plain = control.tf([18], [1, 1.8, 12]) * (1 + 0.5 * control.tf(low_pass))
    expected = control.feedback(control.ss(plain) * C, 1)
    found = feedback(loop * C, 1).at(k=12, delta=low_pass)
    np.testing.assert_allclose(response(found), response(expected), rtol=1e-8)
    positive = feedback(loop * C, 1, sign=1).at(k=12, delta=0.3)
    expected = control.feedback(1.15 * control.ss(control.tf([18], [1, 1.8, 12])) * C, 1, 1)
    np.testing.assert_allclose(response(positive), response(expected), rtol=1e-8)


def test_blocks_of_dynamics_that_are_not_square():
    delta = dynamics("delta", 3, 2, bound=0.5)
    assert delta.structure.blocks == (Full(2, 3, name="delta"),)
    D = np.arange(6.0).reshape(2, 3) / 20
    system = np.array([[1.0, 2.0]]) @ delta @ append(LAG, LAG, 1.0)
    assert (system.system.noutputs, system.system.ninputs) == (3 + 1, 2 + 3)
    expected = response(control.append(LAG, LAG, control.ss([], [], [], [[1.0]])))
    expected = 0.5 * np.array([[1.0, 2.0]]) @ D @ expected
    np.testing.assert_allclose(response(system.at(delta=D)), expected, atol=1e-12)
    with pytest.raises(InputError, match=r"delta, a block of 2 x 3, occurs 2 times"):
        _ = (delta + delta).structure


def test_dynamics_that_occur_twice_are_the_same():
    delta = dynamics("delta", 2, 2)
    one = control.ss([[-1.0, 0.3], [0, -2]], np.eye(2), [[0.2, 0], [0.1, 0.4]], 0)
    twice = (delta @ delta).at(delta=one)
    np.testing.assert_allclose(response(twice), response(one) @ response(one), atol=1e-12)
    assert (dynamics("d", 1, 1) ** 2).structure.blocks == (Complex(2, name="d"),)


def test_a_weight_bounds_the_dynamics():
    W = control.ss(control.tf([1, 1], [0.1, 10]))
    for inputs, outputs in ((1, 1), (2, 3), (3, 2)):
        delta = dynamics("delta", inputs, outputs, bound=W)
        D = np.ones((outputs, inputs)) / 3
        expected = response(W) * D
        np.testing.assert_allclose(response(delta.at(delta=D)), expected, atol=1e-12)


def test_members_lie_in_the_set():
    k, z = real("k", 10, low=8, high=15), complex_scalar("z", 1.0, 0.2)
    G = tf([1], [1, 1, k]) * z * (1 + dynamics("delta", 1, 1, bound=0.1))
    assert {len(G.sample(5)), len(G.vertices()[:2])} == {5, 2}
    ends = [one.A[1, 0] for one in G.vertices()]
    np.testing.assert_allclose(sorted(ends), [-15, -8])
    again = [one.A[1, 0] for one in G.sample(20, seed=3)]
    assert again == [one.A[1, 0] for one in G.sample(20, seed=3)]
    assert all(-15 <= value <= -8 for value in again) and np.ptp(again) > 2
    for delta in [dynamics("d", 2, 3).sample(1, seed=seed)[0] for seed in range(20)]:
        assert delta.poles().real.max() < 0
        assert np.linalg.norm(response(delta), 2, axis=(1, 2)).max() <= 1 + 1e-12
    np.testing.assert_allclose(G.response(OMEGA), response(G.nominal))


def test_a_bundle_of_members():
    k = real("k", 10, percent=40)
    figure = tf([18], [1, 1.8, k]).plot(samples=7)
    (panel,) = figure.axes
    assert len(panel.lines) == 8
    assert panel.get_xlabel() == "angular frequency [rad/s]" and panel.get_ylabel() == "gain [1]"
    peaks = [line.get_ydata().max() for line in panel.lines]
    assert len(set(peaks)) == 8 and max(peaks) < 18 / (1.8 * np.sqrt(6 - 0.81))


def test_slices():
    a = parameters()["a"]
    whole = append(a * LAG, LAG, dynamics("d", 1, 1))
    assert whole[0, :].value.shape == (1, 3)
    assert list(whole[:2, :2].elements) == ["a", "d"] or list(whole[:2, :2].elements) == ["a"]
    np.testing.assert_allclose(response(whole[0, 0].at(a=1.2)), 1.2 * response(LAG), atol=1e-12)


def test_models_are_uncertain_systems():
    s = control.tf("s")
    model = UncertaintyModel(10 / (s + 1), 0.1 * (s + 1) / (s + 10), 0.2 / (s + 1))
    found = 2 * feedback(model * LAG, 1)
    assert found.structure.to_pairs() == model.structure.to_pairs()
    expected = 2 * control.feedback(control.ss(model.lti) * LAG, 1)
    np.testing.assert_allclose(response(found.nominal), response(expected), rtol=1e-9)
    R, L = Parameter("R", 2.0, 0.3), Parameter("L", 0.1, 0.2)
    coil = parametric_lft(
        lambda R, L: ([[-R / L]], [[1 / L]], [[1.0]], [[0.0]]), [R, L], inputs=["u"], outputs=["i"]
    )
    found = feedback(coil, 1.0)
    expected = control.feedback(control.ss(control.tf([1], [0.11, 2.4])), 1)
    np.testing.assert_allclose(response(found.at(R=2.4, L=0.11)), response(expected), rtol=1e-9)


def test_it_is_a_block_and_a_generalised_plant():
    k = real("k", 10, percent=20)
    G = tf([18], [1, 1.8, k])
    plant = append(1.0, G)
    assert plant.plant(1, 1).structure.blocks == (Real(1, name="k"),)
    wide = np.array([[1.0], [1.0]]) @ G @ np.array([[0.1, 1.0]])
    found = conditions(wide.plant(1, 1), control.ss(control.tf([-0.5], [1, 1])))
    assert found.nominal_stability and found.robust_performance.upper > 0


def test_perturbations_of_two_models_are_two():
    """Both are called "complex"; as one perturbation they would be a smaller set."""
    s = control.tf("s")
    one, other = (UncertaintyModel(10 / (s + pole), 0.1 * (s + 1) / (s + 10)) for pole in (1, 2))
    for call in (lambda: one * other, lambda: append(one, other), lambda: feedback(one, other)):
        with pytest.raises(InputError, match="two elements are called 'complex'"):
            call()
    assert (one * one).structure.blocks == (Complex(2, name="complex"),)


def test_the_worst_perturbation_goes_back_into_the_system():
    z = complex_scalar("z", 2.0, 0.5)
    loop = feedback(control.ss(control.tf([1], [1, 3, 3, 1])) * z, 1)
    margin = robust_stability(loop)
    poles = loop.at(**margin.worst).poles()
    assert np.abs(poles - 1j * margin.omega).min() < 1e-5 * margin.omega


def test_it_is_connected_by_names():
    k = real("k", 10, percent=40)
    G = tf([18], [1, 1.8, k])
    loop = {"exogenous": "r", "control": "u", "performance": "e", "measurement": "e"}
    plant = generalised_plant([(G, "u", "y")], {"e": "r - y"}, **loop)
    assert plant.structure.blocks == (Real(1, name="k"),)
    other = tf([1], [1, k])
    with pytest.raises(InputError, match="blocks 1 and 2 both hold the uncertain element 'k'"):
        generalised_plant([(G, "u", "y"), (other, "y", "x")], {"e": "r - x"}, **loop)
    both = generalised_plant([(other * G, "u", "x")], {"e": "r - x"}, **loop)
    assert both.structure.blocks == (Real(2, name="k"),)


@each(
    ("call", "words"),
    [
        (lambda: real("k", 10), "give one of percent="),
        (lambda: real("k", 10, percent=40, low=1), "give one of percent="),
        (lambda: real("k", 0, percent=40), "nominal 0, for which a percentage"),
        (lambda: real("k", 10, low=11, high=12), "nominal 10 must lie between"),
        (lambda: real("k", 10, low=9), "belong together"),
        (lambda: real("k", 10, percent=-4), "percent is -4"),
        (lambda: real("k", "ten", percent=4), "nominal is 'ten'"),
        (lambda: real("a b", 1, percent=4), "called 'a b'"),
        (lambda: complex_scalar("z", 1, -1), "radius is -1"),
        (lambda: dynamics("d", 0, 1), "inputs is 0"),
        (lambda: dynamics("d", 1, 1, bound=-1), "bound is -1"),
        (lambda: dynamics("d", 1, 1, bound=append(LAG, LAG)), "bound has 2 outputs"),
        (lambda: dynamics("d", 1, 1, bound=control.tf([1], [1, -1])), "bound is unstable"),
        (lambda: real("k", 1, percent=4) + real("k", 2, percent=4), "two elements are called 'k'"),
        (lambda: tf([1, 0, 0], [1, 1]), "num has degree 2"),
        (lambda: tf([1], [0, 0]), "den is zero"),
        (lambda: tf([1], [real("k", 0, plus_minus=1), 1]), "coefficient of den is 0"),
        (lambda: tf([LAG], [1, 1]), "num holds a system with 1 states"),
        (lambda: tf("1", [1, 1]), "num must be a list"),
        (lambda: tf([1], [1, np.nan]), "an entry of den is nan; a gain needs finite"),
        (lambda: tf([1], [1, 1], -1), "dt is -1; it must be a sampling time"),
        (lambda: tf([1], [1, 1], "1 ms"), "dt is '1 ms'"),
        (lambda: ss([[1]], [[1]], [[1]], [[0]], np.nan), "dt is nan"),
        (lambda: ss([], [], [], 1.0, np.inf), "dt is inf"),
        (lambda: ss(-np.eye(2), np.eye(2), np.eye(2), 1.0), "do not fit"),
        (lambda: ss([[1, 2]], [[1]], [[1]], [[0]]), "A has shape"),
        (lambda: ss([[1], [1, 2]], [[1]], [[1]], [[0]]), "A has rows of lengths"),
        (lambda: feedback(append(LAG, LAG), append(1.0, 2.0, 3.0)), "must fit each other"),
        (lambda: feedback(real("k", 1, percent=5), -1.0), "singular through the direct terms"),
        (lambda: feedback(LAG, 1, sign=2), "sign is 2"),
        (lambda: append(), "at least one"),
        (lambda: LAG * real("k", 1, percent=5) * LAG.sample(0.1), "sampling times"),
        (lambda: real("k", 1, percent=5) * "two", "the right operand must be"),
        (lambda: real("k", 1, percent=5) ** 0.5, "power 0.5"),
        (lambda: 1 / tf([1], [1, real("k", 1, percent=5)]), "zero or singular at the nominal"),
        (lambda: real("k", 1, percent=5).at(m=2), "no uncertain element is called 'm'"),
        (lambda: real("k", 1, percent=5).at(k="two"), "k = 'two'"),
        (lambda: real("k", 2, low=1, high=9).at(k=-90), "lies so far beyond its range"),
        (lambda: dynamics("d", 2, 1).at(d=np.eye(3)), "d has 1 outputs and 2 inputs"),
        (lambda: complex_scalar("z", 1, 1).at(z=1j), "complex coefficient"),
        (lambda: complex_scalar("z", 1, 1).at(z="two"), "z must be"),
        (lambda: dynamics("d", 1, 1).at(d="two"), "d must be"),
        (lambda: (1 / real("k", 1, percent=50)).at(k=0.0), "not well posed"),
        (lambda: real("k", 1, percent=5).sample(0), "count is 0"),
        (lambda: append(LAG, real("k", 1, percent=5))[0], "give outputs and inputs"),
        (lambda: (append(LAG, LAG) * real("k", 1, percent=5)) ** 2 @ np.eye(3), "shapes"),
    ],
)
def test_misuse(call, words):
    with pytest.raises(WorkbenchError, match=words):
        call()


EMPTY = control.ss([], [], [], np.zeros((0, 0)))
UNCERTAIN_LAG = LAG * real("k", 1, percent=5)


@pytest.mark.parametrize(
    ("call", "name"),
    [
        (lambda empty: UNCERTAIN_LAG * empty, "the right operand"),
        (lambda empty: empty + UNCERTAIN_LAG, "the left operand"),
        (lambda empty: append(LAG, empty), "system 2"),
        (lambda empty: series(empty, LAG), "system 1"),
        (lambda empty: feedback(empty), "sys1"),
        (lambda empty: block([[LAG], [empty]]), "block 2, 1"),
        (lambda empty: loop_margins(empty), "plant"),
        (lambda empty: loop_margins(LAG, empty), "controller"),
    ],
)
@pytest.mark.parametrize(
    "empty", [EMPTY, UNCERTAIN_LAG[[], []], UNCERTAIN_LAG[[], :]], ids=["static", "none", "0 x 1"]
)
def test_a_system_without_channels_is_refused_by_its_own_name(call, name, empty):
    words = f"^{name} has 0 outputs and {empty.ninputs} inputs; .* needs at least one of each"
    with pytest.raises(InputError, match=words):
        call(empty)


@pytest.mark.parametrize("dt", [0, 0.0, 0.1, True, None])
def test_a_time_base_is_that_of_python_control(dt):
    k = real("k", 2, percent=5)
    assert tf([1], [1, k], dt).dt is dt
    assert ss([[-k]], [[1]], [[1]], [[0]], dt).dt is dt


def test_short_forms_of_python_control():
    """A number for a polynomial of degree 0, and one 0 for a direct term of any size."""
    k = real("k", 2, percent=5)
    np.testing.assert_allclose(response(tf(3, [1, k]).nominal), response(control.tf(3, [1, 2])))
    np.testing.assert_allclose(response(tf(k, [1, 3]).nominal), response(control.tf(2, [1, 3])))
    A, B, C = -np.eye(2), np.ones((2, 3)), np.eye(2)
    theirs, ours = control.ss(A, B, C, 0), ss([[-k / 2, 0], [0, -1]], B, C, 0)
    np.testing.assert_allclose(response(ours.nominal), response(theirs))


def test_unknown_names_are_of_their_kind():
    with pytest.raises(UnknownNameError):
        real("k", 1, percent=5).at(j=2)
