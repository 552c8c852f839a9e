"""Generalised plants: the focus loop under mixed uncertainty, against its closed formulas."""

import control
import numpy as np
import pytest
from workbench.plants.cd_drive.drive.plants import (
    controller,
    loop_response,
    nominal_parameters,
    plant,
    total_gain,
)
from workbench.plants.cd_drive.drive.tables import drives

from workbench.errors import InputError, UnknownNameError
from workbench.structure import Complex, Full, Real, Structure
from workbench.systems.connection import generalised_plant
from workbench.systems.generalised_plant import GeneralisedPlant, response
from workbench.uncertainty.parametric_models.model import parametric_lft
from workbench.uncertainty.parametric_models.parameters import Parameter

FREQUENCY = np.geomspace(5.0, 50e3, 80)
OMEGA = 2 * np.pi * FREQUENCY
S = 2j * np.pi * FREQUENCY

K_OPT = float(np.mean([drive.K_optn for drive in drives("focus")]))
K = controller("focus")
ACT = plant(nominal_parameters("focus"), total_gain("focus") / K_OPT, antialiasing=False)

M, A, WB, WI = 2.0, 0.004, 2 * np.pi * 230, 2 * np.pi * 10
W_P = control.zpk(  # eq. 6.11
    [-WB * M ** (1 / 3)] * 3 + [-WI], [-WB * A ** (1 / 3)] * 3 + [-0.001], 1 / M
)
W_R = control.zpk([-2e3, -4e4], [-8e3, -1e4], 0.3)
W_C = control.zpk([-1e3], [-5e4], 0.5)
W_U = control.tf(0.1, 1)
MIXED = [(Real(1, name="r"), "y_r", "u_r"), (Complex(1, name="c"), "y_c", "u_c")]


def focus(actuator, perturbation, sums, weights=()):
    return generalised_plant(
        [
            (actuator, "v", "x"),
            (W_P, "e", "z_p"),
            (W_U, "u", "z_u"),
            (control.tf(K_OPT, 1), "e", "f_en"),
            *weights,
        ],
        {"e": "w_p + w_u - x"} | sums,
        perturbation=perturbation,
        exogenous=["w_p", "w_u"],
        control="u",
        performance=["z_p", "z_u"],
        measurement="f_en",
    )


def stadium():
    return focus(ACT, MIXED, {"v": "u + u_r + u_c"}, weights=[(W_R, "u", "y_r"), (W_C, "u", "y_c")])


def zpk(system):
    """Response from zeros and poles: no realisation, no polynomial."""
    zeros, poles = system.zeros(), system.poles()
    gain = system.num[0][0][0] / system.den[0][0][0]
    return gain * np.prod(S[:, None] - zeros, axis=1) / np.prod(S[:, None] - poles, axis=1)


def test_the_focus_loop_matches_its_formulas():
    loop_plant = stadium()
    assert loop_plant.structure == Structure([Real(1, name="r"), Complex(1, name="c")])
    assert loop_plant.system.input_labels == ["u_r", "u_c", "w_p", "w_u", "u"]
    assert loop_plant.system.output_labels == ["y_r", "y_c", "z_p", "z_u", "f_en"]
    assert (loop_plant.exogenous, loop_plant.performance) == (2, 2)

    N = loop_plant.close(K)
    assert N.input_labels == ["u_r", "u_c", "w_p", "w_u"]
    assert N.nstates == 4 + 4 + 2 + 1 + 3
    assert max(N.poles().real) < 0

    ones = np.ones((len(S), 1, 2))
    w_p, w_r, w_c, w_u = zpk(W_P), zpk(W_R), zpk(W_C), 0.1 * np.ones(len(S))
    loop = loop_response("focus", FREQUENCY) * (1 + S / (2 * np.pi * 8000.0))  # without the filter
    k = zpk(K)
    act = loop / (k * K_OPT)
    k_s = k / (1 + loop) * K_OPT

    def column(*entries):
        return np.stack(entries, axis=-1)[..., None] @ ones

    expected = (
        column(-w_r * k_s * act, -w_c * k_s * act),
        column(w_r * k_s, w_c * k_s),
        column(w_p * act * (k_s * act - 1), -w_u * k_s * act),
        column(w_p * (1 - act * k_s), w_u * k_s),
    )
    found = loop_plant.partition(response(N, OMEGA))
    for block, formula in zip(found, expected, strict=True):
        np.testing.assert_allclose(block, formula, rtol=1e-8)


def test_response_of_the_open_plant():
    P = stadium().response(OMEGA)
    assert P.shape == (len(OMEGA), 5, 5)
    np.testing.assert_allclose(P[:, 0, 4], zpk(W_R), rtol=1e-10)
    np.testing.assert_allclose(P[:, 2, 2], zpk(W_P), rtol=1e-10)
    np.testing.assert_array_equal(P[:, :2, :4], 0.0)


def actuator(K_at, k, b, m):
    """One mass on a spring and a damper, u [V] -> x [m]."""
    return [[0, 1], [-k / m, -b / m]], [[0], [1 / m]], [[K_at, 0]], 0


def test_a_parametric_model_brings_its_perturbations():
    parts = [
        Parameter("K_at", 2.5e-3, 0.1),
        Parameter("k", 23.2, 0.17),
        Parameter("b", 0.0073, 0.09),
        Parameter("m", 5.6e-4, 0.05),
    ]
    uncertain = parametric_lft(actuator, parts, inputs=["v"], outputs=["x"])
    loop_plant = focus(
        uncertain, [(Complex(1, name="c"), "y_c", "u_c")], {"v": "u + u_c"}, [(W_C, "u", "y_c")]
    )
    assert [b.name for b in loop_plant.structure] == ["c", "K_at", "k", "b", "m"]
    assert loop_plant.structure.rows == 5
    N = response(loop_plant.close(K), OMEGA)

    deltas = [0.4, -1.0, 0.3, 0.9]
    Delta = np.diag([0.0, *deltas])
    N11, N12, N21, N22 = loop_plant.partition(N)
    closed = N22 + N21 @ np.linalg.solve(np.eye(5) - Delta @ N11, Delta @ N12)
    x = uncertain.response(OMEGA, deltas)[:, 0, 0]
    sensitivity = 1 / (1 + x * zpk(K) * K_OPT)
    np.testing.assert_allclose(closed[:, 0, 0], zpk(W_P) * sensitivity, rtol=1e-8)
    np.testing.assert_allclose(closed[:, 1, 1], 0.1 * zpk(K) * K_OPT * sensitivity, rtol=1e-8)

    # The same by its names given with the block.
    renamed = (uncertain, ["v"], ["x"])
    again = generalised_plant([renamed], {}, exogenous="v", performance="x")
    assert again.structure == uncertain.structure
    np.testing.assert_allclose(again.response(OMEGA), response(uncertain.system, OMEGA))


def test_no_mode_is_cancelled():
    unstable = control.tf([1, -1], [1, -1, 0], inputs="u", outputs="y")  # (s - 1) / (s (s - 1))
    loop_plant = generalised_plant(
        [unstable], {"e": "r - y"}, exogenous="r", control="u", performance="e", measurement="e"
    )
    assert loop_plant.system.nstates == 2
    poles = loop_plant.close(control.tf(1, 1)).poles()
    np.testing.assert_allclose(np.sort(poles.real), [-1, 1], atol=1e-9)
    hidden = control.tf([1, -1], [1, -2])  # its zero meets the plant's pole
    assert len(loop_plant.close(hidden).poles()) == 3


def test_direct_terms_and_static_systems():
    gain = control.ss([], [], [], [[2.0]])
    loop_plant = generalised_plant(
        [(gain, "v", "y")],
        {"v": "u + w", "e": "w - y"},
        exogenous="w",
        control="u",
        performance=["y", "w"],
        measurement="e",
    )
    # y = 2 (k (w - y) + w)
    N = response(loop_plant.close(control.ss([], [], [], [[3.0]])), [0.0, 1.0])
    np.testing.assert_allclose(N[:, 0, 0], 2 * 4 / 7)
    np.testing.assert_allclose(N[:, 1, 0], 1.0)
    with pytest.raises(InputError, match="not determined"):
        loop_plant.close(control.ss([], [], [], [[-0.5]]))


def test_several_inputs_and_outputs():
    rng = np.random.default_rng(0)
    A = rng.standard_normal((3, 3)) - 3 * np.eye(3)
    G = control.ss(A, rng.standard_normal((3, 3)), rng.standard_normal((2, 3)), np.zeros((2, 3)))
    C = control.ss(rng.standard_normal((2, 2)), np.ones((2, 2)), np.ones((3, 2)), np.zeros((3, 2)))
    loop_plant = generalised_plant(
        [(G, ["v1", "v2", "v3"], ["y1", "y2"])],
        {f"v{i}": f"u{i} + w{i}" for i in (1, 2, 3)},
        perturbation=[(Full(3, 2), ["y1", "y2"], ["w1", "w2", "w3"])],
        control=["u1", "u2", "u3"],
        measurement=["y1", "y2"],
    )
    assert loop_plant.system.output_labels == ["y1", "y2", "y1#2", "y2#2"]
    N = response(loop_plant.close(C), OMEGA)
    g, c = response(G, OMEGA), response(C, OMEGA)
    np.testing.assert_allclose(N, np.linalg.solve(np.eye(2) - g @ c, g), rtol=1e-8)
    # A transfer function of several outputs shares its states.
    shared = control.tf([[[1.0]], [[1.0]]], [[[1.0, 0.0]], [[1.0, 0.0]]])
    both = generalised_plant([(shared, "u", ["a", "b"])], {}, exogenous="u", performance=["a", "b"])
    assert both.system.nstates == 1


def test_discrete_time():
    delay = control.tf([1], [1, 0], dt=0.01, inputs="u", outputs="y")
    loop_plant = generalised_plant(
        [delay], {"e": "r - y"}, exogenous="r", control="u", performance="e", measurement="e"
    )
    assert loop_plant.system.dt == 0.01
    omega = np.array([1.0, 100.0])
    z = np.exp(1j * omega * 0.01)
    N = response(loop_plant.close(control.tf([0.5], [1], dt=0.01)), omega)
    np.testing.assert_allclose(N[:, 0, 0], 1 / (1 + 0.5 / z))
    with pytest.raises(InputError, match="sampling times"):
        loop_plant.close(control.tf([1], [1, 1], dt=0.02))


G = control.tf([1], [1, 1], inputs="u", outputs="y")


def make(blocks=(G,), sums=None, **places):
    default = {"exogenous": "r", "control": "u", "performance": "e", "measurement": "e"}
    return generalised_plant(blocks, {"e": "r - y"} | (sums or {}), **(default | places))


@pytest.mark.parametrize(
    "arguments, message",
    [
        ({"blocks": [G, (G, "u", "y")]}, "'y' is driven 2 times"),
        ({"exogenous": ["r", "y"]}, "'y' is driven 2 times"),
        ({"sums": {"y": "u + r"}}, "'y' is driven 2 times"),
        ({"exogenous": ["r", "d"]}, "nothing reads the input 'd'"),
        ({"sums": {"f": "2 * y"}}, "write signal names"),
        ({"sums": {"f": ""}}, "write signal names"),
        ({"perturbation": [(Full(1, 2), "y", "w")]}, "reads 2 signals and drives 1"),
        ({"blocks": [(G, ["u", "v"], "y")]}, "1 inputs and 1 outputs was given"),
        ({"blocks": [control.frd([1.0], [1.0])]}, "fit a model or a cover"),
        ({"blocks": [control.tf([1, 0, 0], [1, 1], inputs="u", outputs="y")]}, "improper"),
        ({"blocks": [G, control.tf(1, [1, 1], 0.1, inputs="u", outputs="q")]}, "sampling times"),
        ({"sums": {"a": "b + r", "b": "a"}}, "loop through a, b has no dynamics"),
    ],
)
def test_connections_that_are_refused(arguments, message):
    with pytest.raises(InputError, match=message):
        make(**arguments)


def test_unknown_signals():
    with pytest.raises(UnknownNameError, match="no signal is called 'z_q'; did you mean z_p"):
        make(sums={"z_p": "y - r"}, performance="z_q")
    with pytest.raises(UnknownNameError, match="'x'"):
        make(sums={"f": "x - r"})


def test_a_solvable_loop_without_dynamics():
    # a = r + b / 2, b = a: a = 2 r
    half = control.tf(0.5, 1)
    loop_plant = make(blocks=[G, (half, "b", "h")], sums={"a": "r + h", "b": "a"}, performance="a")
    np.testing.assert_allclose(loop_plant.response([1.0])[0, 0, 0], 2.0)


def test_plants_and_controllers_of_other_sizes():
    with pytest.raises(InputError, match="2 inputs and 1 outputs"):
        make().close(control.ss([], [], [], [[1.0, 1.0]]))
    with pytest.raises(InputError, match="N has shape"):
        make().partition(np.zeros((3, 2, 2)))
    with pytest.raises(InputError, match="the structure needs 2"):
        GeneralisedPlant(control.ss([], [], [], np.eye(2)), Structure([Real(2)]), 1, 1)


def test_a_channel_is_the_plant_with_its_signals_alone():
    plant_ = stadium()
    part = plant_.channel(performance="z_u", exogenous=["w_u", "w_p"])
    assert (part.performance, part.exogenous) == (1, 2)
    N, M = (response(p.close(K), OMEGA[:5]) for p in (plant_, part))
    np.testing.assert_allclose(M, N[:, [0, 1, 3]][:, :, [0, 1, 3, 2]], rtol=1e-9)
    assert plant_.channel(performance=1, exogenous=0).system.output_labels == [
        "y_r",
        "y_c",
        "z_u",
        "f_en",
    ]


@pytest.mark.parametrize("signals", [2, -1, [], ["z_p", "z_p"]])
def test_a_channel_needs_signals_that_there_are(signals):
    with pytest.raises(InputError, match="performance output"):
        stadium().channel(performance=signals)
    with pytest.raises(UnknownNameError, match="z_q"):
        stadium().channel(performance="z_q")
